"""Bounce maps of lamps with a surface: the scene as it is seen from points drawn on them.

A lamp shines from many points, and from each of them the first flights of photons are a picture (McGuire and
Luebke 2009). A pass draws some points in proportion to flux, another pass others; a point is a light whose
intensity falls with the cosine, so that its maps, their plan and their photons are made as those of a spot.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ispm.accel.emitters import emitter_flux
from ispm.accel.glow import beam, face_radiance
from ispm.accel.records import Hit
from ispm.accel.surface import SurfaceTable, hit_position, scene_tables
from ispm.lights.emission import emit_texels
from ispm.lights.lightmap import LIGHT_LAMBERT, light_map
from ispm.lights.plan import PlannedMap, plan_views
from ispm.lights.surface_emission import cumulative_shares, draw_lamp_point, lattice_shifts
from ispm.optics.jit import jit
from ispm.optics.records import EMITTED_BY_SURFACE, LIGHT, take
from ispm.optics.vector import dot, scale, sub, vec3
from ispm.scene.packed import Packed

f32, u32 = np.float32, np.uint32

_DIMENSION = (1 << 20) - 4  # of the random numbers that shift the points of all passes
_PHOTONS = 1000  # that a point is drawn for
_MOST = 64  # points in a pass
_ROOT = 1.2207440846057596  # x^4 = x + 1: for a lattice even in three dimensions (Roberts 2018)
_STEPS = _ROOT ** -np.arange(1.0, 4.0)


@dataclass(frozen=True, eq=False)
class LampMaps:
    """Points of lamps with a surface, and the maps that they send photons through.

    lights    (P,) LIGHT of the kind LIGHT_LAMBERT, each with the light of its share of all lamps
    emitters  (P,) uint32, rows of the emissive triangles that they lie on
    extents   (P,) float32 m2, their shares of the lamps' area
    widths    (P,) float32 m, sides of squares of these, no larger than the lamp
    maps      of the points, point by point
    """

    lights: np.ndarray
    emitters: np.ndarray
    extents: np.ndarray
    widths: np.ndarray
    maps: list[PlannedMap]


def plan_lamp_maps(
    packed: Packed, surfaces: SurfaceTable, count: int, caustic_share: float, seed: int, pass_index: int
) -> LampMaps | None:
    """Return points and maps for the photons that leave lamps with a surface; None: there are none.

    count          photons of all lamps together
    caustic_share  of them is aimed at mirrors and glass that cast caustics, where there are any
    The points of all passes of a seed are one lattice, even in triangle and place.
    """
    tables = scene_tables(packed, None, surfaces)
    flux = emitter_flux(tables.emitters)
    if count == 0 or not flux.any():
        return None
    number = min(max(count // _PHOTONS, 1), _MOST)
    lights = np.zeros(number, LIGHT)
    emitters, extents = np.zeros(number, np.uint32), np.zeros(number, np.float32)
    places = lattice_shifts(_DIMENSION, seed, 0)[:3] + number * pass_index * _STEPS
    numbers = np.float32((places + np.arange(number)[:, None] * _STEPS) % 1.0)
    numbers = np.minimum(numbers, np.float32(1.0 - 2.0**-24))  # which rounding may take to 1
    _draw_points(tables, cumulative_shares(flux), numbers, lights, emitters, extents)
    lights["kind"], lights["intensity"] = LIGHT_LAMBERT, lights["intensity"] * (extents / number)[:, None]
    counts = np.diff(np.rint(np.linspace(0, count, number + 1)).astype(np.int64))
    counts[~lights["intensity"].any(axis=1)] = 0
    own = [light_map(k, light, packed.bounds) for k, light in enumerate(lights)]
    plan = plan_views(
        lights, own, packed.caustic_hulls, counts, caustic_share, seed, pass_index, len(packed.lights)
    )
    areas = np.minimum(extents / number, take(tables.emitters.triangles, emitters)["lamp"])
    return LampMaps(lights, emitters, extents / f32(number), np.sqrt(areas), plan)


def emit_from_lamp_maps(
    lamps: LampMaps, surfaces: SurfaceTable, texels: Sequence[np.ndarray], first_key: int
) -> np.ndarray:
    """Return the photons that leave lamps through maps, at their first hits, (n,) EMITTED.

    texels  of each map, (F, W, W, 2) uint32: instance and primitive;  first_key  of the photons' keys
    """
    rows = emit_texels(lamps.lights, surfaces, lamps.maps, texels, first_key)
    point = rows["light"].astype(np.int64)
    brightest = lamps.lights["intensity"].max(axis=1)
    # m2 sr of the lamp's light that are the photon's own
    extent = lamps.extents[point] * rows["flux"].max(axis=1) / brightest[point]
    rows["origin"], rows["emitter"] = lamps.lights["position"][point], lamps.emitters[point]
    rows["spread"] = lamps.widths[point]
    rows["turn"] = np.sqrt(extent) / rows["spread"]
    rows["light"] = EMITTED_BY_SURFACE
    assert surfaces.emitters is not None  # of which the points were drawn
    _dim(surfaces.addresses, surfaces.emitters.triangles, rows)
    return rows[rows["flux"].any(axis=1)]


@jit
def _dim(table, triangles, rows):
    """Take what spots with a radius do not send out of (n,) EMITTED; triangles: (m,) EMITTER."""
    for i in range(len(rows)):
        row, lamp = rows[i], triangles[rows[i].emitter]
        to_lamp = sub(vec3(row.origin), hit_position(table, Hit(row.instance, row.primitive, row.u, row.v)))
        d = scale(f32(1) / f32(math.sqrt(max(dot(to_lamp, to_lamp), f32(1e-30)))), to_lamp)
        share = beam(table, Hit(lamp.instance, lamp.primitive, f32(0), f32(0)), d)
        for c in range(3):
            row.flux[c] *= share


@jit
def _draw_points(tables, cumulative, numbers, lights, emitters, extents):
    """Write (P,) LIGHT of points that (P, 3) numbers of [0, 1) draw: position, direction, and for intensity
    radiance, cd/m2; rows of their EMITTERs and their `extent`.

    They lie on the surface itself: what sees the scene from them has a near plane, and the tables no trees.
    """
    for i in range(len(lights)):
        drawn = draw_lamp_point(tables, cumulative, numbers[i, 0], numbers[i, 1], numbers[i, 2])
        place, radiance = hit_position(tables.surfaces, drawn.hit), face_radiance(tables, drawn.hit)
        for c in range(3):
            lights[i].position[c] = place[c]
            lights[i].direction[c] = drawn.n[c]
            lights[i].intensity[c] = radiance[c]
        emitters[i], extents[i] = u32(drawn.row), drawn.extent
