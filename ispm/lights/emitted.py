"""What an emitted photon brings to its first hit: where its flight began, and how wide its beam is.

Sources: Igehy, Tracing Ray Differentials, SIGGRAPH 1999; Schjoth et al., Photon Differentials, GRAPHITE 2007.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ispm.accel.records import Hit
from ispm.accel.surface import hit_position
from ispm.lights.area import lamp_irradiance
from ispm.optics.jit import jit
from ispm.optics.light import cone_falloff, light_arriving, range_window
from ispm.optics.records import EMITTED_BY_ENVIRONMENT, EMITTED_BY_SURFACE, LIGHT_DIRECTIONAL
from ispm.optics.sampling import orthonormal_basis
from ispm.optics.vector import Vector, dot, scale, sub, vec3

f32, i64, u32 = np.float32, np.int64, np.uint32


class Beam(NamedTuple):
    """How the position of a path (dx, m) and its direction (dd) change from one side of the photon's share
    of the light to the other, along one direction (_u) and along another (_v); float32.

    On a surface dx_u and dx_v span the area that the photon alone lights.
    """

    dx_u: Vector
    dx_v: Vector
    dd_u: Vector
    dd_v: Vector


@jit
def emitted_beam(tables, photon, d):
    """Return the Beam of an EMITTED photon where it leaves its light along d: a square of its share of it.

    The flux of a photon of a punctual light is the intensity times the solid angle that is the photon's own,
    in sr; of a directional light its irradiance times an area, in m2.
    """
    s, t = orthonormal_basis(d)
    none = (f32(0), f32(0), f32(0))
    if _from_area(photon):
        spread, turn = photon.spread, photon.turn
        return Beam(scale(spread, s), scale(spread, t), scale(turn, s), scale(turn, t))
    light, flux = tables.lights[i64(photon.light)], photon.flux
    brightest = max(light.intensity[0], max(light.intensity[1], light.intensity[2])) * cone_falloff(light, d)
    side = math.sqrt(max(flux[0], max(flux[1], flux[2])) / max(brightest, f32(1e-30)))
    if light.kind == u32(LIGHT_DIRECTIONAL):
        return Beam(scale(side, s), scale(side, t), none, none)
    return Beam(none, none, scale(side, s), scale(side, t))


@jit
def first_segment(tables, photon):
    """Return where the flight of an EMITTED photon to its first hit begins, its direction, and the share
    of the flux within the light's range. Light from infinitely far begins at the hit: it is not in what it
    shines on.
    """
    hit = Hit(photon.instance, photon.primitive, photon.u, photon.v)
    position = hit_position(tables.surfaces, hit)
    if photon.light == u32(EMITTED_BY_ENVIRONMENT):
        return position, vec3(photon.origin), f32(1)
    origin, reach = vec3(photon.origin), f32(0)
    if photon.light != u32(EMITTED_BY_SURFACE):
        light = tables.lights[i64(photon.light)]
        if light.kind == u32(LIGHT_DIRECTIONAL):
            return position, vec3(light.direction), f32(1)
        origin, reach = vec3(light.position), light.range
    segment = sub(position, origin)
    square = dot(segment, segment)
    distance = f32(math.sqrt(square if square > f32(0) else f32(1e-30)))
    return origin, scale(f32(1) / distance, segment), range_window(distance, reach)


@jit
def first_irradiance(tables, photon, position):
    """Return (irradiance, wi) at the first hit of an EMITTED photon, at `position`: lx on a surface that
    faces its light, unit and towards it. Of an environment it is 0: no place is near to that."""
    if photon.light == u32(EMITTED_BY_ENVIRONMENT):
        return (f32(0), f32(0), f32(0)), scale(f32(-1), vec3(photon.origin))
    if photon.light == u32(EMITTED_BY_SURFACE):
        origin = vec3(photon.origin)
        segment = sub(origin, position)
        inverse = f32(1) / f32(math.sqrt(max(dot(segment, segment), f32(1e-30))))
        emitter = tables.emitters.triangles[i64(photon.emitter)]
        return lamp_irradiance(emitter, origin, position), scale(inverse, segment)
    irradiance, _, wi = light_arriving(tables.lights[i64(photon.light)], position)
    return irradiance, wi


@jit
def _from_area(photon):
    """Whether an EMITTED photon comes from a lamp with a surface or an environment."""
    return photon.light >= u32(EMITTED_BY_ENVIRONMENT)
