"""Photons as they come from the environment: rays into the scene.

They are drawn evenly in five dimensions: a direction by the environment's image, and where the ray crosses a
plane across it: within the shadow that the box about the scene casts there, or, a share of them, that of a
smaller box about what the eye sees, or of a sphere: about a mirror or glass that casts caustics, or in an
opening through which light comes in to what the eye sees. The densities of all are added (the balance
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
from ispm.lights.openings import NO_WAYS, WAY, Ways
from ispm.lights.surface_emission import caustic_spheres, drawn_row, lattice5, lattice_shifts
from ispm.optics.environment import environment_light, environment_radiance, sample_environment
from ispm.optics.environment_table import environment_power
from ispm.optics.jit import jit
from ispm.optics.records import EMITTED, EMITTED_BY_ENVIRONMENT, NO_HIT
from ispm.optics.rng import random4
from ispm.optics.sampling import in_cone, orthonormal_basis
from ispm.optics.vector import add, dot, scale, sub, vec3
from ispm.scene.packed import Packed

f32, i64, u32 = np.float32, np.int64, np.uint32

_DIMENSION = (1 << 20) - 3  # of the random numbers of a ray, and of those that shift all of them
_THROUGH = 0.5  # of the photons that are not aimed at caustics, if all that is seen is lit through openings
_FREE = 1.0 / 3.0  # of those, which come from anywhere: where no way leads few carry much
_MOST = 256  # spheres that those are sent through
_CHUNK = 1024  # rays a thread takes at a time


class _Targets(NamedTuple):
    """Where rays are sent.

    boxes      (n, 2, 3) float32 corners, m, of the box about the scene and of those about what is seen
    chances    (n,) float32, of the photons that are not aimed at spheres, those sent through each
    spheres    (k, 4) float32, middle and radius, m, of what casts caustics and of openings
    aimed      (k + 1,) float64, of the photons, those aimed at the spheres before each, and at all
    ways       (l, 4) and (l, 3) float32, spheres and directions of ways in; along: of the photons, those sent
               along these
    away       m, from a place within the scene to one outside
    shifts     (5,) float64, of the lattice
    """

    boxes: np.ndarray
    chances: np.ndarray
    spheres: np.ndarray
    aimed: np.ndarray
    ways: tuple[np.ndarray, np.ndarray]
    along: np.float32
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
    kinds = len(ways.spheres) > 0, len(ways.to_sun) > 0
    through = _THROUGH * ways.share * (1.0 - to_caustics)
    dark, to_sun = (through / max(sum(kinds), 1) * some for some in kinds)
    openings = ways.spheres[:: max(len(ways.spheres) // _MOST, 1)]
    near = [] if seen is None else seen_boxes(packed.bounds, seen)
    chances = [1.0 - SEEN, *[SEEN / len(near)] * len(near)] if near else [1.0]
    targets = _Targets(
        np.stack([packed.bounds, *near]).astype(np.float32),
        np.array(chances, np.float32),
        np.concatenate([spheres, ways.to_sun, openings]),
        _cumulative((len(spheres), to_caustics), (len(ways.to_sun), to_sun), (len(openings), _FREE * dark)),
        (ways.spheres, ways.directions),
        f32((1.0 - _FREE) * dark),
        f32(2.0 * packed.diagonal),
        lattice_shifts(_DIMENSION, seed, pass_index),
    )
    rows = np.zeros(count, EMITTED)
    rows["light"] = EMITTED_BY_ENVIRONMENT
    rows["key"] = np.arange(first_key, first_key + count, dtype=np.uint32)
    numbers = np.uint32(pass_index), np.uint32(seed)
    run_shared(lambda counter: _emit(tables, targets, *numbers, counter, rows), world.threads)
    return rows[rows["flux"].any(axis=1)]


def _cumulative(*groups: tuple[int, float]) -> np.ndarray:
    """Cumulative shares, float64, of groups of so many, each of which has a share; 0 first."""
    each = [np.full(count, share / max(count, 1)) for count, share in groups]
    return np.cumsum(np.concatenate([[0.0], *each]))


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
    (spheres, directions), along = targets.ways, targets.along
    if u4 < along:
        count = i64(len(spheres))
        k = min(i64(u4 / along * f32(count)), count - 1)
        wi = in_cone(vec3(directions[k]), f32(WAY), u0, u1)
        point = _in_disc(spheres[k], wi, u2, u3)
        _, pdf = environment_light(tables.environment, wi)
    else:
        wi, _, pdf = sample_environment(tables.environment, u0, u1)
        point = _point(targets, wi, u2, u3, min((u4 - along) / (f32(1) - along), f32(1 - 2.0**-24)))
    if pdf <= f32(0):  # it is dark there
        return wi, point, pdf, f32(0)
    density = _density(targets, wi, point)
    together = pdf * density
    for way in range(len(spheres)):
        if dot(vec3(directions[way]), wi) >= f32(WAY) and _meets_sphere(spheres[way], point, wi):
            area = f32(math.pi) * spheres[way, 3] * spheres[way, 3]
            together += along / (f32(len(spheres)) * f32(2 * math.pi * (1 - WAY)) * area)
    return wi, point, pdf, together / pdf


@jit
def _point(targets, wi, u, v, w):
    """A point, m, that a ray from wi passes, drawn by u, v, w of [0, 1)."""
    boxes, chances, aimed, spheres = targets.boxes, targets.chances, targets.aimed, targets.spheres
    w *= f32(1) - targets.along
    share = f32(aimed[len(spheres)])
    if w < share:
        row, _, _ = drawn_row(aimed, w)
        return _in_disc(spheres[row], wi, u, v)
    w = (w - share) / (f32(1) - targets.along - share)
    k = 0
    while k + 1 < len(chances) and w >= chances[k]:
        w -= chances[k]
        k += 1
    return _on_box(boxes[k, 0], boxes[k, 1], wi, u, v, min(w / chances[k], f32(1)))


@jit
def _density(targets, wi, point):
    """The density, 1/m2 across the ray, of a point among those that rays from wi pass which are drawn by the
    environment."""
    boxes, chances, aimed, spheres = targets.boxes, targets.chances, targets.aimed, targets.spheres
    density, rest = f32(0), f32(1) - targets.along - f32(aimed[len(spheres)])
    for k in range(len(boxes)):
        low, high = boxes[k, 0], boxes[k, 1]
        if _meets_box(low, high, point, wi):
            density += rest * chances[k] / max(_shadow(low, high, wi), f32(1e-30))
    for k in range(len(spheres)):
        if _meets_sphere(spheres[k], point, wi):
            square = spheres[k, 3] * spheres[k, 3]
            density += f32(aimed[k + 1] - aimed[k]) * f32(1 / math.pi) / square
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


@jit
def _shadow(low, high, wi):
    """Area, m2, that a box shows to a direction."""
    x, y, z = high[0] - low[0], high[1] - low[1], high[2] - low[2]
    return abs(wi[0]) * y * z + abs(wi[1]) * z * x + abs(wi[2]) * x * y


@jit
def _on_box(low, high, wi, u, v, w):
    """A point, m, of the sides of a box that a direction sees, drawn evenly across it by u, v, w, [0, 1)."""
    x, y, z = high[0] - low[0], high[1] - low[1], high[2] - low[2]
    a, b, whole = abs(wi[0]) * y * z, abs(wi[1]) * z * x, _shadow(low, high, wi)
    w *= whole
    if w < a:
        side = high[0] if wi[0] > f32(0) else low[0]
        return side, low[1] + u * y, low[2] + v * z
    if w < a + b:
        side = high[1] if wi[1] > f32(0) else low[1]
        return low[0] + u * x, side, low[2] + v * z
    side = high[2] if wi[2] > f32(0) else low[2]
    return low[0] + u * x, low[1] + v * y, side


@jit
def _meets_box(low, high, point, wi):
    """Whether the line through a point along wi meets a box; one that touches it, by rounding, does."""
    near, far = f32(-np.inf), f32(np.inf)
    slack = f32(1e-5) * ((high[0] - low[0]) + (high[1] - low[1]) + (high[2] - low[2]))
    for k in range(3):
        o, d = (point[0], point[1], point[2])[k], (wi[0], wi[1], wi[2])[k]
        if abs(d) < f32(1e-12):
            if o < low[k] - slack or o > high[k] + slack:
                return False
            continue
        a, b = (low[k] - slack - o) / d, (high[k] + slack - o) / d
        near, far = max(near, min(a, b)), min(far, max(a, b))
    return near <= far
