"""Reprojection: light is found again where what it lies on was seen."""

import numpy as np
import pytest

import ispm
from ispm.live.reproject import NOWHERE, moves, reproject, seen
from ispm.scene.packed import pack

SETTINGS = ispm.Settings(size=(160, 96), photons=100, subsampling=4)


@pytest.fixture
def scene():
    made = ispm.Scene()
    made.add(ispm.shapes.box((8, 0.2, 8)), translation=(0, -0.1, 0), name="floor")
    made.add(ispm.shapes.box((1, 1, 1)), translation=(-1.0, 0.5, 0), name="box")
    made.add(ispm.PointLight((10, 10, 10)), translation=(0, 4, 0))
    return made


class Look:
    """What a frame of a scene shows at low resolution, and its instances."""

    def __init__(self, gpu, scene, eye=(0.0, 2.5, 5.0), target=(0.0, 0.4, 0.0)):
        camera = ispm.Camera.look_at(eye, target)
        with ispm.Renderer(scene, SETTINGS, camera, gpu=gpu) as renderer:
            renderer.render()
            self.image, self.view = renderer._last.receivers, renderer._last.made.view
            self.placed = renderer._last.made.packed.placed
        self.points = self.image.points
        self.shown = self.points["valid"] > 0

    def keep(self, values):
        return seen(self.image, self.view, SETTINGS.subsampling, np.ascontiguousarray(values, np.float32))

    def find(self, before, values):
        """What is found here of values kept at the receivers of the frame before."""
        return reproject(self.points, moves(self.placed, before.placed), before.keep(values), 2)


def test_receivers_tell_their_instance(gpu, scene):
    look = Look(gpu, scene)
    rows = look.placed.instances
    numbers = look.points["valid"][look.shown].astype(int) - 1
    assert set(numbers) == {0, 1}
    box = look.points["position"][look.shown][rows["node"][numbers] == 1]
    assert (np.abs(box - [-1.0, 0.5, 0.0]).max(axis=1) < 0.501).all()


def test_a_picture_at_rest_is_found_whole(gpu, scene):
    look = Look(gpu, scene)
    found = look.find(look, np.full((len(look.points), 2), 3.0))
    np.testing.assert_allclose(found[look.shown], 3.0, rtol=1e-6)
    assert not found[~look.shown].any()


def test_values_stay_where_they_were_at_rest(gpu, scene):
    """The receiver itself weighs most: what neighbors add is a 50th each at a pixel's distance."""
    look = Look(gpu, scene)
    values = look.points["position"]
    for _ in range(20):
        values = look.find(look, values)
    off = np.linalg.norm(values - look.points["position"], axis=1)[look.shown]
    footprint = (look.points["footprint"] * look.points["slant"])[look.shown]
    assert np.median(off / footprint) < 0.25


def test_a_camera_that_moves_finds_the_same_places(gpu, scene):
    before, now = Look(gpu, scene), Look(gpu, scene, eye=(0.15, 2.5, 5.0))
    found = now.find(before, before.points["position"])
    known = (found != 0.0).any(axis=1)
    assert known.sum() > 0.9 * now.shown.sum()
    off = np.linalg.norm(found - now.points["position"], axis=1)[known]
    reach = (now.points["footprint"] * now.points["slant"])[known]
    assert (off < 2.2 * reach).all()  # the mean is of places in 3 x 3 pixels
    assert np.median(off / reach) < 0.5


def test_an_object_that_moves_takes_its_light_along(gpu, scene):
    before = Look(gpu, scene)
    is_box = before.placed.instances["node"][np.maximum(before.points["valid"].astype(int) - 1, 0)] == 1
    scene.nodes[1].translation = (1.0, 0.5, 0.2)
    now = Look(gpu, scene)
    found = now.find(before, np.where(is_box, 7.0, 2.0)[:, None])
    box = (now.placed.instances["node"][np.maximum(now.points["valid"].astype(int) - 1, 0)] == 1) & now.shown
    known = found[:, 0] > 0.0
    assert known[box].mean() > 0.8
    np.testing.assert_allclose(found[box & known], 7.0, rtol=1e-5)
    np.testing.assert_allclose(found[now.shown & ~box & known], 2.0, rtol=1e-5)


def test_what_was_hidden_is_not_known(gpu, scene):
    before = Look(gpu, scene)
    scene.nodes[1].translation = (1.0, 0.5, 0.0)
    now = Look(gpu, scene)
    found = now.find(before, np.ones((len(before.points), 1)))
    behind = np.linalg.norm(now.points["position"][:, [0, 2]] - [-1.0, 0.0], axis=1) < 0.3
    assert not found[behind & now.shown & (now.points["position"][:, 1] < 0.01)].any()


def test_a_cut_knows_nothing(gpu, scene):
    before = Look(gpu, scene)
    now = Look(gpu, scene, eye=(0.0, -2.5, 5.0))  # from below
    top = before.points["ng"][:, 1] > 0.5
    found = now.find(before, np.where(top, 1.0, 0.0)[:, None])
    assert not found.any()


def placed(scene):
    return pack(scene).placed


def test_instances_are_told_by_their_nodes(scene):
    before = placed(scene)
    first = scene.nodes[0]
    scene.roots.insert(0, scene.add(ispm.shapes.box((1, 1, 1)), name="new"))
    scene.roots.pop()
    scene.remove(first)
    now = placed(scene)
    found = moves(now, before).rows
    names = [scene.nodes[node].name for node in now.instances["node"]]
    assert dict(zip(names, found, strict=True))["new"] == NOWHERE
    node = before.instances["node"][found[names.index("box")]]
    assert before.layout.nodes[node].name == "box"


def test_where_a_turned_and_stretched_instance_was(scene):
    before = placed(scene)
    scene.nodes[1].rotation = (0.0, 0.6, 0.0, 0.8)
    scene.nodes[1].scale = (1.0, 3.0, 0.5)
    now = placed(scene)
    (k,) = np.flatnonzero(now.instances["node"] == 1)
    found = moves(now, before)
    world = np.stack([now.instances[k][f"world{i}"] for i in range(3)])
    old = np.stack([before.instances[found.rows[k]][f"world{i}"] for i in range(3)])
    point, normal = np.array([0.3, 0.5, -0.2, 1.0]), np.array([0.0, 0.6, 0.8])
    np.testing.assert_allclose(found.places[k] @ np.append(world @ point, 1.0), old @ point, atol=1e-5)
    there = found.normals[k] @ (np.linalg.inv(world[:, :3]).T @ normal)
    expected = np.linalg.inv(old[:, :3]).T @ normal
    np.testing.assert_allclose(there / np.linalg.norm(there), expected / np.linalg.norm(expected), atol=1e-5)


def test_a_node_that_hangs_in_several_places(scene):
    """Each of its copies is found where that one was, also when another node comes."""
    shared = scene.nodes[1]
    for x in (2.0, 3.0):
        scene.roots.append(ispm.Node("parent", translation=(x, 0.0, 0.0), children=[shared]))
    before = placed(scene)
    scene.add(ispm.shapes.box((0.1, 0.1, 0.1)), name="new")
    now = placed(scene)
    found = moves(now, before)
    for row, then in enumerate(found.rows):
        if then != NOWHERE:
            assert (now.instances[row]["world0"] == before.instances[then]["world0"]).all()
    assert (found.rows != NOWHERE).sum() == len(before.ids) == 4
