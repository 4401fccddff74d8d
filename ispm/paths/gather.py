"""Gather rays: from each receiver a few rays that look for the light around it.

Light that comes to a receiver x from where it last scattered, y, reaches the picture in one of two ways, and
each path from a light to x goes one of them alone:

- By a ray from x that ends at y, in two parts: what a light sends straight to y, which a shadow ray finds,
  and what the photons stored at y bring that have scattered before.
- By the photon itself, stored at x (`Walk.not_gathered`), where rays would seldom find y or not at all: y
  is a bright first bounce near a light or a highlight (`nee.is_bright`), is lit by a caustic, or lets
  light through (`nee.is_gathered`); or a mirror or glass lies between y and x.

So rays stop without light at mirrors and glass; only thin clear sheets they pass, as shadows do. What glows
is left out: photons do not carry it either.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ispm.accel.intersect import STACK_WORDS
from ispm.accel.records import Scratch
from ispm.accel.surface import SurfaceTable, closest_surface, leave_surface, scene_tables, surface
from ispm.accel.world import World
from ispm.kernels.simd import address, alloca, atomic_add
from ispm.kernels.threads import run_threads
from ispm.lights.nee import is_gathered, light_from_one, times
from ispm.optics.bsdf import gloss_terms, is_smooth, smooth_split, transmits
from ispm.optics.jit import jit
from ispm.optics.records import MATERIAL_UNLIT, RECEIVER
from ispm.optics.rng import random4
from ispm.optics.sampling import cosine_hemisphere, to_world
from ispm.optics.vector import Vector, add, dot, scale, sub
from ispm.paths.guide import guided
from ispm.paths.vertices import PATH_END, store_end, store_point
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
    ends      (m,) PATH_END; slot: the ray's row
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
    limit      of bright first bounces, see `nee.is_bright`
    """
    count = len(receivers) * side * side
    fresnel, nearness = np.zeros((2, count), np.float32)
    found = Gathered(
        np.zeros((count, 3), np.float32),
        fresnel,
        nearness,
        np.zeros(count, PATH_END),
        np.zeros(count, RECEIVER),
    )
    tables = scene_tables(packed, world, surfaces)
    (densities, guide_rows), (lifts, keys, shifts) = guide, numbers
    plan = _Plan(
        densities, guide_rows, lifts, keys, shifts, i64(side), f32(limit), u32(pass_index), u32(seed)
    )  # fmt: skip
    out = _Out(found.radiance, found.fresnel, found.nearness, found.ends, found.points)
    counter = np.zeros(8, np.int64)
    run_threads(
        lambda _: _gather_chunks(tables, receivers, plan, address(counter), out),
        threads,
    )
    return found


class _Plan(NamedTuple):
    """Which rays are traced, see `gather_rays`.

    densities, guide_rows   the guide
    lifts, keys, shifts     the numbers: of each receiver
    """

    densities: np.ndarray
    guide_rows: np.ndarray
    lifts: np.ndarray
    keys: np.ndarray
    shifts: np.ndarray
    side: np.int64
    limit: np.float32
    pass_index: np.uint32
    seed: np.uint32


class _Out(NamedTuple):
    """Arrays of a Gathered, a row for each ray."""

    radiance: np.ndarray
    fresnel: np.ndarray
    nearness: np.ndarray
    ends: np.ndarray
    points: np.ndarray


class _GatherRay(NamedTuple):
    """A ray, and the row for what it finds.

    share         of its receiver's light, per density
    u, u_shadow   random, for holes that it meets, and for those that light meets
    key, dimension   of its further random numbers
    """

    row: np.int64
    start: Vector
    d: Vector
    share: np.float32
    u: np.float32
    u_shadow: np.float32
    key: np.uint32
    dimension: np.uint32


@jit
def _gather_chunks(tables, receivers, plan, counter, out):
    scratch = Scratch(alloca(STACK_WORDS), alloca(2))
    while True:
        first = atomic_add(counter, i64(_CHUNK))
        if first >= len(receivers):
            return
        for r in range(first, min(first + i64(_CHUNK), len(receivers))):
            if receivers[r].valid != u32(0):
                for k in range(plan.side * plan.side):
                    _gather_one(tables, receivers[r], plan, r, k, scratch, out)


@jit
def _gather_one(tables, receiver, plan, r, k, scratch, out):
    """Trace ray `k` of receiver `r`."""
    side, shifts = plan.side, plan.shifts
    row, key, dimension = r * side * side + k, plan.keys[r], u32(_DIMENSION + 16 * k)
    u3, u4, _, _ = random4(key, dimension, plan.pass_index, plan.seed)
    share = f32(1) / f32(side)
    u1, u2 = (f32(k // side) + shifts[r, 0]) * share, (f32(k % side) + shifts[r, 1]) * share
    u1, u2, density = guided(plan.densities, plan.guide_rows[r], u1, u2)
    n = (receiver.n[0], receiver.n[1], receiver.n[2])
    ng = (receiver.ng[0], receiver.ng[1], receiver.ng[2])
    d = to_world(cosine_hemisphere(u1, u2), n)
    if dot(d, ng) <= f32(0):
        return
    if receiver.alpha > f32(0):
        wo = (receiver.wo[0], receiver.wo[1], receiver.wo[2])
        _, _, out.fresnel[row] = gloss_terms(receiver.alpha, n, wo, d)
    position = (receiver.position[0], receiver.position[1], receiver.position[2])
    start = add(position, scale(plan.lifts[r], ng))
    ray = _GatherRay(row, start, d, f32(1) / density, u3, u4, key, dimension)
    _look(tables, ray, plan, scratch, out)


@jit
def _look(tables, ray, plan, scratch, out):
    """Write what a ray finds."""
    start, d, share, u, u_shadow = ray.start, ray.d, ray.share, ray.u, ray.u_shadow
    weight, wo, row = (share, share, share), scale(f32(-1), d), ray.row
    for sheet in range(_SHEETS_MAX):
        found, hit = closest_surface(tables, start, d, u, scratch)
        if not found:
            return
        x = surface(tables, hit, d)
        b = x.bsdf
        out.nearness[row] = share / max(dot(sub(x.position, ray.start), d), f32(1e-30))
        if is_gathered(b):
            break
        if b.thin == f32(0) or not is_smooth(b) or not transmits(b):
            return
        _, transmittance, _, _, _ = smooth_split(b, x.n, x.ng, wo)
        weight = times(weight, transmittance)
        start = leave_surface(tables, hit, scale(f32(-1), x.ng))
        u, u_shadow, _, _ = random4(ray.key, ray.dimension + u32(1 + sheet), plan.pass_index, plan.seed)
    if x.flags & u32(MATERIAL_UNLIT) != u32(0) or not is_gathered(b):
        return
    pick, _, _, _ = random4(ray.key, ray.dimension + u32(_SHEETS_MAX + 1), plan.pass_index, plan.seed)
    light = times(weight, light_from_one(tables, x, wo, u_shadow, pick, scratch, plan.limit))
    for c in range(3):
        out.radiance[row, c] = light[c]
    store_end(out.ends[row], u32(row), u32(0), weight, b, hit.instance)
    store_point(out.points[row], x, wo, b, f32(0))
