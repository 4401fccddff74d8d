"""Caustics at full resolution, unfiltered: as sharp as their photons lie close."""

from __future__ import annotations

import numpy as np

from ispm.frame import GBuffer, GpuScene
from ispm.gpu import FLAT, Gpu, Recording, Target, Texture
from ispm.stages.camera import CameraView

_PATH = "stages/caustic.wgsl"


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
        group = self._splat.bind(
            0,
            frame,
            camera=view.uniform(),
            photons=self._photons.write(photons),
            materials=scene.materials,
            **gbuffer.surfaces,
        )
        with frame.draw_into(radiance, irradiance) as canvas:
            canvas.use(self._splat, group)
            canvas.draw(3 * len(photons))
        return radiance, irradiance
