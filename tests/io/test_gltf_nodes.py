"""Nodes, cameras and lights of a file against matrices composed by hand."""

import math
from pathlib import Path

import numpy as np
import pytest
from gltf_builder import GltfBuilder

from ispm.errors import SceneError
from ispm.scene.camera import Camera
from ispm.scene.light import DirectionalLight, SpotLight


def test_node_matrices_compose_translation_rotation_scale(tmp_path: Path) -> None:
    """A quarter turn about Y takes +X to -Z; scale acts first, translation last."""
    half = math.sqrt(0.5)
    builder = GltfBuilder(scenes=[{"nodes": [0]}])
    builder.node(name="a", translation=[1, 2, 3], rotation=[0, half, 0, half], scale=[2, 3, 4], children=[1])
    builder.node(name="b", matrix=[0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 5, 0, 0, 1])  # columns; turn about Z
    places = {node.name: world for node, world in builder.load(tmp_path).placed()}
    a = np.array([[0, 0, 4, 1], [0, 3, 0, 2], [-2, 0, 0, 3], [0, 0, 0, 1]])
    b = np.array([[0, -1, 0, 5], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    np.testing.assert_allclose(places["a"], a, atol=1e-12)
    np.testing.assert_allclose(places["b"], a @ b, atol=1e-12)


def test_a_chain_of_100000_nodes_loads(tmp_path: Path) -> None:
    count = 100_000
    nodes = [{"name": str(i), "children": [i + 1]} for i in range(count - 1)] + [{"name": "last"}]
    (node,) = GltfBuilder(nodes=nodes, scenes=[{"nodes": [0]}]).load(tmp_path).roots
    for i in range(count - 1):
        assert node.name == str(i)
        (node,) = node.children
    assert (node.name, node.children) == ("last", [])


@pytest.mark.parametrize("children", [[[0]], [[1], [2], [0]], [[1], [2], [1]], [[3], [2], [1], []]])
def test_cycles_are_refused_or_cut(tmp_path: Path, children: list[list[int]]) -> None:
    nodes = [{"children": c} if c else {} for c in children]
    builder = GltfBuilder(nodes=nodes, scenes=[{"nodes": [0]}])
    if children == [[1], [2], [1]]:  # node 1 hangs on 0 already
        assert [len(node.children) for node in builder.load(tmp_path).nodes] == [1, 1, 0]
    else:
        with pytest.raises(SceneError, match="its own"):
            builder.load(tmp_path)


def test_a_cycle_is_found_from_a_tail_that_leads_into_it(tmp_path: Path) -> None:
    nodes = [{}, {"children": [2, 0]}, {"children": [1]}]  # 0 hangs on 1, and 1 and 2 on each other
    with pytest.raises(SceneError, match="its own ancestor"):
        GltfBuilder(nodes=nodes).load(tmp_path)


def test_the_first_of_two_parents_is_kept(tmp_path: Path) -> None:
    nodes = [{"children": [2], "translation": [1, 0, 0]}, {"children": [2, 2]}, {"name": "child"}]
    scene = GltfBuilder(nodes=nodes, scenes=[{"nodes": [0, 1]}]).load(tmp_path)
    assert [node.name for node in scene.nodes].count("child") == 1
    assert {n.name: w for n, w in scene.placed()}["child"][0, 3] == 1.0
    assert scene.warnings == ["node 'child' has two parents; the first is kept"]


@pytest.mark.parametrize(
    ("json", "shown"),
    [
        ({"scene": 1, "scenes": [{"nodes": [0]}, {"nodes": [1], "name": "second"}]}, ["b"]),
        ({"scenes": [{"nodes": [0]}, {"nodes": [1]}]}, ["a"]),
        ({"scene": 9, "scenes": [{"nodes": [0]}]}, ["a"]),
        ({}, ["a", "b", "c"]),
        ({"scenes": [{"nodes": [1, 2, 1]}]}, ["b"]),
        ({"scenes": [{}]}, []),
    ],
)
def test_the_default_scene_is_shown(tmp_path: Path, json: dict, shown: list[str]) -> None:
    nodes = [{"name": "a", "children": [2]}, {"name": "b"}, {"name": "c"}]
    scene = GltfBuilder(nodes=nodes, **json).load(tmp_path)
    assert sorted(node.name for node in scene.nodes if node.name in shown) == shown
    assert bool(scene.warnings) == (json.get("scene") == 9 or json.get("scenes") == [{"nodes": [1, 2, 1]}])


@pytest.mark.parametrize("rotation", [[0, 0, 0, 0], [1e-200, 0, 0, 0], [1e200, 0, 0, 0]])
def test_rotations_without_a_direction_count_as_none(tmp_path: Path, rotation: list[float]) -> None:
    scene = GltfBuilder(nodes=[{"rotation": rotation, "translation": [1, 2, 3]}]).load(tmp_path)
    ((_, world),) = scene.placed()
    assert (world == [[1, 0, 0, 1], [0, 1, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]]).all()
    assert "rotation" in scene.warnings[0]


@pytest.mark.parametrize("place", [{"translation": [0, 1e200, 0]}, {"scale": [1, 1, -1e30]}])
def test_places_beyond_reckoning_are_refused(tmp_path: Path, place: dict) -> None:
    with pytest.raises(SceneError, match=r"node 0: its place or size is beyond"):
        GltfBuilder(nodes=[place]).load(tmp_path)


def test_cameras_of_both_kinds_are_read(tmp_path: Path) -> None:
    cameras = [
        {"type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.1}, "name": "eye"},
        {"type": "orthographic", "orthographic": {"xmag": 2, "ymag": 3, "znear": 0, "zfar": 10}},
    ]
    builder = GltfBuilder(cameras=cameras, nodes=[{"camera": 0}, {"camera": 1}])
    scene = builder.load(tmp_path)
    assert [node.camera for node in scene.cameras] == [Camera(yfov=0.7), Camera(ymag=3.0)]
    assert scene.cameras[0].camera.name == "eye"
    assert scene.warnings == []


@pytest.mark.parametrize(
    ("camera", "kept"),
    [
        ({"type": "perspective", "perspective": {"yfov": 0, "znear": 0.1}}, True),
        ({"type": "perspective", "perspective": {"yfov": 4, "znear": 0.1}}, True),
        ({"type": "perspective", "perspective": {"yfov": 1, "znear": 2, "zfar": 1}}, True),
        ({"type": "orthographic", "orthographic": {"xmag": 0, "ymag": 0, "znear": 0, "zfar": 1}}, False),
        ({"type": "orthographic"}, False),
        ({"type": "fisheye"}, False),
    ],
)
def test_cameras_with_wrong_numbers_are_told(tmp_path: Path, camera: dict, kept: bool) -> None:
    scene = GltfBuilder(cameras=[camera], nodes=[{"camera": 0}]).load(tmp_path)
    assert len(scene.cameras) == kept
    assert len(scene.warnings) == 1
    assert all(0.0 < node.camera.yfov < math.pi for node in scene.cameras)


def with_lights(*lights: dict) -> GltfBuilder:
    nodes = [
        {"name": f"n{i}", "extensions": {"KHR_lights_punctual": {"light": i}}} for i in range(len(lights))
    ]
    return GltfBuilder(nodes=nodes, extensions={"KHR_lights_punctual": {"lights": list(lights)}})


def test_point_lights_have_intensity_per_channel(tmp_path: Path) -> None:
    builder = with_lights(
        {"type": "point", "color": [1, 0.5, 0.25], "intensity": 80, "range": 7, "name": "lamp"},
        {"type": "point"},
    )
    first, second = (node.light for node in builder.load(tmp_path).lights)
    assert (first.intensity, first.range, first.name) == ((80.0, 40.0, 20.0), 7.0, "lamp")
    assert (second.intensity, second.range) == ((1.0, 1.0, 1.0), math.inf)


def test_lights_of_an_unknown_type_are_left_out(tmp_path: Path) -> None:
    scene = with_lights({"type": "tube"}).load(tmp_path)
    assert scene.lights == []
    assert scene.warnings == ["light 'n0' is left out: its type 'tube' is unknown"]


def test_spots_and_directional_lights_are_read(tmp_path: Path) -> None:
    spot = {"innerConeAngle": 0.25, "outerConeAngle": 0.5}
    builder = with_lights(
        {"type": "spot", "color": [1, 0.5, 0], "intensity": 8, "range": 3, "spot": spot, "name": "s"},
        {"type": "spot", "spot": {}},
        {"type": "directional", "color": [0, 1, 0], "intensity": 5, "range": 3},
    )
    scene = builder.load(tmp_path)
    assert [node.light for node in scene.lights] == [
        SpotLight((8.0, 4.0, 0.0), 3.0, 0.25, 0.5),
        SpotLight((1.0, 1.0, 1.0), math.inf, 0.0, math.pi / 4),  # the extension's defaults
        DirectionalLight((0.0, 5.0, 0.0)),
    ]
    assert scene.warnings == []


@pytest.mark.parametrize(
    ("inner", "outer", "told"),
    [(0.0, math.pi / 2, 0), (0.0, 1.5707964, 0), (0.9, 0.3, 1), (0.5, 0.5, 1), (-1.0, 0.3, 1), (0.1, 3.0, 1),
     (0.0, 0.0, 1), (0.0, -2.0, 1), (9.0, 9.0, 1)],
)  # fmt: skip
def test_cones_are_clamped_to_what_the_extension_allows(
    tmp_path: Path, inner: float, outer: float, told: int
) -> None:
    record = {"type": "spot", "spot": {"innerConeAngle": inner, "outerConeAngle": outer}}
    scene = with_lights(record).load(tmp_path)
    (light,) = (node.light for node in scene.lights)
    assert 0.0 <= light.inner_angle < light.outer_angle <= math.pi / 2
    assert len(scene.warnings) == told


def test_lights_with_wrong_numbers_are_mended(tmp_path: Path) -> None:
    builder = with_lights(
        {"type": "point", "intensity": -5},
        {"type": "point", "range": 0},
        {"type": "point", "color": [-1, 1, 1]},
    )
    scene = builder.load(tmp_path)
    a, b, c = (node.light for node in scene.lights)
    assert (a.intensity, b.range, c.intensity) == ((0.0, 0.0, 0.0), math.inf, (0.0, 1.0, 1.0))
    assert len(scene.warnings) == 3
