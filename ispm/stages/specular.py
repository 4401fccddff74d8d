"""The pixels that show mirrors, glass, narrow lobes and blended surfaces, and the light that eye paths bring
to them."""

from __future__ import annotations

import numpy as np

from ispm import wgsl
from ispm.frame import GBuffer, GpuScene
from ispm.gpu import Counted, Gpu, Kept, Recording, Texture
from ispm.optics.records import (
    MATERIAL_ANISOTROPIC,
    MATERIAL_BLEND,
    MATERIAL_COATED,
    MATERIAL_SHEEN,
    MATERIAL_TRANSLUCENT,
    MATERIAL_TRANSMITS,
    copied,
)

_PATH = "stages/specular.wgsl"
_SHADER = wgsl.load(_PATH)
LAYER_BASE, LAYER_COAT, LAYER_SHEEN, LAYER_BEHIND, LAYER_FAR = (
    int(_SHADER.constants[f"LAYER_{name}"]) for name in ("BASE", "COAT", "SHEEN", "BEHIND", "FAR")
)
SEEN, BROUGHT = _SHADER.dtype("Seen"), _SHADER.dtype("Brought")
_BY_FLAGS = (  # may lead on
    MATERIAL_TRANSMITS
    | MATERIAL_COATED
    | MATERIAL_SHEEN
    | MATERIAL_BLEND
    | MATERIAL_ANISOTROPIC
    | MATERIAL_TRANSLUCENT
)
_BAND = 1 << 18  # pixels whose light lies in memory at a time, on either side
_THREADS = int(_SHADER.constants["THREADS"])
_NARROW = 1.01 * _SHADER.constants["NARROW_ALPHA"]  # roughness^2, and what the G-buffer's halves may round


class SpecularStage:
    """Lists the pixels from which eye rays go on, and adds what those rays found.

    In   gbuffer (W, H)
    Out  (n,) SEEN: pixel number y W + x and the triangle there, sorted by number
    Where no material is a mirror, transmits, is blended or has a narrow lobe nothing is looked for.
    """

    def __init__(self, gpu: Gpu) -> None:
        self._gpu = gpu
        self._find, self._add, self._write = (
            gpu.compute(_PATH, entry) for entry in ("find_specular", "add_pixels", "write_pixels")
        )
        self._count, self._seen = gpu.buffer("specular count"), gpu.buffer("specular pixels")
        self._brought = gpu.buffer("specular light")
        usage = ("attachment", "storage", "sampled")
        self._through, self._none = (
            gpu.texture(name, "rgba32float", usage=usage) for name in ("seen through glass", "nothing seen")
        )
        self._none.sized((1, 1))
        self._counted = Counted(gpu)
        self._kept, self._read = Kept(), np.zeros(0, SEEN)
        self._looked = self._unread = False

    def __call__(self, frame: Recording, scene: GpuScene, gbuffer: GBuffer) -> None:
        """Record the search for the pixels."""
        self._looked = _may_lead_on(scene.packed.materials)
        if not self._looked or not self._kept.lacks(frame, gbuffer, scene.packed.looks):
            return
        self._unread = True
        capacity = min(gbuffer.size[0] * gbuffer.size[1], self._gpu.max_binding // SEEN.itemsize)
        self._count.write(np.zeros(4, np.uint32))
        self._find(
            frame,
            over=gbuffer.size,
            materials=scene.materials,
            ids=gbuffer.ids,
            points=gbuffer.points,
            base=gbuffer.base,
            glow=gbuffer.emission,
            specular=gbuffer.specular,
            seen_count=self._count,
            seen=self._seen.sized(capacity * SEEN.itemsize),
        )

    def read(self) -> np.ndarray:
        """Return the pixels that were found; waits for them."""
        if not self._looked:
            return np.zeros(0, SEEN)
        if self._unread:
            most = self._seen.nbytes // SEEN.itemsize
            _, (found,) = self._counted.read(self._count, most, (self._seen, SEEN))
            self._read, self._unread = found[np.argsort(found["pixel"])], False
        return copied(self._read)

    def patch(
        self,
        frame: Recording,
        pixels: np.ndarray,
        light: np.ndarray,
        direct: Texture,
        indirect: Texture,
        emission: Texture,
        irradiance: Texture,
    ) -> Texture:
        """Add light, direct, indirect and emission RGB, to the numbered pixels of three textures.

        light  (n, 17): behind these nine numbers the share of a background that a pixel shows, RGB; the share
               of irradiance, over pi, that its sheen reflects, RGB; the share of emission there that
               transparency hides; and that of direct and indirect light, which a coat and sheen hide too
        irradiance  of photons at the pixels, lx
        ->     an image of that share, W x H; where there is none, of one black texel
        """
        through = self._none
        if light[:, 9:12].any():
            through = self._through.sized(direct.size)
            with frame.draw_into(through):
                pass  # clears it
        if not len(pixels):
            return through
        textures = direct, indirect, emission, irradiance, through
        for first in range(0, len(pixels), _BAND):
            if first:
                frame.submit()  # the band before, whose buffer is written anew
            rows = slice(first, first + _BAND)
            self._patch_band(frame, pixels[rows], light[rows], *textures)
        return through

    def _patch_band(
        self,
        frame: Recording,
        pixels: np.ndarray,
        light: np.ndarray,
        direct: Texture,
        indirect: Texture,
        emission: Texture,
        irradiance: Texture,
        through: Texture,
    ) -> None:
        brought = np.zeros(len(pixels), BROUGHT)
        brought["pixel"] = pixels
        for k, name in enumerate(("direct", "indirect", "emission", "through", "albedo")):
            brought[name] = light[:, 3 * k : 3 * k + 3]
        brought["clear"], brought["hidden"] = light[:, 15], light[:, 16]
        threads = min(len(pixels), _THREADS)
        self._add(
            frame,
            over=threads,
            brought=self._brought.write(brought),
            direct_in=direct,
            indirect_in=indirect,
            emission_in=emission,
            irradiance_in=irradiance,
        )
        self._write(
            frame,
            over=threads,
            summed=self._brought,
            direct_out=direct,
            indirect_out=indirect,
            emission_out=emission,
            through_out=through,
        )


def _may_lead_on(materials: np.ndarray) -> bool:
    """Whether eye rays may have to go on from any of these."""
    textured = materials["metallic_roughness_texture"]["texture"] >= 0
    layered = materials["flags"] & _BY_FLAGS != 0
    may = layered | (materials["roughness"] ** 2 < _NARROW) | textured
    return bool(may.any())
