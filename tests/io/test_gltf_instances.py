"""Copies of a mesh by EXT_mesh_gpu_instancing, and numbers packed small, against values made by hand."""

import math
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gltf_builder import QUAD, QUAD_INDICES, GltfBuilder

from ispm.cli.info import summary
from ispm.errors import SceneError
from ispm.scene.packed import pack
from ispm.scene.scene import Node

HALF = math.sqrt(0.5)


def instanced(node: dict[str, Any] | None = None, **attributes: np.ndarray) -> GltfBuilder:
    """A quad, copied as the attributes say."""
    builder = GltfBuilder(extensionsUsed=["EXT_mesh_gpu_instancing"])
    accessors = {
        name: builder.accessor(values, **({"normalized": True} if values.dtype.kind == "i" else {}))
        for name, values in attributes.items()
    }
    extension = {"EXT_mesh_gpu_instancing": {"attributes": accessors}}
    builder.node(mesh=builder.mesh(), extensions=extension, **(node or {}))
    return builder


def test_copies_are_placed_by_translation_rotation_and_scale(tmp_path: Path) -> None:
    """A quarter turn about Y takes +X to -Z; scale acts first, then the node's own place."""
    builder = instanced(
        {"translation": [10, 0, 0]},
        TRANSLATION=np.array([[1, 2, 3], [0, 0, 5]], np.float32),
        ROTATION=np.array([[0, HALF, 0, HALF], [0, 0, 0, 1]], np.float32),
        SCALE=np.array([[2, 3, 4], [1, 1, 1]], np.float32),
    )
    scene = builder.load(tmp_path)
    (node,) = scene.nodes
    expected = [
        [[0, 0, 4, 11], [0, 3, 0, 2], [-2, 0, 0, 3], [0, 0, 0, 1]],
        [[1, 0, 0, 10], [0, 1, 0, 0], [0, 0, 1, 5], [0, 0, 0, 1]],
    ]
    np.testing.assert_allclose(node.places(node.local_matrix()), expected, atol=1e-6)
    assert (scene.triangle_count, scene.extensions_honoured) == (4, ["EXT_mesh_gpu_instancing"])
    packed = pack(scene)
    assert (packed.triangle_count, len(packed.draws), len(packed.geometry.ranges)) == (4, 1, 1)
    np.testing.assert_allclose(packed.bounds, [[7, 0, 1], [15, 2, 6]], atol=1e-5)
    contents = summary(scene)
    assert (contents["instances"], contents["meshes"]) == (2, 1)
    np.testing.assert_allclose([contents["bounds_low"], contents["bounds_high"]], packed.bounds, atol=1e-5)


def test_rotations_may_be_normalised_integers(tmp_path: Path) -> None:
    turn = np.array([[0, 90, 0, 90]], np.int8)  # 127 sqrt(1/2) is 89.8
    (node,) = instanced(ROTATION=turn).load(tmp_path).nodes
    quarter = [[0, 0, 1, 0], [0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 0, 1]]
    np.testing.assert_allclose(node.instances, [quarter], atol=1e-6)


def test_mirrored_copies_are_drawn_apart(tmp_path: Path) -> None:
    scale = np.array([[1, 1, 1], [-1, 1, 1], [1, 1, 1]], np.float32)
    packed = pack(instanced(SCALE=scale).load(tmp_path))
    assert [(draw.first_instance, draw.instance_count, draw.mirrored) for draw in packed.draws] == [
        (0, 2, False),
        (2, 1, True),
    ]


@pytest.mark.parametrize(
    ("attributes", "reason"),
    [
        ({}, "missing or differ"),
        ({"TRANSLATION": np.zeros((3, 3), np.float32), "SCALE": np.ones((2, 3), np.float32)}, "differ"),
        ({"TRANSLATION": np.zeros((3, 4), np.float32)}, "TRANSLATION of its instances is not a VEC3"),
    ],
)
def test_wrong_attributes_are_refused(tmp_path: Path, attributes: dict[str, np.ndarray], reason: str) -> None:
    with pytest.raises(SceneError, match=reason):
        instanced(**attributes).load(tmp_path)


def test_copies_that_are_nowhere_are_left_out(tmp_path: Path) -> None:
    where = np.array([[0, 0, 0], [np.nan, 0, 0], [1e30, 0, 0]], np.float32)
    scene = instanced(TRANSLATION=where).load(tmp_path)
    assert scene.triangle_count == 2
    assert "2 left out" in scene.warnings[0]


def test_a_turn_of_no_length_is_none(tmp_path: Path) -> None:
    (node,) = instanced(ROTATION=np.zeros((1, 4), np.float32)).load(tmp_path).nodes
    assert (node.instances == np.eye(4)).all()


def test_a_million_copies_load_within_limits(tmp_path: Path) -> None:
    """0.3 s on a core of 2023; the limits count each copy."""
    where = np.random.default_rng(1).normal(size=(1_000_000, 3)).astype(np.float32)
    builder = instanced(TRANSLATION=where)
    path = builder.save_glb(tmp_path / "scene.glb")
    from ispm.io.load import load

    start = time.process_time()
    scene = load(path)
    assert time.process_time() - start < 5.0
    assert scene.triangle_count == 2_000_000
    for limit in ("max_nodes", "max_triangles"):
        with pytest.raises(SceneError, match=f"{limit}=999999"):
            load(path, **{limit: 999_999})


def test_a_node_without_copies_stands_once() -> None:
    world = np.diag([2.0, 2.0, 2.0, 1.0])
    assert (Node().places(world) == world[None]).all()
    assert Node(instances=np.zeros((0, 4, 4))).copies == 0


def test_numbers_packed_small_mean_the_same(tmp_path: Path) -> None:
    """KHR_mesh_quantization: the node brings integers back to size; normals and uvs are fractions."""
    builder = GltfBuilder(
        extensionsUsed=["KHR_mesh_quantization"], extensionsRequired=["KHR_mesh_quantization"]
    )
    whole = {
        "POSITION": builder.accessor((QUAD * 100).astype(np.int16)),
        "NORMAL": builder.accessor(np.tile(np.array([0, 127, 0], np.int8), (4, 1)), normalized=True),
        "TANGENT": builder.accessor(np.tile(np.array([127, 0, 0, -127], np.int8), (4, 1)), normalized=True),
        "TEXCOORD_0": builder.accessor(
            np.array([[0, 0], [65535, 0], [65535, 65535], [0, 65535]], np.uint16), normalized=True
        ),
        "TEXCOORD_1": builder.accessor(np.array([[0, 0], [3, 0], [3, 3], [0, 3]], np.uint8)),
    }
    fraction = {"POSITION": builder.accessor((QUAD * 127).astype(np.int8), normalized=True)}
    for attributes in (whole, fraction):
        primitive = {"attributes": attributes, "indices": builder.accessor(QUAD_INDICES)}
        builder.node(mesh=builder.put("meshes", {"primitives": [primitive]}), scale=[0.01] * 3)
    scene = builder.load(tmp_path)
    first, second = (node.parts[0].mesh for node in scene.nodes)
    assert scene.warnings == []
    assert (first.positions == QUAD * 100).all() and (second.positions == QUAD).all()
    assert (first.normals == (0, 1, 0)).all() and (first.tangents == (1, 0, 0, -1)).all()
    assert first.uv0[2].tolist() == [1.0, 1.0] and first.uv1[2].tolist() == [3.0, 3.0]
