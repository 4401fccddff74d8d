"""Rays from neighboring points to one point, together: what none of them can meet is left out once for all.

A Shaft holds the segments from its apex, where they all end, to the points of a box, where they start. The
two-level tree is gone through with it, and each ray is then met with the subtrees that it touches alone, by
the same tests: a ray is stopped exactly where `any_hit` finds that it is.

Source: Reshetov, Soupikov & Hurley, "Multi-Level Ray Tracing Algorithm", SIGGRAPH 2005, section 3.1.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ispm.accel.build import LEAF
from ispm.accel.collapse import NODE_WORDS, REFS
from ispm.accel.intersect import (
    ORDER_FIRST,
    ORDER_FIRST_KEY,
    ORDER_INSTANCE,
    ORDER_KEY,
    ROW_REACH,
    ROW_ROOT,
    ROW_WORDS,
    meet_mesh,
    of_instance,
)
from ispm.accel.records import Mesh, Ray, Scratch
from ispm.kernels.simd import (
    alloca,
    count_trailing_zeros,
    data,
    ldf,
    ldq,
    ldu,
    mask_le,
    splat8,
    stf,
    stq,
    stu,
    vfma,
    vload8,
    vmax,
    vmin,
)
from ispm.optics.jit import jit

f32, i64, u32, u64 = np.float32, np.int64, np.uint32, np.uint64

MOST = 32  # subtrees that are worth listing, of 8, 16 and 32; with more each ray goes through the whole tree
_LOW = np.uint64(0xFFFFFFFF)
_NO_KEY = np.uint64(0xFFFFFFFFFFFFFFFF)
_NEAREST = f32(1e-30)
_SMALLEST = f32(1e-18)
_FAR = f32(1e30)
# Boxes grow by this share of the largest coordinates met: 8 roundings as for a ray, and 3 of its direction.
_SLACK = f32(1.5 * 2.0**-21)


class Side(NamedTuple):
    """What a plane of boxes says of the shares of the way from the apex to a start at which segments are
    between the planes: none below `rate` x + `near`, none above `up_to` x + `far`; float32 in eight lanes."""

    rate: Any
    near: Any
    up_to: Any
    far: Any


class Shaft(NamedTuple):
    """The segments between an apex and a box: a Side for lower and one for upper planes of each axis."""

    lower_x: Side
    upper_x: Side
    lower_y: Side
    upper_y: Side
    lower_z: Side
    upper_z: Side


@jit
def _side(apex, start, slack):
    """The Side of planes that segments to `start`, the farthest along or against an axis, are bound by.

    slack  m, by which the planes are farther out: below 0 for lower ones
    """
    d = start - apex
    r = f32(1) / (d if abs(d) > _SMALLEST else (_SMALLEST if d >= f32(0) else -_SMALLEST))
    offset = (slack - apex) * r
    is_near = (r > f32(0)) == (slack < f32(0))
    none, rate, offset = splat8(f32(0)), splat8(r), splat8(offset)
    if is_near:
        return Side(rate, offset, none, splat8(_FAR))
    return Side(none, splat8(-_FAR), rate, offset)


@jit
def shaft(apex, low, high, reach):
    """Return the Shaft from an apex to a box, m; reach: largest coordinate of the boxes that it meets."""
    (ax, ay, az), (lx, ly, lz), (hx, hy, hz) = apex, low, high
    x = _SLACK * (abs(ax) + max(abs(lx), abs(hx)) + reach)
    y = _SLACK * (abs(ay) + max(abs(ly), abs(hy)) + reach)
    z = _SLACK * (abs(az) + max(abs(lz), abs(hz)) + reach)
    # a lower plane lies below what goes highest
    sides_x, sides_y = (_side(ax, hx, -x), _side(ax, lx, x)), (_side(ay, hy, -y), _side(ay, ly, y))
    return Shaft(*sides_x, *sides_y, _side(az, hz, -z), _side(az, lz, z))


@jit(inline=True)
def _between(side, planes, near, far):
    """The shares from near to far that a Side leaves."""
    return vmax(near, vfma(planes, side.rate, side.near)), vmin(far, vfma(planes, side.up_to, side.far))


@jit
def _go_through(nodes, root, shaft, instance, stack, refs, count):
    """List the leaves that a Shaft meets below a root, each with its instance; -1: there is no room.

    instance  int64; -1: the leaves are instances
    refs      address of words instance << 32 | ref, of which `count` are listed; -> how many are then
    """
    waiting, ref = i64(0), i64(root)
    while True:
        if (ref & i64(LEAF)) != 0:
            if count == MOST:
                return i64(-1)
            stq(refs, count, u64(ref) if instance < i64(0) else (u64(instance) << u64(32)) | u64(ref))
            count += i64(1)
        else:
            word = ref * NODE_WORDS
            near, far = splat8(f32(0)), splat8(f32(1.0 + 2.0**-20))
            near, far = _between(shaft.lower_x, vload8(nodes, word), near, far)
            near, far = _between(shaft.upper_x, vload8(nodes, word + 8), near, far)
            near, far = _between(shaft.lower_y, vload8(nodes, word + 16), near, far)
            near, far = _between(shaft.upper_y, vload8(nodes, word + 24), near, far)
            near, far = _between(shaft.lower_z, vload8(nodes, word + 32), near, far)
            near, far = _between(shaft.upper_z, vload8(nodes, word + 40), near, far)
            met = i64(mask_le(near, far))
            while met != 0:
                k = i64(count_trailing_zeros(u32(met)))
                met &= met - 1
                stq(stack, waiting, u64(ldu(nodes, word + REFS + k)))
                waiting += i64(1)
        if waiting == i64(0):
            return count
        waiting -= i64(1)
        ref = i64(ldq(stack, waiting))


@jit
def list_met(trees, apex, low, high, stack, refs):
    """List the leaves of meshes that segments from the points of a box to an apex, m, may meet.

    stack  of STACK_WORDS;  refs  address of MOST words, for `is_stopped`
    ->     how many; -1: too many
    """
    rows, found = data(trees.rows), alloca(MOST)
    count = _go_through(
        data(trees.top), i64(0), shaft(apex, low, high, trees.reach), i64(-1), stack, found, i64(0)
    )
    total = i64(0)
    for k in range(count):
        instance = i64(ldq(found, k)) & i64(0x7FFFFFF)
        m = rows + u64(4 * ROW_WORDS) * u64(instance)
        top, lower, upper, rounded = _placed(m, apex, low, high)
        of_mesh = shaft(top, lower, upper, ldf(m, ROW_REACH) + rounded)
        total = _go_through(data(trees.nodes), i64(ldu(m, ROW_ROOT)), of_mesh, instance, stack, refs, total)
        if total < i64(0):
            break
    return total if count >= i64(0) else count


@jit
def _placed(m, apex, low, high):
    """An apex and the sides of a box in the space of the instance whose row is at the address `m`, and the
    largest number, m, of which rounding errors there are a share."""
    center = f32(0.5) * (low[0] + high[0]), f32(0.5) * (low[1] + high[1]), f32(0.5) * (low[2] + high[2])
    half = high[0] - center[0], high[1] - center[1], high[2] - center[2]
    (top, _), (middle, _) = of_instance(m, apex, half), of_instance(m, center, half)
    x, y, z = _spread(m, 0, half), _spread(m, 4, half), _spread(m, 8, half)
    along_x, along_y = _largest(apex, center, 0) + half[0], _largest(apex, center, 1) + half[1]
    sizes = along_x, along_y, _largest(apex, center, 2) + half[2]
    a, b, c = _spread(m, 0, sizes), _spread(m, 4, sizes), _spread(m, 8, sizes)
    rounded = max(a + abs(ldf(m, 3)), max(b + abs(ldf(m, 7)), c + abs(ldf(m, 11))))
    least, most = (middle[0] - x, middle[1] - y, middle[2] - z), (middle[0] + x, middle[1] + y, middle[2] + z)
    return top, least, most, rounded


@jit
def _spread(m, word, half):
    """How far a box reaches from its middle, m, along the axis of a matrix's row from `word` on."""
    return abs(ldf(m, word)) * half[0] + abs(ldf(m, word + 1)) * half[1] + abs(ldf(m, word + 2)) * half[2]


@jit
def _largest(a, b, axis):
    """The larger one of two coordinates, without signs."""
    return max(abs(a[axis]), abs(b[axis]))


@jit
def is_stopped(trees, ray, refs, count, stack):
    """Return whether anything that `list_met` has listed lies on a Ray before its end; arguments likewise."""
    rows, order = data(trees.rows), alloca(3)
    stq(order, ORDER_KEY, u64(0))
    stq(order, ORDER_FIRST_KEY, _NO_KEY)
    stf(order, ORDER_FIRST, _NEAREST)
    scratch = Scratch(stack, alloca(2))
    for k in range(count):
        word = ldq(refs, k)
        m = rows + u64(4 * ROW_WORDS) * (word >> u64(32))
        stu(order, ORDER_INSTANCE, u32(word >> u64(32)))
        mesh = Mesh(data(trees.nodes), data(trees.blocks), u32(word & _LOW), ldf(m, ROW_REACH))
        origin, direction = of_instance(m, ray.origin, ray.direction)
        if meet_mesh(mesh, Ray(origin, direction, ray.t_max), True, scratch, i64(0), order) < ray.t_max:
            return True
    return False
