"""From the binary tree to nodes of 8 children and blocks of 4 triangles, the form that rays meet.

Node, 64 words (256 bytes): min x[8] max x[8] min y[8] max y[8] min z[8] max z[8] ref[8], 8 free. A ref is
a node's index; with bit 31 a leaf: bits 27-30 its blocks less one, bits 0-26 the first block (in the tree
over instances: the instance's row). Empty: ref NO_REF and a box turned inside out, of finite numbers.
Children lie behind their parents.

Block, 40 words (160 bytes): x[4] y[4] z[4] of the first corners, the same of the second and third, id[4].
Ids of needles, triangles thinner than 1:4, have the bit NEEDLE. Lanes without a triangle have three equal
corners, which no ray hits.

Source: Wald, Benthin & Boulos, "Getting rid of packets", 2008.
"""

from __future__ import annotations

import numpy as np

from ispm.accel.build import LEAF, MAX_DEPTH, BinaryTree, area
from ispm.kernels.simd import address, aligned, f2u, ldf, ldu, stf, stu, vload8
from ispm.kernels.threads import run_threads
from ispm.optics.jit import jit
from ispm.optics.vector import cross, dot, sub

f32, f64, i64, u32 = np.float32, np.float64, np.int64, np.uint32

WIDTH = 8
NODE_WORDS = 64
REFS = 48  # word of a node's first ref
BLOCK = 4
BLOCK_WORDS = 40
IDS = 36  # word of a block's first id
LEAF_SIZE = 8
NO_REF = 0xFFFFFFFF
NEEDLE = 0x80000000
_FAR = np.float32(1e30)
# A node adds at most 8 waiting children and takes one; wide paths are no longer than binary ones.
_STACK_ROWS = 7 * MAX_DEPTH + 8


def collapse(tree: BinaryTree, rows: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return the nodes as flat float32 words and the leaves, (n, 3) int64: first reference, count, block.

    rows  leaves hold one reference each and point to its id instead of a block
    """
    room = aligned(NODE_WORDS * len(tree.refs))
    leaves = np.empty((len(tree.refs), 3), np.int64)
    stack = np.empty((_STACK_ROWS, 2), np.int64)
    node_count, leaf_count = write_nodes(
        address(tree.refs), address(tree.boxes), tree.links, rows, address(room), leaves, stack
    )
    nodes = aligned(NODE_WORDS * node_count)
    nodes[:] = room[: len(nodes)]
    return nodes, leaves[:leaf_count]


def empty_node() -> np.ndarray:
    """Return a node without children, (64,) float32 words."""
    node = aligned(NODE_WORDS)
    for k in range(WIDTH):
        clear_child(address(node), 0, k)
    return node


def triangle_blocks(
    positions: np.ndarray, triangles: np.ndarray, refs: np.ndarray, leaves: np.ndarray, threads: int
) -> np.ndarray:
    """Return the blocks of `leaves` as flat float32 words; see `build_mesh_bvh` and `collapse`."""
    block_count = int(leaves[-1, 2]) + -(-int(leaves[-1, 1]) // BLOCK)
    blocks = aligned(BLOCK_WORDS * block_count)
    cuts = np.linspace(0, len(leaves), threads + 1).astype(np.int64)
    run_threads(
        lambda k: write_blocks(
            positions, triangles, address(refs), leaves, cuts[k], cuts[k + 1], address(blocks)
        ),
        threads,
    )
    return blocks


@jit(allocates=True)
def write_nodes(refs, boxes, links, rows, nodes, leaves, stack):
    """Write wide nodes depth first; return how many nodes and leaves there are.

    refs, boxes, links  of a BinaryTree, the first two by address;  rows  as of `collapse`
    nodes   address of 64 float32 words for each reference;  leaves  (n, 3) int64
    stack   (_STACK_ROWS, 2) int64 to work in
    """
    children = np.empty(WIDTH, np.int64)
    node_count, block_count, leaf_count = 1, i64(0), 0
    stack[0, 0], stack[0, 1] = 0, 0
    waiting = 1
    while waiting > 0:
        waiting -= 1
        source, node = stack[waiting, 0], stack[waiting, 1] * NODE_WORDS
        count = open_children(boxes, links, source, children)
        for k in range(WIDTH):
            if k >= count:
                clear_child(nodes, node, k)
                continue
            child = children[k]
            for axis in range(3):
                stf(nodes, node + 16 * axis + k, ldf(boxes, 8 * child + axis))
                stf(nodes, node + 16 * axis + 8 + k, -ldf(boxes, 8 * child + 4 + axis))
            if links[child, 1] & u32(LEAF):
                first, size = i64(links[child, 0]), i64(links[child, 1] & u32(0x7FFFFFFF))
                leaves[leaf_count, 0], leaves[leaf_count, 1], leaves[leaf_count, 2] = first, size, block_count
                leaf_count += 1
                blocks = (size + BLOCK - 1) // BLOCK
                target = i64(f2u(ldf(refs, 8 * first + 3))) if rows else block_count
                stu(nodes, node + REFS + k, u32(LEAF) | u32((blocks - 1) << 27) | u32(target))
                block_count += blocks
            else:
                stu(nodes, node + REFS + k, u32(node_count))
                stack[waiting, 0], stack[waiting, 1] = child, node_count
                waiting += 1
                node_count += 1
    return node_count, leaf_count


@jit
def open_children(boxes, links, source, children):
    """Begin with the children of the binary node `source`, itself where it is a leaf, and replace the one of
    largest area by its two children until there are 8; return their count.

    children  (WIDTH,) int64, written;  boxes, links  as of `write_nodes`
    """
    if links[source, 1] & u32(LEAF):
        children[0] = source
        return 1
    children[0], children[1] = i64(links[source, 0]), i64(links[source, 1])
    count = 2
    while count < WIDTH:
        largest, chosen = f32(-1), -1
        for k in range(count):
            if not links[children[k], 1] & u32(LEAF):
                size = area(vload8(boxes, 8 * children[k]))
                if size > largest:
                    largest, chosen = size, k
        if chosen < 0:
            break
        opened = children[chosen]
        children[chosen], children[count] = i64(links[opened, 0]), i64(links[opened, 1])
        count += 1
    return count


@jit
def clear_child(nodes, node, k):
    """Make child k of the node at word `node`, int64, of the address `nodes` empty."""
    for axis in range(3):
        stf(nodes, node + 16 * axis + k, _FAR)
        stf(nodes, node + 16 * axis + 8 + k, -_FAR)
    stu(nodes, node + REFS + k, u32(NO_REF))


@jit
def write_blocks(positions, triangles, refs, leaves, start, stop, blocks):
    """Write the blocks of leaves start..stop, rows of (n, 3) int64, to the address `blocks`.

    positions  (V, 3) float32;  triangles  (T, 3) uint32;  refs  address of the references
    """
    for leaf in range(start, stop):
        first, size, block = leaves[leaf, 0], leaves[leaf, 1], leaves[leaf, 2]
        for i in range(-(-size // BLOCK) * BLOCK):
            word, lane = (block + i // BLOCK) * BLOCK_WORDS, i % BLOCK
            if i >= size:
                stu(blocks, word + IDS + lane, u32(NO_REF))
                continue
            triangle = i64(f2u(ldf(refs, 8 * (first + i) + 3)))
            flag = u32(NEEDLE) if is_needle(positions, triangles, triangle) else u32(0)
            stu(blocks, word + IDS + lane, u32(triangle) | flag)
            for corner in range(3):
                vertex = triangles[triangle, corner]
                for axis in range(3):
                    stf(blocks, word + 12 * corner + 4 * axis + lane, positions[vertex, axis])


@jit
def is_needle(positions, triangles, triangle):
    """Whether a triangle's least height is less than a quarter of its longest edge; arguments as of
    `write_blocks`, the row of the triangle."""
    p, q, s = triangles[triangle, 0], triangles[triangle, 1], triangles[triangle, 2]
    e1 = sub(_vertex(positions, q), _vertex(positions, p))
    e2 = sub(_vertex(positions, s), _vertex(positions, p))
    e3, normal = sub(e2, e1), cross(e1, e2)
    longest = max(dot(e1, e1), max(dot(e2, e2), dot(e3, e3)))
    return longest * longest > f64(16) * dot(normal, normal)


@jit
def _vertex(positions, vertex):
    """The position of a vertex as a tuple of float64."""
    return f64(positions[vertex, 0]), f64(positions[vertex, 1]), f64(positions[vertex, 2])


@jit
def shift_refs(nodes, node_count, first_node, first_block):
    """Make a tree's refs count from elsewhere.

    nodes  address of its `node_count` nodes;  first_node, first_block  int64, by how many farther ahead
    """
    for node in range(node_count):
        for k in range(WIDTH):
            word = node * NODE_WORDS + REFS + k
            ref = ldu(nodes, word)
            if ref != u32(NO_REF):
                stu(nodes, word, u32(i64(ref) + (first_block if ref & u32(LEAF) else first_node)))
