"""The nearest neighbours of points among themselves, exactly.

The points lie in the order of a space-filling curve, eight to a block; eight blocks, with their boxes, make
a node of the level above, and so on up to one node. Vector instructions compute eight distances at once, to
points or to boxes. A search starts in its point's own block and climbs, so that it knows near neighbors
before it meets far nodes.
"""

from __future__ import annotations

import numpy as np

from ispm.kernels.simd import (
    aligned,
    alloca,
    count_trailing_zeros,
    f2u,
    ldf,
    ldq,
    ldu,
    mask_le,
    splat8,
    stf,
    stq,
    stu,
    u2f,
    vfma,
    vload8,
    vmax,
    vstore8,
    vsub,
)
from ispm.optics.jit import jit

f32, i64, u32, u64 = np.float32, np.int64, np.uint32, np.uint64

DIMENSIONS = 6
STACK_WORDS = 96  # uint64: the way up of at most 10 levels, and up to 8 nodes left waiting in each
_LANES = 8
_SHIFT, _LAST = i64(3), i64(_LANES - 1)  # a row is _LANES times its block and its lane there
_ROOM = _LANES // 2  # uint64
_LEVEL, _NODE_MASK = i64(28), i64((1 << 28) - 1)  # a waiting node's level above its number
_BLOCK = DIMENSIONS * _LANES  # floats of eight points, dimension by dimension
_NODE = 2 * _BLOCK  # of eight boxes: low corners, then high ones
_NOWHERE = f32(1e18)  # where lanes without a point lie; its square is a float too


class NearestTree:
    """A tree over points of six dimensions.

    points  (N, 6) float32, N > 0, neighbours in the list near each other in space
    nodes   the tree; keep it alive while its address is in use
    starts  (L,) int64, the first float of each level; level 0 is the points
    """

    def __init__(self, points: np.ndarray) -> None:
        counts = [-(-len(points) // _LANES)]
        while counts[-1] > 1:
            counts.append(-(-counts[-1] // _LANES))
        sizes = [_BLOCK * counts[0], *(_NODE * count for count in counts[1:])]
        self.starts = np.concatenate([[0], np.cumsum(sizes)[:-1]]).astype(np.int64)
        self.nodes = aligned(sum(sizes))
        self.nodes[:] = _NOWHERE
        _fill_blocks(points, self.nodes)
        for level in range(1, len(counts)):
            _fill_boxes(self.nodes, self.starts, level, counts[level - 1])


@jit
def _fill_blocks(points, nodes):
    """Write (N, 6) float32 points to level 0 of the nodes."""
    for i in range(len(points)):
        for d in range(DIMENSIONS):
            nodes[i // _LANES * _BLOCK + d * _LANES + i % _LANES] = points[i, d]


@jit
def _fill_boxes(nodes, starts, level, child_count):
    """Write the bounds, float32, of each child to its lane of its parent, a node of `level` of a tree."""
    low, high = i64(0), i64(0 if level == 1 else _BLOCK)
    size = _BLOCK if level == 1 else _NODE
    for child in range(child_count):
        own = starts[level - 1] + child * size
        into = starts[level] + child // _LANES * _NODE + child % _LANES
        for d in range(DIMENSIONS):
            least, most = _NOWHERE, -_NOWHERE
            for lane in range(_LANES):
                k = own + d * _LANES + lane
                if nodes[k + low] < _NOWHERE:
                    least, most = min(least, nodes[k + low]), max(most, nodes[k + high])
            nodes[into + d * _LANES], nodes[into + _BLOCK + d * _LANES] = least, most


@jit
def find_nearest(nodes, starts, point, wanted, reach, squares, rows, stack):
    """Find the `wanted` points nearest to a point of the tree, nearest first; return how many there are.

    nodes, starts  of the tree, the former by address
    point          its row; it is not its own neighbour
    reach          distance beyond which nothing is looked for
    squares, rows  addresses of room for `wanted` float32 and uint32: squared distances, and the points
    stack          address of STACK_WORDS uint64
    """
    lanes = alloca(_ROOM)
    q = (point >> _SHIFT) * _BLOCK + (point & _LAST)
    bound, found, waiting = reach * reach, i64(0), i64(0)
    for level in range(len(starts) - 1, -1, -1):
        stq(stack, waiting, _waiting(f32(0), i64(level), _ancestor(point, i64(level))))
        waiting += i64(1)
    while waiting > i64(0):
        waiting -= i64(1)
        square, level, node = _parts(ldq(stack, waiting))
        if square > bound:
            continue
        near = _lanes_near(nodes, starts[level], level, node, q, bound, lanes)
        if node == _ancestor(point, level):
            near &= ~(u32(1) << u32(_ancestor(point, level - i64(1)) & _LAST))
        while near != u32(0):
            lane = i64(count_trailing_zeros(near))
            near &= near - u32(1)
            square, child = ldf(lanes, lane), node * i64(_LANES) + lane
            if level > i64(0):
                stq(stack, waiting, _waiting(square, level - i64(1), child))
                waiting += i64(1)
            else:
                found = _insert(square, child, wanted, found, squares, rows)
        if found == wanted:
            bound = ldf(squares, wanted - i64(1))
    return found


@jit
def _ancestor(point, level):
    """The number of the node of a level that a point, int64, lies in; level -1: the point itself."""
    return point >> (_SHIFT * (level + i64(1)))


@jit
def _waiting(square, level, node):
    """A node as it waits on the stack: a uint64, its squared distance in the upper half."""
    return u64(f2u(square)) << u64(32) | u64(level << _LEVEL | node)


@jit
def _parts(waiting):
    """Squared distance (float32), level and number of a waiting node."""
    low = i64(waiting & u64(0xFFFFFFFF))
    return u2f(u32(waiting >> u64(32))), low >> _LEVEL, low & _NODE_MASK


@jit
def _lanes_near(nodes, start, level, node, q, bound, lanes):
    """Write the squared distances of a node's points or boxes to a point: eight float32.

    nodes, lanes  addresses;  start  of the node's level;  q  first float of the point
    -> uint32, bit k: whether that of lane k is within `bound`
    """
    square = splat8(f32(0))
    if level == i64(0):
        block = start + node * i64(_BLOCK)
        for d in range(0, _BLOCK, _LANES):
            away = vsub(vload8(nodes, block + i64(d)), splat8(ldf(nodes, q + i64(d))))
            square = vfma(away, away, square)
    else:
        low, high = start + node * i64(_NODE), start + node * i64(_NODE) + i64(_BLOCK)
        for d in range(0, _BLOCK, _LANES):
            x = splat8(ldf(nodes, q + i64(d)))
            away = vmax(vsub(vload8(nodes, low + i64(d)), x), vsub(x, vload8(nodes, high + i64(d))))
            away = vmax(away, splat8(f32(0)))
            square = vfma(away, away, square)
    vstore8(lanes, i64(0), square)
    return mask_le(square, splat8(bound))


@jit
def _insert(square, point, wanted, found, squares, rows):
    """Insert a point, int64, with its squared distance, float32, among the nearest ones found so far, sorted;
    return how many there are then."""
    if found == wanted and not square < ldf(squares, wanted - i64(1)):
        return found
    k = min(found, wanted - i64(1))
    while k > i64(0) and ldf(squares, k - i64(1)) > square:
        stf(squares, k, ldf(squares, k - i64(1)))
        stu(rows, k, ldu(rows, k - i64(1)))
        k -= i64(1)
    stf(squares, k, square)
    stu(rows, k, u32(point))
    return min(found + i64(1), wanted)
