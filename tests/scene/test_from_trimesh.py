"""Meshes and scenes made by trimesh."""

import numpy as np
import pytest
from assets import assets
from PIL import Image

from ispm import Mesh, Scene, load
from ispm.errors import SceneError
from ispm.scene.material import AlphaMode

trimesh = pytest.importorskip("trimesh")


def test_arrays_are_copied() -> None:
    box = trimesh.creation.box()
    mesh = Mesh.from_trimesh(box)
    assert (mesh.positions == box.vertices.astype(np.float32)).all()
    assert (mesh.triangles == box.faces).all()
    assert mesh.normals is None  # none were given: a box is flat
    mesh.positions[:] = 9.0
    assert np.abs(box.vertices).max() == 0.5


def test_normals_that_were_given_are_kept() -> None:
    given = np.tile((0.0, 0.0, 1.0), (3, 1))
    triangle = trimesh.Trimesh(np.eye(3), [[0, 1, 2]], vertex_normals=given, process=False)
    assert (Mesh.from_trimesh(triangle).normals == given).all()


def test_colors_of_vertices_and_faces_are_srgb() -> None:
    triangles = trimesh.Trimesh(np.eye(4)[:, :3], [[0, 1, 2], [1, 2, 3]], process=False)
    triangles.visual.vertex_colors = [[255, 128, 0, 255]] * 4
    np.testing.assert_allclose(Mesh.from_trimesh(triangles).colors[0], (1, 0.2158605, 0, 1), atol=1e-6)
    triangles.visual = trimesh.visual.ColorVisuals(
        triangles, face_colors=[[255, 0, 0, 255], [0, 0, 255, 255]]
    )
    mesh = Mesh.from_trimesh(triangles)
    assert mesh.colors[mesh.triangles[0]].tolist() == [[1, 0, 0, 1]] * 3
    assert mesh.colors[mesh.triangles[1]].tolist() == [[0, 0, 1, 1]] * 3
    assert (mesh.positions[mesh.triangles] == triangles.vertices[triangles.faces]).all()


def textured(**factors: object) -> object:
    uv = np.array([[0, 0], [1, 0], [0, 1]])
    material = trimesh.visual.material.PBRMaterial(**factors)
    visual = trimesh.visual.TextureVisuals(uv=uv, material=material)
    return trimesh.Trimesh(np.eye(3), [[0, 1, 2]], visual=visual, process=False)


def test_pbr_materials_become_ours() -> None:
    picture = Image.new("RGB", (2, 2), (1, 2, 3))
    scene = Scene.from_trimesh(
        textured(
            name="lacquer", baseColorFactor=[255, 0, 51, 255], metallicFactor=0.25, roughnessFactor=0.5,
            emissiveFactor=[0, 0.5, 1], alphaMode="MASK", alphaCutoff=0.3, doubleSided=True,
            baseColorTexture=picture, normalTexture=picture,
        )
    )  # fmt: skip
    (material,) = scene.materials
    assert material.base_color == pytest.approx((1.0, 0.0, 0.2, 1.0))
    assert (material.metallic, material.roughness, material.name) == (0.25, 0.5, "lacquer")
    assert (material.emission, material.alpha_mode, material.alpha_cutoff) == (
        (0, 0.5, 1),
        AlphaMode.MASK,
        0.3,
    )
    assert material.base_color_texture.srgb and not material.normal_texture.srgb
    assert material.base_color_texture.pixels[0, 0].tolist() == [1, 2, 3, 255]
    assert scene.nodes[0].parts[0].mesh.uv0.tolist() == [[0, 1], [1, 1], [0, 0]]  # ours point down


def test_simple_materials_are_no_metal() -> None:
    mesh = textured()
    mesh.visual.material = trimesh.visual.material.SimpleMaterial(diffuse=[255, 0, 0, 255], glossiness=30)
    (material,) = Scene.from_trimesh(mesh).materials
    assert (material.metallic, material.base_color) == (0.0, (1.0, 0.0, 0.0, 1.0))
    assert material.roughness**4 == pytest.approx(2.0 / 32.0)


def test_scenes_keep_places_and_share_meshes() -> None:
    scene = trimesh.Scene()
    box = trimesh.creation.box()
    place = trimesh.transformations.translation_matrix
    scene.add_geometry(box, geom_name="box", transform=place((1, 0, 0)))
    scene.graph.update(frame_to="second", geometry="box", matrix=place((5, 0, 0)))
    scene.add_geometry(trimesh.PointCloud(np.eye(3)))
    ours = Scene.from_trimesh(scene)
    assert ours.triangle_count == 24
    assert sorted(world[0, 3] for _, world in ours.placed()) == [1.0, 5.0]
    assert len({id(part.mesh) for node in ours.nodes for part in node.parts}) == 1
    assert ours.warnings == ["geometries without triangles are left out: 1"]


def test_broken_meshes_are_refused() -> None:
    for vertices, faces in (
        (np.eye(3), [[0, 1, 3]]),
        (np.eye(3), [[0, 1, -1]]),
        (np.full((3, 3), np.nan), [[0, 1, 2]]),
    ):
        broken = trimesh.Trimesh(vertices, faces, process=False, validate=False)
        with pytest.raises(SceneError):
            Mesh.from_trimesh(broken)
    with pytest.raises(SceneError, match="PointCloud has no faces"):
        Mesh.from_trimesh(trimesh.PointCloud(np.eye(3)))


@pytest.mark.parametrize("name", ["NegativeScaleTest.glb", "LightsPunctualLamp.glb"])
def test_assets_come_by_trimesh_as_by_load(name: str) -> None:
    """Corners sorted by each coordinate, as their order is free; 1e-5 of the size for float32."""
    path = assets() / "scenes" / name
    both = []
    for scene in (load(path), Scene.from_trimesh(trimesh.load_scene(path, process=False))):
        corners = [
            (part.mesh.positions[part.mesh.triangles] @ world[:3, :3].T + world[:3, 3]).reshape(-1, 3)
            for node, world in scene.placed()
            for part in node.parts
        ]
        both.append(np.sort(np.concatenate(corners), axis=0))
    np.testing.assert_allclose(*both, atol=1e-5 * np.ptp(both[0], axis=0).max())
