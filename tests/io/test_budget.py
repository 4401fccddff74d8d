"""What a scene may take with all its files: memory, work, and what is shared."""

import io
import os
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gltf_builder import QUAD, GltfBuilder, quad
from PIL import Image

import ispm
from ispm.errors import SceneError
from ispm.io import picture, surface_mesh
from ispm.io.budget import MEMORY_PER_BYTE, WORK_PER_BYTE, Budget
from ispm.io.polygons import triangulate
from ispm.settings import LoadLimits

ZEROS = {"componentType": 5126, "count": 1_000_000, "type": "VEC3"}
WORN = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\n"


def png(side: int, text: str = "") -> bytes:
    from PIL.PngImagePlugin import PngInfo

    stream, about = io.BytesIO(), PngInfo()
    about.add_text("t", text)
    Image.new("RGB", (side, side), (9, 8, 7)).save(stream, "PNG", pnginfo=about)
    return stream.getvalue()


def jpeg(side: int, scans: int) -> bytes:
    """A progressive JPEG with its last scan once for each of `scans` more."""
    stream = io.BytesIO()
    Image.new("L", (side, side)).save(stream, "JPEG", progressive=True)
    data = stream.getvalue()
    return data[:-2] + data[data.rfind(picture.SCAN) : -2] * scans + data[-2:]


def showing(pictures: list[bytes]) -> GltfBuilder:
    """A triangle for each picture."""
    builder = GltfBuilder()
    points, uv = builder.accessor(QUAD[:3]), builder.accessor(QUAD[:3, :2].copy())
    for data in pictures:
        image = builder.put("images", {"bufferView": builder.view(data)})
        texture = builder.put("textures", {"source": image})
        slot = {"baseColorTexture": {"index": texture}, "metallicRoughnessTexture": {"index": texture}}
        material = builder.put("materials", {"pbrMetallicRoughness": slot})
        primitive = {"attributes": {"POSITION": points, "TEXCOORD_0": uv}, "material": material}
        builder.node(mesh=builder.put("meshes", {"primitives": [primitive]}))
    return builder


def pixels_of(scene: ispm.Scene) -> list[np.ndarray]:
    uses = [use for m in scene.materials for use in (m.base_color_texture, m.metallic_roughness_texture)]
    return [use.texture.pixels for use in uses if use is not None]


def test_small_files_stay_small_and_large_ones_may_be_large() -> None:
    budget = Budget(LoadLimits(max_memory=100, max_work=10, max_file_bytes=1000))
    with pytest.raises(SceneError, match=r"^a mesh: there is no memory left .* max_memory=100 by"):
        budget.take("a mesh", memory=101, work=1)
    budget.take("a mesh", memory=100, work=10)  # what was refused took nothing
    budget.read(500, "a.bin")
    budget.take("a mesh", memory=500 * MEMORY_PER_BYTE, work=500 * WORK_PER_BYTE)
    with pytest.raises(SceneError, match="no work left for it; raise max_work=10"):
        budget.take("a mesh", work=1)
    with pytest.raises(SceneError, match=r"b\.bin has 501 bytes with those before it; max_file_bytes=1000"):
        budget.read(501, "b.bin")


def test_accessors_without_bytes_are_bounded_together(tmp_path: Path) -> None:
    """14 kB that asked for 2.3 GiB: 100 primitives over 100 accessors of a million zeros."""
    builder = GltfBuilder(accessors=[ZEROS] * 100)
    builder.put("meshes", {"primitives": [{"attributes": {"POSITION": k}} for k in range(100)]})
    builder.node(mesh=0)
    with pytest.raises(SceneError, match=r"^scene\.gltf: .*max_memory=671088640"):
        builder.load(tmp_path)
    assert builder.load(tmp_path, max_memory=4 << 30).triangle_count == 100 * 333_333


def test_sparse_accessors_are_copied_once(tmp_path: Path) -> None:
    builder = GltfBuilder()
    view = builder.view(struct.pack("<I3f", 0, 1, 2, 3))
    sparse = {"count": 1, "indices": {"bufferView": view, "componentType": 5125},
              "values": {"bufferView": view, "byteOffset": 4}}  # fmt: skip
    points = builder.put("accessors", {**ZEROS, "sparse": sparse})
    for k in range(200):  # 2.4 GB of copies
        corners = builder.accessor(np.array([0, k, 999_999], np.uint32))
        builder.put("meshes", {"primitives": [{"attributes": {"POSITION": points}, "indices": corners}]})
        builder.node(mesh=k)
    scene = builder.load(tmp_path, max_memory=20_000_000)
    assert scene.nodes[7].parts[0].mesh.positions.tolist() == [[1, 2, 3], [0, 0, 0], [0, 0, 0]]


def test_channels_over_nothing_are_bounded(tmp_path: Path) -> None:
    builder = quad()
    keys = builder.accessor(np.arange(1000, dtype=np.float32))
    values = builder.put("accessors", {**ZEROS, "count": 1000})
    samplers = [{"input": keys, "output": values}]
    channels = [{"sampler": 0, "target": {"node": 0, "path": "translation"}}] * 300
    builder.put("animations", {"channels": channels, "samplers": samplers})
    scene = builder.load(tmp_path, max_memory=1 << 20)
    assert 0 < len(scene.animations[0].channels) < 300
    assert any("a channel is left out" in line and "max_memory" in line for line in scene.warnings)


@pytest.fixture
def decoded(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """The sizes of the pictures that are decoded."""
    sizes: list[Any] = []
    plain = picture.rgba
    monkeypatch.setattr(picture, "rgba", lambda image: (sizes.append(image.size), plain(image))[1])
    return sizes


def test_equal_pictures_are_decoded_once_and_shared(tmp_path: Path, decoded: list[Any]) -> None:
    scene = showing([png(64)] * 60).load(tmp_path)
    assert decoded == [(64, 64)]
    assert len(pixels_of(scene)) == 120 and len({id(p) for p in pixels_of(scene)}) == 1
    textures = {id(m.base_color_texture.texture) for m in scene.materials}
    assert len(textures) == 1 and scene.warnings == []


def test_broken_pictures_are_tried_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[Any] = []
    plain = Image.open
    monkeypatch.setattr(Image, "open", lambda *a, **k: (opened.append(1), plain(*a, **k))[1])
    scene = showing([png(64)[:100]] * 60).load(tmp_path)
    assert len(opened) == 1 and pixels_of(scene) == []


def test_pictures_of_an_mtl_that_are_equal_are_one(tmp_path: Path, decoded: list[Any]) -> None:
    for name in "ab":
        (tmp_path / f"{name}.png").write_bytes(png(32))
    (tmp_path / "a.mtl").write_text("newmtl a\nmap_Kd a.png\nmap_Ke ./a.png\nnewmtl b\nmap_Kd b.png\n")
    (tmp_path / "a.obj").write_text(f"mtllib a.mtl\n{WORN}usemtl a\nf 1/1 2/2 3/3\nusemtl b\nf 1/1 2/2 3/3\n")
    a, b = ispm.load(tmp_path / "a.obj").materials
    assert decoded == [(32, 32)]
    uses = a.base_color_texture, a.emission_texture, b.base_color_texture
    assert len({id(use.texture.pixels) for use in uses}) == 1


def test_pictures_that_differ_are_halved_so_that_all_fit(tmp_path: Path) -> None:
    pictures = [png(256, str(k)) for k in range(40)]  # 256 kB each, 10 MB together
    limit = 2 << 20
    builder = showing(pictures)
    scene = builder.load(tmp_path, max_memory=limit)
    every = {id(p): p for p in pixels_of(scene)}.values()
    found = [m.base_color_texture.texture.pixels for m in scene.materials]
    read = (tmp_path / "scene.gltf").stat().st_size
    assert len(found) == 40 and sum(p.nbytes for p in every) < limit + MEMORY_PER_BYTE * read
    sides = [len(p) for p in found]
    assert sides[0] == 256 and sorted(sides, reverse=True) == sides and sides[-1] < 256
    assert all((p == (9, 8, 7, 255)).all() for p in found)  # one color stays what it is
    assert any(line.endswith("pictures are halved, for want of memory; max_memory allows more")
               for line in scene.warnings)  # fmt: skip
    assert {len(p) for p in pixels_of(builder.load(tmp_path))} == {256}


def test_scans_of_a_jpeg_are_work(tmp_path: Path) -> None:
    few, many = showing([jpeg(4096, 4)]), showing([jpeg(4096, 3000)])  # 0.1 s and 38 s
    assert few.load(tmp_path).warnings == []
    scene = many.load(tmp_path)
    assert pixels_of(scene) == []
    assert "4096 x 4096 pixels: there is no work left for it; raise max_work" in scene.warnings[0]


@pytest.mark.parametrize("mode", ["L", "RGB", "RGBA", "P", "1", "LA", "CMYK", "I;16"])
def test_large_pictures_are_converted_in_tiles_to_the_same(mode: str) -> None:
    """Against Pillow's conversion of the whole."""
    noise = np.random.default_rng(1).integers(
        0, 256, (picture.TILE + 3, 2 * picture.TILE + 1, 4), dtype=np.uint8
    )
    if mode == "I;16":
        gray = np.ascontiguousarray(noise[..., :2]).view("<u2")[..., 0]
        image = Image.fromarray(gray)
        wanted = np.dstack([gray >> 8] * 3 + [np.full_like(gray, 255)]).astype(np.uint8)
    else:
        image = Image.fromarray(noise, "RGBA").convert("RGB" if mode in ("P", "CMYK") else mode).convert(mode)
        wanted = np.asarray(image.convert("RGBA"))
    assert (picture.rgba(image) == wanted).all()


def test_an_obj_takes_time_of_its_length_whatever_its_objects(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is looked at, counted: 800 objects of 15 MB took 33 s when each looked at all vertices."""
    seen: list[int] = []
    plain = surface_mesh.wild
    monkeypatch.setattr(surface_mesh, "wild", lambda values: (seen.append(values.size), plain(values))[1])
    counts = []
    for objects in (20, 40):
        seen.clear()
        text = "".join(
            f"o {k}\n" + "".join(f"v {k} {i} {i * i % 7}\nvt {i} 0\n" for i in range(30))
            + "".join(f"f {a}/{a} {a + 1}/{a + 1} {a + 2}/{a + 2}\n" for a in range(30 * k + 1, 30 * k + 29))
            for k in range(objects)
        )  # fmt: skip
        (tmp_path / "a.obj").write_text(text)
        assert len(ispm.load(tmp_path / "a.obj").nodes) == objects
        counts.append(sum(seen))
    assert counts[1] == 2 * counts[0]


def test_ears_are_looked_for_in_the_square_of_the_corners(monkeypatch: pytest.MonkeyPatch) -> None:
    """The teeth of a comb; a corner is asked three times at most, and all of its area is covered."""
    from ispm.io import polygons

    asked: list[int] = []
    plain = polygons._is_ear
    monkeypatch.setattr(polygons, "_is_ear", lambda *given: (asked.append(1), plain(*given))[1])
    for size in (32, 64, 128):
        asked.clear()
        teeth = [(k, 50.0 * (k % 2), 0.0) for k in range(size - 2)]
        points = np.array([*teeth, (size - 2, -1.0, 0.0), (0, -1.0, 0.0)])[::-1]
        triangles = triangulate(np.arange(size), np.array([size]), points)
        a, b, c = points[triangles][..., :2].swapaxes(0, 1)
        areas = ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / 2.0
        x, y = points[:, 0], points[:, 1]
        assert (areas > 0.0).all() and areas.sum() == pytest.approx(
            (x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2
        )
        assert len(asked) <= 3 * size


@pytest.mark.parametrize(
    "line",
    ["s 99999999999999999999", f"s {'9' * 5000}", f"s {2**63}", "s -1", "s 007",
     "mtllib " + "a" * 300, "mtllib " + "a" * 100_000, "mtllib " + "a/" * 5000, "mtllib ring/a.mtl",
     "mtllib pipe", "mtllib \udcff\udcfe"],
)  # fmt: skip
def test_odd_lines_of_an_obj_are_passed_over(tmp_path: Path, line: str) -> None:
    (tmp_path / "ring").symlink_to("ring")
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "a.obj").write_bytes(f"{WORN}{line}\nf 1 2 3\n".encode("utf-8", "surrogateescape"))
    scene = ispm.load(tmp_path / "a.obj")
    assert scene.triangle_count == 1
    assert bool(scene.warnings) == line.startswith("mtllib")


def test_smoothing_groups_of_any_number_are_told_apart(tmp_path: Path) -> None:
    roof = "v 0 0 0\nv 0 1 0\nv 1 0 1\nv 1 1 1\nv 2 0 0\nv 2 1 0\ns {}\nf 1 3 4 2\ns {}\nf 3 5 6 4\n"
    for first, second, vertices in ((2**70, 2**70 + 1, 8), (2**70, 2**70, 6), ("007", "7", 6)):
        (tmp_path / "a.obj").write_text(roof.format(first, second))
        ((part,),) = [node.parts for node in ispm.load(tmp_path / "a.obj").nodes]
        assert len(part.mesh.positions) == vertices


@pytest.mark.parametrize("name", ["ring/a", "ring", "a" * 300, "a/" * 5000, "\ud800", "pipe", "%ff"])
def test_odd_names_of_a_gltf_are_refused_in_a_line(tmp_path: Path, name: str) -> None:
    (tmp_path / "ring").symlink_to("ring")
    os.mkfifo(tmp_path / "pipe")
    builder = quad(buffers=[{"byteLength": 140, "uri": name}])
    with pytest.raises(SceneError, match=r"^scene\.gltf: "):
        builder.load(tmp_path)


@pytest.mark.parametrize("name", [b"caf\xe9.obj", b"caf\xe9.ply"])
def test_files_whose_names_are_no_utf_8_load_and_can_be_told_of(tmp_path: Path, name: bytes) -> None:
    path = tmp_path / os.fsdecode(name)
    path.write_text(WORN + "f 1 2 3\nf 1 2\n" if name.endswith(b"obj") else "ply\n")
    try:
        scene = ispm.load(path)
    except SceneError as error:
        str(error).encode()
    else:
        told = [scene.name, repr(scene), *scene.warnings, *(node.name for node in scene.nodes)]
        assert scene.triangle_count == 1 and "".join(told).encode()


def test_a_link_to_itself_and_other_odd_paths_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.obj").symlink_to("a.obj")
    for path in (
        tmp_path / "a.obj",
        "a" * 300 + ".obj",
        "a/" * 5000 + "a.obj",
        "a\0.obj",
        "\ud800.obj",
        b"a.obj",
    ):
        with pytest.raises(SceneError) as caught:
            ispm.load(path)
        assert str(caught.value).isprintable() and len(str(caught.value)) < 1000


@pytest.mark.parametrize("length", ["nan", "inf", "-inf"])
def test_lists_of_a_ply_whose_length_is_no_number_are_refused(tmp_path: Path, length: str) -> None:
    text = (
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
        "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n"
    )
    (tmp_path / "a.ply").write_text(text + f"{length} 0 1 2\n")
    with pytest.raises(SceneError, match=r"^a\.ply: a list of 'face' has a length that is no number"):
        ispm.load(tmp_path / "a.ply")
    (tmp_path / "a.ply").write_text(text.replace("vertex 3", f"vertex {'9' * 5000}"))
    with pytest.raises(SceneError, match=r"^a\.ply: 'vertex' has a count of 5000 digits"):
        ispm.load(tmp_path / "a.ply")


def test_lookups_of_files_are_work(tmp_path: Path) -> None:
    names = " ".join(f"n{k}" for k in range(2000))
    (tmp_path / "a.obj").write_text(f"mtllib {names}\n{WORN}f 1 2 3\n")
    assert ispm.load(tmp_path / "a.obj").triangle_count == 1
    with pytest.raises(SceneError, match="no work left"):
        ispm.load(tmp_path / "a.obj", max_work=1_000_000)
