"""Where a ray meets a triangle that a rasteriser found at its pixel or texel. Twin of stages/meet.wgsl.

In float64. Vectors are tuples.
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
from ispm.optics.vector import add, cross, dot, scale, sub

f32, f64, i64, u32 = np.float32, np.float64, np.int64, np.uint32

_INSET = 4e-6  # as in the shader
_SAME = 1e-9  # share of the way by which one triangle is not nearer than another
_FLAGS = word_of(MATERIAL, "flags")


class _Triangle(NamedTuple):
    """A triangle of an instance."""

    instance: np.uint32
    primitive: np.uint32


class _Place(NamedTuple):
    """Barycentrics of a triangle's second and third corner."""

    u: np.float64
    v: np.float64


def meet_many(
    surfaces: SurfaceTable, instance: np.ndarray, primitive: np.ndarray, origins: np.ndarray,
    directions: np.ndarray, parallel: bool,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Return barycentrics, (n, 2) float32, of the points of (n,) triangles that rays see, and how many of
    their directions' lengths away these are, (n,) float64.

    origins, directions  (n, 3) float64, world space;  parallel  see `meet`
    """
    places, along = np.empty((len(instance), 2), np.float32), np.empty(len(instance))
    arrays = (np.ascontiguousarray(a) for a in (instance, primitive, origins, directions))
    _meet_many(surfaces.addresses, *arrays, parallel, places, along)
    return places, along


@jit
def _meet_many(table, instance, primitive, origins, directions, parallel, places, along):
    for i in range(len(places)):
        origin = (origins[i, 0], origins[i, 1], origins[i, 2])
        direction = (directions[i, 0], directions[i, 1], directions[i, 2])
        u, v, t = meet(table, instance[i], primitive[i], origin, direction, parallel)
        places[i, 0], places[i, 1], along[i] = u, v, t


def meet_texels(
    surfaces: SurfaceTable, content: np.ndarray, texels: np.ndarray, origins: np.ndarray,
    directions: np.ndarray, parallel: bool,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:  # fmt: skip
    """Return what rays through (n,) texels meet: triangles, (n, 2) uint32 instance and primitive, and places
    on them and ways there as `meet_many`.

    content  (F, W, W, 2) uint32 instance, NO_HIT where nothing is, and primitive;  texels  numbers in it
    Of the opaque triangles that the 3 x 3 texels about one show, and its own, a ray takes the first that it
    meets: so rasterisers that snap corners to different grids agree, but on what no texel's neighbour shows.
    """
    found, places = np.empty((len(texels), 2), np.uint32), np.zeros((len(texels), 2), np.float32)
    along = np.zeros(len(texels))
    arrays = (np.ascontiguousarray(a) for a in (content, texels, origins, directions))
    _meet_texels(surfaces.addresses, *arrays, parallel, found, places, along)
    return found, places, along


@jit
def _meet_texels(table, content, texels, origins, directions, parallel, found, places, along):
    width = content.shape[1]
    for i in range(len(texels)):
        face, y, x = texels[i] // (width * width), texels[i] // width % width, texels[i] % width
        origin = (origins[i, 0], origins[i, 1], origins[i, 2])
        direction = (directions[i, 0], directions[i, 1], directions[i, 2])
        own = _Triangle(content[face, y, x, 0], content[face, y, x, 1])
        before = _Triangle(u32(NO_HIT), u32(0))
        best, place, t, hits = own, _Place(f64(0), f64(0)), f64(0), False
        if own.instance != u32(NO_HIT):
            place, t, hits = _on_plane(table, own, origin, direction)
        for row in range(max(y - 1, 0), min(y + 2, width)):
            for column in range(max(x - 1, 0), min(x + 2, width)):
                other = _Triangle(content[face, row, column, 0], content[face, row, column, 1])
                if other.instance == u32(NO_HIT) or other == own:
                    continue
                if other == before or _has_holes(table, other):
                    continue
                before = other
                there, way, meets = _on_plane(table, other, origin, direction)
                nearer = way < t - f64(_SAME) * abs(t) if hits else parallel or way > f64(0)
                if meets and nearer and (parallel or way > f64(0)):
                    best, place, t, hits = other, there, way, True
        found[i, 0], found[i, 1] = best
        if hits:
            places[i, 0] = place.u
            places[i, 1] = min(f32(place.v), f32(1) - places[i, 0])
            along[i] = t
        elif best.instance != u32(NO_HIT):
            places[i, 0], places[i, 1], along[i] = meet(
                table, best.instance, best.primitive, origin, direction, parallel
            )


@jit
def _has_holes(table, triangle):
    """Whether a triangle's material has holes, which are not looked into here."""
    _, material, _ = triangle_at(table, Hit(triangle.instance, triangle.primitive, f32(0), f32(0)))
    return ldu(table[MATERIALS], material + _FLAGS) & u32(MATERIAL_MASK | MATERIAL_BLEND) != u32(0)


@jit
def _on_plane(table, triangle, origin, direction):
    """Barycentrics of where a ray meets a triangle's plane, how many lengths away, and whether within it."""
    corner, e1, e2 = _placed(table, triangle)
    n = cross(e1, e2)
    square, facing = max(dot(n, n), f64(1e-300)), dot(n, direction)
    away = sub(origin, corner)
    t = -dot(n, away) / facing if facing != f64(0) else f64(0)
    way = add(away, scale(t, direction))
    u, v = dot(cross(way, e2), n) / square, dot(cross(e1, way), n) / square
    return _Place(u, v), t, facing != f64(0) and min(u, min(v, f64(1) - u - v)) >= f64(0)


@jit
def meet(table, instance, primitive, origin, direction, parallel):
    """Return the barycentrics u, v, float32, of the point of a triangle that a ray sees, and how many lengths
    of `direction` away it is.

    parallel  rays beside it have its direction; else they come from its origin
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
        way = sub(add(scale(u, e1), scale(v, e2)), away)
        t = dot(way, direction) / dot(direction, direction)
    u = f32(u)
    return u, min(f32(v), f32(1) - u), t


@jit
def _placed(table, triangle):
    """The first corner of a triangle and its edges to the second and third, world space."""
    row, _, corners = triangle_at(table, Hit(triangle.instance, triangle.primitive, f32(0), f32(0)))
    p0, e1, e2 = edges_at(table, corners)
    m = row + TO_WORLD
    moved = (_word(table, m + i64(3)), _word(table, m + i64(7)), _word(table, m + i64(11)))
    return add(_turned(table, m, p0), moved), _turned(table, m, e1), _turned(table, m, e2)


@jit
def _turned(table, m, x):
    return (
        _word(table, m) * x[0] + _word(table, m + i64(1)) * x[1] + _word(table, m + i64(2)) * x[2],
        _word(table, m + i64(4)) * x[0] + _word(table, m + i64(5)) * x[1] + _word(table, m + i64(6)) * x[2],
        _word(table, m + i64(8)) * x[0] + _word(table, m + i64(9)) * x[1] + _word(table, m + i64(10)) * x[2],
    )


@jit
def _word(table, place):
    return f64(ldf(table[INSTANCES], place))


@jit
def _nearest(corner, e1, e2, away, direction, parallel):
    """Barycentrics of what on a triangle is nearest to a ray on the screen."""
    x, y = _across(direction)
    least, place = f64(np.inf), _Place(f64(0), f64(0))
    for k in range(3):
        first = _Place(f64(k == 1), f64(k == 2))
        edge = _Place(f64(k == 0) - first.u, f64(k == 1) - first.v)
        last = _Place(first.u + edge.u, first.v + edge.v)
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
            place = _Place(first.u + share * edge.u, first.v + share * edge.v)
    return _within(corner, e1, e2, place)


@jit
def _across(direction):
    """Two unit vectors across a direction and each other."""
    d = scale(f64(1) / math.sqrt(dot(direction, direction)), direction)
    s = f64(1) if d[2] >= f64(0) else f64(-1)
    a = f64(-1) / (s + d[2])
    b = d[0] * d[1] * a
    return (f64(1) + s * d[0] * d[0] * a, s * b, -s * d[0]), (b, s + d[1] * d[1] * a, -d[1])


@jit
def _from_ray(e1, e2, away, place, x, y, direction, parallel):
    """A point of a triangle as homogeneous coordinates on a screen that the ray meets at 0."""
    p = sub(add(scale(place.u, e1), scale(place.v, e2)), away)
    ahead = f64(1) if parallel else dot(p, direction) / math.sqrt(dot(direction, direction))
    return dot(p, x), dot(p, y), ahead


@jit
def _within(corner, e1, e2, place):
    """A point of a triangle, moved towards the centre of the circle within until it is clear of walls at its
    edges."""
    e3, area = sub(e2, e1), cross(e1, e2)
    a, b, c = math.sqrt(dot(e3, e3)), math.sqrt(dot(e2, e2)), math.sqrt(dot(e1, e1))
    around = max(a + b + c, f64(1e-300))
    radius = max(math.sqrt(dot(area, area)), f64(1e-300)) / around
    at = add(corner, add(scale(place.u, e1), scale(place.v, e2)))
    margin = f64(_INSET) * max(abs(at[0]), max(abs(at[1]), abs(at[2])))
    share = min(margin / radius, f64(0.5))
    return _Place(place.u + share * (b / around - place.u), place.v + share * (c / around - place.v))
