"""Primitives become meshes: modes, shared objects, attributes, and what is left out."""

from pathlib import Path

import numpy as np
import pytest
from gltf_builder import QUAD, QUAD_INDICES, QUAD_UV, GltfBuilder

from ispm.io.gltf_mesh import assemble
from ispm.scene.mesh import Mesh


def only_mesh(builder: GltfBuilder, folder: Path) -> Mesh:
    (mesh,) = {part.mesh for node in builder.load(folder).nodes for part in node.parts}
    return mesh


@pytest.mark.parametrize(
    ("mode", "corners", "triangles"),
    [
        (4, [7, 8, 9, 3, 2], [[7, 8, 9]]),
        (5, [0, 1, 2, 3, 4], [[0, 1, 2], [1, 3, 2], [2, 3, 4]]),
        (6, [5, 1, 2, 3], [[1, 2, 5], [2, 3, 5]]),
        (5, [0, 1], []),
        (6, [], []),
    ],
)
def test_assemble_follows_the_specification(
    mode: int, corners: list[int], triangles: list[list[int]]
) -> None:
    assert assemble(np.array(corners, np.uint32), mode).tolist() == triangles


@pytest.mark.parametrize("mode", [5, 6])
def test_strips_and_fans_keep_the_winding(mode: int) -> None:
    """A ring of corners in the plane, all triangles of which turn the same way."""
    angle = np.linspace(0.0, 5.0, 9)
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    order = np.arange(9) if mode == 6 else np.array([0, 1, 8, 2, 7, 3, 6, 4, 5])
    corners = ring[assemble(order, mode)]
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / 2
    assert len(area) == 7
    assert (area > 0.0).all()


def test_points_and_lines_are_left_out_and_counted(tmp_path: Path) -> None:
    builder = GltfBuilder()
    for mode in range(7):
        builder.node(mesh=builder.mesh(None, POSITION=QUAD[:3], more={"mode": mode}))
    scene = builder.load(tmp_path)
    assert scene.triangle_count == 3
    assert scene.warnings == ["4 primitives of points or lines are not drawn"]


def test_nodes_of_one_mesh_share_mesh_and_material(tmp_path: Path) -> None:
    builder = GltfBuilder(materials=[{"name": "red"}])
    mesh = builder.mesh(more={"material": 0})
    first, second = (builder.node(mesh=mesh) for _ in range(2))
    scene = builder.load(tmp_path)
    a, b = scene.nodes[first].parts[0], scene.nodes[second].parts[0]
    assert a.mesh is b.mesh
    assert a.material is b.material
    assert a is not b  # another material may be given to one of them


def test_meshes_over_the_same_accessors_share_one_mesh(tmp_path: Path) -> None:
    builder = GltfBuilder(materials=[{"name": "red"}, {"name": "blue"}])
    builder.node(mesh=builder.mesh(more={"material": 0}))
    again = builder.json["meshes"][0]["primitives"][0] | {"material": 1}
    builder.node(mesh=builder.put("meshes", {"primitives": [again]}))
    a, b = (node.parts[0] for node in builder.load(tmp_path).nodes)
    assert a.mesh is b.mesh
    assert (a.material.name, b.material.name) == ("red", "blue")


def test_primitives_over_shared_vertices_keep_only_their_own(tmp_path: Path) -> None:
    many = np.random.default_rng(1).random((1000, 3), np.float32)
    corners = np.array([900, 3, 900, 900, 3, 17], np.uint32)
    builder = GltfBuilder()
    builder.node(mesh=builder.mesh(corners, POSITION=many, NORMAL=many))
    mesh = only_mesh(builder, tmp_path)
    assert mesh.positions.shape == (3, 3)
    assert (mesh.positions[mesh.triangles.ravel()] == many[corners]).all()
    assert (mesh.normals[mesh.triangles.ravel()] == many[corners]).all()


def test_mesh_arrays_may_be_written_to(tmp_path: Path) -> None:
    builder = GltfBuilder()
    builder.node(mesh=builder.mesh())
    mesh = only_mesh(builder, tmp_path)
    mesh.positions += 1.0
    mesh.triangles[:] = 0


@pytest.mark.parametrize("kind", [np.float32, np.uint8, np.uint16])
@pytest.mark.parametrize("width", [3, 4])
def test_vertex_colors_become_linear_rgba(tmp_path: Path, kind: type, width: int) -> None:
    fractions = np.array([[0, 0.2, 1, 0.4], [1, 0, 0.6, 0.8], [0.2, 0.2, 0.2, 1]])[:, :width]
    full = 1.0 if kind is np.float32 else np.iinfo(kind).max
    stored = np.rint(fractions * full).astype(kind) if full > 1 else fractions.astype(kind)
    builder = GltfBuilder()
    builder.node(mesh=builder.mesh(None, POSITION=QUAD[:3], COLOR_0=stored))
    colors = only_mesh(builder, tmp_path).colors
    assert colors.dtype == np.float32
    np.testing.assert_allclose(colors[:, :width], fractions, atol=1e-6)  # all fractions are whole 255ths
    if width == 3:
        assert (colors[:, 3] == 1.0).all()


def test_attributes_that_do_not_fit_are_left_out(tmp_path: Path) -> None:
    builder = GltfBuilder()
    builder.node(
        mesh=builder.mesh(
            QUAD_INDICES,
            POSITION=QUAD,
            NORMAL=np.zeros((4, 2), np.float32),
            TEXCOORD_0=QUAD_UV[:2],
            TEXCOORD_1=np.full((4, 2), np.nan, np.float32),
        )
    )
    scene = builder.load(tmp_path)
    mesh = scene.nodes[0].parts[0].mesh
    assert mesh.normals is None
    assert mesh.uv0 is None
    assert (mesh.uv1 == 0.0).all()
    assert len(scene.warnings) == 3


def test_a_skin_without_joints_to_follow_is_told(tmp_path: Path) -> None:
    builder = GltfBuilder(skins=[{"joints": [0]}])
    position = builder.accessor(QUAD)
    builder.node(mesh=builder.mesh(more={"targets": [{"POSITION": position}]}), skin=0, name="body")
    scene = builder.load(tmp_path)
    assert scene.triangle_count == 2
    assert len(scene["body"].parts[0].mesh.morphs) == 1
    assert scene.warnings == ["node 'body' is drawn as bound: its mesh has no joints and weights to follow"]
