"""Incident light from low to full resolution."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ispm import wgsl
from ispm.frame import GBuffer, GpuScene
from ispm.gpu import FLAT, Buffer, Compute, Counted, Gpu, Raster, Recording, Texture
from ispm.optics.gradient import WORDS
from ispm.optics.incident import FilteredLight
from ispm.optics.records import RECEIVER
from ispm.stages.camera import CameraView

_PATH = "stages/upsample.wgsl"
_SHADER = wgsl.load(_PATH)
MISSED = _SHADER.dtype("Missed")
_FINISHING = 64 * int(_SHADER.constants["FINISHING"])  # threads
_LISTED = 16  # pixels for each of which there is room among the missed at first
_MUCH_GLOSS = 0.125  # of the receivers, above which all pixels look for gloss at once
_NO_GRADIENT = np.zeros((1, WORDS), np.float32)
UNUSED = np.float32(-1e30)  # density of light that is not to be spread


class Upsample:
    """Joint bilateral upsampling of incident light, and the radiance that the surfaces make of it.

    In   gbuffer (W, H); receivers (w h,) and their light, UNUSED as its density where it is not to be
         spread; where it has a gradient it follows the normals of pixels; caustics, radiance and
         irradiance at full resolution, which are added
    Out  indirect, irradiance, and emission as it is: (W, H) rgba32float, alpha 1 where a surface is seen
    A fragment shader: on llvmpipe it takes two thirds of the time of a compute shader that serves K x K
    pixels a thread.
    Source: Kopf et al. 2007, with plane distance as the range weight.
    """

    def __init__(self, gpu: Gpu, subsampling: int) -> None:
        self._gpu, self._block = gpu, subsampling
        self._main: dict[tuple[int, bool], Raster] = {}  # by how they treat gloss; has light slopes
        self._others: dict[tuple[str, bool], Compute] = {}
        self._glow = gpu.raster(_PATH, ["rgba32float"], replace(FLAT, fragment="fs_glow"))
        self._patch = gpu.compute(_PATH, "patch_missed", BLOCK=subsampling)
        self._light, self._gradient = gpu.buffer("incident light"), gpu.buffer("gradient of light")
        self._count, self._counted = gpu.buffer("missed count"), Counted(gpu)
        self._room, self._most = 0, gpu.max_binding // RECEIVER.itemsize
        self._look: dict[str, Any] = {}  # what the pixels that are left were last looked at with,
        self._turned = False  # and whether that light has slopes
        self._missed = gpu.buffer("missed pixels")
        self._left_count, self._left = gpu.buffer("left count"), gpu.buffer("left pixels")
        self._places, self._lights, self._slopes = (
            gpu.texture(f"receivers' {what}", "rgba32uint", usage=["storage", "sampled"])
            for what in ("places", "lights", "slopes")
        )
        self._missed_receivers = gpu.buffer("missed receivers")
        self._missed_light = gpu.buffer("missed light")
        usage = ("attachment", "storage", "sampled")
        self.indirect, self.irradiance, self.emission = (
            gpu.texture(name, "rgba32float", usage=usage) for name in ("indirect", "irradiance", "emission")
        )
        self._black = gpu.texture("no caustic", "rgba32float").sized((1, 1))

    def __call__(
        self,
        frame: Recording,
        scene: GpuScene,
        gbuffer: GBuffer,
        view: CameraView,
        receivers: Buffer,
        filtered: FilteredLight,
        caustic: tuple[Texture, Texture] | None = None,
    ) -> tuple[Texture, Texture, Texture]:
        self._room = min(max(self._room, 1 + view.size[0] * view.size[1] // _LISTED), self._most)
        self._left.sized(min(4 * view.size[0] * view.size[1], self._gpu.max_binding))
        self._left_count.write(np.zeros(4, np.uint32))
        low = -(-view.size[0] // self._block), -(-view.size[1] // self._block)
        incident, turned = self._light.write(filtered.light), filtered.gradient is not None
        self._compute("pack_receivers", turned)(
            frame,
            over=low,
            camera=view.uniform(),
            receivers=receivers,
            light=incident,
            gradient=self._gradient.write(_NO_GRADIENT if filtered.gradient is None else filtered.gradient),
            places_out=self._places.sized(low),
            lights_out=self._lights.sized(low),
            slopes_out=self._slopes.sized(low if turned else (1, 1)),
        )
        shared: dict[str, Any] = dict(
            **self._surface(scene, gbuffer, view),
            **self._sharp(caustic),
            receivers=receivers,
            light=incident,
            places=self._places,
            lights=self._lights,
            slopes=self._slopes,
            left_count=self._left_count,
            left=self._left,
        )
        main = self._pipeline(filtered.light, turned)
        group = main.bind(0, frame, **shared)
        with frame.draw_into(*self._targets(view).values()) as canvas:
            canvas.use(main, group)
            canvas.draw(3)
        self._look, self._turned = shared | self._targets(view), turned
        self._find_left(frame)
        with frame.draw_into(self.emission.sized(view.size)) as canvas:
            if scene.packed.glows:
                canvas.use(self._glow, self._glow.bind(0, emission=gbuffer.emission, points=gbuffer.points))
                canvas.draw(3)
        return self.indirect, self.irradiance, self.emission

    def _compute(self, entry: str, turned: bool) -> Compute:
        """The pipeline of an entry point, for light with slopes or without; compiled when first needed."""
        if (entry, turned) not in self._others:
            made = self._gpu.compute(_PATH, entry, BLOCK=self._block, TURNED_LIGHT=turned)
            self._others[entry, turned] = made
        return self._others[entry, turned]

    def _pipeline(self, light: np.ndarray, turned: bool) -> Raster:
        """Likewise that of all pixels, for (w h, 16) light."""
        glossy = float(light.reshape(-1, 4, 4)[:, 1:, :3].any(axis=(1, 2)).mean())
        gloss = (glossy > 0.0) + (glossy > _MUCH_GLOSS)
        if (gloss, turned) not in self._main:
            formats = ["rgba32float"] * 2
            told = dict(BLOCK=self._block, GLOSS=gloss, TURNED_LIGHT=turned)
            self._main[gloss, turned] = self._gpu.raster(_PATH, formats, FLAT, **told)
        return self._main[gloss, turned]

    def _find_left(self, frame: Recording) -> None:
        """Record the search for the light of pixels that are left, which lists those that find none."""
        self._count.write(np.zeros(4, np.uint32))
        self._compute("finish", self._turned)(
            frame,
            over=_FINISHING,
            **self._look,
            missed_count=self._count,
            missed=self._missed.sized(self._room * MISSED.itemsize),
            missed_receivers=self._missed_receivers.sized(self._room * RECEIVER.itemsize),
        )

    def missed(self) -> tuple[np.ndarray, np.ndarray]:
        """Return (M,) MISSED and (M,) RECEIVER: the pixels that found no neighbour; waits for them.

        Where there was no room for all it looks again, with more.
        """
        lists = (self._missed, MISSED), (self._missed_receivers, RECEIVER)
        count, (pixels, receivers) = self._counted.read(self._count, self._room, *lists)
        if count > self._room < self._most:
            self._room = min(count * 5 // 4, self._most)
            with self._gpu.frame() as frame:
                self._find_left(frame)
            _, (pixels, receivers) = self._counted.read(self._count, self._room, *lists)
        return pixels, receivers

    def patch(
        self,
        frame: Recording,
        scene: GpuScene,
        gbuffer: GBuffer,
        view: CameraView,
        light: np.ndarray,
        caustic: tuple[Texture, Texture] | None = None,
    ) -> None:
        """Write the (M, 16) light of the missed pixels."""
        self._patch(
            frame,
            over=len(light),
            **self._surface(scene, gbuffer, view),
            missed_list=self._missed,
            missed_light=self._missed_light.write(light),
            **self._targets(view),
            **self._sharp(caustic),
        )

    def _surface(self, scene: GpuScene, gbuffer: GBuffer, view: CameraView) -> dict[str, Any]:
        return {
            "camera": view.uniform(),
            "materials": scene.materials,
            **gbuffer.surfaces,
        }

    def _sharp(self, caustic: tuple[Texture, Texture] | None) -> dict[str, Any]:
        radiance, irradiance = caustic or (self._black, self._black)
        return {"caustic": radiance, "caustic_irradiance": irradiance}

    def _targets(self, view: CameraView) -> dict[str, Any]:
        return {
            "indirect_out": self.indirect.sized(view.size),
            "irradiance_out": self.irradiance.sized(view.size),
        }
