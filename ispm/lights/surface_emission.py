"""Photons as they leave lamps with a surface: rays from points drawn on them.

A lamp shines from many points, so that its photons' first flights are no picture from one place, but several,
see `lamp_maps`. Rays are drawn evenly in five dimensions: the triangle in proportion to its flux, a point on
it, a direction by the cosine; where the scene has mirrors or glass that cast caustics, a share of them
towards these, with the densities of both added (the balance heuristic of Veach 1997, section 9.2.2).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ispm.accel.emitters import emitter_flux, emitter_hit, emitter_point
from ispm.accel.glow import emitted_radiance
from ispm.accel.intersect import STACK_WORDS
from ispm.accel.records import Hit, Scratch
from ispm.accel.surface import SurfaceTable, closest_surface, leave_surface, scene_tables
from ispm.accel.world import World
from ispm.kernels.share import run_shared, shared_rows
from ispm.kernels.simd import alloca
from ispm.optics.jit import jit
from ispm.optics.records import EMITTED, EMITTED_BY_SURFACE, NO_HIT
from ispm.optics.rng import random4
from ispm.optics.sampling import cosine_hemisphere, in_cone, to_world
from ispm.optics.vector import Vector, dot, scale, sub, vec3
from ispm.scene.packed import Packed

f32, f64, i64, u32 = np.float32, np.float64, np.int64, np.uint32

_DIMENSION = (1 << 20) - 2  # of the random numbers of a ray, and of those that shift all of them
_CHUNK = 1024  # rays a thread takes at a time
_ROOT = 1.1347241384015194  # x^6 = x + 1: for a lattice even in five dimensions (Roberts 2018)
_STEPS = tuple(_ROOT**-k for k in range(1, 6))


class LampPoint(NamedTuple):
    """A point drawn on a lamp with a surface.

    row     of its EMITTER;  hit  there
    point   m, world space;  n  unit, of the side that it shines from
    extent  m2 of the lamps' surface, over the density of the draw
    """

    row: np.int64
    hit: Hit
    point: Vector
    n: Vector
    extent: np.float32


class _Lamps(NamedTuple):
    """What photons leave.

    cumulative  (n + 1,) float64, share of the flux of the emissive triangles before each
    spheres     (k, 4) float32, middle and radius, m, of what casts caustics
    share       of the photons that are aimed at these
    shifts      (5,) float64, of the lattice
    """

    cumulative: np.ndarray
    spheres: np.ndarray
    share: np.float32
    shifts: np.ndarray


def emissive_flux(packed: Packed, surfaces: SurfaceTable) -> float:
    """Return the luminous flux of all emissive surfaces of a scene, lm."""
    return float(emitter_flux(scene_tables(packed, None, surfaces).emitters).sum())


def has_area_light(packed: Packed, surfaces: SurfaceTable) -> bool:
    """Return whether a scene is lit by lamps with a surface or by an environment."""
    return emissive_flux(packed, surfaces) > 0.0 or len(packed.environment.rows) > 0


def emit_from_surfaces(
    packed: Packed,
    world: World,
    surfaces: SurfaceTable,
    count: int,
    caustic_share: float,
    seed: int,
    pass_index: int,
    first_key: int,
) -> np.ndarray:
    """Return the photons that leave lamps with a surface, at their first hits, (count,) EMITTED.

    caustic_share  of them is aimed at mirrors and glass that cast caustics, where there are any
    first_key      of the photons' keys
    """
    tables = scene_tables(packed, world, surfaces)
    flux = emitter_flux(tables.emitters)
    if count == 0 or not flux.any():
        return np.zeros(0, EMITTED)
    spheres = caustic_spheres(packed)
    lamps = _Lamps(
        cumulative_shares(flux),
        spheres,
        f32(caustic_share if len(spheres) else 0.0),
        lattice_shifts(_DIMENSION, seed, pass_index),
    )
    rows = np.zeros(count, EMITTED)
    rows["light"] = EMITTED_BY_SURFACE
    rows["key"] = np.arange(first_key, first_key + count, dtype=np.uint32)
    numbers_of = np.uint32(pass_index), np.uint32(seed)
    run_shared(lambda counter: _emit(tables, lamps, *numbers_of, counter, rows), world.threads)
    return rows[rows["flux"].any(axis=1)]


def cumulative_shares(flux: np.ndarray) -> np.ndarray:
    """Return the share of all flux before each of (n,) emitters, and 1, (n + 1,) float64."""
    return np.append(0.0, np.cumsum(flux) / flux.sum())


def lattice_shifts(dimension: int, seed: int, pass_index: int) -> np.ndarray:
    """Return where a pass's `lattice5` begins, (5,) float64; dimension: of the random numbers."""
    numbers = [
        random4(np.uint32(k), np.uint32(dimension), np.uint32(pass_index), np.uint32(seed)) for k in (0, 1)
    ]
    return np.array([*numbers[0], numbers[1][0]], np.float64)


def caustic_spheres(packed: Packed) -> np.ndarray:
    """Return spheres about the instances that cast caustics, (k, 4) float32: middle and radius, m."""
    hulls = packed.caustic_hulls
    middles = (hulls.min(axis=1) + hulls.max(axis=1)) / 2.0
    radii = np.linalg.norm(hulls - middles[:, None], axis=2).max(axis=1, initial=0.0)
    return np.column_stack([middles, radii]).astype(np.float32)


@jit
def _emit(tables, lamps, pass_index, seed, counter, rows):
    """Trace a ray for as many of the (n,) EMITTED rows as a thread gets; those that leave a dark point or at
    the horizon keep a flux of 0."""
    scratch = Scratch(alloca(STACK_WORDS), alloca(2))
    count = f32(len(rows))
    for i in shared_rows(counter, _CHUNK, len(rows)):
        u0, u1, u2, u3, u4 = lattice5(lamps.shifts, i)
        drawn = draw_lamp_point(tables, lamps.cumulative, u0, u1, u2)
        point, n, emitter = drawn.point, drawn.n, tables.emitters.triangles[drawn.row]
        d, density = _direction(lamps, emitter, point, n, u3, u4)
        cosine = dot(n, d)
        if cosine <= f32(0) or density <= f32(0):
            continue
        # m2 sr of the lamp's light that are the photon's own
        extent = drawn.extent * cosine / (count * density)
        radiance = emitted_radiance(tables, drawn.hit, scale(f32(-1), d))
        row = rows[i]
        row.spread = f32(math.sqrt(emitter.lamp)) * (extent / (f32(math.pi) * emitter.lamp)) ** f32(0.25)
        row.turn = f32(math.sqrt(extent)) / row.spread
        row.emitter = u32(drawn.row)
        for c in range(3):
            row.flux[c] = extent * radiance[c]
            row.origin[c] = point[c]
        holes, _, _, _ = random4(row.key, u32(_DIMENSION), pass_index, seed)
        start = leave_surface(tables, drawn.hit, n)
        found, met = closest_surface(tables, start, d, holes, scratch)
        row.instance = met.instance if found else u32(NO_HIT)
        row.primitive = met.primitive
        row.u = met.u
        row.v = met.v


@jit
def draw_lamp_point(tables, cumulative, u0, u1, u2):
    """Return the LampPoint drawn by u0, u1, u2 of [0, 1), in proportion to flux; cumulative: see
    `cumulative_shares`."""
    k, chance, u0 = drawn_row(cumulative, u0)
    emitter = tables.emitters.triangles[k]
    root = f32(math.sqrt(u1))
    u, v = root * (f32(1) - u2), root * u2
    n, sides = vec3(emitter.normal), f32(1)
    if emitter.two_sided != u32(0):
        sides = f32(2)
        if u0 >= f32(0.5):
            n = scale(f32(-1), n)
    hit = emitter_hit(emitter, u, v)
    return LampPoint(k, hit, emitter_point(emitter, u, v), n, sides * emitter.area / chance)


@jit
def lattice5(s, i):
    """Return point `i` of a lattice in [0, 1)^5, float32, that is shifted by (5,) float64."""
    a, b, c, d, e = _STEPS
    return (
        _part(s[0] + f64(i) * a),
        _part(s[1] + f64(i) * b),
        _part(s[2] + f64(i) * c),
        _part(s[3] + f64(i) * d),
        _part(s[4] + f64(i) * e),
    )


@jit
def _part(x):
    """What a float64 is above the whole number below it, float32 below 1."""
    return min(f32(x - math.floor(x)), f32(1 - 2.0**-24))


@jit
def drawn_row(cumulative, u):
    """Return (row, chance, u): of (n + 1,) cumulative chances the row that u, of [0, 1), falls into, its
    chance, and u, uniform again."""
    low, high = i64(0), i64(len(cumulative) - 2)
    while low < high:
        middle = (low + high) // 2
        if f64(u) >= cumulative[middle + 1]:
            low = middle + 1
        else:
            high = middle
    chance = cumulative[low + 1] - cumulative[low]
    within = f32((f64(u) - cumulative[low]) / chance) if chance > f64(0) else f32(0)
    return low, f32(chance), min(max(within, f32(0)), f32(1 - 2.0**-24))


@jit
def _direction(lamps, emitter, point, n, u, v):
    """Return (d, pdf): a direction drawn by u, v of [0, 1) for a photon that leaves a point of an EMITTER on
    the side of n, and its density, 1/sr. d may lie below the surface.

    By the cosine, or of a spot with a radius evenly in its cone.
    """
    share, spheres = lamps.share, lamps.spheres
    within_cone = emitter.cone > f32(0)
    if u < share:
        count = f32(len(spheres))
        u *= count / share
        drawn = min(i64(u), i64(len(spheres) - 1))
        toward, cosine = sphere_cone(spheres[drawn], point)
        d = in_cone(toward, cosine, u - f32(drawn), v)
    elif within_cone:
        d = in_cone(vec3(emitter.axis), f32(1) - emitter.cone, (u - share) / (f32(1) - share), v)
    else:
        d = to_world(cosine_hemisphere((u - share) / (f32(1) - share), v), n)
    density = (f32(1) - share) * max(dot(n, d), f32(0)) * f32(1 / math.pi)
    if within_cone:
        within = dot(vec3(emitter.axis), d) >= f32(1) - emitter.cone
        density = (f32(1) - share) / (f32(2 * math.pi) * emitter.cone) if within else f32(0)
    if share > f32(0):
        aimed = f32(0)
        for k in range(len(spheres)):
            toward, cosine = sphere_cone(spheres[k], point)
            if dot(d, toward) >= cosine:
                aimed += f32(1 / (2 * math.pi)) / (f32(1) - cosine)
        density += share * aimed / f32(len(spheres))
    return d, density


@jit
def sphere_cone(sphere, point):
    """Return the axis and the cosine of half the angle of the cone in which a point sees a (4,) sphere; from
    within all directions."""
    segment = sub((sphere[0], sphere[1], sphere[2]), point)
    square, radius2 = dot(segment, segment), sphere[3] * sphere[3]
    if square <= radius2:
        return (f32(0), f32(0), f32(1)), f32(-1)
    axis = scale(f32(1) / f32(math.sqrt(square)), segment)
    # a little wider, so that rounding does not leave out the rim; never of no angle
    return axis, min(f32(math.sqrt(f32(1) - radius2 / square)), f32(1 - 1e-6))
