"""Photons as they come from the environment: rays into the scene.

They are drawn evenly in five dimensions: a direction by the environment's image, and where the ray crosses a
plane across it: within the shadow that the box about the scene casts there, or, a share of them, that of a
smaller box about what the eye sees, of a sphere about a mirror or glass that casts caustics, or of a box
about an opening through which light comes in to what the eye sees. Others pass an opening in a direction
about a line of light that comes in, or in one to such a sphere. The densities of all are added (the balance
heuristic of Veach 1997, section 9.2.2).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ispm.accel.intersect import STACK_WORDS
from ispm.accel.records import Scratch
from ispm.accel.surface import SurfaceTable, closest_surface, scene_tables
from ispm.accel.world import World
from ispm.kernels.share import run_shared, shared_rows
from ispm.kernels.simd import alloca
from ispm.lights.aim import SEEN, seen_boxes
from ispm.lights.boxes import (
    Boxes,
    box_shadow,
    draw_in_box,
    draw_on_box,
    joined_boxes,
    meets_box,
    meets_middle,
    upright_boxes,
)
from ispm.lights.openings import NO_WAYS, WAY, Ways
from ispm.lights.surface_emission import caustic_spheres, drawn_row, lattice5, lattice_shifts, sphere_cone
from ispm.optics.environment import environment_light, environment_radiance, sample_environment
from ispm.optics.environment_table import environment_power
from ispm.optics.jit import jit
from ispm.optics.records import EMITTED, EMITTED_BY_ENVIRONMENT, NO_HIT
from ispm.optics.rng import random4
from ispm.optics.sampling import cosine_hemisphere, in_cone, orthonormal_basis, to_world
from ispm.optics.vector import add, dot, scale, sub, vec3
from ispm.scene.packed import Packed

f32, i64, u32 = np.float32, np.int64, np.uint32

_DIMENSION = (1 << 20) - 3  # of the random numbers of a ray, and of those that shift all of them
_THROUGH = 0.8  # of the photons, that are sent through openings, if all that is seen is lit through these
_FREE = 0.2  # of those, which come from anywhere: where no way leads few carry much
# Of the others, those from any side of an opening, not along lines; and those onto what lines it, too
_COSINE, _LINED = f32(0.5), f32(0.5)
_LARGEST = f32(1 - 2.0**-24)  # below 1
_CHUNK = 1024  # rays a thread takes at a time


class _Targets(NamedTuple):
    """Where rays are sent.

    spheres    (n, 4) float32, middle and radius, m, of what casts caustics
    boxes      m of them, about the scene, about what is seen and about openings
    aimed      (n + m + 1,) float64, of the photons, those aimed at the spheres and boxes before each, and at
               all
    ways       in;  along: of the photons, those sent along their lines
    into       of the photons, those sent through ways to spheres
    each_way   (k + 1,) float64, of photons through ways those through the ones before each, and through all
    away       m, from a place within the scene to one outside
    shifts     (5,) float64, of the lattice
    """

    spheres: np.ndarray
    boxes: Boxes
    aimed: np.ndarray
    ways: Ways
    along: np.float32
    into: np.float32
    each_way: np.ndarray
    away: np.float32
    shifts: np.ndarray


def environment_flux(packed: Packed) -> float:
    """Return the luminous flux of an environment through the box about a scene, lm: as if the box showed all
    directions the same area, a quarter of its surface (Cauchy)."""
    x, y, z = packed.bounds[1] - packed.bounds[0]
    return environment_power(packed.environment) * float(x * y + y * z + z * x) / 2.0


def emit_from_environment(
    packed: Packed,
    world: World,
    surfaces: SurfaceTable,
    count: int,
    caustic_share: float,
    seed: int,
    pass_index: int,
    first_key: int,
    seen: np.ndarray | None = None,
    ways: Ways = NO_WAYS,
) -> np.ndarray:
    """Return the photons that come from the environment, at their first hits, (n,) EMITTED, but for
    those that bring nothing. Arguments as of `emit_from_surfaces`.

    seen  (n, 3) m, points in the picture: half of the photons that are not aimed at caustics are aimed at
          them, if the scene is much larger; None: unknown
    ways  in, which most of those take, where there are any
    """
    if count == 0 or environment_flux(packed) == 0.0:
        return np.zeros(0, EMITTED)
    tables = scene_tables(packed, world, surfaces)
    spheres = caustic_spheres(packed)
    to_caustics = caustic_share if len(spheres) else 0.0
    kinds = ways.to_sky.any(), ways.to_sun.any()
    dark, to_sun = (_THROUGH * ways.share / max(sum(kinds), 1) * some for some in kinds)
    into = dark * to_caustics
    dark, to_sun = dark * (1.0 - to_caustics), to_sun * (1.0 - to_caustics)
    each_way = np.cumsum([0.0, *ways.to_sky], dtype=np.float64)
    near = [] if seen is None else seen_boxes(packed.bounds, seen)
    chances = np.array([1.0 - SEEN, *[SEEN / len(near)] * len(near)] if near else [1.0])
    each_sphere = np.full(len(spheres), (to_caustics - into) / max(len(spheres), 1))
    each_box = _FREE * dark * ways.to_sky + to_sun * ways.to_sun
    aimed = 0.0, *each_sphere, *((1.0 - to_caustics - dark - to_sun) * chances), *each_box
    targets = _Targets(
        spheres,
        joined_boxes([upright_boxes(np.stack([packed.bounds, *near])), ways.lined]),
        np.cumsum(aimed, dtype=np.float64),
        ways,
        f32((1.0 - _FREE) * dark),
        f32(into),
        each_way / max(each_way[-1], 1e-30),
        f32(2.0 * packed.diagonal),
        lattice_shifts(_DIMENSION, seed, pass_index),
    )
    rows = np.zeros(count, EMITTED)
    rows["light"] = EMITTED_BY_ENVIRONMENT
    rows["key"] = np.arange(first_key, first_key + count, dtype=np.uint32)
    numbers = np.uint32(pass_index), np.uint32(seed)
    run_shared(lambda counter: _emit(tables, targets, *numbers, counter, rows), world.threads)
    return rows[rows["flux"].any(axis=1)]


@jit
def _emit(tables, targets, pass_index, seed, counter, rows):
    """Trace a ray for as many of the (n,) EMITTED rows as a thread gets."""
    scratch = Scratch(alloca(STACK_WORDS), alloca(2))
    count = f32(len(rows))
    quarter = f32(math.sqrt(f32(math.sqrt(f32(1) / count))))
    for i in shared_rows(counter, _CHUNK, len(rows)):
        wi, point, pdf, density = _drawn(tables, targets, lattice5(targets.shifts, i))
        if density <= f32(0):
            continue
        radiance, start = environment_radiance(tables.environment, wi), add(point, scale(targets.away, wi))
        row = rows[i]
        d = scale(f32(-1), wi)
        # m2 sr of the light that are the photon's own
        extent = f32(1) / (count * pdf * density)
        row.spread, row.turn = quarter / f32(math.sqrt(density)), quarter / f32(math.sqrt(pdf))
        for c in range(3):
            row.flux[c] = extent * radiance[c]
            row.origin[c] = d[c]
        holes, _, _, _ = random4(row.key, u32(_DIMENSION), pass_index, seed)
        found, met = closest_surface(tables, start, d, holes, scratch)
        row.instance = met.instance if found else u32(NO_HIT)
        row.primitive = met.primitive
        row.u = met.u
        row.v = met.v


@jit
def _drawn(tables, targets, numbers):
    """Return a direction, a point, m, that a ray from there passes, and densities, 1/sr and 1/m2 across the
    ray, whose product is that of all draws together."""
    u0, u1, u2, u3, u4 = numbers
    along, into = targets.along, targets.into
    if u4 < along:
        wi, point = _on_way(targets, u0, u1, u2, u3, min(u4 / along, _LARGEST))
        _, pdf = environment_light(tables.environment, wi)
    elif u4 < along + into:
        wi, point = _to_sphere(targets, u0, u1, u2, u3, min((u4 - along) / into, _LARGEST))
        _, pdf = environment_light(tables.environment, wi)
    else:
        wi, _, pdf = sample_environment(tables.environment, u0, u1)
        point = _point(targets, wi, u2, u3, u4 - along - into)
    if pdf <= f32(0):  # it is dark there
        return wi, point, pdf, f32(0)
    guided = along * _density_of_ways(targets.ways, wi, point)
    if into > f32(0):
        guided += into * _density_to_spheres(targets, wi, point)
    return wi, point, pdf, _density(targets, wi, point) + guided / pdf


@jit
def _on_way(targets, u0, u1, u2, u3, u4):
    """A direction of light that comes in by a way, and a point that it passes there, m, by numbers of
    [0, 1)."""
    ways = targets.ways
    k, _, u4 = drawn_row(targets.each_way, u4)
    if u4 < _COSINE:
        u4 *= f32(1) / _COSINE
        wi = to_world(cosine_hemisphere(u0, u1), vec3(ways.boxes.axes[k, 0]))
    else:
        first, count = ways.firsts[k], ways.firsts[k + 1] - ways.firsts[k]
        u4 = (u4 - _COSINE) / (f32(1) - _COSINE) * f32(count)
        line = min(i64(u4), count - 1)
        u4 = u4 - f32(line)
        wi = in_cone(vec3(ways.directions[first + line]), f32(WAY), u0, u1)
    if u4 < _LINED:
        return wi, draw_on_box(ways.lined, k, wi, u2, u3, u4 / _LINED)
    return wi, draw_in_box(ways.boxes, k, f32(0.5), u2, u3)


@jit
def _density_of_ways(ways, wi, point):
    """The density, 1/(sr m2), with which `_on_way` draws a direction and a point across it."""
    density = f32(0)
    for k in range(len(ways.to_sky)):
        if ways.to_sky[k] <= f32(0):
            continue
        passes, _, area = meets_middle(ways.boxes, k, point, wi)
        across = (f32(1) - _LINED) / area if passes else f32(0)
        if meets_box(ways.lined, k, point, wi):
            across += _LINED / max(box_shadow(ways.lined, k, wi), f32(1e-30))
        if across > f32(0):
            near, first, end = 0, ways.firsts[k], ways.firsts[k + 1]
            for line in range(first, end):
                near += dot(vec3(ways.directions[line]), wi) >= f32(WAY)
            by_lines = f32(near) / f32(end - first) * f32(1 / (2 * math.pi * (1 - WAY)))
            by_cosine = max(dot(vec3(ways.boxes.axes[k, 0]), wi), f32(0)) * f32(1 / math.pi)
            density += ways.to_sky[k] * (by_lines + _COSINE * (by_cosine - by_lines)) * across
    return density


@jit
def _to_sphere(targets, u0, u1, u2, u3, u4):
    """A direction from a sphere to the middle of a way's box, and where it passes that, m, by numbers of
    [0, 1)."""
    k, _, u4 = drawn_row(targets.each_way, u4)
    sphere = targets.spheres[i64(u4 * f32(len(targets.spheres)))]
    point = draw_in_box(targets.ways.boxes, k, f32(0.5), u2, u3)
    toward, cosine = sphere_cone(sphere, point)
    return scale(f32(-1), in_cone(toward, cosine, u0, u1)), point


@jit
def _density_to_spheres(targets, wi, point):
    """The density, 1/(sr m2), with which `_to_sphere` draws a direction and a point across it."""
    boxes, spheres, density = targets.ways.boxes, targets.spheres, f32(0)
    for k in range(len(boxes.middles)):
        passes, at, area = meets_middle(boxes, k, point, wi)
        if not passes:
            continue
        chance = f32(targets.each_way[k + 1] - targets.each_way[k]) / area
        for j in range(len(spheres)):
            toward, cosine = sphere_cone(spheres[j], at)
            if -dot(wi, toward) >= cosine:
                density += chance / (f32(1) - cosine)
    return density * f32(1 / (2 * math.pi)) / f32(len(spheres))


@jit
def _point(targets, wi, u, v, w):
    """A point, m, that a ray from wi passes, drawn by u, v of [0, 1) and w below what all `aimed` are."""
    row, _, w = drawn_row(targets.aimed, w)
    if row < len(targets.spheres):
        return _in_disc(targets.spheres[row], wi, u, v)
    return draw_on_box(targets.boxes, row - len(targets.spheres), wi, u, v, w)


@jit
def _density(targets, wi, point):
    """The density, 1/m2 across the ray, of a point among those that rays from wi pass which are drawn by the
    environment."""
    boxes, aimed, spheres = targets.boxes, targets.aimed, targets.spheres
    density = f32(0)
    for k in range(len(spheres)):
        if _meets_sphere(spheres[k], point, wi):
            square = spheres[k, 3] * spheres[k, 3]
            density += f32(aimed[k + 1] - aimed[k]) * f32(1 / math.pi) / square
    for k in range(len(boxes.middles)):
        if meets_box(boxes, k, point, wi):
            share = f32(aimed[len(spheres) + k + 1] - aimed[len(spheres) + k])
            density += share / max(box_shadow(boxes, k, wi), f32(1e-30))
    return density


@jit
def _in_disc(sphere, wi, u, v):
    """A point, m, of the disc that a sphere shows to wi, drawn evenly by u, v of [0, 1)."""
    radius, phi = sphere[3] * f32(math.sqrt(u)), f32(2 * math.pi) * v
    s, t = orthonormal_basis(wi)
    across = add(scale(radius * f32(math.cos(phi)), s), scale(radius * f32(math.sin(phi)), t))
    return add(vec3(sphere), across)


@jit
def _meets_sphere(sphere, point, wi):
    """Whether the line through a point along wi meets a sphere."""
    off = sub(point, vec3(sphere))
    along = dot(off, wi)
    return dot(off, off) - along * along <= sphere[3] * sphere[3]
