"""The tree of one mesh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ispm.accel.build import BinaryTree, triangle_refs
from ispm.accel.collapse import (
    BLOCK,
    BLOCK_WORDS,
    LEAF_SIZE,
    NODE_WORDS,
    collapse,
    empty_node,
    shift_refs,
    triangle_blocks,
)
from ispm.kernels.simd import address, aligned


@dataclass
class MeshBvh:
    """Nodes and triangle blocks of one mesh, in object space, as `collapse` lays them out.

    nodes   (64 N,) float32 words, the root first
    blocks  (40 B,) float32 words
    bounds  (2, 3) float32 corners of the box; zeros without a usable triangle
    whole   whether all triangles are in it
    first_node, first_block  from which on its refs count
    cost    what rays meet of it as it was built, as `accel.refit` counts; None: not asked for yet
    """

    nodes: np.ndarray
    blocks: np.ndarray
    bounds: np.ndarray
    whole: bool
    first_node: int = 0
    first_block: int = 0
    cost: float | None = None

    def move(self, nodes: np.ndarray, blocks: np.ndarray, first_node: int, first_block: int) -> None:
        """Put the tree into other arrays, its refs counting from there.

        nodes, blocks  of as many words
        """
        nodes[:], blocks[:] = self.nodes, self.blocks
        shift = first_node - self.first_node, first_block - self.first_block
        shift_refs(address(nodes), len(nodes) // NODE_WORDS, *shift)
        self.nodes, self.blocks, self.first_node, self.first_block = nodes, blocks, first_node, first_block


def build_mesh_bvh(positions: np.ndarray, triangles: np.ndarray, threads: int = 1) -> MeshBvh:
    """Build the tree of a mesh; the same bytes for any number of threads.

    positions  (V, 3) float32, any strides;  triangles  (T, 3) uint32
    Triangles with a corner that is not finite, or beyond 1e18 m, are left out.
    """
    positions = np.ascontiguousarray(positions, np.float32)
    triangles = np.ascontiguousarray(triangles, np.uint32)
    refs = triangle_refs(positions, triangles, threads)
    if not len(refs):
        return MeshBvh(empty_node(), aligned(BLOCK_WORDS), np.zeros((2, 3), np.float32), False)
    tree = BinaryTree(refs, BLOCK.bit_length() - 1, LEAF_SIZE, threads)
    nodes, leaves = collapse(tree, rows=False)
    blocks = triangle_blocks(positions, triangles, refs, leaves, threads)
    return MeshBvh(nodes, blocks, tree.bounds, len(refs) == len(triangles))
