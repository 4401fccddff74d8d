"""OBJ files and their materials."""

import math
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from assets import assets
from PIL import Image

from ispm.errors import SceneError
from ispm.io.load import load
from ispm.io.mtl_picture import MapUse, parse_map
from ispm.io.notes import Notes
from ispm.io.polygons import triangulate
from ispm.scene.material import AlphaMode, Material, Wrap
from ispm.scene.mesh import Mesh
from ispm.scene.scene import Scene

QUAD = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
UVS = "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
CUBE = (
    "".join(f"v {i & 1} {i >> 1 & 1} {i >> 2}\n" for i in range(8))
    + "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n"
)


def read(folder: Path, obj: str, mtl: str = "", **limits: Any) -> Scene:
    (folder / "a.obj").write_text(("mtllib a.mtl\n" if mtl else "") + obj)
    if mtl:
        (folder / "a.mtl").write_text(mtl)
    return load(folder / "a.obj", **limits)


def only_mesh(scene: Scene) -> Mesh:
    ((part,),) = [node.parts for node in scene.nodes]
    return part.mesh


def worn(folder: Path, mtl: str, obj: str = QUAD + UVS + "usemtl m\nf 1/1 2/2 3/3 4/4\n") -> Material:
    """The material that the statements make."""
    (material,) = read(folder, obj, f"newmtl m\n{mtl}\n").materials
    return material


def area(points: np.ndarray, triangles: np.ndarray) -> float:
    a, b, c = (points[triangles[:, k]] for k in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2.0)


@pytest.mark.parametrize("face", ["f 1 2 3 4", "f -4 -3 -2 -1", "f 1/1 2/2 3/3 4/4", "f 1//1 2//1 3//1 4//1",
                                  "f 1/1/1 -3/-3/-1 3/3/1 4/4/1", "f 1 2 \\\n 3 4 # square"])  # fmt: skip
def test_faces_are_written_in_many_ways(tmp_path: Path, face: str) -> None:
    mesh = only_mesh(read(tmp_path, f"{QUAD}{UVS}vn 0 0 1\n{face}\n".replace("# square", "")))
    corners = mesh.positions[mesh.triangles]
    assert corners.tolist() == [[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0]]]
    if "/1 " in face and "//" not in face:
        by_place = {tuple(p): tuple(uv) for p, uv in zip(mesh.positions, mesh.uv0, strict=True)}
        assert by_place == {(0, 0, 0): (0, 1), (1, 0, 0): (1, 1), (1, 1, 0): (1, 0), (0, 1, 0): (0, 0)}
    if "//1" in face or "1/1/1" in face:
        assert (mesh.normals == (0, 0, 1)).all()


def test_indices_are_relative_to_what_stands_before(tmp_path: Path) -> None:
    scene = read(tmp_path, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\nv 5 0 0\nv 6 0 0\nv 5 1 0\nf -3 -2 -1\n")
    mesh = only_mesh(scene)
    assert mesh.positions[mesh.triangles][:, 0, 0].tolist() == [0.0, 5.0]


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_lines_may_end_in_any_way(tmp_path: Path, end: str) -> None:
    (tmp_path / "a.obj").write_bytes((QUAD + "  f\t1 2 3 4").replace("\n", end).encode())
    assert load(tmp_path / "a.obj").triangle_count == 2


def test_objects_are_nodes_and_materials_are_parts(tmp_path: Path) -> None:
    text = QUAD + "o a\nusemtl red\nf 1 2 3\nusemtl blue\nf 1 3 4\no b\nf 1 2 4\no a\nusemtl red\nf 2 3 4\n"
    scene = read(tmp_path, text, "newmtl red\nKd 1 0 0\nnewmtl blue\nKd 0 0 1\n")
    found = {
        node.name: [(part.material.name, len(part.mesh.triangles)) for part in node.parts]
        for node in scene.nodes
    }
    assert found == {"a": [("red", 2), ("blue", 1)], "b": [("blue", 1)]}
    assert scene["a"].parts[1].material is scene["b"].parts[0].material
    assert read(tmp_path, QUAD + "g x\nf 1 2 3\ng y\nf 1 3 4\n")["y"].parts


def test_vertex_colors_are_srgb(tmp_path: Path) -> None:
    mesh = only_mesh(read(tmp_path, "v 0 0 0 0.5 0 1\nv 1 0 0 1 1 1\nv 0 1 0\nf 1 2 3\n"))
    np.testing.assert_allclose(mesh.colors[0], (0.2140411, 0, 1, 1), atol=1e-6)  # IEC 61966-2-1 of 0.5
    assert (mesh.colors[1:] == 1).all()


def test_smoothing_groups_share_normals_within_and_only_within(tmp_path: Path) -> None:
    """A roof of two slopes; the ridge is smooth where both are in one group."""
    roof = "v 0 0 0\nv 0 1 0\nv 1 0 1\nv 1 1 1\nv 2 0 0\nv 2 1 0\n{}\nf 1 3 4 2\n{}\nf 3 5 6 4\n"
    half = math.sqrt(0.5)
    for first, second, ridge in (
        ("s 1", "", {(0, 0, 1)}),
        ("s 1", "s 2", {(-half, 0, half), (half, 0, half)}),
    ):
        mesh = only_mesh(read(tmp_path, roof.format(first, second)))
        unit = mesh.normals / np.linalg.norm(mesh.normals, axis=1, keepdims=True)
        found = {tuple(np.round(n, 6)) for n in unit[mesh.positions[:, 0] == 1.0].tolist()}
        assert found == {tuple(np.round(n, 6)) for n in ridge}
    assert only_mesh(read(tmp_path, roof.format("s off", ""))).normals is None
    scene = read(tmp_path, roof.format("s 1", "s off"))
    assert sorted(part.mesh.normals is None for node in scene.nodes for part in node.parts) == [False, True]


def polygon(*corners: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """The corners in a plane askew to the axes, and their triangles."""
    across, up = np.array([0.6, 0.0, 0.8]), np.array([0.0, 1.0, 0.0])
    points = np.array(corners) @ np.stack([across, up])
    return points, triangulate(np.arange(len(points)), np.array([len(points)]), points)


SPIRAL = [(0, 0), (5, 0), (5, 5), (1, 5), (1, 2), (3, 2), (3, 3), (2, 3), (2, 4), (4, 4), (4, 1), (0, 1)]


def shoelace(corners: np.ndarray) -> float:
    x, y = corners.T
    return abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1))) / 2.0


@pytest.mark.parametrize(
    "corners",
    [
        [(0, 0), (4, 0), (4, 4), (3, 1)],  # a dart: a fan from its first corner would do
        [(4, 4), (3, 1), (0, 0), (4, 0)],  # but not from here
        [(0, 0), (2, 0), (2, 2), (1, 2), (1, 1), (0, 1)],
        SPIRAL,
        SPIRAL[::-1],
        [(0, 0), (1, 0), (2, 0), (3, 0), (3, 1), (0, 1)],  # corners in a line
        # a square hole, reached by a slit that is passed twice
        [(0, 0), (3, 0), (3, 3), (0, 3), (0, 0), (1, 1), (1, 2), (2, 2), (2, 1), (1, 1)],
    ],
)
def test_polygons_are_covered_once(corners: list[tuple[float, float]]) -> None:
    """Triangles that overlap or reach outside would cover more than the shoelace formula says."""
    points, triangles = polygon(*corners)
    assert len(triangles) == len(corners) - 2
    assert area(points, triangles) == pytest.approx(shoelace(np.array(corners, float)))
    a, b, c = (points[triangles[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    assert (normals @ normals.sum(axis=0) >= -1e-9).all()  # wound alike


def test_random_star_polygons_are_covered_once() -> None:
    """200 polygons of 5 to 30 corners around a point, seed 1; the shoelace formula gives their area."""
    random = np.random.default_rng(1)
    for _ in range(200):
        count = int(random.integers(5, 31))
        angle = np.sort(random.uniform(0, 2 * math.pi, count))
        if np.diff(angle, append=angle[0] + 2 * math.pi).max() > 3.0:
            continue  # the centre would be outside
        flat = (random.uniform(0.1, 1.0, count) * (np.cos(angle), np.sin(angle))).T
        points, triangles = polygon(*flat.tolist())
        assert area(points, triangles) == pytest.approx(shoelace(flat), rel=1e-9)


def test_polygons_keep_their_order() -> None:
    points = np.random.default_rng(1).normal(size=(12, 3))
    triangles = triangulate(np.arange(12), np.array([3, 5, 4]), points)
    assert [set(t) <= set(range(3)) for t in triangles.tolist()] == [True] + 5 * [False]
    assert [min(t) >= 8 for t in triangles.tolist()] == 4 * [False] + 2 * [True]


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("v 0 0 0\nf 0 1 1\n", "line 2: index 0"),
        ("v 0 0 0\nf 1 1 2\n", "vertex 2 of 1"),
        ("v 0 0 0\nf 1 1 -2\n", "line 2: index -2 points before the first of 1"),
        ("v 0 0\n", "line 1: a vertex needs three"),
        ("v 0 0 x\n", "line 1: 'v' with numbers"),
        ("v 0 0 0\nf 1 1 a\n", "line 2: 'f' with numbers"),
        ("v 0 0 0\nf 1 1 99999999999999999999999\n", "line 2: index 9+ is too large"),
        ("vn 0 0\n", "line 1: 'vn' with numbers"),
    ],
)
def test_broken_lines_are_refused_by_number(tmp_path: Path, text: str, reason: str) -> None:
    with pytest.raises(SceneError, match=rf"^a\.obj: .*({reason})"):
        read(tmp_path, text)


@pytest.mark.parametrize(
    ("text", "count", "told"),
    [
        ("", 0, "no faces"),
        (QUAD + "f 1 2\nf 1 2 3\n", 1, "1 face of fewer than three corners"),
        (QUAD + "l 1 2\np 1\nf 1 2 3\n", 1, "2 elements of points or lines are not drawn"),
        (QUAD + "cstype bezier\nf 1 2 3\n", 1, "free-form"),
        (QUAD + "f 1/9 2/9 3/9\n", 1, "texture coordinates"),
        (QUAD + "f 1//9 2//9 3//9\n", 1, "normals"),
        (QUAD + "v nan inf 0\nf 1 2 3\nf 1 2 5\n", 1, "not finite: 1 left out"),
        (
            QUAD + "v 1e38 0 0\nf 1 2 3\nf 1 2 5\n",
            1,
            "with vertices beyond 1e+18 m or not finite: 1 left out",
        ),
        (QUAD + "usemtl nowhere\nf 1 2 3\n", 1, "'nowhere' is not there"),
        ("mtllib nowhere.mtl\n" + QUAD + "f 1 2 3\n", 1, "materials 'nowhere.mtl' are left out"),
        ("mtllib ../outside.mtl\n" + QUAD + "f 1 2 3\n", 1, "outside the scene's own folder"),
    ],
)
def test_faults_that_leave_something_are_told(tmp_path: Path, text: str, count: int, told: str) -> None:
    scene = read(tmp_path, text)
    assert scene.triangle_count == count
    assert len(scene.warnings) == 1
    assert told in scene.warnings[0]


@pytest.mark.parametrize(
    ("limits", "reason"),
    [
        ({"max_elements": 3}, "max_elements=3"),
        ({"max_triangles": 1}, "max_triangles=1"),
        ({"max_file_bytes": 9}, "max_file_bytes=9"),
    ],
)
def test_limits_are_held(tmp_path: Path, limits: dict[str, int], reason: str) -> None:
    with pytest.raises(SceneError, match=reason):
        read(tmp_path, QUAD + "f 1 2 3 4\n", **limits)


def test_phong_exponents_become_roughness(tmp_path: Path) -> None:
    """alpha = sqrt(2 / (Ns + 2)) = roughness^2; Ks is F0, which 4 % times specular_color makes."""
    material = worn(tmp_path, "Kd 0.2 0.4 0.6\nKs 0.1 0.2 0.04\nNs 30\nKa 1 1 1\nillum 2")
    assert material.base_color == (0.2, 0.4, 0.6)
    assert material.roughness**4 == pytest.approx(2.0 / 32.0)
    assert material.specular_color == pytest.approx((2.5, 5.0, 1.0))
    assert (material.specular, material.metallic, material.transmission) == (1.0, 0.0, 0.0)
    assert worn(tmp_path, "Kd 1 1 1\nKs 0 0 0").specular == 0.0  # Lambert's surface


def test_blenders_specular_level_is_not_a_reflectance(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text("mtllib a.mtl\n" + QUAD + "usemtl m\nf 1 2 3\n")
    (tmp_path / "a.mtl").write_text("# Blender 4.2 MTL File\nnewmtl m\nKd 1 0 0\nKs 0.5 0.5 0.5\nNs 250\n")
    (material,) = load(tmp_path / "a.obj").materials
    assert material.specular_color == pytest.approx((1.0, 1.0, 1.0))  # its default level is F0 = 4 %


@pytest.mark.parametrize("illum", [3, 5])
def test_mirrors_are_metals(tmp_path: Path, illum: int) -> None:
    material = worn(tmp_path, f"Kd 0.01 0.01 0.01\nKs 0.9 0.8 0.7\nNs 1000\nillum {illum}")
    assert (material.base_color, material.metallic, material.roughness) == ((0.9, 0.8, 0.7), 1.0, 0.0)
    rough = worn(tmp_path, f"Ks 0.9 0.8 0.7\nNs 30\nillum {illum}")
    assert rough.roughness**4 == pytest.approx(2.0 / 32.0)


@pytest.mark.parametrize("said", ["illum 4", "illum 6", "illum 7", "illum 9", ""])
def test_glass_is_solid_where_it_is_closed(tmp_path: Path, said: str) -> None:
    mtl = f"Kd 0 0 0\nKs 0.3 0.3 0.3\nNi 1.33\nTf 0.1 0.2 0.2\nNs 200\nd 0.1\n{said}"
    solid = worn(tmp_path, mtl, CUBE.replace("f 1 3", "usemtl m\nf 1 3"))
    sheet = worn(tmp_path, mtl)
    for material, thickness in ((solid, 1.0), (sheet, 0.0)):
        assert (material.transmission, material.ior, material.thickness) == (1.0, 1.33, thickness)
        assert (material.roughness, material.alpha_mode) == (0.0, AlphaMode.OPAQUE)
        assert material.base_color == pytest.approx((0.5, 1.0, 1.0))


def test_a_filter_alone_is_no_glass(tmp_path: Path) -> None:
    """3ds Max writes Tf 1 1 1 and Ni 1.5 for every material."""
    assert worn(tmp_path, "Tf 1 1 1\nNi 1.5\nillum 2").transmission == 0.0


def test_physical_statements_go_first(tmp_path: Path) -> None:
    material = worn(tmp_path, "Kd 1 0.5 0\nKs 0.5 0.5 0.5\nNs 9\nPr 0.25\nPm 1\nillum 3\nKe 3 2 1")
    assert (material.metallic, material.roughness, material.specular_color) == (1.0, 0.25, (1.0, 1.0, 1.0))
    assert (material.base_color, material.emission) == ((1.0, 0.5, 0.0), (3.0, 2.0, 1.0))


@pytest.mark.parametrize(
    ("said", "mode", "opacity"),
    [
        ("d 0.25", AlphaMode.BLEND, 0.25),
        ("Tr 0.25", AlphaMode.BLEND, 0.75),
        ("d 1\nTr 1", AlphaMode.OPAQUE, 1.0),
        ("d -halo 0.5", AlphaMode.BLEND, 0.5),
        ("Tr 1", AlphaMode.OPAQUE, 1.0),
        ("d 1.0 # all", AlphaMode.OPAQUE, 1.0),
    ],
)
def test_opacity_comes_from_d_else_from_tr(
    tmp_path: Path, said: str, mode: AlphaMode, opacity: float
) -> None:
    material = worn(tmp_path, f"Kd 1 1 1\n{said}")
    assert material.alpha_mode == mode
    assert (*material.base_color, 1.0)[3] == opacity


@pytest.mark.parametrize(
    "said",
    ["Kd spectral file.rfl", "Kd x y z", "Kd nan 0 0", "Kd -1 7 0", "illum 2\nNs -5", "Ni x", "illum purple",
     "illum 2\nd 9", "Pr nan"],
)  # fmt: skip
def test_statements_without_sense_are_told(tmp_path: Path, said: str) -> None:
    scene = read(tmp_path, QUAD + "usemtl m\nf 1 2 3\n", f"newmtl m\nillum 4\n{said}\n")
    (material,) = scene.materials
    assert 1 <= len(scene.warnings) <= 2
    numbers = (*material.base_color, material.roughness, material.metallic, material.ior)
    assert all(math.isfinite(n) and n >= 0.0 for n in numbers)


def picture(folder: Path, name: str, *color: int) -> None:
    (folder / name).parent.mkdir(exist_ok=True)
    Image.new("RGBA" if len(color) == 4 else "RGB" if len(color) == 3 else "L", (4, 4), color).save(
        folder / name
    )


def test_maps_fill_the_slots(tmp_path: Path) -> None:
    picture(tmp_path, "textures/my wood.png", 200, 100, 50)
    picture(tmp_path, "rough.bmp", 77)
    picture(tmp_path, "metal.tga", 33)
    picture(tmp_path, "normal.jpg", 128, 128, 255)
    material = worn(
        tmp_path,
        "Kd 0 0 0\nmap_Kd -s 2 3 1 -o 0.5 0.25 textures\\my wood.png\nmap_Pr rough.bmp\n"
        "map_Pm -clamp on metal.tga\nnorm normal.jpg\nmap_Ke textures/my wood.png",
    )
    base = material.base_color_texture
    assert material.base_color == (1.0, 1.0, 1.0)  # programs write Kd 0 where a picture says it all
    assert base.texture.pixels[0, 0].tolist() == [200, 100, 50, 255]
    assert base.texture.srgb and base.texture.wrap_u == Wrap.REPEAT
    # (u, v upwards) = (0.3, 0.4) shows 0.3 * 2 + 0.5 and 0.4 * 3 + 0.25 of the picture; our v points down
    np.testing.assert_allclose(np.array(base.transform) @ (0.3, 1 - 0.4, 1), (1.1, 1 - 1.45))
    packed = material.metallic_roughness_texture.texture
    assert packed.pixels[0, 0].tolist() == [255, 77, 33, 255] and not packed.srgb
    assert (material.roughness, material.metallic) == (1.0, 1.0)
    assert not material.normal_texture.texture.srgb
    assert material.emission == (1.0, 1.0, 1.0)


@pytest.mark.parametrize("mask", [(64,), (9, 9, 9, 64)])
def test_cutouts_take_their_opacity_from_map_d(tmp_path: Path, mask: tuple[int, ...]) -> None:
    picture(tmp_path, "leaf.png", 1, 2, 3)
    picture(tmp_path, "mask.png", *mask)
    material = worn(tmp_path, "map_Kd leaf.png\nmap_d mask.png")
    assert material.base_color_texture.texture.pixels[0, 0].tolist() == [1, 2, 3, 64]
    assert material.alpha_mode == AlphaMode.MASK


def test_maps_that_cannot_be_shown_are_told(tmp_path: Path) -> None:
    (tmp_path / "inside").mkdir()
    picture(tmp_path, "outside.png", 1, 2, 3)
    names = ["gone.png", "../outside.png", "/etc/passwd", "http://127.0.0.1:9/a.png", "a.mtl"]
    mtl = "".join(f"newmtl {i}\nmap_Kd {name}\n" for i, name in enumerate(names))
    faces = "".join(f"usemtl {i}\nf 1/1 2/2 3/3\n" for i in range(len(names)))
    scene = read(tmp_path / "inside", QUAD + UVS + faces, mtl)
    assert all(m.base_color_texture is None for m in scene.materials)
    assert len(scene.warnings) == len(names)


def test_maps_named_by_where_they_once_lay_are_found_beside(tmp_path: Path) -> None:
    picture(tmp_path, "wood.png", 1, 2, 3)
    assert worn(tmp_path, "map_Kd C:\\work\\wood.png").base_color_texture is not None


def test_maps_need_coordinates_and_others_are_passed_over(tmp_path: Path) -> None:
    picture(tmp_path, "wood.png", 1, 2, 3)
    scene = read(tmp_path, QUAD + "usemtl m\nf 1 2 3\n", "newmtl m\nmap_Kd wood.png\nmap_Bump wood.png\n")
    assert scene.materials[0].base_color_texture is None
    assert [w.split()[0] for w in scene.warnings] == ["map_bump", "m:"]


def test_map_options_are_told_from_names() -> None:
    assert parse_map("-bm 2 -type sphere bump 01.png") == MapUse("bump 01.png")
    assert parse_map("-s 2 3.png") == MapUse("3.png", scale=(2.0, 1.0))
    assert parse_map("") == MapUse("")


def test_objs_are_as_their_groups_say() -> None:
    """The Cornell boxes count back from the vertices read so far, which some readers take for all."""
    scene = load(assets() / "cornell" / "CornellBox-Mirror.obj")
    assert not scene.warnings
    walls = {node.name: node.parts[0].mesh.positions for node in scene.nodes}
    assert walls["leftWall"][:, 0].max() < -0.9 and walls["rightWall"][:, 0].min() > 0.9
    assert np.ptp(walls["floor"][:, 1]) == 0.0
    (mirror,) = (m for m in scene.materials if m.metallic)
    assert mirror.roughness == 0.0


def test_closed_glass_of_the_assets_is_solid() -> None:
    for name, thickness in (("Sphere", {"rightSphere": 1.0}), ("Water", {"rightSphere": 1.0, "water": 0.0})):
        scene = load(assets() / "cornell" / f"CornellBox-{name}.obj")
        assert {m.name: m.thickness for m in scene.materials if m.transmission} == thickness


def test_a_large_obj_loads_at_a_rate(tmp_path: Path) -> None:
    """100,000 triangles: 0.6 s on a core of 2023; a third of them four times as slow would fail."""
    side = 224
    rows = np.arange(side * side).reshape(side, side) + 1
    quads = np.stack([rows[:-1, :-1], rows[:-1, 1:], rows[1:, 1:], rows[1:, :-1]], axis=-1).reshape(-1, 4)
    lines = [f"v {i % side} 0 {i // side}" for i in range(side * side)]
    lines += ["f " + " ".join(map(str, quad)) for quad in quads]
    (tmp_path / "a.obj").write_text("\n".join(lines))
    start = time.process_time()
    assert load(tmp_path / "a.obj").triangle_count == 2 * (side - 1) ** 2
    assert time.process_time() - start < 3.0


def test_notes_count_like_faults() -> None:
    notes = Notes()
    notes.count("one", "many", 0)
    assert notes.lines() == []
    notes.count("one", "many", 2)
    assert notes.lines() == ["2 many"]


def test_random_damage_never_ends_otherwise(tmp_path: Path) -> None:
    """600 copies of a scene, with 1 to 4 bytes of the OBJ or of the MTL overwritten; seed 1."""
    picture(tmp_path, "wood.png", 1, 2, 3)
    wholes = {
        "a.obj": f"mtllib a.mtl\n{QUAD}{UVS}vn 0 0 1\ns 1\nusemtl m\nf 1/1 2/2 3/3 4/4\nf -1//1 -2//1 -3//1",
        "a.mtl": "newmtl m\nKd 0.1 0.2 0.3\nKs 1 1 1\nNs 30\nNi 1.5\nd 0.5\nillum 7\nmap_Kd -s 2 2 wood.png",
    }
    random, refused = np.random.default_rng(1), 0
    for turn in range(600):
        for name, text in wholes.items():
            data = np.frombuffer(text.encode(), np.uint8).copy()
            if name == ("a.obj", "a.mtl")[turn % 2]:
                data[random.integers(0, len(data), random.integers(1, 5))] = random.integers(0, 256)
            (tmp_path / name).write_bytes(data.tobytes())
        try:
            scene = load(tmp_path / "a.obj")
        except SceneError:
            refused += 1
            continue
        for part in (part for node in scene.nodes for part in node.parts):
            assert np.isfinite(part.mesh.positions).all()
            values = (*part.material.base_color, part.material.roughness, part.material.ior)
            assert all(math.isfinite(v) and v >= 0.0 for v in values)
    assert 0 < refused < 300  # a broken MTL is told, not refused
