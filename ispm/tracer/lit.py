"""Light that comes to a point straight from the lights, its shadows found by rays, and bright spots."""

from __future__ import annotations

import math

import numpy as np

from ispm.optics.bsdf import eval_bsdf, has_finite, smooth_split, transmits
from ispm.optics.jit import jit
from ispm.optics.light import light_arriving
from ispm.optics.vector import add, dot, scale, sub
from ispm.tracer.intersect import any_hit
from ispm.tracer.surface import closest_surface, hit_position, leave_surface, surface

f32, i64 = np.float32, np.int64

_SHEETS_MAX = 8  # of glass that a shadow ray passes
_BEFORE = f32(1e-4)  # of the distance that a shadow ray ends before a light, which may hang on a wall

_ALPHA, _ETA, _THIN = 7, 13, 14  # places in a Bsdf tuple


@jit
def direct_light(place, lights, porous, hit, position, ng, n, b, wo, u, scratch, limit):
    """Return (radiance along wo, rays traced) of the lobes at a hit that spread.

    place    the world's and the surfaces' arrays: world, table, texels, rows
    porous   whether any material may let shadow rays pass
    scratch  a stack and a hit's words, for rays
    limit    lights of which a bright spot is seen here are left out, see `is_bright`; infinite: none
    """
    total, traced = (f32(0), f32(0), f32(0)), i64(0)
    for k in range(len(lights)):
        irradiance, distance, wi = light_arriving(lights[k], position)
        if greatest(irradiance) <= f32(0):
            continue
        f = eval_bsdf(b, n, ng, wo, wi)
        if greatest(f) <= f32(0) or is_bright(b, ng, wo, irradiance, wi, limit):
            continue
        if dot(wi, ng) < f32(0) and b[_THIN] == f32(0):  # refracted radiance
            f = scale(f32(1) / (b[_ETA] * b[_ETA]), f)
        start = leave_surface(place[0], place[1], hit, side_of(ng, wi))
        traced += 1
        passed = let_through(place, porous, start, wi, distance, u, scratch)
        total = add(total, scale(abs(dot(n, wi)), times(times(f, irradiance), passed)))
    return total, traced


@jit
def is_bright(b, ng, wo, irradiance, wi, limit):
    """Return whether a light makes a bright spot of a point that is seen along wo.

    irradiance, wi  as `light_arriving` has them
    limit           of pi times the radiance that the light would make there without shadows
    The same for the eye and for photons: it takes the geometric normal, as the shading normal is bent towards
    who looks, and is symmetric in wo and wi.
    """
    if limit == f32(np.inf):
        return False
    seen = times(eval_bsdf(b, ng, ng, wo, wi), irradiance)
    return f32(math.pi) * abs(dot(ng, wi)) * greatest(seen) > limit


@jit
def is_gathered(b):
    """Return whether gather rays end at a surface: it is opaque, and scatters."""
    return has_finite(b) and not transmits(b)


@jit
def let_through(place, porous, start, d, distance, u, scratch):
    """Return the share of light, RGB, that comes to `start` from `distance` m along `d`.

    Thin smooth sheets let it through by their transmittance, holes wholly; all else blocks.
    """
    world, table, texels, rows = place
    stack, words = scratch
    none, share = (f32(0), f32(0), f32(0)), (f32(1), f32(1), f32(1))
    limit = distance * (f32(1) - _BEFORE)
    if not any_hit(world, start[0], start[1], start[2], d[0], d[1], d[2], limit, stack):
        return share
    if not porous:
        return none
    for _ in range(_SHEETS_MAX):
        found, hit = closest_surface(world, table, texels, rows, start, d, u, stack, words)
        if not found:
            return share
        way = sub(hit_position(table, hit), start)
        limit -= math.sqrt(dot(way, way))
        if limit <= f32(0):
            return share
        _, ng, n, b, _, _ = surface(table, texels, rows, hit, d)
        if b[_THIN] == f32(0) or b[_ALPHA] > f32(0) or not transmits(b):
            return none
        share = times(share, smooth_split(b, n, ng, scale(f32(-1), d))[1])
        start = leave_surface(world, table, hit, scale(f32(-1), ng))
    return none


@jit
def side_of(ng, wi):
    """Return the normal of the surface's side that `wi` leaves from."""
    return ng if dot(wi, ng) > f32(0) else scale(f32(-1), ng)


@jit
def times(a, b):
    """Return a b, channel by channel."""
    return a[0] * b[0], a[1] * b[1], a[2] * b[2]


@jit
def greatest(a):
    """Return the largest channel."""
    return max(a[0], max(a[1], a[2]))
