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

from ispm.accel.emitter_tree import PATH_WORDS, draw_next
from ispm.accel.emitters import Emitters, corners_from, emitter_hit, emitter_point, sample_triangle
from ispm.accel.glow import emitted_radiance
from ispm.accel.mesh import INSTANCES, triangle_at, world_point
from ispm.accel.records import Hit
from ispm.kernels.simd import alloca
from ispm.lights.area import faces, lit_side
from ispm.optics.jit import jit
from ispm.optics.sampling import LATTICE
from ispm.optics.vector import add, cross, dot, scale, sub, vec3

f32, f64, i64, u32 = np.float32, np.float64, np.int64, np.uint32

_SLIGHT = (
    0.04  # sine^2 of angles below which their ratio is a series, off by 1e-13 at most: a third of the time
)
# asin(s) / s by powers of s^2, the highest first
_SERIES = tuple(math.comb(2 * k, k) / (4.0**k * (2 * k + 1)) for k in range(7, -1, -1))
_FEW = 12  # triangles of a scene that all pixels add up: these take half as long as a draw with its ray
_FILLED = 0.4  # of what a lamp in one piece spans: of a square 1, askew .5
_EVEN = f32(0.18)  # radians, over which a lamp's light is averaged at most
_TO_EDGE = f32(0.25)  # of the angle to the edge of a spot's cone, likewise
_ALL = 48  # triangles of a scene that are added up: these take as long as the draws from more


def are_known(emitters: Emitters) -> bool:
    """Return whether `unshaded_lamps` takes no longer than a draw, and no random numbers: there are few
    triangles, and none has a texture or shines in a cone."""
    triangles = emitters.triangles
    drawn = triangles["textured"].any() or (triangles["cone"] > 0).any()
    return len(triangles) <= _FEW and not drawn


def is_one_lamp(emitters: Emitters) -> bool:
    """Return whether all draws are to one lamp in one piece: nothing else with a surface shines, and its
    triangles fill what it spans."""
    lamp = emitters.triangles
    if not (lamp["instance"] == lamp["instance"][:1]).all():
        return False
    corners = lamp["corner"][:, None] + np.stack(
        [np.zeros_like(lamp["edge1"]), lamp["edge1"], lamp["edge2"]], 1
    )
    _, width, length = np.sort(np.ptp(corners.reshape(-1, 3), axis=0)) if len(lamp) else np.zeros(3)
    return bool(lamp["area"].sum() >= _FILLED * width * length)


@jit
def even_angle(table, emitter, position):
    """Return the angle at the lamp of an EMITTER, radians, over which its light may be averaged about a
    position, m: toward the edge of a spot's cone ever less, but for what its sphere blurs that.

    It is alike for all points of the lamp, or dim ones that are drawn would keep their pixels dim.
    """
    if emitter.cone <= f32(0):
        return _EVEN
    instance, _, _ = triangle_at(table, Hit(emitter.instance, emitter.primitive, f32(0), f32(0)))
    middle = world_point(table[INSTANCES], instance, (f32(0), f32(0), f32(0)))
    out = sub(world_point(table[INSTANCES], instance, (f32(0), f32(0), f32(1))), middle)
    way = sub(position, middle)
    distance = max(f32(math.sqrt(dot(way, way))), f32(1e-30))
    cosine = min(max(dot(vec3(emitter.axis), way) / distance, f32(-1)), f32(1))
    to_edge = f32(math.acos(f32(1) - emitter.cone)) - f32(math.acos(cosine))
    return min(_EVEN, _TO_EDGE * max(to_edge, f32(math.sqrt(dot(out, out))) / distance))


@jit
def unshaded_lamps(tables, x, u0, u1, u2, draws):
    """Return the irradiance of a SurfacePoint, lx RGB, by all lamps with a surface but for shadows.

    u0, u1, u2  random in [0, 1);  draws  where there are too many lamps to add up all
    """
    triangles, total = tables.emitters.triangles, (f32(0), f32(0), f32(0))
    if len(triangles) <= _ALL:
        for row in range(len(triangles)):
            total = add(total, _of_triangle(tables, triangles[row], x, u1, u2, row))
        return total
    side, share, k = lit_side(x), f32(1) / f32(draws), i64(0)
    path, node, level = alloca(PATH_WORDS), i64(0), i64(-1)
    while k < draws:
        row, chance, least, node, level = draw_next(
            tables.emitters, x.position, side, (f32(k) + u0) * share, node, level, path
        )
        first, until = k, least + chance
        k += i64(1)
        while k < draws and (f32(k) + u0) * share < until:
            k += i64(1)
        if row >= i64(0):
            light = _of_triangle(tables, triangles[row], x, u1, u2, first)
            total = add(total, scale(f32(k - first) * share / chance, light))
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
    hit, wi = emitter_hit(emitter, u, v), scale(f32(1) / distance, segment)
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
    across, along = cross(p, q), dot(p, q)
    square, both = dot(across, across), dot(p, p) * dot(q, q)
    if square < f64(_SLIGHT) * both and along > f64(0):
        z, series = square / both, f64(0)
        for k in range(len(_SERIES)):
            series = series * z + _SERIES[k]
        return series * dot(across, n) / math.sqrt(both)
    sine = math.sqrt(square)
    return math.atan2(sine, along) * dot(across, n) / sine if sine > f64(0) else f64(0)
