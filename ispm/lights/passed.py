"""The share of a light that reaches points, by shadow rays."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ispm.accel.intersect import STACK_WORDS
from ispm.accel.records import Scratch
from ispm.accel.surface import SurfaceTable, scene_tables
from ispm.accel.world import World
from ispm.kernels.share import run_shared, shared_rows
from ispm.kernels.simd import alloca
from ispm.lights.nee import BEFORE, shadow_transmittance
from ispm.optics.jit import jit
from ispm.optics.records import LIGHT_DIRECTIONAL, MATERIAL_BLEND, MATERIAL_MASK, MATERIAL_THIN
from ispm.optics.rng import random4
from ispm.optics.vector import vec3
from ispm.scene.packed import Packed

f32, u32 = np.float32, np.uint32

_DIMENSION = 3 << 20  # of the random numbers for holes
_CHUNK = 64  # rays a thread takes at a time


class RayNumbers(NamedTuple):
    """Random numbers of rays, for holes that they meet.

    keys    (n,) uint32
    sample  which of those of its key each takes
    """

    keys: np.ndarray
    sample: int
    pass_index: int
    seed: int


def passed_light(
    packed: Packed,
    world: World,
    surfaces: SurfaceTable,
    starts: np.ndarray,
    lights: np.ndarray,
    numbers: RayNumbers,
) -> np.ndarray:
    """Return the share of its light that reaches each point, (n, 3) float32, see `nee.shadow_transmittance`.

    starts  (n, 3) float32, where shadow rays start;  lights  (n,) rows of the lights
    """
    directions, distances = _towards(packed.lights, lights, starts)
    if not (packed.materials["flags"] & (MATERIAL_MASK | MATERIAL_BLEND | MATERIAL_THIN)).any():
        free = ~world.occluded(starts, directions, distances * (f32(1) - BEFORE))
        return np.repeat(free[:, None], 3, axis=1).astype(np.float32)
    tables, out = scene_tables(packed, world, surfaces), np.empty((len(starts), 3), np.float32)
    rays = tuple(np.ascontiguousarray(a, np.float32) for a in (starts, directions, distances))
    numbers = numbers._replace(keys=np.ascontiguousarray(numbers.keys))
    run_shared(lambda counter: _pass_some(tables, *rays, numbers, counter, out), world.threads)
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
def _pass_some(tables, starts, directions, distances, numbers, counter, out):
    """Write `nee.shadow_transmittance` of as many of n rays as a thread gets, to (n, 3) float32."""
    scratch = Scratch(alloca(STACK_WORDS), alloca(2))
    dimension, pass_index, seed = u32(_DIMENSION + numbers.sample), u32(numbers.pass_index), u32(numbers.seed)
    for i in shared_rows(counter, _CHUNK, len(starts)):
        u, _, _, _ = random4(numbers.keys[i], dimension, pass_index, seed)
        passed = shadow_transmittance(tables, vec3(starts[i]), vec3(directions[i]), distances[i], u, scratch)
        for c in range(3):
            out[i, c] = passed[c]
