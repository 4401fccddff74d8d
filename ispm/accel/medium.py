"""What lies between hits: where flights start, and the solids that they go through.

`tables` is a Tables; directions are unit, as tuples of float32, world space.
"""

from __future__ import annotations

import math

import numpy as np

from ispm.accel.mesh import MATERIALS, triangle_at, vector_at, word_of
from ispm.accel.records import Hit
from ispm.accel.surface import leave_surface
from ispm.optics.jit import jit
from ispm.optics.records import MATERIAL, MATERIAL_THIN, MATERIAL_TRANSLUCENT, MATERIAL_TRANSMITS, NO_HIT
from ispm.optics.vector import dot, scale, sub

f32, u32 = np.float32, np.uint32

_ATTENUATION = word_of(MATERIAL, "attenuation")


@jit
def no_medium():
    """Return the Hit that bounds nothing: its instance is NO_HIT."""
    return Hit(u32(NO_HIT), u32(0), f32(0), f32(0))


@jit
def medium(inside, x):
    """Return a Hit on the boundary of the solid that a flight to the SurfacePoint x went through: that of x,
    if a solid was met from within, else `inside`, where the path last entered one (NO_HIT: nowhere)."""
    solid = x.flags & u32(MATERIAL_TRANSMITS | MATERIAL_THIN) == u32(MATERIAL_TRANSMITS)
    return x.hit if solid and not x.entering else inside


@jit
def spawn_ray(tables, x, inside, d):
    """Return where a flight along `d` from a SurfacePoint starts, m, and a Hit on the boundary of the solid
    that it is in; inside: that of the flight to x."""
    side = f32(1) if dot(d, x.ng) > f32(0) else f32(-1)
    start = leave_surface(tables, x.hit, scale(side, x.ng))
    if side > f32(0) or x.flags & u32(MATERIAL_THIN | MATERIAL_TRANSLUCENT):
        return start, inside
    return start, x.hit if x.entering else no_medium()


@jit
def passed_sheet(x, wi):
    """Return whether a specular event at a SurfacePoint, which sent a path along wi, went straight through a
    MATERIAL_THIN sheet."""
    return x.flags & u32(MATERIAL_THIN) != u32(0) and dot(wi, x.ng) < f32(0)


@jit
def attenuated(tables, inside, origin, position, flux):
    """Return the flux, RGB, that is left of a flight from `origin` to `position`, m, through the solid whose
    boundary is the Hit `inside`."""
    segment = sub(position, origin)
    left = attenuation(tables.surfaces, inside, f32(math.sqrt(dot(segment, segment))))
    return left[0] * flux[0], left[1] * flux[1], left[2] * flux[2]


@jit
def attenuation(table, hit, distance):
    """Return the share of light, RGB, left after `distance` metres of what a Hit's material bounds.

    Source: KHR_materials_volume, attenuation.
    """
    _, material, _ = triangle_at(table, hit)
    rate = vector_at(table[MATERIALS], material + _ATTENUATION)
    return math.exp(-distance * rate[0]), math.exp(-distance * rate[1]), math.exp(-distance * rate[2])
