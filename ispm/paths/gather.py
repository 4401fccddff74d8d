"""Gather rays: from each receiver a few rays that find the light around it.

Light that comes to a receiver x from where it last scattered, y, reaches the picture in one of two ways, and
each path from a light to x counts in one of them alone:

- By a ray from x that ends at y, in two parts: what a light sends straight to y, which a shadow ray finds,
  and what the photons stored at y bring that have scattered before.
- By the photon itself, stored at x (`Walk.not_gathered`), where rays would seldom find y or not at all: y
  is a bright first bounce near a light or a highlight (`bright.is_bright`), is lit by a caustic, or lets
  light through (`bsdf.is_gathered`); a mirror or glass lies between y and x; or it is y's coat that
  reflects what a light sends straight there.

Lobes too narrow for photons count as wider at rays' ends: what they bring has one bounce more to go. For
what the photons stored at y bring sheen and rough clear coats count as matte there.
Where a ray ends on a translucent sheet, it brings the light of one side, drawn by what that sends here.
So rays end without light at mirrors and glass, but pass thin clear sheets, as shadow rays do. Emission where
they end is left out, and so is the environment: it is direct light of the receiver.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import literal_unroll

from ispm.accel.intersect import STACK_WORDS
from ispm.accel.layers import (
    drawn_side,
    has_sheen,
    is_translucent,
    sheen_point,
    with_matte_sheen,
    with_rough_coat,
)
from ispm.accel.records import Scratch
from ispm.accel.surface import SurfaceTable, closest_surface, leave_surface, scene_tables, surface
from ispm.accel.world import World
from ispm.kernels.share import run_shared, shared_rows
from ispm.kernels.simd import alloca
from ispm.lights.nee import light_from_one, times
from ispm.lights.openings import NO_OPENINGS, Openings
from ispm.optics.bsdf import NARROW_ALPHA, gloss_terms, is_gathered, is_smooth, smooth_split, transmits
from ispm.optics.jit import jit
from ispm.optics.records import MATERIAL_UNLIT, RECEIVER
from ispm.optics.rng import random4
from ispm.optics.sampling import cosine_hemisphere, to_world
from ispm.optics.vector import Vector, add, dot, scale, sub, vec3
from ispm.paths.ends import reflect_incident
from ispm.paths.facet import as_wide
from ispm.paths.guide import guided
from ispm.paths.vertices import PATH_END, store_end, store_point
from ispm.scene.packed import Packed

f32, i64, u32 = np.float32, np.int64, np.uint32

_DIMENSION = 1 << 22  # of the first random numbers; photons and maps take those below
_SHEETS_MAX = 8  # of glass that a gather ray passes
_CHUNK = 64  # receivers a thread takes at a time; results do not depend on it or on the threads


class Gathered(NamedTuple):
    """What rays found, receiver by receiver.

    radiance  (m, 3) float32, of direct light where each ray ends, times its share and what sheets let pass
    lobes     (m, 3) float32, D V (1 - Fc), D V Fc and Fc of the ray's direction at a glossy receiver, else 0;
              the first two are 0 for lobes narrower than NARROW_ALPHA
    nearness  (m,) float32 1/m, the ray's share over its length, 0 where it met nothing
    covered   (m,) float32, the ray's share, likewise
    ends      (m,) PATH_END; slot: the ray's row
    points    (m,) RECEIVER; invalid where the ray met nothing that photons light
    """

    radiance: np.ndarray
    lobes: np.ndarray
    nearness: np.ndarray
    covered: np.ndarray
    ends: np.ndarray
    points: np.ndarray


class Gather(NamedTuple):
    """What the gather rays from n receivers find.

    irradiance, fresnel, gloss, grazing  (n, 3) float32, as in INCIDENT
    nearness             (n,) float32 1/m, mean inverse length of the rays
    covered              (n,) float32, share of the hemisphere, by cosine, in which they met something
    """

    irradiance: np.ndarray
    fresnel: np.ndarray
    gloss: np.ndarray
    grazing: np.ndarray
    nearness: np.ndarray
    covered: np.ndarray


class RayPlan(NamedTuple):
    """Which rays are traced from n receivers, side^2 from each.

    densities   (m, rings, sectors + 1) float32, of rays over the square, see `Guide.densities`
    guide_rows  (n,) int32, the row of these that each receiver takes
    lifts       (n,) float32 m, by which rays start above the surface
    keys        (n,) uint32, of the random numbers
    shifts      (n, 2) float32 in [0, 1), positions of a receiver's rays in their parts of the hemisphere
    side        of the side x side equal parts of the hemisphere by cosine that have a ray each
    """

    densities: np.ndarray
    guide_rows: np.ndarray
    lifts: np.ndarray
    keys: np.ndarray
    shifts: np.ndarray
    side: int

    def of(self, rows: slice) -> RayPlan:
        """Return the plan for some of the (n,) receivers."""
        guide_rows, lifts, keys, shifts = (
            each[rows] for each in (self.guide_rows, self.lifts, self.keys, self.shifts)
        )
        return RayPlan(self.densities, guide_rows, lifts, keys, shifts, self.side)


def gather_rays(
    packed: Packed,
    world: World,
    surfaces: SurfaceTable,
    receivers: np.ndarray,
    plan: RayPlan,
    limit: float,
    seed: int,
    pass_index: int,
    openings: Openings = NO_OPENINGS,
) -> Gathered:
    """Trace rays from receivers; the same bytes for any number of threads.

    receivers  (n,) RECEIVER
    plan       of m = n side^2 rays
    limit      of bright first bounces, see `bright.is_bright`
    """
    count = len(receivers) * plan.side**2
    radiance, lobes = np.zeros((2, count, 3), np.float32)
    nearness, covered = np.zeros((2, count), np.float32)
    out = Gathered(radiance, lobes, nearness, covered, np.zeros(count, PATH_END), np.zeros(count, RECEIVER))
    tables = scene_tables(packed, world, surfaces)
    course = _Course(f32(limit), u32(pass_index), u32(seed), openings)
    run_shared(lambda counter: _gather_chunks(tables, receivers, plan, course, counter, out), world.threads)
    return out


def average_rays(met: Gathered, light: np.ndarray, shortest: np.ndarray, threads: int, out: Gather) -> None:
    """Write what n receivers get by their rays.

    light     (m, 16) of photons at the rays' ends
    shortest  (n,) m, that the length of each one's rays counts as at least
    """
    nearest = np.asarray(1.0 / np.maximum(shortest, 1e-30), np.float32)
    run_shared(lambda counter: _average(met, light, nearest, counter, out), threads)


@jit
def _average(met, light, nearest, counter, out):
    """Write the Gather of as many receivers as a thread gets; nearest: (n,) 1/m, over `shortest`."""
    rays = len(met.covered) // max(len(out.covered), 1)
    for receiver in shared_rows(counter, _CHUNK, len(out.covered)):
        near, covered = f32(0), f32(0)
        for row in range(receiver * rays, (receiver + 1) * rays):
            near += min(met.nearness[row], nearest[receiver])
            covered += met.covered[row]
            for c in literal_unroll((0, 1, 2)):
                reflected = met.ends[row].weight[c] * reflect_incident(met.ends[row], light, row, c)
                radiance = met.radiance[row, c] + reflected
                out.irradiance[receiver, c] += radiance
                out.gloss[receiver, c] += met.lobes[row, 0] * radiance
                out.grazing[receiver, c] += met.lobes[row, 1] * radiance
                out.fresnel[receiver, c] += met.lobes[row, 2] * radiance
        out.nearness[receiver], out.covered[receiver] = near / f32(rays), covered / f32(rays)
        for found in (out.irradiance, out.fresnel, out.gloss, out.grazing):
            for c in range(3):
                found[receiver, c] *= f32(math.pi) / f32(rays)


@jit
def join_light(light, others, found, rows):
    """Let (n,) INCIDENT `light` be that of (n,) INCIDENT `others`, and with it what rays found, a Gather, at
    (m,) int64 rows; in place."""
    for i in range(len(light)):
        for c in range(3):
            light[i].irradiance[c], light[i].fresnel[c] = others[i].irradiance[c], others[i].fresnel[c]
            light[i].gloss[c], light[i].grazing[c] = others[i].gloss[c], others[i].grazing[c]
    for k in range(len(rows)):
        for c in range(3):
            light[rows[k]].irradiance[c] += found.irradiance[k, c]
            light[rows[k]].fresnel[c] += found.fresnel[k, c]
            light[rows[k]].gloss[c] += found.gloss[k, c]
            light[rows[k]].grazing[c] += found.grazing[k, c]


class _Course(NamedTuple):
    """The limit of bright first bounces, and which random numbers rays take."""

    limit: np.float32
    pass_index: np.uint32
    seed: np.uint32
    openings: Openings


class _GatherRay(NamedTuple):
    """A ray, and the row for what it finds.

    share         its weight: 1 over the density of rays in its direction, whose mean is 1
    u, u_light    random, for holes that it meets, and for the points of lamps that light its end
    key, dimension   of its further random numbers
    """

    row: np.int64
    start: Vector
    d: Vector
    share: np.float32
    u: np.float32
    u_light: np.float32
    key: np.uint32
    dimension: np.uint32


@jit
def _gather_chunks(tables, receivers, plan, course, counter, out):
    """Fill the rows of a Gathered for as many of the (n,) RECEIVER as a thread gets."""
    scratch = Scratch(alloca(STACK_WORDS), alloca(2))
    for r in shared_rows(counter, _CHUNK, len(receivers)):
        if receivers[r].valid != u32(0):
            for k in range(plan.side * plan.side):
                _gather_one(tables, receivers[r], plan, course, r, k, scratch, out)


@jit
def _gather_one(tables, receiver, plan, course, r, k, scratch, out):
    """Trace ray `k` of the RECEIVER of row `r`."""
    side, shifts = plan.side, plan.shifts
    row, key, dimension = r * side * side + k, plan.keys[r], u32(_DIMENSION + 16 * k)
    u3, u4, _, _ = random4(key, dimension, course.pass_index, course.seed)
    step = f32(1) / f32(side)
    u1, u2 = (f32(k // side) + shifts[r, 0]) * step, (f32(k % side) + shifts[r, 1]) * step
    u1, u2, density = guided(plan.densities, plan.guide_rows[r], u1, u2)
    n, ng = vec3(receiver.n), vec3(receiver.ng)
    d = to_world(cosine_hemisphere(u1, u2), n)
    if dot(d, ng) <= f32(0):
        return
    if receiver.alpha > f32(0):
        first, second, fresnel = gloss_terms(receiver.alpha, n, vec3(receiver.wo), d)
        if receiver.alpha >= NARROW_ALPHA:
            out.lobes[row, 0], out.lobes[row, 1] = first, second
        out.lobes[row, 2] = fresnel
    start = add(vec3(receiver.position), scale(plan.lifts[r], ng))
    ray = _GatherRay(row, start, d, f32(1) / density, u3, u4, key, dimension)
    _look(tables, ray, course, scratch, out)


@jit
def _look(tables, ray, course, scratch, out):
    """Trace a _GatherRay to its end, a PATH_END and RECEIVER, and write its row of a Gathered."""
    start, d, share, u, u_light = ray.start, ray.d, ray.share, ray.u, ray.u_light
    weight, wo, row = (share, share, share), scale(f32(-1), d), ray.row
    for sheet in range(_SHEETS_MAX):
        found, hit = closest_surface(tables, start, d, u, scratch)
        if not found:
            return
        x = surface(tables, hit, d)
        matte = with_matte_sheen(x)
        b = matte.bsdf
        out.covered[row] = share
        out.nearness[row] = share / max(dot(sub(x.position, ray.start), d), f32(1e-30))
        if is_gathered(b) or is_translucent(x):
            break
        if b.thin == f32(0) or not is_smooth(b) or not transmits(b):
            return
        _, transmittance, _, _, _ = smooth_split(b, x.n, x.ng, wo)
        weight = times(weight, transmittance)
        start = leave_surface(tables, hit, scale(f32(-1), x.ng))
        u, u_light, _, _ = random4(ray.key, ray.dimension + u32(1 + sheet), course.pass_index, course.seed)
    if x.flags & u32(MATERIAL_UNLIT) != u32(0) or not (is_gathered(b) or is_translucent(x)):
        return
    pick, u, _, _ = random4(ray.key, ray.dimension + u32(_SHEETS_MAX + 1), course.pass_index, course.seed)
    if is_translucent(x):
        matte, wo, u, chance = drawn_side(matte, wo, u)
        weight = scale(f32(1) / chance, weight)
    lit, chance = _lit_layer(x, matte, u)
    light = light_from_one(tables, lit, wo, u_light, pick, scratch, course.limit, course.openings)
    for c in range(3):
        out.radiance[row, c] = weight[c] / chance * light[c]
    b = as_wide(with_rough_coat(matte).bsdf, dot(matte.n, wo), NARROW_ALPHA)
    store_end(out.ends[row], u32(row), u32(0), weight, b, hit.instance)
    store_point(out.points[row], matte, wo, b, f32(0), NARROW_ALPHA)


@jit
def _lit_layer(x, matte, u):
    """Draw what lamps light straight of a SurfacePoint, its sheen or what is under it, by u of [0, 1), and
    return the chance, float32; matte: its side that is seen, whose sheen counts as matte."""
    if not has_sheen(matte):
        return matte, f32(1)
    hidden = f32(1) - x.sheen.shown
    return (sheen_point(x), hidden) if u < hidden else (x, x.sheen.shown)
