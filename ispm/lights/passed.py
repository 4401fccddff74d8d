"""Light that comes through to points, by shadow rays."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ispm.accel.intersect import STACK_WORDS
from ispm.accel.records import Scratch
from ispm.accel.surface import SurfaceTable, scene_tables
from ispm.accel.world import World
from ispm.kernels.simd import address, alloca, atomic_add
from ispm.kernels.threads import run_threads
from ispm.lights.nee import BEFORE, shadow_transmittance
from ispm.optics.jit import jit
from ispm.optics.records import MATERIAL_BLEND, MATERIAL_MASK, MATERIAL_THIN
from ispm.optics.rng import random4
from ispm.scene.packed import Packed

f32, i64, u32 = np.float32, np.int64, np.uint32

_DIMENSION = 3 << 20  # of the random numbers for holes
_CHUNK = 64


class _Numbers(NamedTuple):
    """Random numbers of each ray: those of its key, uint32, at one dimension."""

    keys: np.ndarray
    dimension: np.uint32
    pass_index: np.uint32
    seed: np.uint32


def passed_light(
    packed: Packed,
    world: World,
    surfaces: SurfaceTable,
    starts: np.ndarray,
    directions: np.ndarray,
    distances: np.ndarray,
    keys: np.ndarray,
    sample: int,
    pass_index: int,
    seed: int,
    threads: int,
) -> np.ndarray:
    """Return the share of light that comes to each start from as far as the light is, (n, 3) float32.

    starts, directions  (n, 3) float32, unit;  distances  (n,) float32 m, infinite for a sun
    keys                (n,) uint32, of the random numbers of blended materials;  sample  which of theirs
    As `nee.shadow_transmittance` has it.
    """
    if not (packed.materials["flags"] & (MATERIAL_MASK | MATERIAL_BLEND | MATERIAL_THIN)).any():
        free = ~world.occluded(starts, directions, distances * (f32(1) - BEFORE))
        return np.repeat(free[:, None], 3, axis=1).astype(np.float32)
    tables = scene_tables(packed, world, surfaces)
    rays = tuple(np.ascontiguousarray(a, np.float32) for a in (starts, directions, distances))
    numbers = _Numbers(keys.astype(np.uint32), u32(_DIMENSION + sample), u32(pass_index), u32(seed))
    counter, out = np.zeros(8, np.int64), np.empty((len(starts), 3), np.float32)
    run_threads(lambda _: _pass_chunks(tables, *rays, numbers, address(counter), out), threads)
    return out


@jit
def _pass_chunks(tables, starts, directions, distances, numbers, counter, out):
    scratch = Scratch(alloca(STACK_WORDS), alloca(2))
    while True:
        first = atomic_add(counter, i64(_CHUNK))
        if first >= len(starts):
            return
        for i in range(first, min(first + i64(_CHUNK), len(starts))):
            start = (starts[i, 0], starts[i, 1], starts[i, 2])
            d = (directions[i, 0], directions[i, 1], directions[i, 2])
            u, _, _, _ = random4(numbers.keys[i], numbers.dimension, numbers.pass_index, numbers.seed)
            passed = shadow_transmittance(tables, start, d, distances[i], u, scratch)
            for c in range(3):
                out[i, c] = passed[c]
