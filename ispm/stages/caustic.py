"""Caustics at full resolution, unfiltered: as sharp as their photons lie close."""

from __future__ import annotations

import numpy as np

from ispm.frame import GBuffer, GpuScene
from ispm.gpu import FLAT, Gpu, Recording, Target, Texture
from ispm.stages.camera import CameraView

_PATH = "stages/caustic.wgsl"
_ALIGNED = 256  # photons, so that parts of their buffer begin at multiples of as many bytes


class CausticStage:
    """Draws each caustic photon's kernel over the G-buffer and adds up its light by blending.

    In   scene, gbuffer, the view it was drawn with, and (N,) CAUSTIC
    Out  reflected radiance and irradiance, of the G-buffer's size; None where there are no photons
    Sums are 32-bit floats; where the adapter cannot blend those they are 16-bit ones, which lose light
    where many dim photons meet.
    Source: McGuire and Luebke 2009, section 3.4, with the kernel's outline on the screen as the volume.
    """

    def __init__(self, gpu: Gpu) -> None:
        format = "rgba32float" if gpu.has("float32-blendable") else "rgba16float"
        sum_up = Target(format, blend="add")
        self._most = gpu.max_binding
        self._splat = gpu.raster(_PATH, [sum_up, sum_up], FLAT)
        self._photons = gpu.buffer("caustic photons")
        self._sums = [gpu.texture(f"caustic {name}", format) for name in ("radiance", "irradiance")]

    def __call__(
        self, frame: Recording, scene: GpuScene, gbuffer: GBuffer, view: CameraView, photons: np.ndarray
    ) -> tuple[Texture, Texture] | None:
        """Record the draws and return where their result will be."""
        if not len(photons):
            return None
        radiance, irradiance = (texture.sized(gbuffer.size) for texture in self._sums)
        shared = {"camera": view.uniform(), "materials": scene.materials, **gbuffer.surfaces}
        kept, each = self._photons.write(photons), photons.itemsize
        most = self._most // each // _ALIGNED * _ALIGNED  # what an adapter binds at once has a limit
        with frame.draw_into(radiance, irradiance) as canvas:
            for first in range(0, len(photons), most):
                count = min(most, len(photons) - first)
                part = kept.rows(first, first + count, each)
                canvas.use(self._splat, self._splat.bind(0, frame, photons=part, **shared))
                canvas.draw(3 * count)
        return radiance, irradiance
