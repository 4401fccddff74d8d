"""Light of lamps with a surface without shadows, by few draws or none: what they bring to a matt surface that
nothing shades.

A triangle's is known (Lambert's formula for polygons; Baum, Rushmeier and Winget, Improving Radiosity
Solutions through the Use of Analytically Determined Form-Factors, SIGGRAPH 1989, equation 7). Of few all are
added up; of more some are drawn from even parts of the tree of emitters. Close to thin lamps single points of
them say little of what all bring, so this takes grain away that filters cannot.
Source: Heitz, Hill and McGuire, Combining Analytic Direct Illumination and Stochastic Shadows, I3D 2018.
"""

from __future__ import annotations

import math

import numpy as np

from ispm.accel.emitters import corners_from, draw_emitter, emitter_point, sample_triangle
from ispm.accel.glow import emitted_radiance
from ispm.accel.records import Hit
from ispm.lights.area import faces, lit_side
from ispm.optics.jit import jit
from ispm.optics.sampling import LATTICE
from ispm.optics.vector import add, cross, dot, scale, sub, vec3

f32, f64, i64, u32 = np.float32, np.float64, np.int64, np.uint32

_ALL = 48  # triangles of a scene that are added up: these take as long as the draws from more
_DRAWS = 16  # from the triangles of others


@jit
def unshaded_lamps(tables, x, u0, u1, u2):
    """Return the irradiance of a SurfacePoint, lx RGB, by all lamps with a surface but for shadows.

    u0, u1, u2  random in [0, 1)
    """
    triangles, total = tables.emitters.triangles, (f32(0), f32(0), f32(0))
    if len(triangles) <= _ALL:
        for row in range(len(triangles)):
            total = add(total, _of_triangle(tables, triangles[row], x, u1, u2, row))
        return total
    side = lit_side(x)
    for k in range(_DRAWS):
        u = (f32(k) + u0) * f32(1 / _DRAWS)
        row, chance, _ = draw_emitter(tables.emitters, x.position, side, u)
        if row >= i64(0):
            light = _of_triangle(tables, triangles[row], x, u1, u2, k)
            total = add(total, scale(f32(1 / _DRAWS) / chance, light))
    return total


@jit
def _of_triangle(tables, emitter, x, u1, u2, k):
    """The irradiance, lx RGB, of a SurfacePoint by an EMITTER; where a texture says how it shines by a point,
    drawn by two random numbers, k steps on; likewise where it shines in a cone."""
    none, side = (f32(0), f32(0), f32(0)), lit_side(x)
    if not faces(emitter, sub(vec3(emitter.corner), x.position)):
        return none
    if emitter.textured != u32(0) or emitter.cone > f32(0):
        return _of_point(tables, emitter, x, u1 + f32(k) * f32(LATTICE[0]), u2 + f32(k) * f32(LATTICE[1]))
    a, b, c = corners_from(emitter, x.position)
    if max(dot(side, a), max(dot(side, b), dot(side, c))) < f64(0):  # never drawn, as `drawn` is without it
        return none
    return scale(f32(form_factor(a, b, c, x.n)), vec3(emitter.radiance))


@jit
def _of_point(tables, emitter, x, u1, u2):
    """Likewise, by a point that two numbers of 0 or more draw."""
    u, v, pdf = sample_triangle(emitter, x.position, u1 - f32(math.floor(u1)), u2 - f32(math.floor(u2)))
    segment = sub(emitter_point(emitter, u, v), x.position)
    square = dot(segment, segment)
    if pdf <= f32(0) or square == f32(0):
        return f32(0), f32(0), f32(0)
    distance = f32(math.sqrt(square))
    hit, wi = Hit(emitter.instance, emitter.primitive, u, v), scale(f32(1) / distance, segment)
    cosine = max(dot(x.n, segment), f32(0)) / distance
    return scale(cosine / pdf, emitted_radiance(tables, hit, wi))


@jit
def form_factor(a, b, c, n):
    """Return the integral of the cosine to n over the directions of a triangle, cut at the horizon.

    a, b, c  its corners as seen from the point, float64 m;  n  unit;  ->  float64, up to pi
    """
    total, left, back = f64(0), a, a
    is_cut = False
    for p, q in ((a, b), (b, c), (c, a)):
        begins, ends = dot(p, n), dot(q, n)
        if begins < f64(0) and ends < f64(0):
            continue
        if begins < f64(0):
            p = back = _between(p, q, begins, ends)
            is_cut = True
        elif ends < f64(0):
            q = left = _between(p, q, begins, ends)
            is_cut = True
        total += _edge(p, q, n)
    if is_cut:
        total += _edge(left, back, n)
    return abs(total) * f64(0.5)


@jit
def _between(p, q, begins, ends):
    """Where an edge from p to q meets the horizon, above which they are as high as `begins` and `ends`."""
    return add(p, scale(begins / (begins - ends), sub(q, p)))


@jit
def _edge(p, q, n):
    """The angle from p to q times the cosine between n and the normal of their plane."""
    across = cross(p, q)
    sine = math.sqrt(dot(across, across))
    return math.atan2(sine, dot(p, q)) * dot(across, n) / sine if sine > f64(0) else f64(0)
