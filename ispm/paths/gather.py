"""Gather rays: from each receiver a few rays that look for the light around it.

Light that comes to a receiver x from where it last scattered, y, reaches the picture in one of two ways, and
each path from a light to x goes one of them alone:

- By a ray from x that ends at y, in two parts: what a light sends straight to y, which a shadow ray finds,
  and what the photons stored at y bring that have scattered before.
- By the photon itself, stored at x (`Walk.straight`), where rays would seldom find y or not at all: y is a
  bright spot near a light or a highlight (`lit.is_bright`), is lit by a caustic, or lets light through
  (`lit.is_gathered`); or a mirror or glass lies between y and x.

So rays stop without light at mirrors and glass; only thin clear sheets they pass, as shadows do. What glows
is left out: photons do not carry it either.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ispm.accel.intersect import STACK_WORDS
from ispm.accel.surface import SurfaceTable, closest_surface, leave_surface, surface
from ispm.accel.world import World
from ispm.kernels.simd import address, alloca, atomic_add
from ispm.kernels.threads import run_threads
from ispm.lights.nee import is_gathered, light_from_one, times
from ispm.optics.bsdf import gloss_terms, is_smooth, smooth_split, transmits
from ispm.optics.jit import jit
from ispm.optics.records import MATERIAL_BLEND, MATERIAL_MASK, MATERIAL_THIN, MATERIAL_UNLIT, RECEIVER
from ispm.optics.rng import random4
from ispm.optics.sampling import cosine_hemisphere, to_world
from ispm.optics.vector import add, dot, scale, sub
from ispm.paths.guide import guided
from ispm.paths.vertices import END, store_end, store_point
from ispm.scene.packed import Packed

f32, i64, u32 = np.float32, np.int64, np.uint32

_DIMENSION = 1 << 22  # of the first random numbers; photons and maps take those below
_SHEETS_MAX = 8  # that a ray passes
_CHUNK = 64  # receivers a thread takes at a time; results do not depend on it or on the threads


@dataclass(frozen=True)
class Gathered:
    """What rays found, receiver by receiver.

    radiance  (m, 3) float32, made along each ray by light straight from the lights
    fresnel   (m,) float32, Fc of the ray's direction at a glossy receiver, else 0
    nearness  (m,) float32 1/m, 1 over the ray's length, 0 where it met nothing
    ends      (m,) END; slot: the ray's row
    points    (m,) RECEIVER; invalid where the ray met nothing that photons light
    """

    radiance: np.ndarray
    fresnel: np.ndarray
    nearness: np.ndarray
    ends: np.ndarray
    points: np.ndarray


def gather_rays(
    packed: Packed,
    world: World,
    surfaces: SurfaceTable,
    receivers: np.ndarray,
    guide: tuple[np.ndarray, np.ndarray],
    numbers: tuple[np.ndarray, ...],
    side: int,
    limit: float,
    seed: int,
    pass_index: int,
    threads: int,
) -> Gathered:
    """Trace rays from receivers; the same bytes for any number of threads.

    receivers  (n,) RECEIVER
    guide      (m, ...) densities of rays, and (n,) int32, the row of each receiver: as `Guide.densities`
    numbers    (n,) float32 m, by which rays start above the surface; (n,) uint32, keys of the random numbers;
               (n, 2) float32 in [0, 1), places of a receiver's rays in their parts of the hemisphere
    side       m = n side^2 rays: one through each of side x side equal parts of the hemisphere by cosine
    limit      of bright spots, see `lit.is_bright`
    """
    count = len(receivers) * side * side
    fresnel, nearness = np.zeros((2, count), np.float32)
    found = Gathered(
        np.zeros((count, 3), np.float32), fresnel, nearness, np.zeros(count, END), np.zeros(count, RECEIVER)
    )
    porous = bool((packed.materials["flags"] & (MATERIAL_MASK | MATERIAL_BLEND | MATERIAL_THIN)).any())
    place = address(world.table), surfaces.addresses, surfaces.texels, surfaces.rows
    scene = packed.lights, porous, f32(limit), u32(pass_index), u32(seed)
    out = found.radiance, found.fresnel, found.nearness, found.ends, found.points
    counter = np.zeros(8, np.int64)
    run_threads(
        lambda _: _gather_chunks(place, scene, receivers, guide, numbers, i64(side), address(counter), out),
        threads,
    )
    return found


@jit
def _gather_chunks(place, scene, receivers, guide, numbers, side, counter, out):
    scratch = alloca(STACK_WORDS), alloca(2)
    while True:
        first = atomic_add(counter, i64(_CHUNK))
        if first >= len(receivers):
            return
        for r in range(first, min(first + i64(_CHUNK), len(receivers))):
            if receivers[r].valid != u32(0):
                for k in range(side * side):
                    _gather_one(place, scene, receivers[r], guide, numbers, r, k, side, scratch, out)


@jit
def _gather_one(place, scene, receiver, guide, numbers, r, k, side, scratch, out):
    """Trace ray `k` of receiver `r`."""
    row, key, dimension = r * side * side + k, numbers[1][r], u32(_DIMENSION + 16 * k)
    u3, u4, _, _ = random4(key, dimension, scene[3], scene[4])
    share = f32(1) / f32(side)
    u1, u2 = (f32(k // side) + numbers[2][r, 0]) * share, (f32(k % side) + numbers[2][r, 1]) * share
    u1, u2, density = guided(guide[0], guide[1][r], u1, u2)
    n = (receiver.n[0], receiver.n[1], receiver.n[2])
    ng = (receiver.ng[0], receiver.ng[1], receiver.ng[2])
    d = to_world(cosine_hemisphere(u1, u2), n)
    if dot(d, ng) <= f32(0):
        return
    if receiver.alpha > f32(0):
        wo = (receiver.wo[0], receiver.wo[1], receiver.wo[2])
        out[1][row] = gloss_terms(receiver.alpha, n, wo, d)[2]
    start = add((receiver.position[0], receiver.position[1], receiver.position[2]), scale(numbers[0][r], ng))
    _look(place, scene, start, d, f32(1) / density, u3, u4, (key, dimension), scratch, row, out)


@jit
def _look(place, scene, start, d, share, u, u_shadow, numbers, scratch, row, out):
    """Write what a ray finds; u: random, for holes that it meets; u_shadow: for those that light meets."""
    world, table, texels, rows = place
    lights, porous, limit, pass_index, seed = scene
    weight, wo, origin = (share, share, share), scale(f32(-1), d), start
    for sheet in range(_SHEETS_MAX):
        found, hit = closest_surface(world, table, texels, rows, start, d, u, scratch[0], scratch[1])
        if not found:
            return
        position, ng, n, b, flags, _ = surface(table, texels, rows, hit, d)
        out[2][row] = share / max(dot(sub(position, origin), d), f32(1e-30))
        if is_gathered(b):
            break
        if b.thin == f32(0) or not is_smooth(b) or not transmits(b):
            return
        weight = times(weight, smooth_split(b, n, ng, wo)[1])
        start = leave_surface(world, table, hit, scale(f32(-1), ng))
        u, u_shadow, _, _ = random4(numbers[0], numbers[1] + u32(1 + sheet), pass_index, seed)
    if flags & u32(MATERIAL_UNLIT) != u32(0) or not is_gathered(b):
        return
    pick, _, _, _ = random4(numbers[0], numbers[1] + u32(_SHEETS_MAX + 1), pass_index, seed)
    light = light_from_one(
        place, lights, porous, hit, position, ng, n, b, wo, u_shadow, pick, scratch, limit
    )  # fmt: skip
    light = times(weight, light)
    for c in range(3):
        out[0][row, c] = light[c]
    store_end(out[3][row], u32(row), u32(0), weight, b, hit[0])
    store_point(out[4][row], position, ng, n, wo, b, f32(0))
