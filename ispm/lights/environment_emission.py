"""Photons as they come from the environment: rays into the scene.

They are drawn evenly in five dimensions: a direction by the environment's image, and where the ray crosses a
plane across it: within the shadow that the box about the scene casts there, or, a share of them, that of a
smaller box about what the eye sees, or of a sphere about a mirror or glass that casts caustics, with the
densities of all added (the balance heuristic of Veach 1997, section 9.2.2).
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
from ispm.lights.surface_emission import caustic_spheres, lattice5, lattice_shifts
from ispm.optics.environment import environment_power, sample_environment
from ispm.optics.jit import jit
from ispm.optics.records import EMITTED, EMITTED_BY_ENVIRONMENT, NO_HIT
from ispm.optics.rng import random4
from ispm.optics.sampling import orthonormal_basis
from ispm.optics.vector import add, dot, scale, sub
from ispm.scene.packed import Packed

f32, i64, u32 = np.float32, np.int64, np.uint32

_DIMENSION = (1 << 20) - 3  # of the random numbers of a ray, and of those that shift all of them
_CHUNK = 1024  # rays a thread takes at a time


class _Targets(NamedTuple):
    """Where rays are sent.

    boxes      (n, 2, 3) float32 corners, m, of the box about the scene and of those about what is seen
    chances    (n,) float32, of the photons that are not aimed at spheres, those sent through each
    spheres    (k, 4) float32, middle and radius, m, of what casts caustics
    share      of the photons that are aimed at these
    away       m, from a place within the scene to one outside
    shifts     (5,) float64, of the lattice
    """

    boxes: np.ndarray
    chances: np.ndarray
    spheres: np.ndarray
    share: np.float32
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
) -> np.ndarray:
    """Return the photons that come from the environment, at their first hits, (n,) EMITTED, but for
    those that bring nothing. Arguments as of `emit_from_surfaces`.

    seen  (n, 3) m, points in the picture: half of the photons that are not aimed at caustics are aimed at
          them, if the scene is much larger; None: unknown
    """
    if count == 0 or environment_flux(packed) == 0.0:
        return np.zeros(0, EMITTED)
    tables = scene_tables(packed, world, surfaces)
    spheres = caustic_spheres(packed)
    near = [] if seen is None else seen_boxes(packed.bounds, seen)
    chances = [1.0 - SEEN, *[SEEN / len(near)] * len(near)] if near else [1.0]
    targets = _Targets(
        np.stack([packed.bounds, *near]).astype(np.float32),
        np.array(chances, np.float32),
        spheres,
        f32(caustic_share if len(spheres) else 0.0),
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
        u0, u1, u2, u3, u4 = lattice5(targets.shifts, i)
        wi, radiance, pdf = sample_environment(tables.environment, u0, u1)
        if pdf <= f32(0):
            continue
        start, density = _start(targets, wi, u2, u3, u4)
        if density <= f32(0):
            continue
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
def _start(targets, wi, u, v, w):
    """Return where a ray from wi starts, m, outside the scene, drawn by u, v, w of [0, 1), and the density of
    that, 1/m2 across the ray."""
    boxes, chances, share, spheres = targets.boxes, targets.chances, targets.share, targets.spheres
    if w < share:
        drawn = min(i64(w / share * f32(len(spheres))), i64(len(spheres) - 1))
        radius, phi = spheres[drawn, 3] * f32(math.sqrt(u)), f32(2 * math.pi) * v
        s, t = orthonormal_basis(wi)
        across = add(scale(radius * f32(math.cos(phi)), s), scale(radius * f32(math.sin(phi)), t))
        point = add((spheres[drawn, 0], spheres[drawn, 1], spheres[drawn, 2]), across)
    else:
        w = (w - share) / (f32(1) - share)
        k = 0
        while k + 1 < len(chances) and w >= chances[k]:
            w -= chances[k]
            k += 1
        point = _on_box(boxes[k, 0], boxes[k, 1], wi, u, v, min(w / chances[k], f32(1)))
    density = f32(0)
    for k in range(len(boxes)):
        low, high = boxes[k, 0], boxes[k, 1]
        if _meets_box(low, high, point, wi):
            density += (f32(1) - share) * chances[k] / max(_shadow(low, high, wi), f32(1e-30))
    if share > f32(0):
        aimed = f32(0)
        for k in range(len(spheres)):
            off = sub(point, (spheres[k, 0], spheres[k, 1], spheres[k, 2]))
            along, square = dot(off, wi), spheres[k, 3] * spheres[k, 3]
            if dot(off, off) - along * along <= square:
                aimed += f32(1 / math.pi) / square
        density += share * aimed / f32(len(spheres))
    return add(point, scale(targets.away, wi)), density


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
