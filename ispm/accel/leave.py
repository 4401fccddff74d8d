"""Where a ray starts that leaves a hit.

Source: Wächter & Binder, "A fast and robust method for avoiding self-intersection", Ray Tracing Gems, ch. 6.
"""

from __future__ import annotations

import math

import numpy as np

from ispm.optics.jit import jit
from ispm.optics.vector import cross, dot, sub

f32 = np.float32

# How far a ray starts from its surface, in units of the scale of rounding errors.
_OFFSET = np.float32(4 * 2.0**-24)


@jit
def leave_triangle(corner, e1, e2, u, v, n, scale):
    """Return where a ray starts that leaves a hit: on the side of n and inside all walls at its edges.

    corner, e1, e2  first corner and edges to the second and third, world space; vectors as tuples
    u, v            barycentric coordinates of the hit;  n  unit geometric normal of the side to leave
    scale           m, `instance_scale`
    A point from barycentrics is off by a few 2^-24 of the largest number on its path to world space: its
    object space coordinates, its translation, or what they give, whichever is largest, not what they sum
    to. Rays are taken back to object space, where an uneven matrix makes the error grow. An instance's scale
    is the product of both; the point moves by 4 of its 2^-24 along n. A point this close to an edge may also
    lie behind the wall that begins there, so it first moves towards the center of the triangle's incircle
    until it is four times as far from all edges, or half of the circle's radius: the wall may lean over this
    triangle, down to an angle of 15 degrees. Others stay: the center of a needle is far away.
    """
    h = _OFFSET * scale
    e3, area = sub(e2, e1), cross(e1, e2)
    longest = max(dot(e1, e1), max(dot(e2, e2), dot(e3, e3)))
    least = min(u, min(v, f32(1) - u - v))
    if least * least * dot(area, area) < f32(16) * h * h * longest:  # may be nearer than 4 h to an edge
        u, v = inwards(e1, e2, e3, u, v, inside_margin(scale))
    return (
        corner[0] + (u * e1[0] + v * e2[0]) + h * n[0],
        corner[1] + (u * e1[1] + v * e2[1]) + h * n[1],
        corner[2] + (u * e1[2] + v * e2[2]) + h * n[2],
    )


@jit
def inside_margin(scale):
    """Return how far from the edges of its triangle, m, a ray's start lies, at an `instance_scale`, m."""
    return f32(4) * _OFFSET * scale


@jit
def inwards(e1, e2, e3, u, v, margin):
    """Return the barycentrics of a point moved towards the center of the triangle's incircle until it is
    `margin`, m, from all edges, or half of the circle's radius.

    e1, e2, e3  edges from the first corner to the second, to the third, and from the second to the third, m
    """
    area = cross(e1, e2)
    a, b, c = math.sqrt(dot(e3, e3)), math.sqrt(dot(e2, e2)), math.sqrt(dot(e1, e1))
    around, twice_area = a + b + c, math.sqrt(dot(area, area))
    if around > f32(0):  # the weights of the center
        a, b, c = a / around, b / around, c / around
    share = f32(0.5)  # of the circle's radius
    if margin * around < share * twice_area:
        share = margin * around / twice_area
    moved = max(_share_to(share * b, u, b), _share_to(share * c, v, c))
    moved = max(_share_to(share * a, f32(1) - u - v, a), moved)
    return u + moved * (b - u), v + moved * (c - v)


@jit(inline=True)
def _share_to(low, weight, center):
    """Return which share of the distance from a weight to that of the center reaches `low`; 0 to 1."""
    return (low - weight) / (center - weight) if weight < low else f32(0)
