"""Direct light at the eye's pixels."""

from __future__ import annotations

import numpy as np

from ispm import wgsl
from ispm.frame import GBuffer, GpuScene, ShadowMaps
from ispm.gpu import Gpu, Recording, Texture
from ispm.stages.camera import CameraView

_DIRECT = wgsl.load("stages/direct.wgsl").dtype("Direct")


class DirectStage:
    """Radiance that point lights send to the eye by one reflection.

    In   scene, gbuffer, shadows, and the view the G-buffer was drawn with
    Out  rgba32float of the G-buffer's size: cd/m2, 1; black where nothing is and where it is unlit
    Shadows are filtered over two to three texels of their map. A fragment shader: on llvmpipe it takes
    four fifths of a compute shader's time, half of it in the four cube comparisons.
    """

    def __init__(self, gpu: Gpu) -> None:
        self._shade = gpu.raster("stages/direct.wgsl", ["rgba32float"], depth=None)
        self._farther = gpu.sampler(compare="greater-equal")  # reversed depth: nearer is greater
        usage = ("attachment", "sampled", "storage")
        self._radiance = gpu.texture("direct radiance", "rgba32float", usage=usage)

    def __call__(
        self, frame: Recording, scene: GpuScene, gbuffer: GBuffer, shadows: ShadowMaps, view: CameraView
    ) -> Texture:
        """Record the shading and return where its result will be."""
        radiance = self._radiance.sized(gbuffer.size)
        group = self._shade.bind(
            0, frame, camera=view.uniform(),
            direct=np.array((scene.light_count, 0, 1.0 / np.array(shadows.depth.size)), _DIRECT),
            lights=scene.lights, materials=scene.materials, ids=gbuffer.ids, normals=gbuffer.normals,
            base=gbuffer.base, emission=gbuffer.emission, depth=gbuffer.depth, atlas=shadows.depth,
            farther=self._farther, maps=shadows.maps, tiles=shadows.tiles,
        )  # fmt: skip
        with frame.draw_into(radiance) as canvas:
            canvas.use(self._shade, group)
            canvas.draw(3)
        return radiance

    def close(self) -> None:
        """Free the radiance."""
        self._radiance.close()
