"""All instances of a scene, ready for rays: a tree over instances above one tree per mesh."""

from __future__ import annotations

import math
from operator import is_
from typing import Any

import numpy as np

from ispm.accel.build import BinaryTree
from ispm.accel.bvh import MeshBvh, build_mesh_bvh
from ispm.accel.collapse import BLOCK_WORDS, NODE_WORDS, collapse, empty_node
from ispm.accel.intersect import (
    ROW_REACH,
    ROW_ROOT,
    ROW_SCALE,
    ROW_WORDS,
)
from ispm.accel.rays import HIT, occlude_rays, trace_rays
from ispm.accel.records import Trees
from ispm.accel.refit import refit
from ispm.kernels.simd import address, aligned, stf, stu
from ispm.kernels.threads import run_threads, thread_count
from ispm.optics.jit import jit
from ispm.optics.vector import cross, dot
from ispm.scene.packed import Geometry, MeshRange, Packed, to_world

f32, f64, u32 = np.float32, np.float64, np.uint32

# Rounding errors of a point count in units of 2^-24 of its instance's scale; a box takes four of them.
_BOX_MARGIN = 4.0 * 2.0**-24
# A matrix that loses more than 20 of float32's 24 bits has no usable inverse.
_WORST_GROWTH = 2.0**20


class World:
    """Two-level tree over the instances of a packed scene.

    trees  what kernels are handed of it; another one after each `update`, which may write into its arrays
    """

    def __init__(self, threads: int | None = None) -> None:
        """threads: how many work at once; None: one for each usable core."""
        self.threads = thread_count(threads)
        self._geometry: Geometry | None = None
        self._placed: np.ndarray | None = None
        self._scratch = np.empty(0, np.uint8)
        self._trees: dict[int, tuple[MeshRange, MeshBvh]] = {}
        self._roots = np.zeros(0, np.uint32)
        self._boxes = np.zeros((0, 2, 3), np.float32)
        self._nodes = self._blocks = np.zeros(0, np.float32)
        self._place(np.zeros((0, 3, 4), np.float32), np.zeros(0, np.uint32))

    def update(self, packed: Packed) -> None:
        """Build trees of the meshes that are new in a scene, refit those of meshes that deformed, and build
        the tree over its instances.

        Nothing is done for instances that are in it already, which are not to be edited.
        """
        if packed.instances is self._placed:
            return
        if packed.geometry is not self._geometry:
            self._join(packed.geometry)
            self._geometry = packed.geometry
        rows = self._placed = packed.instances
        matrices = to_world(rows)
        self._place(matrices, np.ascontiguousarray(rows["mesh"]))

    def scratch(self, count: int, dtype: np.dtype) -> np.ndarray:
        """Return (count,) records of any content, overwritten by who calls next.

        Kept between frames: fresh memory costs the system more than filling it.
        """
        nbytes = count * dtype.itemsize
        if self._scratch.nbytes < nbytes:
            self._scratch = np.empty(nbytes, np.uint8)
        return self._scratch[:nbytes].view(dtype)

    def trace(
        self, origins: np.ndarray, directions: np.ndarray, t_max: float | np.ndarray = np.inf
    ) -> np.ndarray:
        """Return the nearest hits, (N,) HIT.

        origins, directions  (N, 3) float32; t counts in lengths of the direction
        t_max                hits must be nearer; (N,) or one for all
        """
        hits = np.empty(len(origins), HIT)
        self._share(trace_rays, origins, directions, t_max, address(hits))
        return hits

    def occluded(self, origins: np.ndarray, directions: np.ndarray, t_max: float | np.ndarray) -> np.ndarray:
        """Return whether anything is nearer than t_max, (N,) bool; arguments as for `trace`."""
        blocked = np.empty(len(origins), np.bool_)
        self._share(occlude_rays, origins, directions, t_max, blocked)
        return blocked

    def _share(
        self, kernel: Any, origins: np.ndarray, directions: np.ndarray, t_max: float | np.ndarray, out: Any
    ) -> None:
        """Run a kernel over rays on all threads."""
        count = len(origins)
        origins = np.ascontiguousarray(origins, np.float32)
        directions = np.ascontiguousarray(directions, np.float32)
        limits = np.ascontiguousarray(np.broadcast_to(np.asarray(t_max, np.float32), count))
        counter = np.zeros(1, np.int64)
        arrays = [address(a) for a in (origins, directions, limits)]
        run_threads(lambda _: kernel(self.trees, *arrays, count, address(counter), out), self.threads)

    def _join(self, geometry: Geometry) -> None:
        """Put the trees of all meshes into one array of nodes and one of blocks."""
        known = [tree for _, tree in self._trees.values()]
        trees = [self._tree(part) for part in geometry.ranges]
        kept = zip(geometry.ranges, trees, strict=True)
        self._trees = {id(part.source): (part, tree) for part, tree in kept}
        self._boxes = np.array([tree.bounds for tree in trees], np.float32).reshape(-1, 2, 3)
        if len(trees) == len(known) and all(map(is_, trees, known)):
            return  # where they are
        self._nodes = aligned(sum(len(tree.nodes) for tree in trees))
        self._blocks = aligned(sum(len(tree.blocks) for tree in trees))
        node = block = 0
        for tree in trees:
            nodes, blocks = len(tree.nodes), len(tree.blocks)
            places = self._nodes[node : node + nodes], self._blocks[block : block + blocks]
            tree.move(*places, node // NODE_WORDS, block // BLOCK_WORDS)
            node, block = node + nodes, block + blocks
        self._roots = np.array([tree.first_node for tree in trees], np.uint32)

    def _tree(self, part: MeshRange) -> MeshBvh:
        """Return the tree of a mesh: the one that is kept where the mesh is still the same, refitted where it
        deformed and that serves."""
        mesh = part.mesh
        if id(part.source) in self._trees:
            known, tree = self._trees[id(part.source)]
            if known.source is part.source:
                if known.shows(mesh):
                    return tree
                same = tree.whole and known.is_shaped_by(mesh)
                if same and refit(tree, mesh.positions, mesh.triangles, self.threads):
                    return tree
        return build_mesh_bvh(mesh.positions, mesh.triangles, self.threads)

    def _place(self, matrices: np.ndarray, meshes: np.ndarray) -> None:
        """Build the tree over instances.

        matrices  (n, 3, 4) float32, object to world space;  meshes  (n,) uint32
        """
        count = len(matrices)
        refs = aligned(8 * count).reshape(-1, 8)
        rows = aligned(ROW_WORDS * count)
        used = write_rows(matrices, meshes, self._boxes, self._roots, address(refs), address(rows))
        reach = np.float32(0.0)
        if used:
            tree = BinaryTree(refs[:used], 0, 1, 1)
            top, _ = collapse(tree, rows=True)
            reach = np.abs(tree.bounds).max()
        else:
            top = empty_node()
        self.trees = Trees(top, rows, self._nodes, self._blocks, reach)


@jit(allocates=True)
def write_rows(matrices, meshes, boxes, roots, refs, rows):
    """Write the row of each instance and a reference to each that rays can hit; return their count.

    matrices  (n, 3, 4) float32, object to world space;  meshes  (n,) uint32, row of boxes and roots
    boxes     (m, 2, 3) float32;  roots  (m,) uint32, nodes;  refs, rows  addresses, written
    An instance without a usable inverse is a plane or less: it is left out.
    Its scale is the largest number met on the path of a point to world space, times how much an error grows
    that goes through the inverse and back, the norm of |M| |M^-1|.
    """
    inverse = np.empty((3, 4), np.float64)
    count = 0
    for i in range(len(matrices)):
        mesh = meshes[i]
        if not invert(matrices, i, inverse):
            continue
        scale, growth, reach = f64(0), f64(0), f64(0)
        for r in range(3):
            size, row_growth = abs(f64(matrices[i, r, 3])), f64(0)
            for k in range(3):
                largest = f64(max(abs(boxes[mesh, 0, k]), abs(boxes[mesh, 1, k])))
                reach = max(reach, largest)
                size += abs(f64(matrices[i, r, k])) * largest
                for c in range(3):
                    row_growth += abs(f64(matrices[i, r, k]) * inverse[k, c])
            scale, growth = max(scale, size), max(growth, row_growth)
        scale *= growth
        # written so that NaN is left out too
        if not (growth < _WORST_GROWTH and scale < 1e18):
            continue
        margin = scale * _BOX_MARGIN
        for r in range(3):
            low = high = f64(matrices[i, r, 3])
            for k in range(3):
                a = f64(matrices[i, r, k]) * f64(boxes[mesh, 0, k])
                b = f64(matrices[i, r, k]) * f64(boxes[mesh, 1, k])
                low += min(a, b)
                high += max(a, b)
            stf(refs, 8 * count + r, f32(low - margin))
            stf(refs, 8 * count + 4 + r, f32(-high - margin))
            for k in range(4):
                stf(rows, ROW_WORDS * i + 4 * r + k, f32(inverse[r, k]))
        stu(refs, 8 * count + 3, u32(i))
        stu(rows, ROW_WORDS * i + ROW_ROOT, roots[mesh])
        stf(rows, ROW_WORDS * i + ROW_REACH, f32(reach))
        stf(rows, ROW_WORDS * i + ROW_SCALE, f32(scale))
        count += 1
    return count


@jit
def invert(matrices, i, inverse):
    """Write the inverse of matrix i of (n, 3, 4) float32 to (3, 4) float64; return whether it has one."""
    x, y, z = _left_row(matrices, i, 0), _left_row(matrices, i, 1), _left_row(matrices, i, 2)
    columns = cross(y, z), cross(z, x), cross(x, y)
    determinant = dot(x, cross(y, z))
    if determinant == f64(0) or not math.isfinite(determinant):
        return False
    q = f64(1) / determinant
    for r in range(3):
        inverse[r, 3] = f64(0)
        for c in range(3):
            inverse[r, c] = columns[c][r] * q
            inverse[r, 3] -= inverse[r, c] * f64(matrices[i, c, 3])
    return True


@jit
def _left_row(matrices, i, r):
    """The first three numbers of a row of matrix i, float64."""
    return f64(matrices[i, r, 0]), f64(matrices[i, r, 1]), f64(matrices[i, r, 2])
