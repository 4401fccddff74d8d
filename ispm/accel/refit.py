"""Trees of meshes that deform: their boxes and triangles are written anew, what lies below what stays.

A refitted tree finds the same hits as a new one. Rays meet more of it, the farther what its nodes hold has
drifted apart. Source: Wald, Boulos and Shirley, "Ray tracing deformable scenes using dynamic bounding volume
hierarchies", 2007.
"""

from __future__ import annotations

import numpy as np

from ispm.accel.build import LEAF
from ispm.accel.bvh import MeshBvh
from ispm.accel.collapse import BLOCK, BLOCK_WORDS, IDS, NEEDLE, NO_REF, NODE_WORDS, REFS, WIDTH, is_needle
from ispm.kernels.simd import address, ldf, ldu, stf, stu
from ispm.kernels.threads import run_threads
from ispm.optics.jit import jit

f32, f64, i64, u32 = np.float32, np.float64, np.int64, np.uint32

_FAR = np.float32(1e30)
_BOX = 6  # words: least and greatest corner
_FIRST_BLOCK = (1 << 27) - 1  # bits of a leaf's ref
WORSE = 1.5  # times the cost of the tree as it was built, from which it is built anew, see docs/notes.md


def refit(tree: MeshBvh, positions: np.ndarray, triangles: np.ndarray, threads: int = 1) -> bool:
    """Write a tree's boxes and triangles anew, in place; return whether it still serves rays well.

    tree       of a mesh with these triangles
    positions  (V, 3) float32;  triangles  (T, 3) uint32
    """
    count, block_count = len(tree.nodes) // NODE_WORDS, len(tree.blocks) // BLOCK_WORDS
    nodes, blocks = address(tree.nodes), address(tree.blocks)
    if tree.cost is None:
        tree.cost = tree_cost(nodes, count)
    boxes = np.empty((block_count + count, _BOX), np.float32)
    cuts = np.linspace(0, block_count, threads + 1).astype(np.int64)
    run_threads(lambda k: refill_blocks(positions, triangles, cuts[k], cuts[k + 1], blocks, boxes), threads)
    bound_nodes(nodes, count, block_count, tree.first_node, tree.first_block, boxes)
    tree.bounds = boxes[block_count].reshape(2, 3).copy()
    return bool(tree_cost(nodes, count) <= WORSE * tree.cost)


@jit
def refill_blocks(positions, triangles, start, stop, blocks, boxes):
    """Write the corners of the triangles of blocks start..stop, whether they are needles, and their boxes.

    positions  (V, 3) float32;  triangles  (T, 3) uint32;  blocks  an address
    boxes      (n, 6) float32, a row for each block
    """
    for block in range(start, stop):
        word = block * BLOCK_WORDS
        for axis in range(3):
            boxes[block, axis], boxes[block, 3 + axis] = _FAR, -_FAR
        for lane in range(BLOCK):
            id = ldu(blocks, word + IDS + lane)
            if id == u32(NO_REF):
                continue
            triangle = i64(id & u32(NEEDLE - 1))
            flag = u32(NEEDLE) if is_needle(positions, triangles, triangle) else u32(0)
            stu(blocks, word + IDS + lane, u32(triangle) | flag)
            for corner in range(3):
                vertex = triangles[triangle, corner]
                for axis in range(3):
                    x = positions[vertex, axis]
                    stf(blocks, word + 12 * corner + 4 * axis + lane, x)
                    boxes[block, axis] = min(boxes[block, axis], x)
                    boxes[block, 3 + axis] = max(boxes[block, 3 + axis], x)


@jit
def bound_nodes(nodes, count, block_count, first_node, first_block, boxes):
    """Write the boxes of the children of nodes, the last node first, as children lie behind their parents.

    nodes  address of `count` nodes;  first_node, first_block  from which on their refs count
    boxes  (block_count + count, 6) float32, those of the blocks; written: those of the nodes
    """
    for node in range(count - 1, -1, -1):
        own = block_count + node
        for axis in range(3):
            boxes[own, axis], boxes[own, 3 + axis] = _FAR, -_FAR
        for k in range(WIDTH):
            word = node * NODE_WORDS
            ref = ldu(nodes, word + REFS + k)
            if ref == u32(NO_REF):
                continue
            row, rows = block_count + i64(ref) - first_node, i64(1)
            if ref & u32(LEAF):
                row, rows = i64(ref & u32(_FIRST_BLOCK)) - first_block, i64(ref >> u32(27) & u32(15)) + i64(1)
            for axis in range(3):
                low, high = boxes[row, axis], boxes[row, 3 + axis]
                for other in range(row + 1, row + rows):
                    low, high = min(low, boxes[other, axis]), max(high, boxes[other, 3 + axis])
                stf(nodes, word + 16 * axis + k, low)
                stf(nodes, word + 16 * axis + 8 + k, high)
                boxes[own, axis] = min(boxes[own, axis], low)
                boxes[own, 3 + axis] = max(boxes[own, 3 + axis], high)


@jit
def tree_cost(nodes, count):
    """Return how many nodes and blocks a ray through a tree's box meets in the mean, float64.

    nodes  address of its `count` nodes
    """
    low, high = (_FAR, _FAR, _FAR), (-_FAR, -_FAR, -_FAR)
    total, whole = f64(0), f64(0)
    for node in range(count):
        least, most = low, high
        for k in range(WIDTH):
            word = node * NODE_WORDS
            ref = ldu(nodes, word + REFS + k)
            if ref == u32(NO_REF):
                continue
            a = ldf(nodes, word + k), ldf(nodes, word + 16 + k), ldf(nodes, word + 32 + k)
            b = ldf(nodes, word + 8 + k), ldf(nodes, word + 24 + k), ldf(nodes, word + 40 + k)
            least = min(least[0], a[0]), min(least[1], a[1]), min(least[2], a[2])
            most = max(most[0], b[0]), max(most[1], b[1]), max(most[2], b[2])
            met = i64(1)
            if ref & u32(LEAF):
                met = i64(ref >> u32(27) & u32(15)) + i64(1)
            total += f64(met) * _half_surface(a, b)
        if node == 0:
            whole = _half_surface(least, most)
    return f64(1) + total / whole if whole > f64(0) else f64(1)


@jit
def _half_surface(low, high):
    """Half the surface of a box, m2 float64."""
    x, y, z = f64(high[0]) - low[0], f64(high[1]) - low[1], f64(high[2]) - low[2]
    return x * y + y * z + z * x
