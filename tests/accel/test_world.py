"""Rays against scenes of instances."""

import numba
import numpy as np
import pytest

from ispm.accel.intersect import any_hit, closest, instance_scale
from ispm.accel.leave import leave_triangle
from ispm.accel.world import World
from ispm.optics.jit import jit
from ispm.optics.records import NO_HIT
from ispm.scene.mesh import Mesh
from ispm.scene.packed import pack
from ispm.scene.scene import Scene

SQUARE = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], np.float32)
HALVES = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)


def square():
    return Mesh(SQUARE.copy(), HALVES)


def world_of(scene, threads=1):
    world = World(threads)
    world.update(pack(scene))
    return world


def soup_scene(seed, instances=6):
    """Instances, turned and unevenly scaled, one mirrored, of two meshes of 40 triangles."""
    rng = np.random.default_rng(seed)
    meshes = [
        Mesh(rng.uniform(-1, 1, (120, 3)), np.arange(120, dtype=np.uint32).reshape(-1, 3)) for _ in "ab"
    ]
    scene = Scene()
    for k in range(instances):
        scale = rng.uniform(0.3, 2, 3) * (1, 1, -1 if k == 2 else 1)
        scene.add(meshes[k % 2], translation=rng.uniform(-3, 3, 3), rotation=rng.normal(size=4), scale=scale)
    return scene


def brute_force(packed, origins, directions):
    """Moeller-Trumbore in float64 against each triangle: (t, instance, primitive, u, v, doubtful)."""
    parts = []
    for i, row in enumerate(packed.instances):
        first, count = int(row["first_index"]), int(row["triangle_count"])
        corners = packed.geometry.vertices["position"][packed.geometry.indices[first : first + 3 * count]]
        matrix = np.stack([row[f"world{k}"] for k in range(3)]).astype(np.float64)
        world = corners @ matrix[:, :3].T + matrix[:, 3]
        parts.append((np.full(count, i), np.arange(count), world.reshape(-1, 3, 3)))
    instance, primitive, corners = (np.concatenate(p) for p in zip(*parts, strict=True))
    o, d = origins[:, None].astype(np.float64), directions[:, None].astype(np.float64)
    a = corners[None, :, 0]
    e1, e2 = corners[None, :, 1] - a, corners[None, :, 2] - a
    p, s = np.cross(d, e2), o - a
    det = np.sum(e1 * p, axis=-1)
    q = np.cross(s, e1)
    u, v, t = np.sum(s * p, -1) / det, np.sum(d * q, -1) / det, np.sum(e2 * q, -1) / det
    least = np.minimum(np.minimum(u, v), 1 - u - v)
    doubtful = ((np.abs(least) < 1e-4) & (t > 0)).any(axis=1)
    t = np.where((least >= 0) & (t > 0), t, np.inf)
    k, rows = t.argmin(axis=1), np.arange(len(origins))
    return t[rows, k], instance[k], primitive[k], u[rows, k], v[rows, k], doubtful


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_hits_agree_with_brute_force(seed):
    scene = soup_scene(seed)
    packed, world = pack(scene), world_of(scene)
    rng = np.random.default_rng(seed)
    origins = rng.uniform(-4, 4, (3000, 3)).astype(np.float32)
    directions = rng.normal(size=(3000, 3)).astype(np.float32)
    hits = world.trace(origins, directions)
    t, instance, primitive, u, v, doubtful = brute_force(packed, origins, directions)
    sure = ~doubtful
    assert sure.mean() > 0.9
    met = sure & np.isfinite(t)
    assert 300 < met.sum() < 2900
    assert (np.isfinite(hits["t"]) == np.isfinite(t))[sure].all()
    assert (hits["instance"][met] == instance[met]).all()
    assert (hits["primitive"][met] == primitive[met]).all()
    assert (hits["instance"][sure & ~met] == NO_HIT).all()
    # coordinates below 8, some 10 roundings, grown where a triangle is seen at its edge
    np.testing.assert_allclose(hits["t"][met], t[met], rtol=1e-3, atol=1e-4)
    good = np.abs(hits["u"][met] - u[met]) + np.abs(hits["v"][met] - v[met]) < 1e-4
    assert good.mean() > 0.99


def test_any_hit_agrees_with_closest():
    world = world_of(soup_scene(4))
    rng = np.random.default_rng(4)
    origins, directions = rng.uniform(-4, 4, (5000, 3)), rng.normal(size=(5000, 3))
    t = world.trace(origins, directions)["t"]
    met = np.isfinite(t)
    assert (world.occluded(origins, directions, np.inf) == met).all()
    assert (world.occluded(origins, directions, np.where(met, t * 1.001, 1.0))[met]).all()
    assert not world.occluded(origins, directions, np.where(met, t, 1e3)).any()
    assert (world.trace(origins, directions, np.where(met, t, 7.0))["instance"] == NO_HIT).all()


def test_hits_are_the_same_for_any_number_of_threads():
    scene = soup_scene(5)
    rng = np.random.default_rng(5)
    origins, directions = rng.uniform(-4, 4, (5000, 3)), rng.normal(size=(5000, 3))
    one, two = (world_of(scene, threads).trace(origins, directions) for threads in (1, 2))
    assert one.tobytes() == two.tobytes()


def test_distance_counts_in_lengths_of_the_direction():
    scene = Scene()
    scene.add(square(), scale=(3.0, 3.0, 0.2), translation=(0.0, 0.0, 5.0))
    hits = world_of(scene).trace([[0.5, 0.25, 0.0]], [[0.0, 0.0, 0.5]])
    np.testing.assert_allclose(hits["t"], 10.0, rtol=1e-6)


@pytest.mark.parametrize(
    "scale", [(0.0, 1.0, 1.0), (0.0, 0.0, 0.0), (1e-30, 1.0, 1.0), (1e-25, 1e-25, 1e-25), (1e18, 1e18, 1e18)]
)
def test_an_instance_without_an_inverse_is_never_hit(scale):
    scene = Scene()
    scene.add(square(), scale=scale, rotation=(0.3, 0.2, 0.1, 1.0))
    world = world_of(scene)
    rng = np.random.default_rng(6)
    directions = rng.normal(size=(1000, 3))
    assert (world.trace(-2 * directions, directions)["instance"] == NO_HIT).all()
    scene.add(square(), translation=(0.0, 0.0, 1.0))
    world.update(pack(scene))
    hits = world.trace([[0.0, 0.5, -1.0]], [[0.0, 0.0, 1.0]])
    assert hits["t"][0] == 2.0


def test_a_flat_but_upright_scale_is_hit():
    scene = Scene()
    scene.add(square(), scale=(1.0, 1.0, 1e-6))
    assert world_of(scene).trace([[0.0, 0.5, -1.0]], [[0.0, 0.0, 1.0]])["t"][0] == 1.0


def test_an_empty_scene_has_no_hits():
    world = world_of(Scene())
    assert world.trace([[0.0, 0.0, 0.0]], [[0.0, 0.0, 1.0]])["instance"][0] == NO_HIT
    assert not world.occluded([[0.0, 0.0, 0.0]], [[0.0, 0.0, 1.0]], np.inf).any()


def test_rays_that_have_no_direction_or_no_number_hit_nothing():
    world = world_of(soup_scene(7))
    odd = [[0.0, 0.0, 0.0], [np.nan, 0.0, 1.0], [np.nan, np.nan, np.nan]]
    assert (world.trace(np.zeros((3, 3)), odd)["instance"][[0, 2]] == NO_HIT).all()
    assert world.trace(odd[2:], [[0.0, 0.0, 1.0]])["instance"][0] == NO_HIT


def test_an_update_follows_what_moves_and_what_is_touched():
    scene, mesh = Scene(), square()
    node = scene.add(mesh)
    packed = pack(scene)
    world = World(1)
    world.update(packed)
    ray = [[0.0, 0.5, -1.0]], [[0.0, 0.0, 1.0]]
    assert world.trace(*ray)["t"][0] == 1.0
    node.translation = (0.0, 0.0, 2.0)
    packed = pack(scene, packed)
    before = world.trees
    world.update(packed)
    assert world.trace(*ray)["t"][0] == 3.0
    assert world.trees.nodes is before.nodes  # the mesh's tree was kept
    mesh.positions[:, 2] = 1.0
    mesh.touch()
    world.update(pack(scene, packed))
    assert world.trace(*ray)["t"][0] == 4.0
    scene.roots.clear()
    world.update(pack(scene))
    assert np.isinf(world.trace(*ray)["t"][0])


def cube(quads, size=2.0):
    """A closed cube about the origin, its faces in quads."""
    g = np.linspace(-size / 2, size / 2, quads + 1)
    a, b = (x.ravel() for x in np.meshgrid(g, g, indexing="ij"))
    i, j = np.meshgrid(np.arange(quads), np.arange(quads), indexing="ij")
    k = (i * (quads + 1) + j).ravel()
    face = np.concatenate(
        [np.stack([k, k + quads + 1, k + quads + 2], 1), np.stack([k, k + quads + 2, k + 1], 1)]
    )
    positions, triangles = [], []
    for axis in range(3):
        for side in (-1, 1):
            point = np.empty((len(a), 3))
            point[:, axis], point[:, (axis + 1) % 3], point[:, (axis + 2) % 3] = side * size / 2, a, b
            triangles.append(face + len(positions) * len(a))
            positions.append(point)
    return Mesh(np.concatenate(positions), np.concatenate(triangles))


@pytest.mark.parametrize("place", [(0.0, 0.0, 0.0), (1024.0, -512.0, 256.0)])
def test_rays_along_axes_meet_edges_corners_and_faces_they_run_in(place):
    # All coordinates are binary fractions, so every product is exact. Rays start on all crossings of the
    # grid, the outermost in the planes of the side faces, where boxes are met at their very faces.
    scene = Scene()
    scene.add(cube(8), translation=place)
    world = world_of(scene)
    g = np.linspace(-1, 1, 9)
    a, b = (x.ravel() for x in np.meshgrid(g, g, indexing="ij"))
    for axis in range(3):
        for side in (-1.0, 1.0):
            origins = np.zeros((len(a), 3))
            origins[:, (axis + 1) % 3], origins[:, (axis + 2) % 3] = a, b
            directions = np.zeros((len(a), 3))
            directions[:, axis] = side
            hits = world.trace(origins + place, directions)
            assert (hits["t"] == 1.0).all()


def test_no_ray_passes_between_triangles():
    # A closed cube of 24 x 24 quads a face, its corners shaken, turned and 1 km away: 400,000 rays from
    # within, aimed at points on edges and at corners of triangles. All of them hit.
    rng = np.random.default_rng(8)
    mesh = cube(24)
    _, same = np.unique(mesh.positions, axis=0, return_inverse=True)
    mesh.positions += rng.normal(0, 0.01, (same.max() + 1, 3)).astype(np.float32)[same.ravel()]
    for place in ((0.0, 0.0, 0.0), (700.0, -500.0, 500.0)):
        scene = Scene()
        scene.add(mesh, translation=place, rotation=(0.3, -0.2, 0.5, 1.0))
        packed = pack(scene)
        row = packed.instances[0]
        matrix = np.stack([row[f"world{k}"] for k in range(3)])
        corners = (mesh.positions @ matrix[:, :3].T + matrix[:, 3])[mesh.triangles]
        pick = rng.integers(len(corners), size=200_000)
        along = np.where(rng.random(200_000) < 0.2, 0.0, rng.random(200_000))[:, None]
        targets = corners[pick, 0] * (1 - along) + corners[pick, 1] * along
        origins = (rng.uniform(-0.5, 0.5, (200_000, 3)) + place).astype(np.float32)
        world = World(1)
        world.update(packed)
        assert (world.trace(origins, targets - origins)["instance"] == 0).all()


@jit
def leave(trees, corner, e1, e2, u, v, n, instance):
    return leave_triangle(corner, e1, e2, u, v, n, instance_scale(trees, instance))


def floats(*values):
    return tuple(np.float32(x) for x in values)


def test_a_left_triangle_is_behind_by_more_than_its_rounding():
    scene = Scene()
    scene.add(square(), translation=(0.0, 0.0, 1000.0))
    world = world_of(scene)
    place = floats(-1, -1, 1000), floats(2, 0, 0), floats(2, 2, 0)
    for u, v in ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (0.5, 0.5), (0.3, 0.2)):
        x, y, z = leave(world.trees, *place, *floats(u, v), floats(0, 0, -1), 0)
        assert 1e-4 < 1000.0 - z < 1e-3
        # inside the triangle (-1, -1), (1, -1), (1, 1) by more than an ulp of 1 km
        assert min(1 - x, y + 1, x - y) > 6e-5
        exact = np.array([-1 + 2 * u + 2 * v, -1 + 2 * v])
        assert np.abs([x, y] - exact).max() < 5e-3


def test_kernels_stay_in_float32():
    world_of(soup_scene(9)).trace([[0.0, 0.0, 0.0]], [[0.0, 0.0, 1.0]])
    assert all(s.return_type == numba.float32 for s in closest.nopython_signatures)
    world_of(soup_scene(9)).occluded([[0.0, 0.0, 0.0]], [[0.0, 0.0, 1.0]], 1.0)
    assert all(s.return_type == numba.boolean for s in any_hit.nopython_signatures)
