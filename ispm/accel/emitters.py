"""Triangles that emit light, and a tree by which they are drawn for a point that they may light.

The tree is binary, complete and lies in one array, node k above 2 k and 2 k + 1, its leaves in the order of
a curve through space. A node knows how much light its triangles send out, where they are and where they face;
from that an importance for a point is made, and a triangle is drawn by going down, at each node to either
side with a chance in proportion to it.
Source: Conty Estevez and Kulla, Importance Sampling of Many Lights with Adaptive Tree Splitting, HPG 2018.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ispm.optics.jit import jit
from ispm.optics.vector import LUMINANCE, add, cross, dot, scale, sub, vec3

f32, f64, i64, u32 = np.float32, np.float64, np.int64, np.uint32

# corner, edges: world space, m; normal: of the front, unit; radiance: mean of the face, cd/m2 RGB; lamp: m2
# of all emissive triangles of the instance; axis, cone: of what it shines in, see `beam_cone`.
EMITTER = np.dtype([
    ("corner", "<f4", 3), ("edge1", "<f4", 3), ("edge2", "<f4", 3), ("normal", "<f4", 3),
    ("radiance", "<f4", 3), ("area", "<f4"), ("lamp", "<f4"),
    ("axis", "<f4", 3), ("cone", "<f4"),
    ("instance", "<u4"), ("primitive", "<u4"), ("two_sided", "<u4"), ("textured", "<u4"),
])  # fmt: skip

# A sphere about triangles, the cone about their normals, whose half angle has this cosine, and their luminous
# flux, lm, 0 where there are none.
EMITTER_NODE = np.dtype([
    ("center", "<f4", 3), ("radius", "<f4"), ("axis", "<f4", 3), ("cosine", "<f4"), ("power", "<f4"),
])  # fmt: skip

_SMALL = 1e-4  # sr: triangles that look smaller are drawn from by area
_WIDE = 6.0  # sr: and those that look wider, from next to them
_CURVE_BITS = 20  # of a Morton code along each axis


class Emitters(NamedTuple):
    """The emissive triangles of a scene as kernels read them; of one without any all arrays are empty.

    triangles  (n,) EMITTER
    nodes      (2 w,) EMITTER_NODE, w the least power of two from n on; node 1 is the root, w + k the leaf of
               triangle k
    first      (I,) int32 of each instance, where its triangles begin in `rows`; -1: it does not emit
    rows       (m,) int32 of each triangle of such an instance, its row in `triangles`, -1: it has no area
    """

    triangles: np.ndarray
    nodes: np.ndarray
    first: np.ndarray
    rows: np.ndarray


NO_EMITTERS = Emitters(
    np.zeros(0, EMITTER), np.zeros(0, EMITTER_NODE), np.zeros(0, np.int32), np.zeros(0, np.int32)
)


def emitter_flux(emitters: Emitters) -> np.ndarray:
    """Return the luminous flux that each triangle sends out, (n,) float64 lm."""
    triangles = emitters.triangles
    luminance = triangles["radiance"].astype(np.float64) @ LUMINANCE
    return np.asarray(math.pi * luminance * triangles["area"] * (1.0 + triangles["two_sided"]))


def make_emitters(triangles: np.ndarray, instance_count: int) -> Emitters:
    """Return the Emitters of (m,) EMITTER, whose fields but `lamp` are set, instance by instance and all of
    each; those without area or light are left out."""
    lamps = np.bincount(triangles["instance"], triangles["area"], instance_count)
    triangles["lamp"] = lamps[triangles["instance"]]
    shines = np.flatnonzero((triangles["area"] > 0.0) & triangles["radiance"].any(axis=1))
    if not len(shines):
        return NO_EMITTERS
    order = shines[np.argsort(_along_curve(triangles[shines]), kind="stable")]
    first = np.full(instance_count, -1, np.int32)
    instances, begins = np.unique(triangles["instance"], return_index=True)
    first[instances] = begins
    rows = np.full(len(triangles), -1, np.int32)
    rows[order] = np.arange(len(order))
    kept = np.ascontiguousarray(triangles[order])
    return Emitters(kept, _nodes(Emitters(kept, NO_EMITTERS.nodes, first, rows)), first, rows)


def _along_curve(triangles: np.ndarray) -> np.ndarray:
    """(n,) int64 places of the triangles' middles on a Morton curve."""
    middles = triangles["corner"] + (triangles["edge1"] + triangles["edge2"]) / np.float32(3)
    low = middles.min(axis=0)
    extent = max(float((middles.max(axis=0) - low).max()), 1e-30)
    cells = ((middles - low) * ((2**_CURVE_BITS - 1) / extent)).astype(np.int64)
    places = np.zeros(len(triangles), np.int64)
    for bit in range(_CURVE_BITS):
        for axis in range(3):
            places |= (cells[:, axis] >> bit & 1) << (3 * bit + axis)
    return places


def _nodes(emitters: Emitters) -> np.ndarray:
    """(2 w,) EMITTER_NODE of triangles in the order of the leaves."""
    triangles = emitters.triangles
    count = len(triangles)
    width = 1 << max(count - 1, 0).bit_length()
    nodes = np.zeros(2 * width, EMITTER_NODE)
    low, high = np.full((2 * width, 3), np.inf), np.full((2 * width, 3), -np.inf)
    corners = triangles["corner"][:, None] + np.stack(
        [np.zeros_like(triangles["edge1"]), triangles["edge1"], triangles["edge2"]], axis=1
    )
    leaves = slice(width, width + count)
    low[leaves], high[leaves] = corners.min(axis=1), corners.max(axis=1)
    power, axis = np.zeros(2 * width), np.zeros((2 * width, 3))
    cosine = np.ones(2 * width)
    power[leaves], axis[leaves] = emitter_flux(emitters), triangles["normal"]
    cosine[leaves] = np.where(triangles["two_sided"] > 0, -1.0, 1.0)
    begin = width
    while begin > 1:
        left, right = np.arange(begin, 2 * begin, 2), np.arange(begin + 1, 2 * begin, 2)
        above = left // 2
        low[above], high[above] = np.minimum(low[left], low[right]), np.maximum(high[left], high[right])
        power[above] = power[left] + power[right]
        axis[above], cosine[above] = _cones(axis, cosine, power, left, right)
        begin //= 2
    used = power > 0.0
    nodes["center"][used] = (low[used] + high[used]) / 2.0
    nodes["radius"][used] = np.linalg.norm(high[used] - low[used], axis=1) * (0.5 + 1e-6)
    nodes["axis"], nodes["cosine"], nodes["power"] = axis, cosine, power
    return nodes


def _cones(
    axis: np.ndarray, cosine: np.ndarray, power: np.ndarray, left: np.ndarray, right: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Axes and cosines of cones about those of pairs of nodes; of an empty node the other's.
    Conty Estevez and Kulla, algorithm 1."""
    wide = np.where(cosine[left] <= cosine[right], left, right)
    other = left + right - wide
    alone = (power[left] == 0.0) | (power[right] == 0.0)
    held = np.where(power[left] > 0.0, left, right)
    half_wide, half_other = (np.arccos(np.clip(cosine[k], -1.0, 1.0)) for k in (wide, other))
    between = np.arccos(np.clip(np.einsum("nk,nk->n", axis[wide], axis[other]), -1.0, 1.0))
    half = (half_wide + between + half_other) / 2.0
    within = np.minimum(between + half_other, math.pi) <= half_wide
    turn = half - half_wide
    across = axis[other] - np.cos(between)[:, None] * axis[wide]
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-30)
    turned = np.cos(turn)[:, None] * axis[wide] + np.sin(turn)[:, None] * across
    # Opposite axes have no plane to turn in.
    all_around = (half >= math.pi) | (between > math.pi - 1e-6)
    new_axis = np.where((within | all_around)[:, None], axis[wide], turned)
    new_cosine = np.where(within, cosine[wide], np.where(all_around, -1.0, np.cos(half)))
    return np.where(alone[:, None], axis[held], new_axis), np.where(alone, cosine[held], new_cosine)


@jit
def draw_emitter(emitters, position, n, u):
    """Return (row, chance, u) of a triangle that may light a point, drawn by u of [0, 1): its row in
    `triangles`, int64, -1: none may; the chance of that, float32; and u, uniform again.

    position  m;  n  unit, on the side that is lit; zeros: both sides are
    """
    nodes = emitters.nodes
    if len(nodes) == 0 or _importance(nodes[1], position, n) <= f32(0):
        return i64(-1), f32(0), u
    k, chance, count = i64(1), f32(1), i64(len(nodes) // 2)
    while k < count:
        k *= i64(2)
        left = _importance(nodes[k], position, n)
        total = left + _importance(nodes[k + 1], position, n)
        if total <= f32(0):
            return i64(-1), f32(0), u
        share = left / total
        if u < share:
            u, chance = u / share, chance * share
        else:
            u, chance = (u - share) / (f32(1) - share), chance * (f32(1) - share)
            k += i64(1)
        u = min(u, f32(1 - 2.0**-24))
    return k - count, chance, u


@jit
def emitter_chance(emitters, row, position, n):
    """Return the chance, float32, that `draw_emitter` draws a row for a point."""
    nodes = emitters.nodes
    k, chance = i64(len(nodes) // 2) + row, f32(1)
    while k > i64(1):
        own = _importance(nodes[k], position, n)
        total = own + _importance(nodes[k ^ i64(1)], position, n)
        if total <= f32(0):
            return f32(0)
        chance *= own / total
        k >>= i64(1)
    return chance if _importance(nodes[1], position, n) > f32(0) else f32(0)


@jit
def emitter_row(emitters, instance, primitive):
    """Return the row of a triangle among the emitters, int64; -1: it is none."""
    if len(emitters.first) == 0:
        return i64(-1)
    first = i64(emitters.first[instance])
    return i64(-1) if first < i64(0) else i64(emitters.rows[first + i64(primitive)])


@jit
def _importance(node, position, n):
    """About what an EMITTER_NODE brings to a point, up to a factor; 0 only where it brings nothing.

    Of the bounds on its triangles' cosines there and at the point, over the squared distance.
    Conty Estevez and Kulla, section 4.
    """
    if node.power <= f32(0):
        return f32(0)
    segment = sub(vec3(node.center), position)
    square, radius = dot(segment, segment), node.radius
    if square <= radius * radius:
        return node.power / max(radius * radius, f32(1e-30))
    distance = f32(math.sqrt(square))
    sine_seen = radius / distance
    cosine_seen = f32(math.sqrt(max(f32(1) - sine_seen * sine_seen, f32(0))))
    facing = dot(vec3(node.axis), segment) / -distance
    sine_cone = f32(math.sqrt(max(f32(1) - node.cosine * node.cosine, f32(0))))
    cosine = _less(facing, node.cosine, sine_cone)
    cosine = _less(cosine, cosine_seen, sine_seen)
    if cosine <= f32(0):
        return f32(0)
    lit = f32(1)
    if n[0] != f32(0) or n[1] != f32(0) or n[2] != f32(0):
        lit = _less(dot(n, segment) / distance, cosine_seen, sine_seen)
    return max(lit, f32(0)) * cosine * node.power / square


@jit
def _less(cosine, by_cosine, by_sine):
    """Cosine of an angle made smaller by another, not below 0; float32."""
    if cosine >= by_cosine:
        return f32(1)
    sine = f32(math.sqrt(max(f32(1) - cosine * cosine, f32(0))))
    return cosine * by_cosine + sine * by_sine


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
