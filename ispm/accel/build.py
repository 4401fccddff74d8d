"""Binary tree of boxes by the binned surface area heuristic.

A reference is 8 float32: min x y z, id bits, -max x y z, 0; one vector minimum joins two boxes. Splitting
moves whole references, so every pass reads memory in order. A node's number follows from its range of
references alone (left = node + 1, right = node + 2 * left count): any number of threads builds the same
tree. In kernels `refs`, `boxes` and `scratch` are uint64 addresses of such floats, `scratch` of one thread's
_SCRATCH; `start` and `stop`, int64, are a range of references.

Source: Wald, "On fast construction of SAH-based bounding volume hierarchies", 2007.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ispm.kernels.simd import (
    address,
    aligned,
    atomic_add,
    ldf,
    ldu,
    splat4,
    splat8,
    stf,
    stu,
    vget,
    vload4,
    vload8,
    vmax,
    vmin,
    vstore4,
    vstore8,
    vsub,
)
from ispm.kernels.threads import run_threads
from ispm.optics.jit import jit

f32, i64, u32 = np.float32, np.int64, np.uint32

# No path in the tree is longer: whatever the input, stacks sized by it do not overflow (see `split`).
MAX_DEPTH = 64
LEAF = 0x80000000  # in a link's second word: a leaf; the rest is its count
LARGEST = 1e18  # m; coordinates beyond it, or not finite, are left out: their squares would overflow
_EMPTY = np.float32(1e30)
_FLAT = np.float32(1e-30)  # m; an extent below it is a point
_BINS = 32
_FEW_BINS = 8
# Scratch of one thread, in floats: centroid bounds, both child boxes, bins of 3 axes, counts, sweep costs.
_LEFT, _RIGHT, _BOXES = 8, 16, 32
_COUNTS = _BOXES + 3 * 8 * _BINS
_COSTS = _COUNTS + 3 * _BINS
_SCRATCH = 1024
_PARALLEL = 4096  # references below which one thread is faster than sharing
_STACK_ROWS = MAX_DEPTH + 2


class GrowingTree(NamedTuple):
    """A BinaryTree while it is built, for kernels.

    refs, boxes  uint64 addresses of its arrays;  links  (2 n, 2) uint32
    block_shift  the heuristic counts blocks of 2**block_shift references
    leaf_size    most references of a leaf
    """

    refs: np.uint64
    boxes: np.uint64
    links: np.ndarray
    block_shift: int
    leaf_size: int


class BinaryTree:
    """A binary tree over references.

    refs   (n, 8) float32, reordered so that every node owns a range
    boxes  (2 n, 8) float32, box of each node, in the references' form
    links  (2 n, 2) uint32: left and right child, or first reference and count | LEAF
    """

    def __init__(self, refs: np.ndarray, block_shift: int, leaf_size: int, threads: int) -> None:
        """Build over n >= 1 `refs`. The heuristic counts blocks of 2**block_shift references."""
        n = len(refs)
        self.refs = refs
        self.boxes = aligned(16 * n).reshape(-1, 8)
        self.links = np.zeros((2 * n, 2), np.uint32)
        threads = threads if n >= _PARALLEL else 1
        bound_refs(address(refs), 0, n, address(self.boxes))
        growing = GrowingTree(address(refs), address(self.boxes), self.links, block_shift, leaf_size)
        large, small = np.array([[0, n, 0, 0]], np.int64), np.empty((0, 4), np.int64)
        most = max(1024, n // (16 * threads)) if threads > 1 else n
        while len(large):
            fits = large[:, 1] - large[:, 0] <= most
            small = np.concatenate([small, large[fits]])
            large = self._part(growing, large[~fits], threads)
        largest_first = np.argsort(small[:, 0] - small[:, 1], kind="stable")
        self._grow(growing, small[largest_first], threads)

    @property
    def bounds(self) -> np.ndarray:
        """(2, 3) float32 corners of the box of all references."""
        return np.stack([self.boxes[0, :3], -self.boxes[0, 4:7]])

    @staticmethod
    def _part(growing: GrowingTree, tasks: np.ndarray, threads: int) -> np.ndarray:
        """Part the ranges of `tasks`, (n, 4) int64, each thread taking the next one; return their children,
        (m, 4)."""
        if not len(tasks):
            return tasks
        counter, children = np.zeros(1, np.int64), np.zeros((2 * len(tasks), 4), np.int64)

        def worker(_: int) -> None:
            scratch = aligned(_SCRATCH)
            part_tasks(growing, tasks, address(counter), address(scratch), children)

        run_threads(worker, threads if len(tasks) > 1 else 1)
        return children[children[:, 1] > 0]

    @staticmethod
    def _grow(growing: GrowingTree, tasks: np.ndarray, threads: int) -> None:
        """Build the subtrees of `tasks`, (n, 4) int64, each thread taking the next one."""
        counter = np.zeros(1, np.int64)

        def worker(_: int) -> None:
            scratch, stack = aligned(_SCRATCH), np.empty((_STACK_ROWS, 4), np.int64)
            build_tasks(growing, tasks, address(counter), address(scratch), stack)

        run_threads(worker, threads)


def triangle_refs(positions: np.ndarray, triangles: np.ndarray, threads: int) -> np.ndarray:
    """Return (n, 8) float32 references of the triangles whose corners are finite; arguments as of
    `build_mesh_bvh`."""
    count = len(triangles)
    refs = aligned(8 * count).reshape(-1, 8)
    cuts = np.linspace(0, count, threads + 1).astype(np.int64)
    bad = run_threads(
        lambda k: write_refs(positions, triangles, address(refs), cuts[k], cuts[k + 1]), threads
    )
    if not any(bad):
        return refs
    good = np.flatnonzero(refs[:, 7] == 0.0)
    kept = aligned(8 * len(good)).reshape(-1, 8)
    kept[:] = refs[good]
    return kept


@jit
def write_refs(positions, triangles, refs, start, stop):
    """Write references of triangles start..stop, the last word 1 where one is not usable; return how many
    those are.

    positions  (V, 3) float32;  triangles  (T, 3) uint32
    """
    bad = 0
    for i in range(start, stop):
        a, b, c = triangles[i, 0], triangles[i, 1], triangles[i, 2]
        usable = True
        for k in range(3):
            x, y, z = positions[a, k], positions[b, k], positions[c, k]
            stf(refs, 8 * i + k, min(x, min(y, z)))
            stf(refs, 8 * i + 4 + k, -max(x, max(y, z)))
            for value in (x, y, z):
                usable &= abs(value) < f32(LARGEST)
        stu(refs, 8 * i + 3, u32(i))
        stf(refs, 8 * i + 7, f32(0) if usable else f32(1))
        bad += not usable
    return bad


@jit
def area(box):
    """Return half the surface, float32 m2, of a box in the form of references."""
    x = -vget(box, 4) - vget(box, 0)
    y = -vget(box, 5) - vget(box, 1)
    z = -vget(box, 6) - vget(box, 2)
    return x * y + y * z + z * x


@jit
def bound_refs(refs, start, stop, out):
    """Write the box of references start..stop, 8 float32, to the address `out`."""
    box = splat8(_EMPTY)
    for i in range(start, stop):
        box = vmin(vload8(refs, 8 * i), box)
    vstore8(out, 0, box)


@jit
def bound_centers(refs, start, stop, out):
    """Write min and max of twice the boxes' centers, 4 float32 each (the last of no use), to an address."""
    low, high = splat4(_EMPTY), splat4(-_EMPTY)
    for i in range(start, stop):
        center = vsub(vload4(refs, 8 * i), vload4(refs, 8 * i + 4))
        low, high = vmin(center, low), vmax(center, high)
    vstore4(out, 0, low)
    vstore4(out, 4, high)


@jit(inline=True)
def bin_scale(scratch, axis, bins):
    """Return the bins per metre of twice the center, float32; 0 where all centers agree.

    scratch  its first 8 floats as `bound_centers` writes them;  bins  on each axis
    """
    extent = ldf(scratch, 4 + axis) - ldf(scratch, axis)
    # a little less than the number of bins, so that the last center falls into the last bin
    return f32(bins) * f32(0.99999) / extent if extent > _FLAT else f32(0)


@jit
def fill_bins(refs, start, stop, scratch, bins):
    """Join each reference's box to its bin on each axis, and count: float32 and uint32 words of scratch."""
    empty = splat8(_EMPTY)
    for j in range(3 * bins):
        vstore8(scratch, _BOXES + 8 * j, empty)
        stu(scratch, _COUNTS + j, u32(0))
    x0, y0, z0 = ldf(scratch, 0), ldf(scratch, 1), ldf(scratch, 2)
    sx, sy, sz = bin_scale(scratch, 0, bins), bin_scale(scratch, 1, bins), bin_scale(scratch, 2, bins)
    for i in range(start, stop):
        ref = vload8(refs, 8 * i)
        x = i64((vget(ref, 0) - vget(ref, 4) - x0) * sx)
        y = i64((vget(ref, 1) - vget(ref, 5) - y0) * sy) + bins
        z = i64((vget(ref, 2) - vget(ref, 6) - z0) * sz) + 2 * bins
        vstore8(scratch, _BOXES + 8 * x, vmin(ref, vload8(scratch, _BOXES + 8 * x)))
        vstore8(scratch, _BOXES + 8 * y, vmin(ref, vload8(scratch, _BOXES + 8 * y)))
        vstore8(scratch, _BOXES + 8 * z, vmin(ref, vload8(scratch, _BOXES + 8 * z)))
        stu(scratch, _COUNTS + x, ldu(scratch, _COUNTS + x) + u32(1))
        stu(scratch, _COUNTS + y, ldu(scratch, _COUNTS + y) + u32(1))
        stu(scratch, _COUNTS + z, ldu(scratch, _COUNTS + z) + u32(1))


@jit
def best_cut(scratch, bins, n, block_shift):
    """Return (cost in m2, axis, last bin of the left side) of the cheapest cut of n references in `bins` on
    each axis; axis -1 where no cut parts the centers."""
    round_up = i64((1 << block_shift) - 1)
    best, best_axis, best_bin = f32(3e38), i64(-1), i64(0)
    for axis in range(3):
        first = axis * bins
        box, count = splat8(_EMPTY), i64(0)
        for j in range(bins - 1, 0, -1):
            box = vmin(vload8(scratch, _BOXES + 8 * (first + j)), box)
            count += i64(ldu(scratch, _COUNTS + first + j))
            cost = area(box) * f32((count + round_up) >> block_shift) if count > 0 else f32(0)
            stf(scratch, _COSTS + j, cost)
        box, count = splat8(_EMPTY), i64(0)
        for j in range(bins - 1):
            box = vmin(vload8(scratch, _BOXES + 8 * (first + j)), box)
            count += i64(ldu(scratch, _COUNTS + first + j))
            if 0 < count < n:
                cost = area(box) * f32((count + round_up) >> block_shift) + ldf(scratch, _COSTS + j + 1)
                if cost < best:
                    best, best_axis, best_bin = cost, i64(axis), i64(j)
    return best, best_axis, best_bin


@jit
def write_children(scratch, axis, last_left, bins):
    """Write the child boxes of a cut, as `best_cut` has it, to scratch; return half the surface of the box of
    both, float32 m2."""
    left, right = splat8(_EMPTY), splat8(_EMPTY)
    for j in range(bins):
        box = vload8(scratch, _BOXES + 8 * (axis * bins + j))
        if j <= last_left:
            left = vmin(box, left)
        else:
            right = vmin(box, right)
    vstore8(scratch, _LEFT, left)
    vstore8(scratch, _RIGHT, right)
    return area(vmin(left, right))


@jit
def part_refs(refs, start, stop, scratch, axis, last_left, bins):
    """Move references whose bin on `axis` is last_left at most to the front; return where the others start,
    int64."""
    origin, scale = ldf(scratch, axis), bin_scale(scratch, axis, bins)
    right = start
    for i in range(start, stop):
        # without branches, which would be guessed wrongly every other time
        center = ldf(refs, 8 * i + axis) - ldf(refs, 8 * i + 4 + axis)
        ref, first_right = vload8(refs, 8 * i), vload8(refs, 8 * right)
        vstore8(refs, 8 * i, first_right)
        vstore8(refs, 8 * right, ref)
        right += i64(i64((center - origin) * scale) <= last_left)
    return right


@jit
def halve(refs, start, stop, scratch):
    """Cut a range in the middle, in the order that it has; return where its right side starts, int64."""
    middle = (start + stop) // 2
    bound_refs(refs, start, middle, scratch + 4 * _LEFT)
    bound_refs(refs, middle, stop, scratch + 4 * _RIGHT)
    return middle


@jit
def split(tree, start, stop, depth, scratch):
    """Part a range of a GrowingTree in two; return where the right side starts, int64, `start` for a leaf.

    Once the levels left are just enough to halve the range down to single references it is halved,
    however bad the boxes: so no path is longer than MAX_DEPTH for up to 2**MAX_DEPTH references.
    """
    refs, block_shift, leaf_size = tree.refs, tree.block_shift, tree.leaf_size
    n = stop - start
    if n == 1:
        return start
    levels = i64(0)
    while (i64(1) << levels) < n:
        levels += 1
    if depth + levels >= MAX_DEPTH:
        return halve(refs, start, stop, scratch)
    bound_centers(refs, start, stop, scratch)
    bins = i64(_BINS) if n > 64 else i64(_FEW_BINS)
    fill_bins(refs, start, stop, scratch, bins)
    cost, axis, last_left = best_cut(scratch, bins, n, block_shift)
    if axis < 0:
        return start if n <= leaf_size else halve(refs, start, stop, scratch)
    whole = write_children(scratch, axis, last_left, bins)
    if n <= leaf_size:
        blocks = f32((n + (1 << block_shift) - 1) >> block_shift)
        # visiting a node costs half a block, measured
        if whole * blocks <= cost + whole * (f32(0.5) if block_shift > 0 else f32(1)):
            return start
    return part_refs(refs, start, stop, scratch, axis, last_left, bins)


@jit
def part_range(tree, start, stop, node, depth, scratch, out, k):
    """Write a node of a GrowingTree over the range start..stop; return whether it has children, which rows
    k and k + 1 of `out` then tell: first reference, end, node, depth."""
    boxes, links = tree.boxes, tree.links
    middle = split(tree, start, stop, depth, scratch)
    if middle == start:
        links[node, 0], links[node, 1] = u32(start), u32(stop - start) | u32(LEAF)
        return False
    left, right = node + 1, node + 2 * (middle - start)
    vstore8(boxes, 8 * left, vload8(scratch, _LEFT))
    vstore8(boxes, 8 * right, vload8(scratch, _RIGHT))
    links[node, 0], links[node, 1] = u32(left), u32(right)
    out[k, 0], out[k, 1], out[k, 2], out[k, 3] = start, middle, left, depth + 1
    out[k + 1, 0], out[k + 1, 1], out[k + 1, 2], out[k + 1, 3] = middle, stop, right, depth + 1
    return True


@jit
def part_tasks(tree, tasks, counter, scratch, children):
    """Part the ranges of `tasks`, (n, 4) int64 rows as of `part_range`, until none is left.

    counter   address of an int64 that threads share
    children  (2 n, 4) int64 of zeros, written where there are any
    """
    while True:
        k = atomic_add(counter, i64(1))
        if k >= len(tasks):
            return
        part_range(tree, tasks[k, 0], tasks[k, 1], tasks[k, 2], tasks[k, 3], scratch, children, 2 * k)


@jit
def build_tasks(tree, tasks, counter, scratch, stack):
    """Build the subtrees over the ranges of `tasks`; arguments as of `part_tasks`.

    stack  (MAX_DEPTH + 2, 4) int64: a range waits for each level of the path, so it does not overflow
    """
    while True:
        k = atomic_add(counter, i64(1))
        if k >= len(tasks):
            return
        for word in range(4):
            stack[0, word] = tasks[k, word]
        waiting = 1
        while waiting > 0:
            waiting -= 1
            start, stop, node = stack[waiting, 0], stack[waiting, 1], stack[waiting, 2]
            if part_range(tree, start, stop, node, stack[waiting, 3], scratch, stack, waiting):
                waiting += 2
