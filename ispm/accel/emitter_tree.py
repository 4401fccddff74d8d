"""A tree over triangles that emit light, by which they are drawn for a point that they may light.

The tree is complete, but not all leaves hold a triangle. A node knows how much light its
triangles send out, where they are and where they face; from that an importance for a point is made, and a
triangle is drawn by going down, at each node to one of its eight children with a chance in proportion to it.
In kernels `emitters` is Emitters, `n` a unit normal on the side that is lit, zeros where both sides are,
`lobe` a Lobe that reflects the light, and `importances` the address of eight float32, of 16 for a lobe.
Source: Conty Estevez and Kulla, Importance Sampling of Many Lights with Adaptive Tree Splitting, HPG 2018,
whose tree is binary: eight importances take little longer than one.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ispm.kernels.simd import (
    aligned,
    alloca,
    data,
    ldf,
    splat8,
    stf,
    vdiv,
    vfma,
    vload8,
    vmax,
    vmin,
    vmul,
    vsqrt,
    vstore8,
    vsub,
    vwhere,
)
from ispm.optics.jit import jit
from ispm.optics.vector import Vector

f32, i64, u64 = np.float32, np.int64, np.uint64

# Floats of a node, in eight lanes those of a node's children: a sphere about triangles, m; the cone about
# their normals, whose half angle has this cosine and sine; and their luminous flux, lm, 0 where none is.
_CENTER, _RADIUS, _AXIS, _COSINE, _SINE, _POWER, FLOATS = 0, 3, 4, 7, 8, 9, 10
# And where there are spots: the axis of the cone that all of a child's triangles shine in, and the cosine of
# its half angle, -1 where they shine to all sides. Their flux counts as often as such cones fill a sphere.
_BEAM, _BEAM_COSINE, FLOATS_OF_SPOTS = 10, 13, 14
TO_ALL_SIDES = 0.0, 0.0, 0.0, -1.0
_AT_EDGE = 1e-5  # of that cosine, by which rounding may err
WIDTH, _LEVELS = 8, 3  # children of a node, and levels of a binary tree that they stand for

_SPREAD = f32(0.25)  # alpha^2 of half vectors to a sphere, over the square of the sine they differ by

# Of a path down the tree for each level 64 bytes: importances of eight children, and the node's own numbers.
PATH_WORDS = 8 * 11  # uint64: more levels than 2^32 triangles have
_TOTAL, _LEAST, _CHANCE = 8, 9, 10


class Lobe(NamedTuple):
    """A GGX lobe by which light is weighed.

    n, wo   shading normal, and where the light goes, unit
    square  of alpha; 0: there is none, light counts from all directions alike
    """

    n: Vector
    wo: Vector
    square: np.float32


_ZERO = f32(0), f32(0), f32(0)
NO_LOBE = Lobe(_ZERO, _ZERO, f32(0))


def emitter_tree(
    places: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    axis: np.ndarray,
    cosine: np.ndarray,
    power: np.ndarray,
    beam: np.ndarray,
) -> np.ndarray:
    """Return the tree over n triangles, (m, 10, 8) float32, or (m, 14, 8) where there are spots: of each node
    above leaves its eight children, see _CENTER. Node 0 is the root, the children of node k are 8 k + 1 to
    8 k + 8, and m + k is leaf k.

    places     (n,) the leaf of each, rising
    low, high  (n, 3) m, corners of its box;  axis, cosine  (n, 3) and (n,) of the cone about its normals
    power      (n,) lm
    beam       (n, 4) axis of the cone that it shines in, and the cosine of half its angle, or TO_ALL_SIDES
    """
    width = max(leaves_for(int(places[-1]) + 1), WIDTH)

    def above(leaves: np.ndarray, empty: float | tuple[float, ...]) -> np.ndarray:
        """Of a binary tree, where node k lies above 2 k and 2 k + 1: set are those of triangles."""
        values = np.full((2 * width, *leaves.shape[1:]), empty)
        values[width + places] = leaves
        return values

    low, high, axis = above(low, np.inf), above(high, -np.inf), above(axis, 0.0)
    cosine, power, beam = above(cosine, 1.0), above(power, 0.0), above(beam, TO_ALL_SIDES)
    begin = width
    while begin > 1:
        left, right = np.arange(begin, 2 * begin, 2), np.arange(begin + 1, 2 * begin, 2)
        both = left // 2
        low[both], high[both] = np.minimum(low[left], low[right]), np.maximum(high[left], high[right])
        power[both] = power[left] + power[right]
        axis[both], cosine[both] = _cones(axis, cosine, power, left, right)
        beam[both] = _beams(beam, power, left, right)
        begin //= 2
    has_spots = (beam[:, 3] > -1.0).any()
    nodes, used = np.zeros((2 * width, FLOATS_OF_SPOTS if has_spots else FLOATS)), power > 0.0
    nodes[used, _CENTER:_RADIUS] = (low[used] + high[used]) / 2.0
    nodes[used, _RADIUS] = np.linalg.norm(high[used] - low[used], axis=1) * (0.5 + 1e-6)
    nodes[:, _AXIS:_COSINE], nodes[:, _COSINE], nodes[:, _POWER] = axis, cosine, power
    nodes[:, _SINE] = np.sqrt(np.maximum(1.0 - cosine * cosine, 0.0))
    if has_spots:
        nodes[:, _BEAM:] = beam - np.array([0.0, 0.0, 0.0, _AT_EDGE])
        nodes[:, _POWER] *= 2.0 / (1.0 - beam[:, 3])
    depths = range(_LEVELS, (2 * width).bit_length() - 1, _LEVELS)
    children = np.concatenate([nodes[1 << depth : 2 << depth] for depth in depths])
    children = children.reshape(-1, WIDTH, nodes.shape[1]).transpose(0, 2, 1)
    kept = aligned(children.size).reshape(children.shape)  # as vectors are loaded
    kept[:] = children
    return kept


def leaves_for(count: int) -> int:
    """Return how many leaves a tree has, or a part of one, that holds so many triangles."""
    leaves = 1
    while leaves < count:
        leaves *= WIDTH
    return leaves


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


def _beams(beam: np.ndarray, power: np.ndarray, left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """The cones, (n, 4), that both nodes of pairs shine in; of an empty node the other's."""
    shared = np.where((power[left] > 0.0)[:, None], beam[left], beam[right])
    differ = (power[left] > 0.0) & (power[right] > 0.0) & (beam[left] != beam[right]).any(axis=1)
    return np.where(differ[:, None], TO_ALL_SIDES, shared)


@jit
def draw_emitter(emitters, position, n, lobe, u):
    """Return (row, chance, u) of a triangle that may light a point, drawn by u of [0, 1): its row in
    `triangles`, int64, -1: none may; the chance of that, float32; and u, uniform again.

    position  m
    """
    k, chance, count = i64(0), f32(1), i64(len(emitters.nodes))
    if count == 0:
        return i64(-1), chance, u
    importances = alloca(8)
    while k < count:
        total = _importances_ahead(emitters.nodes, k, position, n, lobe, importances)
        if total <= f32(0):
            return i64(-1), chance, u
        child, share, below = _child(importances, total, u)
        u = min(max((u - below) / share, f32(0)), f32(1 - 2.0**-24))
        chance *= share
        k = WIDTH * k + i64(1) + child
    return i64(emitters.leaves[k - count]), chance, u


@jit
def draw_next(emitters, position, n, u, k, level, path):
    """Return (row, chance, least, k, level) of the triangle that `draw_emitter` draws by u for no lobe, where
    others were drawn for the same point by lesser numbers: that takes a part of the time alone.

    k, level   of the last draw's path; of the first: 0, -1
    path       address of PATH_WORDS uint64
    ->         row; chance of the triangle, or where `row` is -1 that of none, and the least number that does
               the same, float32: from there as many do as the chance says
    """
    count, chance, least = i64(len(emitters.nodes)), f32(1), f32(0)
    while level > i64(0) and u >= ldf(path, 16 * level + _LEAST) + ldf(path, 16 * level + _CHANCE):
        k, level = (k - i64(1)) // WIDTH, level - i64(1)
    is_known = level >= i64(0)
    if is_known:
        chance, least = ldf(path, 16 * level + _CHANCE), ldf(path, 16 * level + _LEAST)
    else:
        level = i64(0)
    while k < count:
        own = path + u64(64) * u64(level)
        if not is_known:
            stf(own, _TOTAL, _importances(emitters.nodes, k, position, n, NO_LOBE, own))
            stf(own, _LEAST, least)
            stf(own, _CHANCE, chance)
        total, is_known = ldf(own, _TOTAL), False
        if total <= f32(0):
            return i64(-1), chance, least, k, level
        child, share, below = _child(own, total, (u - least) / chance)
        least += chance * below
        chance *= share
        if WIDTH * k + i64(1) + child >= count:
            leaf = WIDTH * k + i64(1) + child - count
            return i64(emitters.leaves[leaf]), chance, least, k, level
        k, level = WIDTH * k + i64(1) + child, level + i64(1)
    return i64(-1), chance, least, k, level


@jit
def _child(importances, total, u):
    """Return (child, share, below): which of eight children u of [0, 1) draws, int64, the chance of that and
    that of those before it, float32. `total`, above 0, is the sum of their importances."""
    at, child, until, own = u * total, i64(0), f32(0), f32(0)
    for lane in range(WIDTH):
        importance = ldf(importances, lane)
        if importance > f32(0) and (own == f32(0) or at >= until):
            child, own = i64(lane), importance
            until += importance
    return child, own / total, (until - own) / total


@jit
def emitter_chance(emitters, row, position, n, lobe):
    """Return the chance, float32, that `draw_emitter` draws a row for a point."""
    importances, k, chance = alloca(8), i64(len(emitters.nodes)) + i64(emitters.places[row]), f32(1)
    while k > i64(0):
        k -= i64(1)
        lane, k = k % WIDTH, k // WIDTH
        total = _importances_ahead(emitters.nodes, k, position, n, lobe, importances)
        if total <= f32(0):
            return f32(0)
        chance *= ldf(importances, lane) / total
    return chance


@jit
def _importances_ahead(nodes, k, position, n, lobe, importances):
    """`_importances`; for a lobe those of children are the sums of their own children's, for a wide sphere
    does not tell whether what it holds is where the lobe reflects it."""
    total, children = _importances(nodes, k, position, n, lobe, importances), WIDTH * k + i64(1)
    if lobe.square == f32(0) or children >= len(nodes):
        return total
    total = f32(0)
    for lane in range(WIDTH):
        if ldf(importances, lane) > f32(0):
            value = _importances(nodes, children + lane, position, n, lobe, importances + u64(4 * WIDTH))
            stf(importances, lane, value)
            total += value
    return total


@jit
def _importances(nodes, k, position, n, lobe, importances):
    """Write about what each of the children of node k brings to a point, up to a factor, and return the sum,
    float32; 0 only where they bring nothing.

    Of the bounds on its triangles' cosines there and at the point, over the squared distance; nothing comes
    from spots beyond their cones.
    Conty Estevez and Kulla, section 4.
    """
    own, none = data(nodes) + u64(4 * WIDTH * nodes.shape[1]) * u64(k), splat8(f32(0))
    x = vsub(vload8(own, 8 * _CENTER), splat8(position[0]))
    y = vsub(vload8(own, 8 * _CENTER + 8), splat8(position[1]))
    z = vsub(vload8(own, 8 * _CENTER + 16), splat8(position[2]))
    square, radius, power = _dots(x, y, z, x, y, z), vload8(own, 8 * _RADIUS), vload8(own, 8 * _POWER)
    inverse = vdiv(splat8(f32(1)), vsqrt(square))
    sine_seen = vmul(radius, inverse)
    cosine_seen = _other(sine_seen)
    axis = vload8(own, 8 * _AXIS), vload8(own, 8 * _AXIS + 8), vload8(own, 8 * _AXIS + 16)
    facing = vsub(none, vmul(_dots(axis[0], axis[1], axis[2], x, y, z), inverse))
    cosine = _less(facing, vload8(own, 8 * _COSINE), vload8(own, 8 * _SINE))
    bound = vmax(_less(cosine, cosine_seen, sine_seen), none)
    if n[0] != f32(0) or n[1] != f32(0) or n[2] != f32(0):
        lit = vmul(_dots(splat8(n[0]), splat8(n[1]), splat8(n[2]), x, y, z), inverse)
        bound = vmul(bound, vmax(_less(lit, cosine_seen, sine_seen), none))
    outside = vmul(vmul(bound, power), vmul(inverse, inverse))
    if nodes.shape[1] > FLOATS:
        along = vload8(own, 8 * _BEAM), vload8(own, 8 * _BEAM + 8), vload8(own, 8 * _BEAM + 16)
        within = vsub(none, vmul(_dots(along[0], along[1], along[2], x, y, z), inverse))
        within, edge = _less(within, cosine_seen, sine_seen), vload8(own, 8 * _BEAM_COSINE)
        outside = vwhere(edge, within, outside, none)
    reach = vmul(radius, radius)
    inside = vdiv(power, vmax(reach, splat8(f32(1e-30))))
    if lobe.square > f32(0):
        outside = vmul(outside, _seen_by_lobe(lobe, x, y, z, inverse, sine_seen))
        inside = vmul(inside, splat8(lobe.square / (lobe.square + _SPREAD)))
    value = vwhere(square, reach, inside, outside)
    value = vwhere(power, none, none, value)
    vstore8(importances, 0, value)
    total = f32(0)
    for lane in range(WIDTH):
        total += ldf(importances, lane)
    return total


@jit(inline=True)
def _seen_by_lobe(lobe, x, y, z, inverse, sine_seen):
    """About the means of GGX's D, over its peak, on directions to spheres, of eight lanes: that of facets as
    rough as the lobe's and the half vectors' spread together. These turn by what wi does over |wo + wi|."""
    nx, ny, nz = lobe.n
    hx = vfma(x, inverse, splat8(lobe.wo[0]))
    hy = vfma(y, inverse, splat8(lobe.wo[1]))
    hz = vfma(z, inverse, splat8(lobe.wo[2]))
    one, none = splat8(f32(1)), splat8(f32(0))
    over_length = vdiv(one, vsqrt(vmax(_dots(hx, hy, hz, hx, hy, hz), splat8(f32(1e-12)))))
    cosine = vmax(vmul(_dots(splat8(nx), splat8(ny), splat8(nz), hx, hy, hz), over_length), none)
    spread = vmin(vmul(sine_seen, over_length), one)
    square = vfma(vmul(spread, spread), splat8(_SPREAD), splat8(lobe.square))
    peak = vdiv(square, vfma(vmul(cosine, cosine), vsub(square, one), one))
    return vmul(vmul(peak, peak), vdiv(splat8(lobe.square), square))


@jit(inline=True)
def _dots(a, b, c, x, y, z):
    """Dot products of (a, b, c) and (x, y, z), of eight lanes."""
    return vfma(a, x, vfma(b, y, vmul(c, z)))


@jit(inline=True)
def _other(sine):
    """The cosines of sines, or the other way round, of eight lanes."""
    return vsqrt(vmax(vsub(splat8(f32(1)), vmul(sine, sine)), splat8(f32(0))))


@jit(inline=True)
def _less(cosine, by_cosine, by_sine):
    """Cosines of angles made smaller by others, not below 0, of eight lanes."""
    turned = vfma(cosine, by_cosine, vmul(_other(cosine), by_sine))
    return vwhere(by_cosine, cosine, splat8(f32(1)), turned)
