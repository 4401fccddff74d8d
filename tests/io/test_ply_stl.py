"""PLY and STL files, as text and as bytes of either order."""

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from ispm.errors import SceneError
from ispm.io import stl
from ispm.io.load import load
from ispm.io.weld import number_points, weld
from ispm.scene.mesh import Mesh
from ispm.scene.scene import Scene

XYZ = "property float x\nproperty float y\nproperty float z\n"
LIST = "property list uchar int vertex_indices\n"
HOUSE = [(0, 0, 0), (2, 0, 0), (2, 2, 0), (1, 3, 0), (0, 2, 0), (3, 0, 0)]
FACES = [[0, 1, 2, 3, 4], [1, 5, 2]]


def header(form: str, vertices: int, faces: int, more: str = "", listed: str = LIST) -> str:
    return (
        f"ply\nformat {form} 1.0\ncomment a house\nelement vertex {vertices}\n{XYZ}{more}"
        f"element face {faces}\n{listed}end_header\n"
    )


def house(form: str) -> bytes:
    """A pentagon and a triangle."""
    head = header(form, len(HOUSE), len(FACES))
    if form == "ascii":
        rows = [" ".join(map(str, p)) for p in HOUSE] + [f"{len(f)} {' '.join(map(str, f))}" for f in FACES]
        return (head + "\n".join(rows)).encode()
    order = "<" if "little" in form else ">"
    body = np.array(HOUSE, order + "f4").tobytes()
    return head.encode() + body + b"".join(struct.pack(f"{order}B{len(f)}i", len(f), *f) for f in FACES)


def only_mesh(scene: Scene) -> Mesh:
    ((part,),) = [node.parts for node in scene.nodes]
    return part.mesh


def write(folder: Path, data: bytes | str, name: str = "a.ply") -> Path:
    path = folder / name
    path.write_bytes(data.encode() if isinstance(data, str) else data)
    return path


FORMATS = ("ascii", "binary_little_endian", "binary_big_endian")


@pytest.mark.parametrize("form", FORMATS)
def test_ply_polygons_of_any_size_are_read(tmp_path: Path, form: str) -> None:
    scene = load(write(tmp_path, house(form)))
    mesh = only_mesh(scene)
    corners = mesh.positions[mesh.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (scene.warnings, len(mesh.triangles), mesh.normals) == ([], 4, None)
    assert normals[:, 2].sum() / 2 == 6.0  # the pentagon's 5 and the triangle's 1, wound alike
    assert (normals[:, 2] > 0).all()


@pytest.mark.parametrize("form", FORMATS)
def test_every_cut_of_a_ply_is_refused(tmp_path: Path, form: str) -> None:
    whole = house(form)
    for length in range(0, len(whole) - 1, 3):  # the last digit of a text may be cut and still be a number
        with pytest.raises(SceneError, match=r"^a\.ply: "):
            load(write(tmp_path, whole[:length]))


@pytest.mark.parametrize(
    "types", [("uchar", "255", "128"), ("ushort", "65535", "32896"), ("float", "1.0", "0.5019608")]
)
def test_ply_normals_colors_and_coordinates_are_read(tmp_path: Path, types: tuple[str, str, str]) -> None:
    kind, full, half = types
    more = "".join(f"property float {n}\n" for n in ("nx", "ny", "nz", "s", "t"))
    more += "".join(f"property {kind} {n}\n" for n in ("red", "green", "blue"))
    rows = "".join(f"{x} {y} 0 0 0 1 {x} {y} {full} 0 {half}\n" for x, y in ((0, 0), (1, 0), (0, 0.25)))
    mesh = only_mesh(load(write(tmp_path, header("ascii", 3, 1, more) + rows + "3 0 1 2\n")))
    assert (mesh.normals == (0, 0, 1)).all()
    assert mesh.uv0.tolist() == [[0, 1], [1, 1], [0, 0.75]]  # v points down in our coordinates
    np.testing.assert_allclose(
        mesh.colors, np.tile((1, 0, 0.2158605, 1), (3, 1)), atol=1e-6
    )  # sRGB of 128/255


@pytest.mark.parametrize("form", FORMATS)
def test_ply_lists_and_elements_beside_faces_are_passed_over(tmp_path: Path, form: str) -> None:
    order = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}[form]
    head = (
        f"ply\r\nformat {form} 1.0\r\nelement note 1\r\nproperty list uint uchar text\r\nelement vertex 3\r\n"
        "property double z\r\nproperty short y\r\nproperty uchar x\r\nelement face 2\r\n"
        "property uchar tag\r\nproperty list uchar ushort vertex_index\r\n"
        "property list uchar float w\r\nend_header\r\n"
    )
    if form == "ascii":
        body = b"2 65 66\n5 0 0\n5 0 9\n5 -7 0\n1 3 0 1 2 2 .5 .5\n1 3 0 2 1 1 .5\n"
    else:
        body = struct.pack(order + "I2B", 2, 65, 66)
        body += b"".join(struct.pack(order + "dhB", *v) for v in ((5, 0, 0), (5, 0, 9), (5, -7, 0)))
        body += struct.pack(order + "BB3HB2f", 1, 3, 0, 1, 2, 2, 0.5, 0.5)
        body += struct.pack(order + "BB3HBf", 1, 3, 0, 2, 1, 1, 0.5)
    mesh = only_mesh(load(write(tmp_path, head.encode() + body)))
    assert mesh.positions.tolist() == [[0, 0, 5], [9, 0, 5], [0, -7, 5]]
    assert mesh.triangles.tolist() == [[0, 1, 2], [0, 2, 1]]


def test_ply_points_have_no_surface(tmp_path: Path) -> None:
    scene = load(write(tmp_path, header("ascii", 2, 0) + "0 0 0\n1 1 1\n"))
    assert (scene.triangle_count, scene.warnings) == (0, ["a cloud of 2 points: there is no surface to draw"])


def test_ply_texture_lies_inside_its_folder(tmp_path: Path) -> None:
    more = "property float u\nproperty float v\n"
    text = header("ascii", 3, 1, more) + "0 0 0 0 0\n1 0 0 1 0\n0 1 0 0 1\n3 0 1 2\n"
    Image.new("RGB", (2, 2), (1, 2, 3)).save(tmp_path / "a.png")
    for name, told in (("a.png", 0), ("../b.png", 1), ("gone.png", 1)):
        scene = load(write(tmp_path, text.replace("a house", f"TextureFile {name}")))
        (material,) = scene.materials
        assert (material.base_color_texture is None, len(scene.warnings)) == (bool(told), told)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("plz\n", "no PLY file"),
        ("ply\nformat ascii 1.0\n", "no end"),
        ("ply\nformat morse 1.0\nend_header\n", "format is none of"),
        (header("ascii", 10**12, 1), "max_elements="),
        (header("ascii", 10**8, 1), "cut short"),
        (header("binary_little_endian", 10**8, 1), "cut short"),
        (header("binary_little_endian", 0, 10**8), "cut short"),
        (header("ascii", 1, 1).replace("float x", "quad x"), "'property quad x' makes no sense"),
        (header("ascii", 1, 1).replace("list uchar", "list float"), "makes no sense"),
        (header("ascii", 1, 1).replace("element vertex 1", "element vertex -1"), "makes no sense"),
        ("ply\nformat ascii 1.0\nproperty float x\nend_header\n", "makes no sense"),
        (header("ascii", 0, 0).replace("float z", "float w"), "no vertices with x, y and z"),
        (header("ascii", 3, 1) + "0 0 0\n" * 3 + "3 0 1 3\n", "vertex 3 of 3"),
        (header("ascii", 3, 1) + "0 0 0\n" * 3 + "3 0 1 -1\n", "vertex -1 of 3"),
        (header("ascii", 3, 1) + "0 0 0\n" * 3 + "-3 0 1 2\n", "cut short"),
        (header("ascii", 3, 1) + "0 0 0\n" * 3 + "1e300 0 1 2\n", "cut short|no number"),
        (header("ascii", 3, 1) + "0 0 0\n" * 3 + "3 0 1 x\n", "no number"),
        (header("ascii", 3, 1) + "0 0 " + "0" * 10**6, "no numbers"),
    ],
)  # fmt: skip
def test_broken_ply_is_refused(tmp_path: Path, text: str, reason: str) -> None:
    with pytest.raises(SceneError, match=rf"^a\.ply: .*({reason})"):
        load(write(tmp_path, text))


def test_ply_faults_that_leave_something_are_told(tmp_path: Path) -> None:
    text = header("ascii", 4, 3) + "0 0 0\n1 0 0\n0 1 0\nnan 0 0\n3 0 1 2\n2 0 1\n3 0 1 3\n"
    scene = load(write(tmp_path, text))
    assert scene.triangle_count == 1
    assert len(scene.warnings) == 2


@pytest.mark.parametrize("form", FORMATS)
def test_random_damage_to_a_ply_never_ends_otherwise(tmp_path: Path, form: str) -> None:
    """300 copies with 1 to 4 bytes overwritten; seed 1."""
    whole, random, refused = np.frombuffer(house(form), np.uint8), np.random.default_rng(1), 0
    for _ in range(300):
        damaged = whole.copy()
        damaged[random.integers(0, len(whole), random.integers(1, 5))] = random.integers(0, 256)
        try:
            meshes = [
                part.mesh for node in load(write(tmp_path, damaged.tobytes())).nodes for part in node.parts
            ]
        except SceneError:
            refused += 1
        else:
            assert all(np.isfinite(mesh.positions).all() for mesh in meshes)
    assert 0 < refused < 300


TRIANGLE = (0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0)


def binary_stl(count: int, triangles: int, title: bytes = b"part") -> bytes:
    return title.ljust(80) + struct.pack("<I", count) + struct.pack("<12fH", *TRIANGLE, 0) * triangles


TEXT_STL = """solid first part
facet normal 0 0 1
 outer loop
  vertex 0 0 0
  VERTEX 1 0 0
  vertex 0 1e0 0
 endloop
endfacet
endsolid first part
solid
endsolid
"""


@pytest.mark.parametrize("title", [b"part", b"solid part", b"SOLID facet"])
def test_binary_stl_is_known_by_its_length(tmp_path: Path, title: bytes) -> None:
    mesh = only_mesh(load(write(tmp_path, binary_stl(2, 2, title), "a.stl")))
    assert mesh.positions[mesh.triangles].tolist() == [[[0, 0, 0], [1, 0, 0], [0, 1, 0]]] * 2
    assert mesh.normals is None


def test_text_stl_has_a_node_for_each_solid_with_triangles(tmp_path: Path) -> None:
    scene = load(write(tmp_path, TEXT_STL + TEXT_STL.replace("first", "second"), "a.stl"))
    assert [node.name for node in scene.nodes] == ["first part", "second part"]
    assert scene.triangle_count == 2


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"", "0 of its 84"),
        (binary_stl(2, 1), "says 2 triangles, but it has the bytes of 1"),
        (binary_stl(1, 2), "says 1 triangles, but it has the bytes of 2"),
        (binary_stl(2**32 - 1, 1), "says 4294967295"),
        (TEXT_STL[:90].encode(), "line 6: a vertex"),
        (TEXT_STL[:110].encode(), "cut short"),
        (TEXT_STL.replace("  vertex 0 1e0 0\n", "").encode(), "cut short"),
        (TEXT_STL.replace("1e0", "x").encode(), "line 6: a vertex needs three numbers"),
        (b"hello" * 100, "says"),
    ],
)
def test_broken_stl_is_refused(tmp_path: Path, data: bytes, reason: str) -> None:
    with pytest.raises(SceneError, match=rf"^a\.stl: .*{reason}"):
        load(write(tmp_path, data, "a.stl"))


def test_stl_without_triangles_is_told(tmp_path: Path) -> None:
    assert "nothing to draw" in load(write(tmp_path, binary_stl(0, 0), "a.stl")).warnings[0]


@pytest.mark.parametrize("data", [house("ascii"), house("binary_little_endian")])
@pytest.mark.parametrize("limits", [{"max_elements": 5}, {"max_triangles": 3}])
def test_ply_limits_are_held(tmp_path: Path, data: bytes, limits: dict[str, Any]) -> None:
    with pytest.raises(SceneError, match="allows"):
        load(write(tmp_path, data), **limits)


def test_stl_limits_are_held(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="max_triangles=1"):
        load(write(tmp_path, binary_stl(2, 2), "a.stl"), max_triangles=1)


def test_triangles_of_stl_share_equal_corners(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    corners = rng.integers(-2, 3, (500, 3, 3)).astype("<f4") / np.float32(3.0)
    corners[7, 1] = -0.0
    records = np.zeros(500, stl.TRIANGLE)
    records["corners"] = corners
    data = bytes(80) + struct.pack("<I", 500) + records.tobytes()
    mesh = only_mesh(load(write(tmp_path, data, "a.stl")))
    assert (mesh.positions[mesh.triangles] == corners).all()
    assert len(mesh.positions) == len(np.unique(corners.reshape(-1, 3) + 0.0, axis=0))
    (twice,) = load(write(tmp_path, data, "b.stl")).roots
    assert twice.parts[0].mesh.triangles.tobytes() == mesh.triangles.tobytes()


def test_equal_points_are_one_until_the_table_is_crowded() -> None:
    points = np.random.default_rng(4).integers(0, 30, (20_000, 3)).astype(np.float32)
    rows, numbers = weld(points)
    _, first = np.unique(points, axis=0, return_index=True)
    np.testing.assert_array_equal(rows, np.sort(first))
    assert (points[rows][numbers] == points).all()
    table = np.full(64, 0xFFFFFFFF, np.uint32)  # too small: what finds no place stays apart
    rows, numbers = np.empty(200, np.uint32), np.empty(200, np.uint32)
    few = points[:200].view(np.uint32)
    count = number_points(few, table, rows, numbers)
    assert (few[rows[:count]][numbers] == few).all() and count >= len(np.unique(few, axis=0))
