"""The share of a light that reaches points, by shadow rays."""

from __future__ import annotations

import numpy as np

from ispm.accel.intersect import STACK_WORDS
from ispm.accel.records import Scratch
from ispm.accel.surface import SurfaceTable, scene_tables
from ispm.accel.transmittance import BEFORE, shadow_transmittance
from ispm.accel.world import World
from ispm.kernels.share import run_shared, shared_rows
from ispm.kernels.simd import alloca
from ispm.optics.jit import jit
from ispm.optics.records import LIGHT_DIRECTIONAL, MATERIAL_BLEND, MATERIAL_MASK, MATERIAL_THIN
from ispm.optics.vector import vec3
from ispm.scene.packed import Packed

f32 = np.float32

_CHUNK = 64  # rays a thread takes at a time


def passed_light(
    packed: Packed, world: World, surfaces: SurfaceTable, starts: np.ndarray, lights: np.ndarray
) -> np.ndarray:
    """Return the share of its light that reaches each point, (n, 3) float32, see `shadow_transmittance`.

    starts  (n, 3) float32, where shadow rays start;  lights  (n,) rows of the lights
    """
    directions, distances = _towards(packed.lights, lights, starts)
    if not (packed.materials["flags"] & (MATERIAL_MASK | MATERIAL_BLEND | MATERIAL_THIN)).any():
        free = ~world.occluded(starts, directions, distances * (f32(1) - BEFORE))
        return np.repeat(free[:, None], 3, axis=1).astype(np.float32)
    tables, out = scene_tables(packed, world, surfaces), np.empty((len(starts), 3), np.float32)
    rays = tuple(np.ascontiguousarray(a, np.float32) for a in (starts, directions, distances))
    run_shared(lambda counter: _pass_some(tables, *rays, counter, out), world.threads)
    return out


def _towards(lights: np.ndarray, rows: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the unit direction, (n, 3) float32, from each point to the light of its row, and its distance in
    m, (n,) float32, infinite for directional ones."""
    far = lights["kind"][rows] == LIGHT_DIRECTIONAL
    segments = lights["position"][rows] - points
    distances = np.where(far, f32(np.inf), np.sqrt(np.einsum("nk,nk->n", segments, segments)))
    segments /= distances[:, None]
    segments[far] = -lights["direction"][rows[far]]
    return segments, distances


@jit
def _pass_some(tables, starts, directions, distances, counter, out):
    """Write `shadow_transmittance` of as many of n rays as a thread gets, to (n, 3) float32."""
    scratch = Scratch(alloca(STACK_WORDS), alloca(2))
    for i in shared_rows(counter, _CHUNK, len(starts)):
        passed = shadow_transmittance(tables, vec3(starts[i]), vec3(directions[i]), distances[i], scratch)
        for c in range(3):
            out[i, c] = passed[c]
