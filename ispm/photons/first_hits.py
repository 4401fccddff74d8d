"""First hits of photons as arrays, to show bounce maps."""

from __future__ import annotations

import numpy as np

from ispm.accel.records import Hit
from ispm.accel.surface import SurfaceTable, scene_tables, surface
from ispm.lights.emitted import first_segment
from ispm.lights.openings import NO_WAYS, Ways
from ispm.optics.jit import jit
from ispm.optics.records import EMITTED, NO_HIT
from ispm.optics.vector import scale, vec3
from ispm.photons.scatter import Event, next_flight
from ispm.scene.packed import Packed

f32, i64, u32 = np.float32, np.int64, np.uint32


def first_hits(
    packed: Packed,
    surfaces: SurfaceTable,
    emitted: np.ndarray,
    seed: int,
    pass_index: int,
    ways: Ways = NO_WAYS,
) -> np.ndarray:
    """Return what becomes of photons at their first hits, (N, 12) float32.

    emitted  (N,) EMITTED;  ways  as of `walk`
    ->       columns 0-2 position (m), 3-5 shading normal, 6-8 outgoing flux (lm) and 9-11 direction; all
             zero where nothing was hit, the last six where the photon was absorbed
    The directions are those that `walk` takes.
    """
    assert emitted.dtype == EMITTED
    out = np.zeros((len(emitted), 12), f32)
    _first_hits(scene_tables(packed, None, surfaces), emitted, u32(seed), u32(pass_index), ways, out)
    return out


@jit
def _first_hits(tables, emitted, seed, pass_index, ways, out):
    """Write what `first_hits` returns to (N, 12) float32 zeros."""
    for i in range(len(emitted)):
        photon = emitted[i]
        if photon.instance == u32(NO_HIT):
            continue
        hit = Hit(photon.instance, photon.primitive, photon.u, photon.v)
        _, d, within = first_segment(tables, photon)
        flux = scale(within, vec3(photon.flux))
        x = surface(tables, hit, d)
        event = Event(photon.key, i64(0), i64(0), pass_index, seed)
        alive, wi, scattered, _, _ = next_flight(event, x, d, flux, ways)
        for c in range(3):
            out[i, c] = x.position[c]
            out[i, 3 + c] = x.n[c]
            if alive:
                out[i, 6 + c] = scattered[c]
                out[i, 9 + c] = wi[c]
