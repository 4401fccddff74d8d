"""Follow photons from their first hits until they are absorbed, leave, or have scattered enough."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import literal_unroll

from ispm.optics.bsdf import adjoint_factor, sample_bsdf
from ispm.optics.jit import jit
from ispm.optics.light import range_window
from ispm.optics.records import LIGHT_DIRECTIONAL, MATERIAL_UNLIT, NO_HIT, PHOTON
from ispm.optics.rng import random4
from ispm.optics.vector import dot, scale, sub
from ispm.scene.packed import Packed
from ispm.tracer.intersect import STACK_WORDS
from ispm.tracer.simd import address, alloca, atomic_add
from ispm.tracer.surface import SurfaceTable, closest_surface, hit_position, leave_surface, surface
from ispm.tracer.threads import run_threads
from ispm.tracer.world import World

f32, i64, u32 = np.float32, np.int64, np.uint32

ROULETTE_AFTER = 4  # scatters; living photons lower the error more than they cost before that
_CHUNK = 256  # photons a thread takes at a time; results do not depend on it or on the threads

# rows of a chunk's sums
_EMITTED, _ABSORBED, _ESCAPED, _DROPPED, _STORED = range(5)


@dataclass(frozen=True)
class Walk:
    """What became of the photons.

    photons    (M,) PHOTON in the order of the emitted ones; radius and height not yet set
    emitted, absorbed, escaped, dropped   (3,) float64 lumen; the first is the sum of the others
    stored     (3,) float64 lumen, each photon counted at each hit
    rays       traced
    """

    photons: np.ndarray
    emitted: np.ndarray
    absorbed: np.ndarray
    escaped: np.ndarray
    dropped: np.ndarray
    stored: np.ndarray
    photon_count: int
    rays: int


def walk(
    packed: Packed,
    world: World,
    surfaces: SurfaceTable,
    emitted: np.ndarray,
    bounces: int,
    seed: int,
    pass_index: int,
    threads: int,
) -> Walk:
    """Trace photons from their first hits, storing one at each later hit.

    emitted  (N,) EMITTED
    bounces  scatters at most, the one at the first hit included
    The first hit is direct light, which shadow maps show, so it is not stored. Flux changes by
    f cos / pdf; after `ROULETTE_AFTER` scatters roulette keeps the expectation (method, 1.3).
    Returns the same bytes for any number of threads.
    """
    chunk_count = -(-len(emitted) // _CHUNK)
    capacity = _CHUNK * max(bounces, 1)
    stored = world.scratch(chunk_count * capacity, PHOTON)  # mostly pages that are never touched
    counts = np.zeros((chunk_count, 2), np.int64)
    sums = np.zeros((chunk_count, 5, 3))
    counter = np.zeros(8, np.int64)

    def work(_: int) -> None:
        _walk_chunks(
            address(world.table), surfaces.addresses, surfaces.texels, surfaces.rows, packed.lights, emitted,
            i64(bounces), u32(seed), u32(pass_index), address(counter), stored, counts, sums,
        )  # fmt: skip

    run_threads(work, threads)
    kept = [stored[c * capacity : c * capacity + n] for c, n in enumerate(counts[:, 0])]
    photons = np.concatenate(kept) if kept else np.zeros(0, PHOTON)
    total = sums.sum(axis=0)
    return Walk(
        photons, total[_EMITTED], total[_ABSORBED], total[_ESCAPED], total[_DROPPED], total[_STORED],
        len(emitted), int(counts[:, 1].sum()),
    )  # fmt: skip


@jit
def _walk_chunks(
    world, table, texels, rows, lights, emitted, bounces, seed, pass_index, counter, stored, counts, sums
):  # fmt: skip
    capacity = i64(_CHUNK) * max(bounces, i64(1))
    stack, words = alloca(STACK_WORDS), alloca(2)
    while True:
        chunk = atomic_add(counter, i64(1))
        if chunk >= len(counts):
            return
        row = chunk * capacity
        rays = i64(0)
        for i in range(chunk * i64(_CHUNK), min((chunk + 1) * i64(_CHUNK), len(emitted))):
            row, traced = _walk_one(
                world, table, texels, rows, lights, emitted, i, bounces, seed, pass_index, stack, words,
                stored, row, sums, chunk,
            )  # fmt: skip
            rays += traced
        counts[chunk, 0] = row - chunk * capacity
        counts[chunk, 1] = rays


@jit
def _walk_one(
    world, table, texels, rows, lights, emitted, i, bounces, seed, pass_index, stack, words,
    stored, row, sums, chunk,
):  # fmt: skip
    """Follow photon `i`; return the next free row of `stored` and the number of rays traced."""
    photon = emitted[i]
    flux = (photon.flux[0], photon.flux[1], photon.flux[2])
    _add(sums, chunk, _EMITTED, flux)
    if photon.instance == u32(NO_HIT):
        _add(sums, chunk, _ESCAPED, flux)
        return row, i64(0)
    hit = (photon.instance, photon.primitive, photon.u, photon.v)
    d, within = first_segment(table, lights, i64(photon.light), hit)
    kept = scale(within, flux)
    _add_difference(sums, chunk, _ESCAPED, flux, kept)
    flux = kept
    rays = i64(0)
    for scatters in range(bounces + 1):
        position, ng, n, bsdf, flags = surface(table, texels, rows, hit, d)
        if scatters > 0:
            _store(stored, row, position, ng, flux, d, hit[0], scatters)
            _add(sums, chunk, _STORED, flux)
            row += 1
        if scatters == bounces:
            _add(sums, chunk, _DROPPED, flux)
            break
        u0, u1, u2, u3 = random4(photon.key, u32(2 * scatters), pass_index, seed)
        alive, wi, scattered = scatter(ng, n, bsdf, flags, d, flux, u0, u1, u2)
        if alive and scatters >= ROULETTE_AFTER:
            survival = min(f32(1), _sum(scattered) / _sum(flux))
            alive = u3 < survival
            scattered = scale(f32(1) / survival, scattered)
        if not alive:
            _add(sums, chunk, _ABSORBED, flux)
            break
        _add_difference(sums, chunk, _ABSORBED, flux, scattered)
        flux, d = scattered, wi
        _, _, _, u3 = random4(photon.key, u32(2 * scatters + 1), pass_index, seed)
        start = leave_surface(world, table, hit, ng)
        rays += 1
        found, hit = closest_surface(world, table, texels, rows, start, d, u3, stack, words)
        if not found:
            _add(sums, chunk, _ESCAPED, flux)
            break
    return row, rays


@jit
def first_segment(table, lights, light, hit):
    """Direction from the light to the first hit, and the share of the flux within its range.

    A spot's falloff is not in it: emission has seen to that.
    """
    row = lights[light]
    if row.kind == u32(LIGHT_DIRECTIONAL):
        return (row.direction[0], row.direction[1], row.direction[2]), f32(1)
    way = sub(hit_position(table, hit), (row.position[0], row.position[1], row.position[2]))
    square = dot(way, way)
    distance = f32(math.sqrt(square if square > f32(0) else f32(1e-30)))
    return scale(f32(1) / distance, way), range_window(distance, row.range)


@jit
def scatter(ng, n, bsdf, flags, d, flux, u0, u1, u2):
    """Sample where the photon goes: (alive, wi, flux after it)."""
    wo = scale(f32(-1), d)
    if flags & u32(MATERIAL_UNLIT):
        return False, wo, flux
    alive, wi, weight = sample_bsdf(bsdf, n, wo, u0, u1, u2)
    out_ng = dot(wi, ng)
    if not alive or out_ng <= f32(0):
        return False, wo, flux
    k = adjoint_factor(dot(wo, n), dot(wo, ng), dot(wi, n), out_ng)
    scattered = (k * weight[0] * flux[0], k * weight[1] * flux[1], k * weight[2] * flux[2])
    return _sum(scattered) > f32(0), wi, scattered


@jit
def _store(stored, row, position, ng, flux, d, instance, scatters):
    """Write a PHOTON record; its kernel's size comes later."""
    photon = stored[row]
    for k in literal_unroll((0, 1, 2)):
        photon.position[k] = position[k]
        photon.normal[k] = ng[k]
        photon.flux[k] = flux[k]
        photon.wi[k] = -d[k]
    photon.radius = f32(0)
    photon.height = f32(0)
    photon.bounce = u32(scatters)
    photon.instance = instance


@jit
def _sum(flux):
    return flux[0] + flux[1] + flux[2]


@jit
def _add(sums, chunk, kind, flux):
    sums[chunk, kind, 0] += flux[0]
    sums[chunk, kind, 1] += flux[1]
    sums[chunk, kind, 2] += flux[2]


@jit
def _add_difference(sums, chunk, kind, before, after):
    sums[chunk, kind, 0] += np.float64(before[0]) - np.float64(after[0])
    sums[chunk, kind, 1] += np.float64(before[1]) - np.float64(after[1])
    sums[chunk, kind, 2] += np.float64(before[2]) - np.float64(after[2])
