"""Trees over one mesh."""

import numpy as np
import pytest

from ispm.accel import build, collapse
from ispm.accel.bvh import build_mesh_bvh
from ispm.accel.world import World
from ispm.kernels.simd import address, aligned
from ispm.scene.mesh import Mesh
from ispm.scene.packed import pack
from ispm.scene.scene import Scene


def soup(count, seed, spread=10.0, size=0.3):
    """(positions, triangles) of scattered triangles."""
    rng = np.random.default_rng(seed)
    centers = rng.uniform(0, spread, (count, 1, 3))
    positions = (centers + rng.normal(0, size, (count, 3, 3))).reshape(-1, 3)
    return positions.astype(np.float32), np.arange(3 * count, dtype=np.uint32).reshape(-1, 3)


def world_of(positions, triangles):
    scene = Scene()
    scene.add(Mesh(positions, triangles, normals=np.zeros_like(positions) + np.float32(1)))
    world = World(1)
    world.update(pack(scene))
    return world


def leaves(bvh):
    """Ids of all triangles in the blocks that leaves point to, depth of the tree; checks the boxes."""
    words = bvh.nodes.view(np.uint32).reshape(-1, collapse.NODE_WORDS)
    planes = bvh.nodes.reshape(-1, collapse.NODE_WORDS)
    blocks = bvh.blocks.reshape(-1, collapse.BLOCK_WORDS)
    found, deepest, waiting = [], 0, [(0, 1)]
    while waiting:
        node, depth = waiting.pop()
        deepest = max(deepest, depth)
        for k in range(8):
            ref = int(words[node, collapse.REFS + k])
            if ref == collapse.NO_REF:
                assert (planes[node, k:48:16] > planes[node, k + 8 : 48 : 16]).all()
                continue
            if not ref & build.LEAF:
                assert ref > node
                waiting.append((ref, depth + 1))
                continue
            first, count = ref & 0x7FFFFFF, (ref >> 27 & 15) + 1
            part = blocks[first : first + count]
            ids = part[:, collapse.IDS :].copy().view(np.uint32)
            corners = part[:, : collapse.IDS].reshape(-1, 3, 3, 4).transpose(0, 3, 1, 2)
            corners = corners[ids != collapse.NO_REF].reshape(-1, 3)
            assert (corners.min(axis=0) == planes[node, k:48:16]).all()
            assert (corners.max(axis=0) == planes[node, k + 8 : 48 : 16]).all()
            found += (ids[ids != collapse.NO_REF] & ~np.uint32(collapse.NEEDLE)).tolist()
    return found, deepest


@pytest.mark.parametrize("count", [1, 2, 3, 4, 5, 8, 9, 33, 1000])
def test_tree_holds_each_triangle_once(count):
    bvh = build_mesh_bvh(*soup(count, count))
    found, _ = leaves(bvh)
    assert sorted(found) == list(range(count))


def test_tree_is_the_same_for_any_number_of_threads():
    # above the size from which work is shared
    positions, triangles = soup(20_000, 3)
    one, two, three = (build_mesh_bvh(positions, triangles, threads) for threads in (1, 2, 3))
    assert one.nodes.tobytes() == two.nodes.tobytes() == three.nodes.tobytes()
    assert one.blocks.tobytes() == two.blocks.tobytes() == three.blocks.tobytes()


def test_tree_takes_strided_positions():
    positions, triangles = soup(50, 4)
    wide = np.zeros(len(positions), [("position", "<f4", 3), ("rest", "<f4", 13)])
    wide["position"] = positions
    strided, dense = build_mesh_bvh(wide["position"], triangles), build_mesh_bvh(positions, triangles)
    assert strided.blocks.tobytes() == dense.blocks.tobytes()


def test_tree_of_equal_triangles_holds_all():
    positions, _ = soup(1, 5)
    found, _ = leaves(build_mesh_bvh(positions, np.tile(np.uint32([0, 1, 2]), (5000, 1)), 2))
    assert sorted(found) == list(range(5000))


def test_points_and_needles_are_never_hit_and_hide_nothing():
    positions, triangles = soup(40, 6)
    flat = triangles.copy()
    flat[::2, 2] = flat[::2, 1]  # needles
    flat[::4] = flat[::4, :1]  # points
    world, whole = world_of(positions, flat), world_of(positions, triangles[1::2])
    rng = np.random.default_rng(7)
    origins, directions = rng.uniform(0, 10, (20_000, 3)), rng.normal(size=(20_000, 3))
    hits, truth = world.trace(origins, directions), whole.trace(origins, directions)
    assert (hits["t"] == truth["t"]).all()
    assert np.isfinite(truth["t"]).sum() > 50


def test_triangles_that_are_not_finite_are_left_out():
    positions, triangles = soup(9, 8)
    positions[3, 1], positions[9, 0], positions[15, 2] = np.nan, np.inf, -1e30
    found, _ = leaves(build_mesh_bvh(positions, triangles))
    assert sorted(found) == [0, 2, 4, 6, 7, 8]
    assert leaves(build_mesh_bvh(positions[9:12], triangles[:1])) == ([], 1)


def test_exponentially_spaced_triangles_stay_within_the_stack():
    # 100,000 triangles at 2^-60 .. 2^55 m: bins of equal width part off a few octaves at a time.
    count = 100_000
    x = np.exp2(np.linspace(-60, 55, count))
    positions = np.stack(
        [np.repeat(x, 3), np.tile([0.0, 1.0, 0.0], count), np.tile([0.0, 0.0, 1.0], count)], axis=1
    )
    triangles = np.arange(3 * count, dtype=np.uint32).reshape(-1, 3)
    bvh = build_mesh_bvh(positions, triangles, 2)
    found, depth = leaves(bvh)
    assert sorted(found) == list(range(count))
    assert depth <= build.MAX_DEPTH
    world = world_of(positions.astype(np.float32), triangles)
    # From behind all of them and from before all: every box lies on the way.
    hits = world.trace([[-1.0, 0.25, 0.25], [2.0**56, 0.25, 0.25]], [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]])
    assert hits["t"][0] == 1.0
    assert np.isclose(hits["t"][1], 2.0**55)


def test_ranges_are_halved_where_levels_run_out():
    # 4096 references need 12 levels; with 12 left the cut is in the middle however uneven the boxes.
    count = 4096
    refs = aligned(8 * count).reshape(-1, 8)
    refs[:, 0] = np.exp2(-np.arange(count) / 40.0)
    refs[:, 4] = -refs[:, 0]
    boxes, scratch = aligned(16 * count), aligned(1024)
    links = np.zeros((2 * count, 2), np.uint32)
    tree = build.GrowingTree(address(refs), address(boxes), links, block_shift=2, leaf_size=8)
    free = build.split(tree, 0, count, build.MAX_DEPTH - 13, address(scratch))
    forced = build.split(tree, 0, count, build.MAX_DEPTH - 12, address(scratch))
    assert free != count // 2
    assert forced == count // 2
