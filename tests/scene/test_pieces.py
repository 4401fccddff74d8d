"""Pieces of meshes: that they show all triangles once, and that their boxes hold them."""

from __future__ import annotations

import numpy as np

from ispm.scene.material import Material
from ispm.scene.mesh import Mesh
from ispm.scene.packed import PIECE, Packed, pack
from ispm.scene.pieces import Pieces
from ispm.scene.scene import Scene

TURNED = (0.2, 0.4, 0.1, 0.79**0.5)


def scattered(triangles: int, seed: int) -> Mesh:
    random = np.random.default_rng(seed)
    points = random.uniform(-1.0, 1.0, (3 * triangles, 3)).astype(np.float32)
    return Mesh(points, np.arange(3 * triangles, dtype=np.uint32).reshape(-1, 3))


def cut(scene: Scene) -> tuple[Packed, Pieces]:
    packed = pack(scene)
    low = [
        packed.boxes[d.first_instance : d.first_instance + d.instance_count, 0].min(axis=0)
        for d in packed.draws
    ]
    high = [
        packed.boxes[d.first_instance : d.first_instance + d.instance_count, 1].max(axis=0)
        for d in packed.draws
    ]
    return packed, Pieces.of(packed, np.stack([low, high], axis=1))


def test_pieces_show_each_triangle_once_and_hold_it() -> None:
    scene = Scene()
    scene.add(
        scattered(5 * PIECE + 7, 1), translation=(1.0, 2.0, 3.0), rotation=TURNED, scale=(1.0, -2.0, 0.5)
    )
    scene.add(scattered(3, 2))
    packed, pieces = cut(scene)
    shown = [np.arange(first, first + count) for first, count in zip(pieces.first, pieces.count, strict=True)]
    assert sorted(np.concatenate(shown)) == list(range(len(packed.geometry.indices)))
    assert np.bincount(pieces.row).tolist() in ([6, 1], [1, 6])
    for row, corners, box in zip(pieces.row, shown, pieces.boxes, strict=True):
        place = packed.instances[packed.draws[row].first_instance]
        matrix = np.stack([place["world0"], place["world1"], place["world2"]])
        points = (
            packed.geometry.vertices["position"][packed.geometry.indices[corners]] @ matrix[:, :3].T
            + matrix[:, 3]
        )
        assert (points >= box[0] - 1e-5).all() and (points <= box[1] + 1e-5).all()


def test_runs_join_neighbours_of_one_draw() -> None:
    scene = Scene()
    scene.add(scattered(4 * PIECE, 1))
    scene.add(scattered(2 * PIECE, 2))
    packed, pieces = cut(scene)
    some = np.array([0, 1, 3, 4])
    runs = [(first, count) for _, first, count in pieces.runs(some)]
    starts = packed.draws[1], packed.geometry.ranges[packed.draws[1].mesh].first_index
    assert runs == [(0, 6 * PIECE), (9 * PIECE, 3 * PIECE), (starts[1], 3 * PIECE)]
    assert list(pieces.runs(np.zeros(0, np.int64))) == []


def test_draws_of_many_copies_stay_whole() -> None:
    mesh, scene = scattered(3 * PIECE, 1), Scene()
    matter = Material()
    scene.add(mesh, material=matter)
    scene.add(mesh, material=matter, translation=(5.0, 0.0, 0.0))
    packed, pieces = cut(scene)
    assert pieces.count.tolist() == [9 * PIECE] and packed.draws[0].instance_count == 2


def test_a_scene_without_draws_has_no_pieces() -> None:
    assert not len(Pieces.of(pack(Scene()), np.zeros((0, 2, 3))).count)
