"""Trees of meshes that deform: refitted ones find the hits that new ones find, and are built anew in time."""

import numpy as np
import pytest
from tracer_scenes import intersect64

import ispm
from ispm.accel import world as world_module
from ispm.accel.refit import WORSE
from ispm.accel.world import World
from ispm.optics.records import NO_HIT
from ispm.scene.packed import pack

RAYS = 20_000


def scene_of_three():
    """A ball among two others that share a mesh; `dent` changes it."""
    scene = ispm.Scene()
    scene.add(ispm.shapes.torus(0.4, 0.15), name="ring", translation=(-1, 0, 0))
    scene.add(ispm.shapes.sphere(0.5), name="ball")
    scene.add(scene["ring"].parts[0].mesh, name="other ring", translation=(1, 0, 0))
    return scene


def waves(step):
    """Another shape of the ball for each step."""
    x, y, z = ispm.shapes.sphere(0.5).positions.T
    return np.stack([x + 0.1 * np.sin(9 * y + step), y * (1 + 0.05 * step), z + 0.1 * np.cos(7 * x)], axis=1)


def rays(seed=1, reach=1.6):
    random = np.random.default_rng(seed)
    origins = random.uniform(-reach, reach, (RAYS, 3)).astype(np.float32)
    return origins, random.normal(size=(RAYS, 3)).astype(np.float32)


def world_of(scene, threads=1):
    world = World(threads)
    world.update(pack(scene))
    return world


@pytest.fixture
def built(monkeypatch):
    """The meshes of which trees are built, by how many triangles they have."""
    counts, build = [], world_module.build_mesh_bvh
    monkeypatch.setattr(
        world_module, "build_mesh_bvh", lambda p, t, threads: counts.append(len(t)) or build(p, t, threads)
    )
    return counts


@pytest.mark.parametrize("threads", [1, 2])
def test_a_refitted_tree_finds_what_a_new_one_finds(threads, built):
    scene, world, packed = scene_of_three(), World(threads), None
    mesh = scene["ball"].parts[0].mesh
    for step in range(6):
        mesh.positions = waves(step)
        if step == 3:  # as meshes come and go, trees move
            scene.add(ispm.shapes.box(), name="box", translation=(0, 1.2, 0))
        if step == 5:
            scene.remove("box")
            scene.remove("ring")
        packed = pack(scene, packed)
        world.update(packed)
        fresh = world_of(scene)
        assert world.trace(*rays(step)).tobytes() == fresh.trace(*rays(step)).tobytes()
        assert world.occluded(*rays(step), 1.0).tobytes() == fresh.occluded(*rays(step), 1.0).tobytes()
        np.testing.assert_array_equal(world._boxes, fresh._boxes)
    own = [len(part.mesh.triangles) for part in (*scene["ball"].parts, *scene["other ring"].parts)]
    assert built.count(own[0]) == 1 + 6 and built.count(own[1]) == 1 + 6  # 6 times for the fresh ones


def test_a_refitted_tree_finds_the_nearest_triangle():
    """Against all triangles, in float64; rays through edges and aslant aside."""
    scene, world = scene_of_three(), World(1)
    packed = pack(scene)
    world.update(packed)
    scene["ball"].parts[0].mesh.positions = waves(4)
    packed = pack(scene, packed)
    world.update(packed)
    origins, directions = (each[:300] for each in rays(9))
    hits = world.trace(origins, directions)
    corners = []
    for row in packed.instances:
        kept = packed.geometry.ranges[row["mesh"]].mesh
        matrix = np.stack([row[f"world{k}"] for k in range(3)]).astype(np.float64)
        corners.append((kept.positions @ matrix[:, :3].T + matrix[:, 3])[kept.triangles])
    every = np.concatenate(corners)
    t, least, cosine = intersect64(origins[:, None], directions[:, None], every[None])
    met = (least >= 0) & (t > 0)
    nearest = np.where(met, t, np.inf).min(axis=1)
    doubtful = ((np.abs(least) < 1e-5) | (cosine < 1e-5)).any(axis=1)
    found = np.where(hits["instance"] == NO_HIT, np.inf, hits["t"])[~doubtful]
    assert (~doubtful).sum() > 200 and np.isfinite(found).sum() > 30
    np.testing.assert_allclose(found, nearest[~doubtful], rtol=1e-4)


def test_other_trees_stay_where_they_are(built):
    scene, world = scene_of_three(), World(1)
    packed = pack(scene)
    world.update(packed)
    nodes, trees, digest = world._nodes, world.trees, packed.geometry.digest
    scene["ball"].parts[0].mesh.positions = waves(1)
    later = pack(scene, packed)
    world.update(later)
    assert world._nodes is nodes and world.trees is not trees and len(built) == 2
    assert later.geometry.indices is packed.geometry.indices
    assert [a is b for a, b in zip(later.geometry.ranges, packed.geometry.ranges, strict=True)] == [
        True,
        False,
    ]
    assert later.geometry.digest != digest == packed.geometry.digest
    assert later.geometry.digest == pack(scene).geometry.digest


def test_a_tree_is_built_anew_once_it_costs_too_much(built):
    """Vertices in a random order have nothing to do with where they were."""
    scene, world = scene_of_three(), World(1)
    mesh, packed = scene["ball"].parts[0].mesh, pack(scene)
    world.update(packed)
    mesh.positions = mesh.positions * np.float32(1.1)
    packed = pack(scene, packed)
    world.update(packed)
    assert len(built) == 2  # however large, it is as good as it was
    mesh.positions = mesh.positions[np.random.default_rng(2).permutation(len(mesh.positions))]
    packed = pack(scene, packed)
    world.update(packed)
    assert built[2:] == [len(mesh.triangles)]
    assert world.trace(*rays()).tobytes() == world_of(scene).trace(*rays()).tobytes()
    assert WORSE > 1.0


@pytest.mark.parametrize("change", ["triangles", "vertices", "normals"])
def test_other_triangles_take_a_tree_of_their_own(change, built):
    scene, world = scene_of_three(), World(1)
    mesh, packed = scene["ball"].parts[0].mesh, pack(scene)
    world.update(packed)
    if change == "triangles":
        mesh.triangles = mesh.triangles[::2].copy()
    elif change == "vertices":
        new = ispm.shapes.sphere(0.6, segments=12)
        for name in ("positions", "triangles", "normals", "uv0"):
            setattr(mesh, name, getattr(new, name))
    else:
        mesh.normals = None
    world.update(pack(scene, packed))
    assert len(built) == 3
    assert world.trace(*rays()).tobytes() == world_of(scene).trace(*rays()).tobytes()


def test_needles_are_found_again():
    """A grid drawn out a hundredfold is all needles, which rays meet in another way."""
    scene = ispm.Scene()
    steps = np.linspace(-1, 1, 21)
    x, z = (each.ravel() for each in np.meshgrid(steps, steps))
    first = (21 * np.arange(20)[:, None] + np.arange(20)).ravel()[:, None]
    triangles = np.concatenate([first + np.array(k) for k in ([0, 21, 1], [1, 21, 22])])
    mesh = ispm.Mesh(np.stack([x, 0 * x, z], axis=1), triangles)
    scene.add(mesh)
    packed, world = pack(scene), World(1)
    world.update(packed)
    mesh.positions = mesh.positions * np.array([100.0, 1.0, 1.0])
    world.update(pack(scene, packed))
    assert world.trace(*rays(4)).tobytes() == world_of(scene).trace(*rays(4)).tobytes()


def test_an_animation_refits_the_tree_of_what_it_deforms(built):
    """`scene.at` makes nodes anew for each moment; what they show is still the same."""
    scene, world = scene_of_three(), World(1)
    ball = scene["ball"]
    ball.parts[0].mesh.morphs = [ispm.Morph(waves(1) - ball.parts[0].mesh.positions)]
    ball.weights = [0.0]
    scene.animations.append(ispm.Animation([ispm.Channel(ball, "weights", [0.0, 1.0], [[0.0], [1.0]])]))
    packed = pack(scene.at(0.0))
    world.update(packed)
    built.clear()
    for time in (0.3, 0.6, 1.0):
        packed = pack(scene.at(time), packed)
        world.update(packed)
        new = world_of(scene.at(time))
        assert built == [len(part.mesh.triangles) for part in packed.geometry.ranges]  # of the new one
        built.clear()
        assert world.trace(*rays()).tobytes() == new.trace(*rays()).tobytes()
