"""A WGSL compute shader as a Python callable: its bindings are its keyword arguments."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from copy import copy
from typing import Any

import wgpu

from ispm.gpu.binding import Shader
from ispm.gpu.recording import Recording
from ispm.wgsl import Source


class Compute:
    """One entry point of a shader file, compiled.

    Call it with the frame, the number of threads and a resource for each binding's name: `Texture`,
    `Sampler`, `Buffer`, and for a uniform also a numpy record with the struct's layout.
    """

    def __init__(self, device: wgpu.GPUDevice, path: str, entry: str, constants: Mapping[str, float]) -> None:
        self._shader = shader = Shader(device, path, [entry], wgpu.ShaderStage.COMPUTE, constants)
        self.workgroup = _workgroup_size(shader.source, entry, path)
        with shader.explained():
            self._pipeline = device.create_compute_pipeline(
                label=shader.label,
                layout=shader.pipeline_layout,
                compute={"module": shader.module, "entry_point": entry, "constants": dict(constants)},
            )

    def shared(self) -> Compute:
        """Return the same pipeline with bind groups of its own."""
        other = copy(self)
        other._shader = self._shader.shared()
        return other

    def __call__(self, frame: Recording, *, over: int | Sequence[int], **resources: Any) -> None:
        """Record a dispatch of at least `over` threads: a number, or one for each of up to 3 axes.

        Raises TypeError for a name that is missing or unknown.
        """
        threads = (over,) if isinstance(over, int) else tuple(over)
        counts = [-(-n // size) for n, size in zip(threads, self.workgroup, strict=False)]
        group = self._shader.bind(0, resources, frame)
        if not all(counts):
            return
        with frame.compute_pass(self._shader.label) as commands:
            commands.set_pipeline(self._pipeline)
            commands.set_bind_group(0, group)
            commands.dispatch_workgroups(*counts)


def _workgroup_size(source: Source, entry: str, path: str) -> tuple[int, int, int]:
    """The numbers, or named constants, of an entry point's @workgroup_size."""
    match = re.search(rf"@workgroup_size\((?P<size>[^)]*)\)\s*fn\s+{entry}\b", source.text)
    if match is None:
        raise TypeError(f"{path}: '{entry}' has no @workgroup_size directly before its fn")
    values = [v.strip() for v in match["size"].split(",") if v.strip()]
    size = [int(source.constants.get(v) or v.rstrip("ui")) for v in values]
    x, y, z = [*size, 1, 1][:3]
    return x, y, z
