"""Rays against the two-level tree, for other kernels to call.

Boxes are met conservatively and triangles with their edges: what a ray does at an edge depends on the
edge alone, so it never passes between two triangles that share it. Hits come in order of distance, and at
the same distance in order of instance and triangle. In kernels `trees` is a Trees; `nodes`, `blocks`,
`keys`, `stack` and `order` are uint64 addresses; a ref, int64, is a node or leaf as `accel.collapse` has it;
`waiting` counts the uint64 words of the stack that are in use.

Source of the boxes: Ize, "Robust BVH ray traversal", 2013.
"""

from __future__ import annotations

import numpy as np

from ispm.accel.build import LEAF, MAX_DEPTH
from ispm.accel.collapse import BLOCK_WORDS, IDS, NEEDLE, NODE_WORDS, REFS
from ispm.accel.records import Hit, Mesh, Ray, Scratch, Slab, Slabs
from ispm.accel.triangle import Shear, meet_block, meet_needle
from ispm.kernels.simd import (
    alloca,
    count_trailing_zeros,
    data,
    f2u,
    ldf,
    ldq,
    ldu,
    mask_inside,
    mask_le,
    splat4,
    splat8,
    stf,
    stq,
    stu,
    vdiv,
    vfma,
    vget,
    vkeep,
    vload4,
    vload8,
    vmax,
    vmin,
    vmul,
    vstore8,
)
from ispm.optics.jit import jit

f32, f64, i64, u32, u64 = np.float32, np.float64, np.int64, np.uint32, np.uint64

# An instance's row: 16 words, the inverse 3x4 matrix first.
ROW_WORDS = 16
ROW_ROOT = 12  # uint32: its mesh's root node
ROW_REACH = 13  # largest coordinate of its mesh's box, object space
ROW_SCALE = 14  # m: rounding errors of its points and rays, in units of 2^-24

# Words of a hit.
HIT_PRIMITIVE, HIT_U, HIT_V, HIT_INSTANCE = range(4)

# What a mesh's hits come between: the hit before (distance, float32; key) and the nearest so far, its key.
# A key is instance << 32 | primitive.
ORDER_KEY, ORDER_FIRST_KEY = range(2)
ORDER_FIRST, ORDER_INSTANCE = 4, 5  # words of 4 bytes; the instance whose mesh is met

# uint64 words of a stack: each level of a path leaves at most 7 children waiting, in either tree, and one
# node pushes 8 before it takes the nearest back.
STACK_WORDS = 2 * (7 * MAX_DEPTH + 8)

_NO_NODE = -1
_LOW = 0xFFFFFFFF
_NOT_NEEDLE = np.uint32(NEEDLE ^ 0xFFFFFFFF)
# After all keys: a hit at distance 0 does not come after it.
_NO_KEY = np.uint64(0xFFFFFFFFFFFFFFFF)
# Never 0, so that no sign of zero gets into the integer keys on the stack.
_NEAREST = np.float32(1e-30)
_SMALLEST = np.float32(1e-18)
# Boxes grow by this share of the largest coordinates met. Between the box test (1/d, the product and the
# sum, o/d) and the triangle test (corner - o, the slope, the product) lie 8 roundings of 2^-24.
_SLACK = np.float32(2.0**-21)
# m; with d = 0 (1/d = 1e18) it lets a ray through that lies in the plane of a box's face.
_SLACK_AT_ZERO = np.float32(1e-12)
# Covers the roundings between a distance and its product with a size.
_A_LITTLE_MORE = np.float32(1 + 2.0**-21)
# The share of a mesh's reach within which needles are met in float64, see `meet_needle`.
_NEAR = np.float32(1 / 256)


@jit(inline=True)
def slab(o, d, reach, word):
    """Return the Slab of one axis.

    o, d  the ray's origin, m, and direction along it;  reach  largest coordinate of the boxes, m
    word  of a node, where the axis' lower planes begin
    """
    r = f32(1) / (d if abs(d) > _SMALLEST else (_SMALLEST if d >= f32(0) else -_SMALLEST))
    slack = abs(r) * ((abs(o) + reach) * _SLACK + _SLACK_AT_ZERO)
    return Slab(r, i64(word) if r >= f32(0) else i64(word + 8), -o * r - slack, slack - o * r)


@jit(inline=True)
def lanes(axis):
    """Return a Slab of float32 in eight lanes."""
    return Slab(splat8(axis.rate), axis.word, splat8(axis.near), splat8(axis.far))


@jit(inline=True)
def descend(nodes, node, slabs, limit, nearest, keys, stack, waiting):
    """Meet the 8 boxes of a node: the nearest one met is next, farther ones wait on the stack.

    slabs  of eight lanes, as limit and nearest, float32, the distances between which boxes are met
    keys   8 floats to work in
    ->     (next ref or _NO_NODE, waiting). A waiting word is distance bits << 32 | ref, so that
           comparing integers compares distances.
    """
    x, y, z = slabs.x, slabs.y, slabs.z
    word = node * NODE_WORDS
    lower_x, lower_y = vload8(nodes, word + x.word), vload8(nodes, word + y.word)
    upper_x, upper_y = vload8(nodes, word + 8 - x.word), vload8(nodes, word + 40 - y.word)
    near = vmax(
        vmax(vfma(lower_x, x.rate, x.near), vfma(lower_y, y.rate, y.near)),
        vmax(vfma(vload8(nodes, word + z.word), z.rate, z.near), nearest),
    )
    far = vmin(
        vmin(vfma(upper_x, x.rate, x.far), vfma(upper_y, y.rate, y.far)),
        vmin(vfma(vload8(nodes, word + 72 - z.word), z.rate, z.far), limit),
    )
    met = i64(mask_le(near, far))
    found = i64(_NO_NODE)
    if met != 0:
        word += REFS
        k = i64(count_trailing_zeros(u32(met)))
        met &= met - 1
        found = i64(ldu(nodes, word + k))
        if met != 0:
            vstore8(keys, 0, near)
            key0 = (u64(ldu(keys, k)) << u64(32)) | u64(found)
            k = i64(count_trailing_zeros(u32(met)))
            met &= met - 1
            key1 = (u64(ldu(keys, k)) << u64(32)) | u64(ldu(nodes, word + k))
            lower, upper = min(key0, key1), max(key0, key1)
            stq(stack, waiting, upper)
            bottom = waiting
            waiting += 1
            if met != 0:
                stq(stack, waiting, lower)
                waiting += 1
                while met != 0:
                    k = i64(count_trailing_zeros(u32(met)))
                    met &= met - 1
                    key0 = (u64(ldu(keys, k)) << u64(32)) | u64(ldu(nodes, word + k))
                    slot = waiting
                    while slot > bottom:
                        other = ldq(stack, slot - 1)
                        if other >= key0:
                            break
                        stq(stack, slot, other)
                        slot -= 1
                    stq(stack, slot, key0)
                    waiting += 1
                waiting -= 1
                lower = ldq(stack, waiting)
            found = i64(lower & u64(_LOW))
    return found, waiting


@jit(inline=True)
def next_waiting(stack, bottom, waiting, t):
    """Take refs off the stack down to one no farther than t, float32; return it and the words that are in
    use, (_NO_NODE, bottom) where there is none."""
    bits = u64(f2u(t))
    found = i64(_NO_NODE)
    while waiting > bottom:
        waiting -= 1
        key = ldq(stack, waiting)
        if (key >> u64(32)) <= bits:
            found = i64(key & u64(_LOW))
            break
    return found, waiting


@jit(inline=True)
def is_between(order, t, distance, primitive):
    """Return whether a hit at `distance`, float32, comes before the one at t and after the first of `order`;
    `order` then holds its key."""
    key = (u64(ldu(order, ORDER_INSTANCE)) << u64(32)) | u64(primitive)
    first = ldf(order, ORDER_FIRST)
    before = distance < t or (distance == t and key < ldq(order, ORDER_KEY))
    between = before and (distance > first or (distance == first and key > ldq(order, ORDER_FIRST_KEY)))
    if between:
        stq(order, ORDER_KEY, key)
    return between


@jit
def meet_mesh(mesh, ray, any_hit, scratch, bottom, order):
    """Return the distance, float32, of the first hit of one Mesh by a Ray of its object space, the ray's end
    where there is none before; the rest goes to `scratch.found` and `order`.

    any_hit  any hit will do;  bottom  words of the Scratch's stack that are in use
    order    what hits come between, see ORDER_KEY
    """
    nodes, blocks, stack, hit, t = mesh.nodes, mesh.blocks, scratch.stack, scratch.found, ray.t_max
    (ox, oy, oz), (dx, dy, dz), reach = ray.origin, ray.direction, mesh.reach
    sx, sy, sz = slab(ox, dx, reach, 0), slab(oy, dy, reach, 16), slab(oz, dz, reach, 32)
    # What is not a number would get lost in minima and meet all boxes, empty ones too.
    if not abs(sx.near) + abs(sy.near) + abs(sz.near) < f32(np.inf):
        return t
    rx, ry, rz = sx.rate, sy.rate, sz.rate
    slabs = Slabs(lanes(sx), lanes(sy), lanes(sz))
    limit, nearest = splat8(t), splat8(ldf(order, ORDER_FIRST))
    keys = alloca(4)

    # Shear space: the axis the ray runs along most becomes its z.
    if abs(dx) >= abs(dy) and abs(dx) >= abs(dz):
        wx, wy, wz = i64(4), i64(8), i64(0)
        kx, ky, kz, slope_x, slope_y, rate = oy, oz, ox, dy * rx, dz * rx, rx
    elif abs(dy) >= abs(dz):
        wx, wy, wz = i64(8), i64(0), i64(4)
        kx, ky, kz, slope_x, slope_y, rate = oz, ox, oy, dz * ry, dx * ry, ry
    else:
        wx, wy, wz = i64(0), i64(4), i64(8)
        kx, ky, kz, slope_x, slope_y, rate = ox, oy, oz, dx * rz, dy * rz, rz
    shear = Shear(
        wx, wy, wz, splat4(kx), splat4(ky), splat4(kz), splat4(-slope_x), splat4(-slope_y), splat4(rate)
    )
    near = abs(rate) * reach * _NEAR
    back, farthest = splat4(-near), splat4(t * _A_LITTLE_MORE)

    waiting = bottom
    ref = i64(mesh.root)
    while True:
        if (ref & i64(LEAF)) == 0:
            ref, waiting = descend(nodes, ref, slabs, limit, nearest, keys, stack, waiting)
            if ref >= 0:
                continue
        else:
            word = (ref & i64(0x7FFFFFF)) * BLOCK_WORDS
            for _ in range(((ref >> 27) & 15) + 1):
                b, c, size, inside, scaled = meet_block(blocks, word, shear)
                lowest = vmul(vkeep(vload4(blocks, word + IDS), back), size)
                met = i64(mask_inside(inside, scaled, lowest, vmul(farthest, size)))
                if met == 0:
                    word += BLOCK_WORDS
                    continue
                inverse = vdiv(splat4(f32(1)), size)
                distances = vmul(scaled, inverse)
                while met != 0:
                    k = i64(count_trailing_zeros(u32(met)))
                    met &= met - 1
                    distance, primitive = vget(distances, k), ldu(blocks, word + IDS + k)
                    u = v = f32(0)
                    needle = distance < near and primitive & u32(NEEDLE) != u32(0)  # near is the rarer
                    if needle:
                        distance, u, v = meet_needle(blocks, word + k, ray.origin, ray.direction)
                    if is_between(order, t, distance, primitive & _NOT_NEEDLE):
                        t = distance
                        if not needle:
                            u, v = vget(vmul(b, inverse), k), vget(vmul(c, inverse), k)
                        stf(hit, HIT_U, u)
                        stf(hit, HIT_V, v)
                        if any_hit:
                            return t
                        limit, farthest = splat8(t), splat4(t * _A_LITTLE_MORE)
                word += BLOCK_WORDS
        ref, waiting = next_waiting(stack, bottom, waiting, t)
        if ref < 0:
            return t


@jit(inline=True)
def of_instance(m, o, d):
    """Return a point and a direction, world space, in the object space of the instance whose row is at the
    address `m`."""
    (ox, oy, oz), (dx, dy, dz) = o, d
    origin = (
        ldf(m, 0) * ox + ldf(m, 1) * oy + ldf(m, 2) * oz + ldf(m, 3),
        ldf(m, 4) * ox + ldf(m, 5) * oy + ldf(m, 6) * oz + ldf(m, 7),
        ldf(m, 8) * ox + ldf(m, 9) * oy + ldf(m, 10) * oz + ldf(m, 11),
    )
    direction = (
        ldf(m, 0) * dx + ldf(m, 1) * dy + ldf(m, 2) * dz,
        ldf(m, 4) * dx + ldf(m, 5) * dy + ldf(m, 6) * dz,
        ldf(m, 8) * dx + ldf(m, 9) * dy + ldf(m, 10) * dz,
    )
    return origin, direction


@jit
def meet_world(trees, ray, first, first_key, any_hit, scratch):
    """Return the distance, float32, of the first hit of a Ray over all instances after the one at the
    distance `first` of the uint64 key `first_key`, or of any; the ray's end where there is none."""
    nodes, rows = data(trees.top), data(trees.rows)
    mesh_nodes, blocks = data(trees.nodes), data(trees.blocks)
    stack, hit, t_max = scratch.stack, scratch.found, ray.t_max
    reach = trees.reach
    (ox, oy, oz), (dx, dy, dz) = ray.origin, ray.direction
    sx, sy, sz = slab(ox, dx, reach, 0), slab(oy, dy, reach, 16), slab(oz, dz, reach, 32)
    # What is not a number would get lost in minima and meet all boxes, empty ones too.
    if not abs(sx.near) + abs(sy.near) + abs(sz.near) < f32(np.inf):
        return t_max
    slabs = Slabs(lanes(sx), lanes(sy), lanes(sz))
    order = alloca(3)
    stq(order, ORDER_KEY, u64(0))  # which no key is below: hits are nearer than t_max
    stq(order, ORDER_FIRST_KEY, first_key)
    stf(order, ORDER_FIRST, max(first, _NEAREST))
    t = t_max
    limit, nearest = splat8(t), splat8(max(first, _NEAREST))
    keys = alloca(4)
    waiting = i64(0)
    ref = i64(0)
    while True:
        if (ref & i64(LEAF)) == 0:
            ref, waiting = descend(nodes, ref, slabs, limit, nearest, keys, stack, waiting)
            if ref >= 0:
                continue
        else:
            instance = ref & i64(0x7FFFFFF)
            m = rows + u64(4 * ROW_WORDS) * u64(instance)
            stu(order, ORDER_INSTANCE, u32(instance))
            origin, direction = of_instance(m, (ox, oy, oz), (dx, dy, dz))
            mesh = Mesh(mesh_nodes, blocks, ldu(m, ROW_ROOT), ldf(m, ROW_REACH))
            t = meet_mesh(mesh, Ray(origin, direction, t), any_hit, scratch, waiting, order)
            if any_hit and t < t_max:
                return t
            limit = splat8(t)
        ref, waiting = next_waiting(stack, i64(0), waiting, t)
        if ref < 0:
            break
    if t < t_max:
        key = ldq(order, ORDER_KEY)
        stu(hit, HIT_INSTANCE, u32(key >> u64(32)))
        stu(hit, HIT_PRIMITIVE, u32(key))
    return t


@jit
def closest(trees, ray, scratch):
    """Return the distance, float32, of the nearest hit of a Ray in lengths of its direction, its end where
    nothing is nearer.

    scratch  Scratch, whose `found` is written only where something is hit; for `read_hit`
    """
    return meet_world(trees, ray, f32(0), _NO_KEY, False, scratch)


@jit
def closest_after(trees, ray, first, scratch):
    """Return the distance, float32, of the next hit after the one in `scratch.found`, the ray's end where
    nothing follows.

    first  distance of that one; 0, and in `found` NO_HIT for instance and primitive, for the nearest
    Every triangle along the ray comes once, those that coincide too. Arguments as of `closest`.
    """
    instance, primitive = ldu(scratch.found, HIT_INSTANCE), ldu(scratch.found, HIT_PRIMITIVE)
    key = (u64(instance) << u64(32)) | u64(primitive)
    return meet_world(trees, ray, first, key, False, scratch)


@jit
def read_hit(found):
    """Return the Hit whose words, uint32 and float32, are at an address."""
    return Hit(ldu(found, HIT_INSTANCE), ldu(found, HIT_PRIMITIVE), ldf(found, HIT_U), ldf(found, HIT_V))


@jit
def any_hit(trees, ray, stack):
    """Return whether anything lies on a Ray before its end; stack: of STACK_WORDS uint64."""
    return any_distance(trees, ray, stack) < ray.t_max


@jit
def any_distance(trees, ray, stack):
    """Return how far away something is that lies on a Ray before its end, float32, not always the nearest;
    its end where nothing does."""
    return meet_world(trees, ray, f32(0), _NO_KEY, True, Scratch(stack, alloca(2)))


@jit
def instance_scale(trees, instance):
    """Return the scale of an instance's rounding errors in metres, see `leave_triangle`."""
    return ldf(data(trees.rows), i64(instance) * i64(ROW_WORDS) + i64(ROW_SCALE))
