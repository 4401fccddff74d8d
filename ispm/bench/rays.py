"""The rays of a walk, for a race on the very same."""

from __future__ import annotations

import numpy as np

from ispm.optics.jit import jit
from ispm.optics.records import NO_HIT
from ispm.optics.rng import random4
from ispm.optics.vector import scale
from ispm.scene.packed import Packed
from ispm.tracer.intersect import STACK_WORDS
from ispm.tracer.simd import address, alloca
from ispm.tracer.surface import SurfaceTable, closest_surface, leave_surface, surface
from ispm.tracer.walk import ROULETTE_AFTER, first_segment, scatter
from ispm.tracer.world import World

f32, i64, u32 = np.float32, np.int64, np.uint32


def rays_of_walk(
    packed: Packed, world: World, surfaces: SurfaceTable, emitted: np.ndarray, bounces: int, seed: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return origins and directions, (N, 3) float32, of the rays that `walk` of pass 0 traces, in its order.

    emitted  (N,) EMITTED
    """
    rays = np.empty((len(emitted) * max(bounces, 1), 2, 3), np.float32)
    count = _record(
        address(world.table), surfaces.addresses, surfaces.texels, surfaces.rows, packed.lights, emitted,
        i64(bounces), u32(seed), rays,
    )  # fmt: skip
    return np.ascontiguousarray(rays[:count, 0]), np.ascontiguousarray(rays[:count, 1])


@jit
def _record(world, table, texels, rows, lights, emitted, bounces, seed, rays):
    """Walk each photon as `walk` does, and write its rays instead of what they hit; return how many."""
    stack, words = alloca(STACK_WORDS), alloca(2)
    count = i64(0)
    for i in range(len(emitted)):
        photon = emitted[i]
        if photon.instance == u32(NO_HIT):
            continue
        hit = (photon.instance, photon.primitive, photon.u, photon.v)
        d, within = first_segment(table, lights, i64(photon.light), hit)
        flux = scale(within, (photon.flux[0], photon.flux[1], photon.flux[2]))
        for scatters in range(bounces):
            _, ng, n, bsdf, flags = surface(table, texels, rows, hit, d)
            u0, u1, u2, u3 = random4(photon.key, u32(2 * scatters), u32(0), seed)
            alive, wi, scattered = scatter(ng, n, bsdf, flags, d, flux, u0, u1, u2)
            if alive and scatters >= ROULETTE_AFTER:
                before = flux[0] + flux[1] + flux[2]
                survival = min(f32(1), (scattered[0] + scattered[1] + scattered[2]) / before)
                alive = u3 < survival
                scattered = scale(f32(1) / survival, scattered)
            if not alive:
                break
            flux, d = scattered, wi
            _, _, _, u3 = random4(photon.key, u32(2 * scatters + 1), u32(0), seed)
            start = leave_surface(world, table, hit, ng)
            for axis in range(3):
                rays[count, 0, axis] = start[axis]
                rays[count, 1, axis] = d[axis]
            count += 1
            found, hit = closest_surface(world, table, texels, rows, start, d, u3, stack, words)
            if not found:
                break
    return count
