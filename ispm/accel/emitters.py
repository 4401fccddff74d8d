"""Triangles that emit light, in the order of the leaves of a tree, and points that are drawn on them.

A lamp's triangles are the leaves of a part of the tree that is its own: nodes that hold parts of two lamps
tell little of either. A triangle whose texture says how it shines is cut into equal parts, which are drawn as
triangles of their own: what is dark of a screen or a sign is hardly drawn.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ispm.accel.emitter_tree import FLOATS, TO_ALL_SIDES, WIDTH, emitter_tree, leaves_for
from ispm.accel.intersect import instance_scale
from ispm.accel.leave import leave_triangle
from ispm.accel.records import Hit
from ispm.optics.jit import jit
from ispm.optics.vector import LUMINANCE, add, cross, dot, scale, sub, vec3

f32, f64, i64, u32 = np.float32, np.float64, np.int64, np.uint32

# corner, edges: world space, m; normal: of the front, unit; radiance: mean of the face, cd/m2 RGB; lamp: m2
# of all emissive triangles of the instance; mean: of the radiance of all of them where that is textured, else
# the triangle's; axis, cone: of what it shines in, see `beam_cone`; part: of the triangle `primitive`,
# barycentrics of the corner and how long the edges are, 0, 0, 1 where it is whole.
EMITTER = np.dtype([
    ("corner", "<f4", 3), ("edge1", "<f4", 3), ("edge2", "<f4", 3), ("normal", "<f4", 3),
    ("radiance", "<f4", 3), ("area", "<f4"), ("lamp", "<f4"), ("mean", "<f4", 3),
    ("axis", "<f4", 3), ("cone", "<f4"),
    ("instance", "<u4"), ("primitive", "<u4"), ("two_sided", "<u4"), ("textured", "<u4"), ("part", "<f4", 3),
])  # fmt: skip

_SMALL = 1e-4  # sr: triangles that look smaller are drawn from by area
_WIDE = 6.0  # sr: and those that look wider, from next to them
_CURVE_BITS = 20  # of a Morton code along each axis
_SMALL_TREE = WIDTH**5  # leaves, whose nodes take 1.5 MB


class Emitters(NamedTuple):
    """The emissive triangles of a scene as kernels read them; of one without any all arrays are empty.

    triangles  (n,) EMITTER
    nodes      (m, 10, 8) float32, or (m, 14, 8), the tree, see `emitter_tree`
    leaves     (7 m + 1,) int32 of each leaf, its row in `triangles`; -1: it is empty
    places     (n,) int32 of each triangle, its leaf
    first      (I,) int32 of each instance, where its triangles begin in `rows`; -1: it does not emit
    sides      (I,) int32, parts along a side of each of its triangles
    rows       (m,) int32 of each part of each triangle of such an instance, its row in `triangles`, -1: it
               has no area
    """

    triangles: np.ndarray
    nodes: np.ndarray
    leaves: np.ndarray
    places: np.ndarray
    first: np.ndarray
    sides: np.ndarray
    rows: np.ndarray


NO_EMITTERS = Emitters(
    np.zeros(0, EMITTER),
    np.zeros((0, FLOATS, WIDTH), np.float32),
    np.zeros(0, np.int32),
    np.zeros(0, np.int32),
    np.zeros(0, np.int32),
    np.zeros(0, np.int32),
    np.zeros(0, np.int32),
)


def emitter_flux(emitters: Emitters) -> np.ndarray:
    """Return the luminous flux that each triangle sends out, (n,) float64 lm."""
    return _flux(emitters.triangles)


def _flux(triangles: np.ndarray) -> np.ndarray:
    luminance = triangles["radiance"].astype(np.float64) @ LUMINANCE
    return np.asarray(math.pi * luminance * triangles["area"] * (1.0 + triangles["two_sided"]))


def parts_of(triangles: np.ndarray, sides: int) -> np.ndarray:
    """Return the parts of n whole EMITTER, (n sides^2,), those of each after the other's, row by row."""
    rows = np.repeat(triangles, sides * sides)
    corners = np.array([
        ((i + turned) / sides, (j + turned) / sides, (1 - 2 * turned) / sides)
        for j in range(sides)
        for i in range(sides - j)
        for turned in range(2 if i < sides - j - 1 else 1)
    ])  # fmt: skip
    u, v, scale = np.tile(corners, (len(triangles), 1)).T[:, :, None].astype(np.float32)
    rows["part"] = np.tile(corners, (len(triangles), 1))
    rows["corner"] += u * rows["edge1"] + v * rows["edge2"]
    rows["edge1"], rows["edge2"] = scale * rows["edge1"], scale * rows["edge2"]
    rows["area"] /= np.float32(sides * sides)
    return rows


def make_emitters(triangles: np.ndarray, instance_count: int) -> Emitters:
    """Return the Emitters of (m,) EMITTER, whose fields but `lamp` and `mean` are set, instance by instance
    and all of each; those without area or light are left out."""
    of_lamp, textured = triangles["instance"], triangles["textured"] > 0
    lamps = np.bincount(of_lamp, triangles["area"], instance_count)
    triangles["lamp"], triangles["mean"] = lamps[of_lamp], triangles["radiance"]
    for c in range(3):
        sums = np.bincount(of_lamp, triangles["area"] * triangles["radiance"][:, c], instance_count)
        means = sums / np.maximum(lamps, 1e-300)
        triangles["mean"][textured, c] = means[of_lamp[textured]]
    shines = np.flatnonzero((triangles["area"] > 0.0) & triangles["radiance"].any(axis=1))
    if not len(shines):
        return NO_EMITTERS
    order = shines[_order(triangles[shines], instance_count)]
    first = np.full(instance_count, -1, np.int32)
    instances, begins = np.unique(triangles["instance"], return_index=True)
    first[instances], sides = begins, np.ones(instance_count, np.int32)
    sides[instances] = np.rint(1.0 / abs(triangles["part"][begins, 2]))
    rows = np.full(len(triangles), -1, np.int32)
    rows[order] = np.arange(len(order))
    kept = np.ascontiguousarray(triangles[order])
    places = _places(kept["instance"])
    nodes = _tree(kept, places)
    leaves = np.full((WIDTH - 1) * len(nodes) + 1, -1, np.int32)
    leaves[places] = np.arange(len(kept))
    return Emitters(kept, nodes, leaves, places, first, sides, rows)


def _order(triangles: np.ndarray, instance_count: int) -> np.ndarray:
    """The order of n triangles, (n,): lamps along a curve, and the triangles of each along another."""
    middles = triangles["corner"] + (triangles["edge1"] + triangles["edge2"]) / np.float32(3)
    instances, count = triangles["instance"], np.bincount(triangles["instance"], minlength=instance_count)
    sums = np.stack([np.bincount(instances, axis, instance_count) for axis in middles.T], axis=1)
    lamps = _along_curve(sums / np.maximum(count, 1)[:, None])
    return np.lexsort((_along_curve(middles), instances, lamps[instances]))


def _places(instances: np.ndarray) -> np.ndarray:
    """The leaves, (n,) int32, of triangles of these instances, one after the other: of a lamp the first ones
    below a node that is high enough and holds no other; in a row where that makes a large tree larger."""
    changes = np.flatnonzero(np.diff(instances, prepend=instances[0] + 1))
    places, end = np.empty(len(instances), np.int32), 0
    for begin, until in zip(changes, [*changes[1:], len(instances)], strict=True):
        below = leaves_for(until - begin)
        start = -(-end // below) * below
        places[begin:until] = np.arange(start, start + until - begin)
        end = start + below
    if leaves_for(end) > max(_SMALL_TREE, leaves_for(len(instances))):
        return np.arange(len(instances), dtype=np.int32)
    return places


def _along_curve(middles: np.ndarray) -> np.ndarray:
    """(n,) int64 places of points, (n, 3) m, on a Morton curve."""
    low = middles.min(axis=0)
    extent = max(float((middles.max(axis=0) - low).max()), 1e-30)
    cells = ((middles - low) * ((2**_CURVE_BITS - 1) / extent)).astype(np.int64)
    places = np.zeros(len(middles), np.int64)
    for bit in range(_CURVE_BITS):
        for axis in range(3):
            places |= (cells[:, axis] >> bit & 1) << (3 * bit + axis)
    return places


def _tree(triangles: np.ndarray, places: np.ndarray) -> np.ndarray:
    """The `nodes` over triangles at these leaves."""
    corners = triangles["corner"][:, None] + np.stack(
        [np.zeros_like(triangles["edge1"]), triangles["edge1"], triangles["edge2"]], axis=1
    )
    cosine = np.where(triangles["two_sided"] > 0, -1.0, 1.0)
    bounds = corners.min(axis=1), corners.max(axis=1)
    beam = np.tile(TO_ALL_SIDES, (len(triangles), 1))
    spots = triangles["cone"] > 0.0
    beam[spots, :3] = triangles["axis"][spots]
    beam[spots, 3] = 1.0 - triangles["cone"][spots].astype(np.float64)
    return emitter_tree(places, *bounds, triangles["normal"], cosine, _flux(triangles), beam)


@jit
def emitter_row(emitters, hit):
    """Return the row of the triangle of a Hit, or of the part there, among the emitters, int64, and the
    barycentrics in that; -1: it is none."""
    if len(emitters.first) == 0 or emitters.first[hit.instance] < 0:
        return i64(-1), hit.u, hit.v
    first, sides = i64(emitters.first[hit.instance]), i64(emitters.sides[hit.instance])
    if sides == i64(1):
        return i64(emitters.rows[first + i64(hit.primitive)]), hit.u, hit.v
    u, v = hit.u * f32(sides), hit.v * f32(sides)
    j = min(max(i64(v), i64(0)), sides - i64(1))
    i = min(max(i64(u), i64(0)), sides - i64(1) - j)
    u, v, turned = u - f32(i), v - f32(j), i64(0)
    if u + v > f32(1) and i < sides - i64(1) - j:
        u, v, turned = f32(1) - u, f32(1) - v, i64(1)
    part = j * (i64(2) * sides - j) + i64(2) * i + turned
    return i64(emitters.rows[first + i64(hit.primitive) * sides * sides + part]), u, v


@jit
def emitter_hit(emitter, u, v):
    """Return the Hit of an EMITTER's triangle at barycentrics u, v of the EMITTER."""
    part = emitter.part
    return Hit(emitter.instance, emitter.primitive, part[0] + part[2] * u, part[1] + part[2] * v)


@jit
def sample_triangle(emitter, position, u1, u2):
    """Return (u, v, pdf): barycentrics of a point of an EMITTER, drawn for a point in space, and the
    density of its direction, 1/sr; pdf 0: there is none.

    position  m;  u1, u2  uniform in [0, 1)
    Evenly over what is seen of it: Arvo, Stratified Sampling of Spherical Triangles, SIGGRAPH 1995; of what
    looks tiny, or lies about the point, evenly over its area.
    """
    a, b, c = corners_from(emitter, position)
    angle = _solid_angle(a, b, c)
    if angle <= f64(_SMALL) or angle >= f64(_WIDE):
        root = f32(math.sqrt(u1))
        u, v = root * (f32(1) - u2), root * u2
        return u, v, _by_area(emitter, position, u, v)
    a, b, c = _unit(a), _unit(b), _unit(c)
    nb, nc = _unit(cross(a, b)), _unit(cross(a, c))
    cosine = min(max(dot(nb, nc), f64(-1)), f64(1))
    alpha, sine = math.acos(cosine), math.sqrt(f64(1) - cosine * cosine)
    part = f64(u1) * angle - alpha
    s, t = math.sin(part), math.cos(part)
    side = dot(a, b)
    p, q = t - cosine, s + sine * side
    below = (q * s + p * t) * sine
    w = ((q * t - p * s) * cosine - q) / below if abs(below) > f64(1e-300) else f64(1)
    w = min(max(w, f64(-1)), f64(1))
    edge = add(scale(w, a), scale(math.sqrt(f64(1) - w * w), _unit(sub(c, scale(dot(c, a), a)))))
    z = f64(1) - f64(u2) * (f64(1) - dot(edge, b))
    across = _unit(sub(edge, scale(dot(edge, b), b)))
    d = add(scale(z, b), scale(math.sqrt(max(f64(1) - z * z, f64(0))), across))
    u, v = _met(emitter, position, d)
    return u, v, f32(f64(1) / angle)


@jit
def triangle_pdf(emitter, position, u, v):
    """Return the density, 1/sr float32, with which `sample_triangle` draws the point at barycentrics u, v."""
    angle = _solid_angle(*corners_from(emitter, position))
    if angle <= f64(_SMALL) or angle >= f64(_WIDE):
        return _by_area(emitter, position, u, v)
    return f32(f64(1) / angle)


@jit
def emitter_point(emitter, u, v):
    """Return the point of an EMITTER at barycentrics u, v; m, world space."""
    return add(vec3(emitter.corner), add(scale(u, vec3(emitter.edge1)), scale(v, vec3(emitter.edge2))))


@jit
def in_front_of(trees, emitter, u, v, d):
    """Return where a shadow ray to the point of an EMITTER at barycentrics u, v ends, m: before the lamp that
    it runs to along d, as a path would leave it."""
    n = vec3(emitter.normal)
    n = n if dot(n, d) < f32(0) else scale(f32(-1), n)
    corner, edge1, edge2 = vec3(emitter.corner), vec3(emitter.edge1), vec3(emitter.edge2)
    return leave_triangle(corner, edge1, edge2, u, v, n, instance_scale(trees, emitter.instance))


@jit
def _by_area(emitter, position, u, v):
    """Density of a direction, 1/sr, to a point that is drawn evenly over an EMITTER's area."""
    segment = sub(emitter_point(emitter, u, v), position)
    square = dot(segment, segment)
    facing = abs(dot(segment, vec3(emitter.normal)))
    return square * f32(math.sqrt(square)) / (facing * emitter.area) if facing > f32(0) else f32(0)


@jit
def corners_from(emitter, position):
    """Return an EMITTER's corners as seen from a point, float64 m."""
    p, e, f = emitter.corner, emitter.edge1, emitter.edge2
    a = (f64(p[0]) - position[0], f64(p[1]) - position[1], f64(p[2]) - position[2])
    b = (a[0] + e[0], a[1] + e[1], a[2] + e[2])
    return a, b, (a[0] + f[0], a[1] + f[1], a[2] + f[2])


@jit
def _solid_angle(a, b, c):
    """Solid angle, sr float64, of a triangle. Van Oosterom and Strackee, IEEE Transactions on Biomedical
    Engineering 1983, equation 8."""
    la, lb, lc = math.sqrt(dot(a, a)), math.sqrt(dot(b, b)), math.sqrt(dot(c, c))
    volume = abs(dot(a, cross(b, c)))
    below = la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb
    return f64(2) * math.atan2(volume, below)


@jit
def _met(emitter, position, d):
    """Barycentrics, float32, of the point of an EMITTER that a ray along d, float64, from a point meets."""
    e, f = vec3(emitter.edge1), vec3(emitter.edge2)
    from_corner = sub(position, vec3(emitter.corner))
    p = cross(d, f)
    below = dot(e, p)
    if below == f64(0):
        return f32(1 / 3), f32(1 / 3)
    u = dot(from_corner, p) / below
    v = dot(d, cross(from_corner, e)) / below
    u, v = min(max(u, f64(0)), f64(1)), min(max(v, f64(0)), f64(1))
    total = u + v
    if total > f64(1):
        u, v = u / total, v / total
    return f32(u), f32(v)


@jit
def _unit(a):
    """A vector of length 1, float64; zeros stay zeros."""
    square = dot(a, a)
    return scale(f64(1) / math.sqrt(square), a) if square > f64(0) else a
