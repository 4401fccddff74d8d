"""Where a ray meets a triangle that a rasteriser found at its pixel or texel. Twin of stages/meet.wgsl.

In float64; vectors are tuples of three, in world space. `table` is a SurfaceTable's (8,) uint64 addresses.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ispm.accel.mesh import INSTANCES, MATERIALS, TO_WORLD, edges_at, triangle_at, word_of
from ispm.accel.records import Hit
from ispm.accel.surface import SurfaceTable
from ispm.kernels.simd import ldf, ldu
from ispm.optics.jit import jit
from ispm.optics.records import MATERIAL, MATERIAL_BLEND, MATERIAL_MASK, NO_HIT
from ispm.optics.vector import add, cross, dot, scale, sub, vec3

f32, f64, i64, u32 = np.float32, np.float64, np.int64, np.uint32

_INSET = 4e-6  # as in the shader
_SAME = 1e-9  # share of the distance by which one triangle is not nearer than another
_FLAGS = word_of(MATERIAL, "flags")


class _Triangle(NamedTuple):
    """A triangle of an instance."""

    instance: np.uint32
    primitive: np.uint32


class _Barycentrics(NamedTuple):
    """Weights of a triangle's second and third corner."""

    u: np.float64
    v: np.float64


class Rays(NamedTuple):
    """Rays through pixels or texels.

    origins, directions  (n, 3) float64, world space
    parallel  the rays beside each have its direction; else they come from its origin
    """

    origins: np.ndarray
    directions: np.ndarray
    parallel: bool


def _contiguous(rays: Rays) -> Rays:
    # One place repeated, which may not be written to, is contiguous where there is but one ray.
    origins, directions = (np.require(each, None, ("C", "W")) for each in rays[:2])
    return Rays(origins, directions, rays.parallel)


def meet_texels(
    surfaces: SurfaceTable, content: np.ndarray, texels: np.ndarray, rays: Rays
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return what rays through (n,) texels meet: triangles, (n, 2) uint32 instance and primitive, and
    barycentrics, (n, 2) float32, and how many of their directions' lengths away these are, (n,) float64.

    content  (F, W, W, 2) uint32 instance, NO_HIT where nothing is, and primitive
    texels   (n,) int64, rows of `content` without its last axis, flat
    Of the opaque triangles that the 3 x 3 texels about one show, and its own, a ray takes the first that it
    meets: so rasterisers that snap corners to different grids agree, but on what no texel's neighbor shows.
    """
    found, barycentrics = np.empty((len(texels), 2), np.uint32), np.zeros((len(texels), 2), np.float32)
    distances = np.zeros(len(texels))
    shown = np.ascontiguousarray(content), np.ascontiguousarray(texels)
    _meet_texels(surfaces.addresses, *shown, _contiguous(rays), found, barycentrics, distances)
    return found, barycentrics, distances


@jit
def _meet_texels(table, content, texels, rays, found, barycentrics, distances):
    """Write what `meet_texels` returns."""
    width, parallel = content.shape[1], rays.parallel
    for i in range(len(texels)):
        face, y, x = texels[i] // (width * width), texels[i] // width % width, texels[i] % width
        origin, direction = vec3(rays.origins[i]), vec3(rays.directions[i])
        own = _Triangle(content[face, y, x, 0], content[face, y, x, 1])
        before = _Triangle(u32(NO_HIT), u32(0))
        best, point, t, hits = own, _Barycentrics(f64(0), f64(0)), f64(0), False
        if own.instance != u32(NO_HIT):
            point, t, hits = _on_plane(table, own, origin, direction)
        for beside in range(max(y - 1, 0), min(y + 2, width)):
            for column in range(max(x - 1, 0), min(x + 2, width)):
                other = _Triangle(content[face, beside, column, 0], content[face, beside, column, 1])
                if other.instance == u32(NO_HIT) or other == own:
                    continue
                if other == before or _has_holes(table, other):
                    continue
                before = other
                there, distance, meets = _on_plane(table, other, origin, direction)
                nearer = distance < t - f64(_SAME) * abs(t) if hits else parallel or distance > f64(0)
                if meets and nearer and (parallel or distance > f64(0)):
                    best, point, t, hits = other, there, distance, True
        found[i, 0], found[i, 1] = best
        if hits:
            barycentrics[i, 0] = point.u
            barycentrics[i, 1] = min(f32(point.v), f32(1) - barycentrics[i, 0])
            distances[i] = t
        elif best.instance != u32(NO_HIT):
            barycentrics[i, 0], barycentrics[i, 1], distances[i] = meet(
                table, best.instance, best.primitive, origin, direction, parallel
            )


@jit
def _has_holes(table, triangle):
    """Whether a _Triangle's material may have holes, which are not looked into here."""
    _, material, _ = triangle_at(table, Hit(triangle.instance, triangle.primitive, f32(0), f32(0)))
    return ldu(table[MATERIALS], material + _FLAGS) & u32(MATERIAL_MASK | MATERIAL_BLEND) != u32(0)


@jit
def _on_plane(table, triangle, origin, direction):
    """(_Barycentrics, t, whether within) of where a ray meets the plane of a _Triangle, all float64; t in
    lengths of `direction`."""
    corner, e1, e2 = _placed(table, triangle)
    n = cross(e1, e2)
    square, facing = max(dot(n, n), f64(1e-300)), dot(n, direction)
    away = sub(origin, corner)
    t = -dot(n, away) / facing if facing != f64(0) else f64(0)
    offset = add(away, scale(t, direction))
    u, v = dot(cross(offset, e2), n) / square, dot(cross(e1, offset), n) / square
    return _Barycentrics(u, v), t, facing != f64(0) and min(u, min(v, f64(1) - u - v)) >= f64(0)


@jit
def meet(table, instance, primitive, origin, direction, parallel):
    """Return the barycentrics u, v, float32, of the point of a triangle that a ray sees, and how many lengths
    of `direction` away it is, float64.

    origin, direction  tuples of float64, world space;  parallel  as of Rays
    Rasterisers snap corners to a grid, of 1/16 pixel at the coarsest, so that rays miss some of their
    triangles: the point is then what on the triangle is nearest on the screen, and a little within, before a
    wall at that edge.
    """
    triangle = _Triangle(u32(instance), u32(primitive))
    (u, v), t, hits = _on_plane(table, triangle, origin, direction)
    if not hits:
        corner, e1, e2 = _placed(table, triangle)
        away = sub(origin, corner)
        u, v = _nearest(corner, e1, e2, away, direction, parallel)
        offset = sub(add(scale(u, e1), scale(v, e2)), away)
        t = dot(offset, direction) / dot(direction, direction)
    u = f32(u)
    return u, min(f32(v), f32(1) - u), t


@jit
def _placed(table, triangle):
    """The first corner of a _Triangle and its edges to the second and third, float64, world space."""
    instance, _, corners = triangle_at(table, Hit(triangle.instance, triangle.primitive, f32(0), f32(0)))
    p0, e1, e2 = edges_at(table, corners)
    m = instance + TO_WORLD
    moved = (_word(table, m + i64(3)), _word(table, m + i64(7)), _word(table, m + i64(11)))
    return add(_turned(table, m, p0), moved), _turned(table, m, e1), _turned(table, m, e2)


@jit
def _turned(table, m, x):
    """The float64 product of the left 3x3 of the matrix at word m of the instances and a vector."""
    return (
        _word(table, m) * x[0] + _word(table, m + i64(1)) * x[1] + _word(table, m + i64(2)) * x[2],
        _word(table, m + i64(4)) * x[0] + _word(table, m + i64(5)) * x[1] + _word(table, m + i64(6)) * x[2],
        _word(table, m + i64(8)) * x[0] + _word(table, m + i64(9)) * x[1] + _word(table, m + i64(10)) * x[2],
    )


@jit
def _word(table, word):
    """A float32 word of the instances as float64."""
    return f64(ldf(table[INSTANCES], word))


@jit
def _nearest(corner, e1, e2, away, direction, parallel):
    """_Barycentrics of what on a triangle is nearest to a ray on the screen, and a little within.

    corner, e1, e2  as `_placed` has them, float64;  away  from the corner to the ray's origin
    """
    x, y = _across(direction)
    least, point = f64(np.inf), _Barycentrics(f64(0), f64(0))
    for k in range(3):
        first = _Barycentrics(f64(k == 1), f64(k == 2))
        edge = _Barycentrics(f64(k == 0) - first.u, f64(k == 1) - first.v)
        last = _Barycentrics(first.u + edge.u, first.v + edge.v)
        a = _from_ray(e1, e2, away, first, x, y, direction, parallel)
        b = _from_ray(e1, e2, away, last, x, y, direction, parallel)
        (ax, ay, _), (bx, by, _), (side_x, side_y, _) = a, b, cross(a, b)
        run = -(bx - ax) * side_y + (by - ay) * side_x
        share = f64(0)
        if run != f64(0):
            share = min(max((ax * side_y - ay * side_x) / run, f64(0)), f64(1))
        at = add(a, scale(share, sub(b, a)))
        off = (at[0] * at[0] + at[1] * at[1]) / (at[2] * at[2]) if at[2] > f64(0) else f64(np.inf)
        if k == 0 or off < least:
            least = off
            point = _Barycentrics(first.u + share * edge.u, first.v + share * edge.v)
    return _within(corner, e1, e2, point)


@jit
def _across(direction):
    """Two unit vectors, float64, at right angles to a direction and each other."""
    d = scale(f64(1) / math.sqrt(dot(direction, direction)), direction)
    s = f64(1) if d[2] >= f64(0) else f64(-1)
    a = f64(-1) / (s + d[2])
    b = d[0] * d[1] * a
    return (f64(1) + s * d[0] * d[0] * a, s * b, -s * d[0]), (b, s + d[1] * d[1] * a, -d[1])


@jit
def _from_ray(e1, e2, away, point, x, y, direction, parallel):
    """Homogeneous coordinates, float64, of a triangle's point on a screen of axes x and y that the ray meets
    at 0; other arguments as of `_nearest`."""
    p = sub(add(scale(point.u, e1), scale(point.v, e2)), away)
    ahead = f64(1) if parallel else dot(p, direction) / math.sqrt(dot(direction, direction))
    return dot(p, x), dot(p, y), ahead


@jit
def _within(corner, e1, e2, point):
    """_Barycentrics of a point moved towards the center of the triangle's incircle, clear of walls at the
    edges: by _INSET of the point's largest coordinate, float64, or half of the circle's radius."""
    e3, area = sub(e2, e1), cross(e1, e2)
    a, b, c = math.sqrt(dot(e3, e3)), math.sqrt(dot(e2, e2)), math.sqrt(dot(e1, e1))
    around = max(a + b + c, f64(1e-300))
    radius = max(math.sqrt(dot(area, area)), f64(1e-300)) / around
    at = add(corner, add(scale(point.u, e1), scale(point.v, e2)))
    margin = f64(_INSET) * max(abs(at[0]), max(abs(at[1]), abs(at[2])))
    share = min(margin / radius, f64(0.5))
    return _Barycentrics(point.u + share * (b / around - point.u), point.v + share * (c / around - point.v))
