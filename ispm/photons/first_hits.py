"""What a bounce map holds, texel by texel, for the eye."""

from __future__ import annotations

import numpy as np

from ispm.accel.surface import SurfaceTable, surface
from ispm.optics.jit import jit
from ispm.optics.records import EMITTED, NO_HIT
from ispm.photons.walk import first_segment, next_flight
from ispm.scene.packed import Packed

f32, i64, u32 = np.float32, np.int64, np.uint32


def first_hits(
    packed: Packed, surfaces: SurfaceTable, emitted: np.ndarray, seed: int, pass_index: int
) -> np.ndarray:
    """Return what becomes of photons at their first hits, (N, 12) float32.

    emitted  (N,) EMITTED
    ->       columns 0-2 position (m), 3-5 shading normal, 6-8 outgoing flux (lm) and 9-11 direction; all
             zero where nothing was hit, the last six where the photon was absorbed
    The directions are those that `walk` takes.
    """
    assert emitted.dtype == EMITTED
    out = np.zeros((len(emitted), 12), f32)
    _first_hits(
        surfaces.addresses, surfaces.texels, surfaces.rows, packed.lights, emitted, u32(seed),
        u32(pass_index), out,
    )  # fmt: skip
    return out


@jit
def _first_hits(table, texels, rows, lights, emitted, seed, pass_index, out):
    for i in range(len(emitted)):
        photon = emitted[i]
        if photon.instance == u32(NO_HIT):
            continue
        hit = (photon.instance, photon.primitive, photon.u, photon.v)
        _, d, within = first_segment(table, lights[i64(photon.light)], hit)
        flux = (within * photon.flux[0], within * photon.flux[1], within * photon.flux[2])
        position, ng, n, bsdf, flags, _ = surface(table, texels, rows, hit, d)
        alive, wi, scattered, _ = next_flight(
            photon.key, pass_index, seed, i64(0), i64(0), ng, n, bsdf, flags, d, flux
        )
        for c in range(3):
            out[i, c] = position[c]
            out[i, 3 + c] = n[c]
            if alive:
                out[i, 6 + c] = scattered[c]
                out[i, 9 + c] = wi[c]
