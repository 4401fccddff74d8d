"""Direct light at the eye's pixels."""

from __future__ import annotations

import numpy as np

from ispm import wgsl
from ispm.frame import GBuffer, GpuScene, ShadowMaps
from ispm.gpu import FLAT, Counted, Gpu, Raster, Recording, Texture
from ispm.optics.records import MATERIAL_TRANSMITS
from ispm.stages.camera import CameraView

_SHADER = wgsl.load("stages/direct.wgsl")
DOUBT, _LAMPS = _SHADER.dtype("Doubt"), _SHADER.dtype("Lamps")
_AT_ONCE = _LAMPS["lights"].shape[0]  # lights; a uniform's 64 KiB hold no more
_LISTED = 8  # pixels for each of which there is room in the list at first


class DirectStage:
    """Radiance that lights send to the eye by one reflection, or through a thin surface.

    In   scene, gbuffer, shadows, and the view the G-buffer was drawn with
    Out  rgba32float of the G-buffer's size: cd/m2, 1; black where nothing is and where it is unlit
    Where a light's map does not tell whether it reaches a pixel, what it would bring is left out and listed,
    see `doubts`. A fragment shader: on llvmpipe it takes four fifths of a compute shader's time. Every pixel
    asks every light, 128 at a time.
    """

    def __init__(self, gpu: Gpu) -> None:
        self._gpu = gpu
        self._pipelines: dict[tuple[bool, bool, bool, bool], Raster] = {}
        self._nearest = gpu.sampler(linear=False, mipmaps=False)
        usage = ("attachment", "sampled", "storage")
        self._radiance = [gpu.texture(f"direct radiance {k}", "rgba32float", usage=usage) for k in range(2)]
        self._nothing = gpu.texture("no radiance", "rgba32float").sized((1, 1))
        self._others = gpu.texture("radiance of area lights", "rgba32float")
        self._count, self._doubts = gpu.buffer("doubt count"), gpu.buffer("doubts")
        self._counted = Counted(gpu)
        self._room = 0  # rows of the list, as many as some frame wanted
        self._most = gpu.max_binding // DOUBT.itemsize
        self._drawn: tuple[GpuScene, GBuffer, ShadowMaps, CameraView, np.ndarray | None] | None = None

    def __call__(
        self,
        frame: Recording,
        scene: GpuScene,
        gbuffer: GBuffer,
        shadows: ShadowMaps,
        view: CameraView,
        others: np.ndarray | None = None,
    ) -> Texture:
        """Record the shading and return where its result will be.

        others  (h, w, 4) float32, direct light that it is added to; None: there is none
        """
        self._drawn = scene, gbuffer, shadows, view, others
        self._room = min(max(self._room, 1 + gbuffer.size[0] * gbuffer.size[1] // _LISTED), self._most)
        self._doubts.sized(self._room * DOUBT.itemsize)
        self._count.write(np.zeros(4, np.uint32))
        before = self._nothing
        if others is not None:
            before = self._others.sized(gbuffer.size).write(others)
        for index, first in enumerate(range(0, max(scene.light_count, 1), _AT_ONCE)):
            result = self._radiance[index % 2].sized(gbuffer.size)
            self._shade(frame, scene, gbuffer, shadows, view, first, before, result)
            before = result
        return before

    def doubts(self) -> np.ndarray:
        """Return (n,) DOUBT by light and pixel; waits for them.

        Where there was no room for all it draws the frame again, with more. Those that not even the adapter's
        largest buffer holds have been lit by the share of four texels.
        """
        assert self._drawn is not None
        count, (found,) = self._counted.read(self._count, self._room, (self._doubts, DOUBT))
        if count > self._room < self._most:
            self._room = count * 5 // 4
            with self._gpu.frame() as frame:
                self(frame, *self._drawn)
            _, (found,) = self._counted.read(self._count, self._room, (self._doubts, DOUBT))
        self._drawn = None
        return np.asarray(found[np.lexsort((found["pixel"], found["light"]))])

    def _shade(
        self,
        frame: Recording,
        scene: GpuScene,
        gbuffer: GBuffer,
        shadows: ShadowMaps,
        view: CameraView,
        first: int,
        before: Texture,
        result: Texture,
    ) -> None:
        """Record the shading by the lights from row `first` on, on top of `before`."""
        transmits = bool((scene.packed.materials["flags"] & MATERIAL_TRANSMITS).any())
        adds = before is not self._nothing
        raster = self._pipeline(adds, transmits, shadows.has_sheets, scene.light_count == 1)
        group = raster.bind(
            0,
            frame,
            camera=view.uniform(),
            lamps=_lamps(scene, shadows, first),
            materials=scene.materials,
            **gbuffer.surfaces,
            before=before,
            atlas=shadows.depth,
            sheets=shadows.sheets,
            tints=shadows.tints,
            nearest=self._nearest,
            doubt_count=self._count,
            doubts=self._doubts,
        )
        with frame.draw_into(result) as canvas:
            canvas.use(raster, group)
            canvas.draw(3)

    def _pipeline(self, adds: bool, transmits: bool, sheets: bool, alone: bool) -> Raster:
        key = adds, transmits, sheets, alone
        if key not in self._pipelines:
            self._pipelines[key] = self._gpu.raster(
                "stages/direct.wgsl",
                ["rgba32float"],
                FLAT,
                ADDS=adds,
                TRANSMITS=transmits,
                SHEETS=sheets,
                ALONE=alone,
            )
        return self._pipelines[key]


def _lamps(scene: GpuScene, shadows: ShadowMaps, first: int) -> np.ndarray:
    """The LAMPS record of the lights from row `first` on, as many as it holds."""
    lamps = np.zeros((), _LAMPS)
    count = min(scene.light_count - first, _AT_ONCE)
    lamps["count"], lamps["first"], lamps["extent"] = count, first, scene.packed.diagonal
    lamps["texel"] = 1.0 / np.array(shadows.depth.size)
    lamps["lights"][:count] = scene.packed.lights[first : first + count]
    lamps["maps"][:count] = shadows.maps[first : first + count]
    lamps["tiles"][: 6 * count] = shadows.tiles[6 * first : 6 * (first + count)]
    return lamps
