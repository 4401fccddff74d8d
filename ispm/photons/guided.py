"""Photons that scatter outside, toward openings through which light comes in to what the eye sees.

Ground in the sun lights a room through its window. Few photons that scatter there find the window, each with
the light of a square metre: half of them are sent to it, with as much less (one-sample balance heuristic,
Veach 1997, section 9.2.4).
"""

from __future__ import annotations

import math

import numpy as np

from ispm.lights.boxes import box_pdf, draw_in_box
from ispm.lights.openings import Ways, is_inside
from ispm.optics.jit import jit
from ispm.optics.vector import dot, scale, sub, vec3

f32 = np.float32

_MOST = f32(0.5)  # of photons, that are sent to openings, if all that is seen is lit through these
_LARGE = f32(0.01)  # sr, of what a place sees of all openings, below which fewer are


@jit
def guided_share(ways: Ways, x):
    """Return the share, float32, of photons at a SurfacePoint that are sent to openings; 0: it sees none from
    outside, or is inside: other rooms lie on the outer side of an opening, too."""
    total = f32(0)
    if len(ways.to_sky) == 0 or is_inside(ways.cells, x):
        return total
    for k in range(len(ways.to_sky)):
        total += _angle(ways, k, x)
    return _MOST * f32(ways.share) * min(total * (f32(1) / _LARGE), f32(1))


@jit
def draw_to_opening(ways, x, u0, u1, u2):
    """Return a direction, unit, from a SurfacePoint to a random point of an opening, by u0, u1, u2 of [0, 1):
    only where it has a `guided_share`."""
    total, chosen = f32(0), 0
    for k in range(len(ways.to_sky)):
        angle = _angle(ways, k, x)
        if angle <= f32(0):
            continue
        total += angle
        if u0 * total < angle:
            chosen, u0 = k, u0 * total / angle
        else:
            u0 = (u0 * total - angle) / (total - angle)
    off = sub(draw_in_box(ways.boxes, chosen, u0, u1, u2), x.position)
    return scale(f32(1) / f32(math.sqrt(max(dot(off, off), f32(1e-30)))), off)


@jit
def to_opening_pdf(ways, x, d):
    """Return the density, 1/sr, with which `draw_to_opening` draws d."""
    total, density = f32(0), f32(0)
    for k in range(len(ways.to_sky)):
        angle = _angle(ways, k, x)
        total += angle
        density += angle * box_pdf(ways.boxes, k, x.position, d)
    return density / total if total > f32(0) else f32(0)


@jit
def _angle(ways, k, x):
    """About which solid angle, sr, box k fills for a SurfacePoint outside, times how much comes through it;
    0: it is inside or looks away."""
    boxes, comes = ways.boxes, max(ways.to_sky[k], ways.to_sun[k])
    off = sub(vec3(boxes.middles[k]), x.position)
    away = -dot(vec3(boxes.axes[k, 0]), off)
    if away <= boxes.lengths[k, 0] or dot(x.ng, off) <= f32(0):
        return f32(0)
    square = dot(off, off)
    area = f32(4) * boxes.lengths[k, 1] * boxes.lengths[k, 2]
    return comes * area * away / (square * f32(math.sqrt(square)))
