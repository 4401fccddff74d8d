"""Render pipelines, and the canvas they draw on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
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


class Raster:
    """A vertex and a fragment shader of one file with fixed state. Made by `Gpu.raster`.

    By custom group 0 holds what a frame binds and group 1 what a material binds.
    """

    def __init__(
        self,
        device: wgpu.GPUDevice,
        path: str,
        targets: Sequence[str | Target],
        depth: str | None,
        depth_write: bool,
        cull: str,
        front: str,
        topology: str,
        vertex_layout: Sequence[dict[str, Any]],
        vertex: str,
        fragment: str | None,
        samples: int,
        constants: Mapping[str, float],
    ) -> None:
        entries = [vertex, fragment] if fragment else [vertex]
        visibility = wgpu.ShaderStage.VERTEX | wgpu.ShaderStage.FRAGMENT
        self._shader = shader = Shader(device, path, entries, visibility, constants)
        stage = {"module": shader.module, "constants": dict(constants)}
        primitive: dict[str, Any] = {"topology": topology, "cull_mode": cull, "front_face": front}
        states = [(t if isinstance(t, Target) else Target(t)).state() for t in targets]
        with shader.explained():
            self.pipeline = device.create_render_pipeline(
                label=shader.label,
                layout=shader.pipeline_layout,
                vertex=stage | {"entry_point": vertex, "buffers": list(vertex_layout)},
                primitive=primitive,
                multisample={"count": samples},
                depth_stencil=_depth_state(depth, depth_write) if depth else None,
                fragment=stage | {"entry_point": fragment, "targets": states} if fragment else None,
            )

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
        """Draw into a rectangle of the attachments, and nowhere else."""
        self._commands.set_viewport(x, y, width, height, 0.0, 1.0)
        self._commands.set_scissor_rect(x, y, width, height)

    def draw(
        self, vertices: int, instances: int = 1, *, first_vertex: int = 0, first_instance: int = 0
    ) -> None:
        """Draw without indices."""
        self._commands.draw(vertices, instances, first_vertex, first_instance)

    def draw_indexed(
        self,
        indices: int,
        instances: int = 1,
        *,
        first_index: int = 0,
        base_vertex: int = 0,
        first_instance: int = 0,
    ) -> None:
        """Draw with the index buffer."""
        self._commands.draw_indexed(indices, instances, first_index, base_vertex, first_instance)


def _depth_state(compare: str, write: bool) -> dict[str, Any]:
    return {"format": "depth32float", "depth_write_enabled": write, "depth_compare": compare}
