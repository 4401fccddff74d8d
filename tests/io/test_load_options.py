"""How files are taken: which axis points up, and smooth normals where a file brings none."""

import math
from pathlib import Path

import numpy as np
import pytest
import trimesh
from gltf_builder import quad

import ispm
from ispm.errors import SceneError, SettingsError
from ispm.io.named import open_named
from ispm.scene.mesh import Mesh
from ispm.scene.smooth import connected, smoothed

TOWER = np.array([[0, 0, 0], [2, 0, 0], [0, 3, 0], [0, 0, 7]], np.float64)  # 7 m high, along z
FACES = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])


def write(folder: Path, kind: str, mesh: trimesh.Trimesh) -> Path:
    path = folder / f"a.{kind}"
    mesh.export(path)
    return path


def only_mesh(scene: ispm.Scene) -> Mesh:
    ((part,),) = [node.parts for node in scene.nodes]
    return part.mesh


@pytest.mark.parametrize("kind", ["obj", "ply", "stl"])
def test_z_becomes_y_exactly_and_nothing_is_mirrored(tmp_path: Path, kind: str) -> None:
    path = write(tmp_path, kind, trimesh.Trimesh(TOWER, FACES, process=False))
    was, mesh = only_mesh(ispm.load(path)), only_mesh(ispm.load(path, up="z"))
    x, y, z = was.positions.T
    assert (mesh.positions == np.stack([x, z, -y], axis=1)).all()
    corners = mesh.positions[mesh.triangles].astype(np.float64)
    volume = np.linalg.det(corners).sum() / 6.0
    assert volume == pytest.approx(7.0)  # 2 * 3 * 7 / 6; it were negative if faces were turned inside out


def test_normals_turn_with_the_axis(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nf 1//1 2//1 3//1\n")
    assert (only_mesh(ispm.load(tmp_path / "a.obj", up="z")).normals == (0, 1, 0)).all()


def test_gltf_has_y_up_always(tmp_path: Path) -> None:
    path = quad().save(tmp_path / "a.gltf")
    with pytest.raises(SceneError, match=r"^a\.gltf: up=z is for OBJ, PLY and STL; glTF has y up"):
        ispm.load(path, up="z")
    with pytest.raises(SettingsError, match="'x' is not one of y, z"):
        ispm.load(path, up="x")
    with pytest.raises(SettingsError, match="built in"):
        open_named("cornell-box", up="z")


@pytest.mark.parametrize("kind", ["ply", "stl", "obj"])
def test_smooth_normals_are_those_of_trimesh(tmp_path: Path, kind: str) -> None:
    """On a torus, where all faces are smooth; trimesh too weights by angles."""
    torus = trimesh.creation.torus(2.0, 0.7, major_sections=24, minor_sections=12)
    mesh = only_mesh(ispm.load(write(tmp_path, kind, torus), smooth_normals=True, crease_degrees=60))
    assert only_mesh(ispm.load(tmp_path / f"a.{kind}")).normals is None
    rounded = trimesh.Trimesh(mesh.positions, mesh.triangles, process=False)
    rounded.merge_vertices(digits_vertex=5)
    lookup = {tuple(np.round(p, 5)): n for p, n in zip(rounded.vertices, rounded.vertex_normals, strict=True)}
    wanted = np.array([lookup[tuple(p)] for p in np.round(mesh.positions.astype(np.float64), 5)])
    np.testing.assert_allclose(mesh.normals, wanted, atol=2e-5)  # of float32 positions
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1.0, atol=1e-6)


def test_smooth_normals_of_a_sphere_are_radial() -> None:
    """To the square of an edge's length; below a crease of 1 degree its faces, 4 degrees apart, are flat."""
    ball = trimesh.creation.icosphere(4)
    soup = Mesh(ball.triangles.reshape(-1, 3), np.arange(len(ball.faces) * 3).reshape(-1, 3))
    edge = ball.edges_unique_length.max()
    off = [np.linalg.norm(made.normals - made.positions, axis=1).max()
           for made in (smoothed(soup, math.radians(crease)) for crease in (30, 1))]  # fmt: skip
    assert off[0] < edge**2 < edge / 3 < off[1]


def test_edges_sharper_than_the_crease_stay() -> None:
    cube = trimesh.creation.box((2.0, 2.0, 2.0))
    mesh = Mesh(cube.vertices, cube.faces)
    flat = smoothed(mesh, math.radians(89))
    assert (np.sort(np.abs(flat.normals), axis=1) == (0, 0, 1)).all() and len(flat.positions) == 24
    soft = smoothed(mesh, math.radians(91))
    np.testing.assert_allclose(np.abs(soft.normals), math.sqrt(1 / 3), atol=1e-6)
    assert len(soft.positions) == 8


def test_one_edge_of_a_sheet_is_smooth_and_the_next_is_sharp() -> None:
    """Three strips: the second at 20 degrees to the first, the third at 60 to the second."""
    angles = np.cumsum([0, math.radians(20), math.radians(60)])
    line = np.cumsum([(0, 0), *((math.cos(a), math.sin(a)) for a in angles)], axis=0)
    points = np.array([(x, y, z) for x, y in line for z in (0.0, 1.0)])
    faces = [t for k in range(3) for t in ((2 * k, 2 * k + 1, 2 * k + 3), (2 * k, 2 * k + 3, 2 * k + 2))]
    numbers = np.arange(16, dtype=np.float32).reshape(8, 2)
    made = smoothed(Mesh(points, np.array(faces), uv0=numbers), math.radians(30))
    row = (made.uv0[:, 0] / 2).astype(int)  # of each vertex, the one it was
    assert sorted(row) == [0, 1, 2, 3, 4, 4, 5, 5, 6, 7]
    assert (made.positions == points.astype(np.float32)[row]).all()
    between = math.sin(math.radians(10)), math.cos(math.radians(10)), 0.0
    np.testing.assert_allclose(np.abs(made.normals[(row == 2) | (row == 3)]), [between] * 2, atol=1e-6)


def test_faces_without_an_area_and_edges_of_three_faces_do_no_harm() -> None:
    points = np.array([[0, 0, 0], [1, 0, 0], [0.5, 0, 0], [0.5, 1, 0], [0.5, -1, 0], [0.5, 0, 1]], np.float64)
    faces = [[0, 1, 3], [0, 2, 1], [0, 4, 2], [2, 4, 1], [0, 1, 5], [1, 0, 5]]
    made = smoothed(Mesh(points, faces), math.pi)
    assert np.isfinite(made.normals).all()


def test_meshes_that_bring_normals_keep_them_and_shared_ones_stay_shared(tmp_path: Path) -> None:
    builder = quad()
    builder.node(mesh=0)
    first, second = builder.load(tmp_path, smooth_normals=True).nodes
    assert first.parts[0].mesh is second.parts[0].mesh
    assert (first.parts[0].mesh.normals == (0, 1, 0)).all()
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 1 0\nf 1//1 2//1 3//1\n")
    assert (only_mesh(ispm.load(tmp_path / "a.obj", smooth_normals=True)).normals == (0, 1, 0)).all()


def test_links_join_what_they_should() -> None:
    """Against sets joined one by one; seed 1."""
    random = np.random.default_rng(1)
    for count in (1, 5, 200):
        links = random.integers(0, count, (count // 2, 2))
        sets = [{k} for k in range(count)]
        for a, b in links.tolist():
            joined = next(s for s in sets if a in s) | next(s for s in sets if b in s)
            sets = [s for s in sets if not s & joined] + [joined]
        found = connected(count, links)
        assert all(len({int(found[k]) for k in s}) == 1 for s in sets) and len(set(found.tolist())) == len(
            sets
        )
