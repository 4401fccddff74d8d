"""Scenes and nodes by name: found, counted, bounded, merged and taken out."""

import numpy as np
import pytest

import ispm
from ispm.errors import SceneError
from ispm.scene.animation import Channel


def kitchen():
    """A table with two cups on it, the second with a spoon, and a lamp."""
    scene = ispm.Scene(name="kitchen")
    table = scene.add(ispm.shapes.box((2, 1, 1)), name="table", translation=(0, 0.5, 0))
    cup = ispm.shapes.cylinder(0.1, 0.2)
    scene.add(cup, name="cup 1", translation=(-0.5, 0.6, 0), parent=table)
    second = scene.add(cup, name="cup 2", translation=(0.5, 0.6, 0), parent=table)
    scene.add(ispm.shapes.box((0.01, 0.3, 0.01)), name="spoon", parent=second)
    scene.add(ispm.PointLight(), name="lamp [left]", translation=(0, 3, 0))
    return scene


def names(nodes):
    return [node.name for node in nodes]


def test_nodes_are_found_by_name_and_pattern():
    scene = kitchen()
    assert names(scene) == ["table", "cup 1", "cup 2", "spoon", "lamp [left]"]
    assert names(scene["table"]) == ["cup 1", "cup 2", "spoon"]
    assert "spoon" in scene and "spoon" in scene["table"] and scene["spoon"] in scene
    assert "spoon" not in scene["cup 1"] and "fork" not in scene and 3 not in scene
    assert names(scene.find("cup *")) == names(scene["table"].find("cup ?")) == ["cup 1", "cup 2"]
    assert names(scene.find("lamp [left]")) == ["lamp [left]"]  # itself, though it is a pattern
    assert scene.find("Cup *") == []
    assert scene["table"]["cup 2"] is scene["cup 2"]
    for unnamed in (3, None, scene["spoon"]):
        with pytest.raises(SceneError, match="names are found by a text"):
            scene.find(unnamed)
    with pytest.raises(KeyError, match="no node is called 'spon'; did you mean 'spoon'"):
        scene["table"]["spon"]


def test_what_is_shown_of_them_is_a_line():
    scene = kitchen()
    assert repr(scene) == "<Scene 'kitchen': 536 triangles, 1 light, 0 cameras>"
    assert repr(scene["table"]) == "<Node 'table' at 0, 0.5, 0: 1 part, 2 children>"
    assert repr(scene["lamp [left]"]) == "<Node 'lamp [left]' at 0, 3, 0: PointLight>"
    assert repr(ispm.Node()) == "<Node '' at 0, 0, 0: empty>"
    copies = ispm.Node("n", parts=scene["spoon"].parts, instances=np.stack([np.eye(4)] * 3))
    assert repr(copies) == "<Node 'n' at 0, 0, 0: 1 part, 3 copies>"
    assert repr(scene["spoon"].parts[0].mesh) == "<Mesh 'box': 24 vertices, 12 triangles, normals, uv0>"
    assert repr(ispm.Material()) == "Material()"
    red = ispm.Material((0.7, 0.1, 0.1), roughness=0.4, name="red")
    assert repr(red) == "Material(base_color=(0.7, 0.1, 0.1), roughness=0.4, name='red')"
    assert eval(repr(red), {"Material": ispm.Material}) == red
    assert repr(ispm.Material([0.5, 0.5, 1.0])) == "Material(base_color=(0.5, 0.5, 1.0))"
    assert repr(ispm.Camera.look_at((0, 0, 1), (0, 0, 0))) == "Camera(pose=<array (4, 4)>)"
    assert repr(ispm.SpotLight((1, 2, 3))) == "SpotLight(intensity=(1, 2, 3))"
    (swing,) = ispm.builtin("caustic-ring").animations
    assert repr(swing) == "<Animation 'swing': 2 channels, 8 s>"
    assert repr(swing.channels[0]) == "<Channel translation of 'ring': 33 keys>"
    assert repr(ispm.Texture(np.zeros((2, 3)), name="t")) == "<Texture 't': 3x2, sRGB>"


def test_bounds_are_of_the_surfaces_as_placed():
    scene = kitchen()
    np.testing.assert_allclose(scene.bounds, [[-1, 0, -0.5], [1, 1.25, 0.5]], atol=1e-6)
    np.testing.assert_allclose(scene.bounds_of("cup 1"), [[-0.6, 1, -0.1], [-0.4, 1.2, 0.1]], atol=1e-6)
    np.testing.assert_allclose(scene.bounds_of(scene["cup 2"])[1], [0.6, 1.25, 0.1], atol=1e-6)
    np.testing.assert_allclose(scene.world_matrix("spoon")[:3, 3], [0.5, 1.1, 0])
    scene["table"].rotation = ispm.euler(y=np.pi / 4)
    reach = 1.5 / np.sqrt(2)  # of a corner at 1, 0.5, turned
    np.testing.assert_allclose(scene.bounds[1], [reach, 1.25, reach], atol=1e-6)


@pytest.mark.parametrize("seed", range(4))
def test_bounds_of_copies_are_those_of_every_vertex(seed):
    random = np.random.default_rng(seed)
    scene = ispm.Scene()
    node = scene.add(ispm.shapes.torus(segments=9, sides=7), rotation=random.normal(size=4), scale=(1, 2, 3))
    node.instances = np.tile(np.eye(4), (200, 1, 1))
    node.instances[:, :3, :] = random.normal(size=(200, 3, 4))
    positions = node.parts[0].mesh.positions
    points = np.concatenate([positions, np.ones((len(positions), 1))], axis=1)
    every = np.einsum("nij,vj->nvi", scene.world_matrix(node) @ node.instances, points)[..., :3]
    np.testing.assert_allclose(scene.bounds, [every.min(axis=(0, 1)), every.max(axis=(0, 1))])


def test_what_has_no_surface_has_no_bounds():
    scene = kitchen()
    empty = ispm.Mesh(np.zeros((1, 3)), np.zeros((0, 3), int), name="cloud")
    for make in (lambda: ispm.Scene().bounds, lambda: scene.bounds_of("lamp [left]"), lambda: empty.bounds):
        with pytest.raises(SceneError, match=r"no (surface|triangles)"):
            _ = make()


def test_a_node_is_removed_with_what_is_below_it():
    scene = kitchen()
    cup = scene.remove("cup 2")
    assert cup.name == "cup 2" and names(cup) == ["spoon"]
    assert names(scene) == ["table", "cup 1", "lamp [left]"]
    assert scene.remove(scene["lamp [left]"]).light is not None
    assert scene.lights == []
    with pytest.raises(SceneError, match="node 'cup 2' is not in this scene"):
        scene.remove(cup)
    with pytest.raises(KeyError, match="did you mean 'cup 1'"):
        scene.remove("cup 3")
    with pytest.raises(SceneError, match="a int is no node"):
        scene.remove(3)
    scene.roots += [cup, ispm.Node("tray", children=[cup])]  # in two places
    scene.remove(cup)
    assert cup not in scene and names(scene) == ["table", "cup 1", "tray"]


def test_merged_scenes_share_meshes_but_not_nodes():
    house, room = ispm.Scene(name="house"), kitchen()
    times, values = np.array([0.0, 1.0]), np.array([[0.0, 3.0, 0.0], [4.0, 3.0, 0.0]])
    room.animations = [ispm.Animation([Channel(room["lamp [left]"], "translation", times, values)], "swing")]
    room.warnings = ["dusty"]
    first = house.merge(room)
    second = house.merge(room, name="annex", translation=(10, 0, 0), scale=(2, 2, 2))
    assert names(house.roots) == ["kitchen", "annex"] and first is house["kitchen"]
    assert len(house.nodes) == 12 and len(house.materials) == len(room.materials)
    assert second["cup 1"].parts[0].mesh is room["cup 1"].parts[0].mesh
    second["cup 1"].translation = (0, 9, 0)
    assert room["cup 1"].translation == first["cup 1"].translation == (-0.5, 0.6, 0)
    np.testing.assert_allclose(house.bounds_of(first), room.bounds)
    np.testing.assert_allclose(house.world_matrix(second["spoon"])[:3, 3], [11, 2.2, 0])
    assert house.warnings == ["dusty"]
    later = house.at(1.0, "swing")
    assert [node.translation[0] for node in later.find("lamp*")] == [4.0, 4.0]
    house.remove("kitchen")
    assert [node.translation[0] for node in house.at(0.5).find("lamp*")] == [2.0]
    assert room["lamp [left]"].translation == (0, 3, 0)


def test_a_scene_may_be_merged_into_itself_and_below_a_node():
    scene = kitchen()
    inside = scene.merge(scene, parent=scene["table"], name="small", scale=(0.1, 0.1, 0.1))
    assert inside in scene["table"] and len(scene.nodes) == 11
    with pytest.raises(SceneError, match="cannot merge a Mesh"):
        scene.merge(ispm.shapes.box())
    with pytest.raises(SceneError, match="parent must be a Node"):
        scene.merge(scene, parent="table")
    assert len(scene.nodes) == 11


def test_a_moment_merges_as_it_stands():
    ring = ispm.builtin("caustic-ring")
    later = ring.at(2.0)
    whole = ispm.Scene()
    whole.merge(later)
    np.testing.assert_array_equal(whole.bounds, later.bounds)
    np.testing.assert_array_equal(whole.at_rest().bounds, ring.bounds)
