"""Trees over meshes that make trees bad, against plain loops: hits, cost, and the same bytes."""

import numpy as np
import pytest

from ispm.accel import build, collapse
from ispm.accel.build import BinaryTree, triangle_refs
from ispm.accel.bvh import build_mesh_bvh
from ispm.accel.world import World
from ispm.optics.records import NO_HIT
from ispm.scene.mesh import Mesh
from ispm.scene.packed import pack
from ispm.scene.scene import Scene


def scattered(rng, count, size=0.3):
    return rng.uniform(0.0, 10.0, (count, 1, 3)) + rng.normal(0.0, size, (count, 3, 3))


def slivers(rng, count):
    """A thousand times as long as wide, all ways."""
    corners = scattered(rng, count, 1.0)
    along = corners[:, 1] - corners[:, 0]
    corners[:, 2] = corners[:, 0] + 0.5 * along + 1e-3 * np.cross(along, rng.normal(size=(count, 3)))
    return corners


def coincident(rng, count):
    """Each eight times, at one place."""
    return np.repeat(scattered(rng, count // 8, 1.0), 8, axis=0)


def planar(rng, count):
    """All in one plane along two axes: boxes without a volume."""
    corners = scattered(rng, count)
    corners[..., 1] = 2.0
    return corners


def giant(rng, count):
    """One that covers all of the others' box."""
    corners = scattered(rng, count, 0.02)
    corners[-1] = [[-20.0, 5.0, -20.0], [40.0, 5.1, -20.0], [5.0, 4.9, 60.0]]
    return corners


def crowded(rng, count):
    """Most of them within a thousandth of the box."""
    corners = scattered(rng, count)
    corners[: count * 3 // 4] *= 1e-3
    return corners


AWKWARD = [scattered, slivers, coincident, planar, giant, crowded]


def mesh_of(make, count, seed=11):
    corners = make(np.random.default_rng(seed), count).astype(np.float32)
    return corners.reshape(-1, 3), np.arange(3 * len(corners), dtype=np.uint32).reshape(-1, 3)


def met(corners, origins, directions):
    """Distance, least barycentric and |cosine| of each ray (n, 1) and triangle (1, m), float64."""
    a, e1, e2 = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(e1, e2)
    facing = directions @ normal.T
    with np.errstate(all="ignore"):
        t = ((a * normal).sum(1) - origins @ normal.T) / facing
        away = origins[:, None] + t[..., None] * directions[:, None] - a
        square = (normal * normal).sum(1)
        u = np.einsum("nmk,mk->nm", np.cross(away, e2), normal) / square
        v = np.einsum("nmk,mk->nm", np.cross(e1, away), normal) / square
        cosine = np.abs(facing) / np.sqrt(square)
    return t, np.minimum(np.minimum(u, v), 1.0 - u - v), cosine


@pytest.mark.parametrize("make", AWKWARD)
def test_hits_are_those_of_a_loop_over_all_triangles(make):
    # Corners, and so barycentrics, are known to float32's rounding of coordinates up to 60 m against the
    # triangle's height: hits within 8 roundings of an edge may be missed, and those as far beyond it found.
    positions, triangles = mesh_of(make, 320)
    scene = Scene()
    scene.add(Mesh(positions, triangles))
    world = World(2)
    world.update(pack(scene))
    rng = np.random.default_rng(12)
    origins = rng.uniform(-2.0, 12.0, (600, 3)).astype(np.float32)
    corners = positions.astype(np.float64)[triangles]
    aims = corners[rng.integers(0, len(corners), 600)].mean(axis=1)
    directions = (aims - origins).astype(np.float32)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    hits = world.trace(origins, directions)
    t, least, cosine = met(corners, origins.astype(np.float64), directions.astype(np.float64))
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    heights = (
        np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / edges
    )
    rounding = 8.0 * 60.0 * 2.0**-24
    with np.errstate(all="ignore"):
        slack = rounding / (heights * cosine)
        off = rounding / cosine
    ahead = (t > 1e-3) & (cosine > 1e-3)
    surely = np.where(ahead & (least > slack), t + off, np.inf).min(axis=1)
    perhaps = np.where((t > -1e-3) & ~(least < -slack), t - off, np.inf)
    perhaps[~(cosine > 1e-3)] = -np.inf  # along the plane: anything goes
    found = np.where(hits["instance"] == NO_HIT, np.inf, hits["t"])
    assert (found <= surely).all()
    assert (found >= perhaps.min(axis=1)).all()
    assert np.isfinite(surely).mean() > 0.5  # most rays are told


@pytest.mark.parametrize("make", AWKWARD)
def test_trees_are_the_same_for_any_number_of_threads(make):
    mesh = mesh_of(make, 12_000)
    one = build_mesh_bvh(*mesh, 1)
    for threads in (2, 3, 7):
        other = build_mesh_bvh(*mesh, threads)
        assert other.nodes.tobytes() == one.nodes.tobytes() and other.blocks.tobytes() == one.blocks.tobytes()


def half_surface(low, high):
    x, y, z = np.moveaxis(high - low, -1, 0)
    return x * y + y * z + z * x


def blocks_of(count):
    return -(-count // collapse.BLOCK)


def sweep_cost(low, high):
    """Cost, m2, of the tree of (n, 3) boxes that tries all places of a cut along each axis.

    Half the surface of each node's box, times half a block, and times its blocks where it is a leaf.
    """
    n = len(low)
    whole = half_surface(low.min(axis=0), high.max(axis=0))
    left = np.arange(1, n)
    best, cut = np.inf, None
    for axis in range(3):
        order = np.argsort(low[:, axis] + high[:, axis], kind="stable")
        a, b = low[order], high[order]
        ahead = half_surface(np.minimum.accumulate(a), np.maximum.accumulate(b))
        behind = half_surface(np.minimum.accumulate(a[::-1]), np.maximum.accumulate(b[::-1]))[::-1]
        costs = ahead[:-1] * blocks_of(left) + behind[1:] * blocks_of(n - left)
        if n > 1 and costs.min() < best:
            best, cut = costs.min(), (order[: costs.argmin() + 1], order[costs.argmin() + 1 :])
    if cut is None or (n <= collapse.LEAF_SIZE and whole * blocks_of(n) <= best + 0.5 * whole):
        return whole * blocks_of(n)
    return 0.5 * whole + sum(sweep_cost(low[part], high[part]) for part in cut)


@pytest.mark.parametrize("make", AWKWARD)
def test_cost_is_near_that_of_trees_which_try_all_cuts(make):
    # Bins are for speed: they may cost a tenth at most.
    refs = triangle_refs(*mesh_of(make, 2000), 1)
    low, high = refs[:, :3].astype(np.float64), -refs[:, 4:7].astype(np.float64)
    wanted = sweep_cost(low, high)
    tree = BinaryTree(refs, collapse.BLOCK.bit_length() - 1, collapse.LEAF_SIZE, 1)
    got, waiting = 0.0, [0]
    while waiting:
        node = waiting.pop()
        surface = half_surface(tree.boxes[node, :3].astype(float), -tree.boxes[node, 4:7].astype(float))
        left, right = tree.links[node]
        if right & build.LEAF:
            got += surface * blocks_of(int(right & 0x7FFFFFFF))
        else:
            got += 0.5 * surface
            waiting += [int(left), int(right)]
    assert got <= 1.1 * wanted
