"""Render pipelines, and the canvas they draw on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

import wgpu

from ispm.gpu.binding import Shader
from ispm.gpu.buffer import Buffer

if TYPE_CHECKING:
    from ispm.gpu.recording import Recording

Group: TypeAlias = wgpu.GPUBindGroup

_FACTORS = {"add": ("one", "one"), "multiply": ("dst", "zero")}  # of what is drawn, of what is there
_BLENDS: dict[str, dict[str, Any]] = {
    name: {k: {"operation": "add", "src_factor": ours, "dst_factor": theirs} for k in ("color", "alpha")}
    for name, (ours, theirs) in _FACTORS.items()
}


@dataclass(frozen=True)
class Target:
    """A color attachment a pipeline writes to; `blend` is None, add or multiply."""

    format: str
    blend: str | None = None

    def state(self) -> dict[str, Any]:
        """WebGPU's description of it."""
        return {"format": self.format} | ({"blend": _BLENDS[self.blend]} if self.blend else {})


@dataclass(frozen=True)
class RasterState:
    """What of a pipeline is fixed beside its shaders' file and targets.

    depth          comparison of a depth32float attachment, None without one; depth is reversed
    cull, front    faces that are culled, and those in front, in WebGPU's words
    vertex_layout  WebGPU's vertex buffer layouts; empty where the shader fetches its own vertices
    vertex         entry point, as `fragment`, which is None where only depth is drawn
    """

    depth: str | None = "greater-equal"
    depth_write: bool = True
    cull: str = "none"
    front: str = "ccw"
    vertex_layout: Sequence[dict[str, Any]] = ()
    vertex: str = "vs"
    fragment: str | None = "fs"
    samples: int = 1


DEPTH_TESTED, FLAT = RasterState(), RasterState(depth=None)


class Raster:
    """A vertex and a fragment shader of one file with fixed state. Made by `Gpu.raster`.

    By custom group 0 holds what a frame binds and group 1 what a material binds.
    """

    def __init__(
        self,
        device: wgpu.GPUDevice,
        path: str,
        targets: Sequence[str | Target],
        state: RasterState,
        constants: Mapping[str, float],
    ) -> None:
        entries = [state.vertex, state.fragment] if state.fragment else [state.vertex]
        visibility = wgpu.ShaderStage.VERTEX | wgpu.ShaderStage.FRAGMENT
        self._shader = shader = Shader(device, path, entries, visibility, constants)
        stage = {"module": shader.module, "constants": dict(constants)}
        attachments = [(t if isinstance(t, Target) else Target(t)).state() for t in targets]
        fragment = stage | {"entry_point": state.fragment, "targets": attachments}
        with shader.explained():
            self.pipeline = device.create_render_pipeline(
                label=shader.label,
                layout=shader.pipeline_layout,
                vertex=stage | {"entry_point": state.vertex, "buffers": list(state.vertex_layout)},
                primitive={"cull_mode": state.cull, "front_face": state.front},
                multisample={"count": state.samples},
                depth_stencil=_depth_state(state.depth, state.depth_write) if state.depth else None,
                fragment=fragment if state.fragment else None,
            )

    def shared(self) -> Raster:
        """Return the same pipeline with bind groups of its own."""
        other = copy(self)
        other._shader = self._shader.shared()
        return other

    def bind(self, group: int, frame: Recording | None = None, /, **resources: Any) -> Group:
        """Return a bind group for `Canvas.use`; numpy records as uniforms need `frame` and die with it.

        Raises TypeError for a name that is missing or unknown.
        """
        return self._shader.bind(group, resources, frame)


class Canvas:
    """A render pass being recorded; made by `Recording.draw_into`."""

    def __init__(self, commands: wgpu.GPURenderPassEncoder) -> None:
        self._commands = commands

    def use(self, raster: Raster, *groups: Group) -> None:
        """Draw with this pipeline and these bind groups, 0 first."""
        self._commands.set_pipeline(raster.pipeline)
        for index, group in enumerate(groups):
            self._commands.set_bind_group(index, group)

    def bind(self, index: int, group: Group) -> None:
        """Change one bind group of the pipeline in use."""
        self._commands.set_bind_group(index, group)

    def vertices(self, *buffers: Buffer) -> None:
        """Read vertex attributes from these buffers."""
        for slot, buffer in enumerate(buffers):
            self._commands.set_vertex_buffer(slot, buffer.handle)

    def indices(self, buffer: Buffer) -> None:
        """Read uint32 vertex indices from this buffer."""
        self._commands.set_index_buffer(buffer.handle, "uint32")

    def viewport(self, x: int, y: int, width: int, height: int) -> None:
        """Draw into a rectangle of the attachments, in pixels from the top left, and nowhere else."""
        self._commands.set_viewport(x, y, width, height, 0.0, 1.0)
        self._commands.set_scissor_rect(x, y, width, height)

    def draw(self, vertices: int, instances: int = 1, *, first: int = 0, first_instance: int = 0) -> None:
        """Draw triangles without indices; first: the number of the first vertex."""
        self._commands.draw(vertices, instances, first, first_instance)

    def draw_indexed(
        self, indices: int, instances: int = 1, *, first_index: int = 0, first_instance: int = 0
    ) -> None:
        """Draw triangles with the index buffer."""
        self._commands.draw_indexed(indices, instances, first_index, 0, first_instance)


def _depth_state(compare: str, write: bool) -> dict[str, Any]:
    return {"format": "depth32float", "depth_write_enabled": write, "depth_compare": compare}
