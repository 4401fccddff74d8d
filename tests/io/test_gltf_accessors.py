"""Accessors against a reading element by element with `struct`."""

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from assets import assets
from gltf_builder import GltfBuilder

from ispm.errors import SceneError
from ispm.io.gltf_file import GltfFile
from ispm.io.load import load
from ispm.settings import LoadLimits

LETTERS = {5120: "b", 5121: "B", 5122: "h", 5123: "H", 5125: "I", 5126: "f"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
FULL = {5120: 127, 5121: 255, 5122: 32767, 5123: 65535, 5125: 4294967295}


def opened(builder: GltfBuilder, folder: Path) -> GltfFile:
    return GltfFile(builder.save_glb(folder / "a.glb"), LoadLimits())


def read_slowly(data: bytes, record: dict[str, Any], view: dict[str, Any]) -> list[list[float]]:
    """glTF 2.0, 3.6.2.4: element i begins at the two offsets plus i strides."""
    letter, width = LETTERS[record["componentType"]], WIDTHS[record["type"]]
    size = struct.calcsize(letter)
    stride = view.get("byteStride", size * width)
    start = view["byteOffset"] + record["byteOffset"]
    return [
        [struct.unpack_from("<" + letter, data, start + i * stride + k * size)[0] for k in range(width)]
        for i in range(record["count"])
    ]


@pytest.mark.parametrize("component", LETTERS)
@pytest.mark.parametrize("kind", WIDTHS)
@pytest.mark.parametrize(("stride", "offset"), [(None, 0), (20, 4), (36, 3)])
def test_accessor_reads_every_layout(
    tmp_path: Path, component: int, kind: str, stride: int | None, offset: int
) -> None:
    noise = np.random.default_rng(component + len(kind)).integers(0, 256, 360, np.uint8)
    noise &= 0xBF  # no float, wherever it begins, with an exponent of all ones: NaN is not equal to itself
    builder = GltfBuilder()
    builder.view(b"before")
    view = builder.view(noise.tobytes(), **({"byteStride": stride} if stride else {}))
    record = {"bufferView": view, "componentType": component, "type": kind, "count": 7, "byteOffset": offset}
    index = builder.put("accessors", record)
    expected = read_slowly(builder.data, record, builder.json["bufferViews"][view])
    file = opened(builder, tmp_path)
    assert file.stored(index).tolist() == expected
    assert not file.stored(index).flags.owndata  # in place, over the mapped file


@pytest.mark.parametrize("component", FULL)
def test_accessor_normalizes_integers(tmp_path: Path, component: int) -> None:
    dtype = np.dtype(LETTERS[component])
    low, high = np.iinfo(dtype).min, np.iinfo(dtype).max
    values = np.array([low, low + 1, 0, 1, high // 3, high], dtype)
    builder = GltfBuilder()
    index = builder.accessor(values, normalized=True)
    plain = builder.accessor(values)
    file = opened(builder, tmp_path)
    expected = np.maximum(values.astype(np.float64) / FULL[component], -1.0)  # glTF 2.0, 3.6.2.2
    read = file.floats(index, ("SCALAR",))
    assert read is not None and read.dtype == np.float32
    np.testing.assert_allclose(read[:, 0], expected, rtol=2**-22)  # one rounding in, one in the division
    assert file.floats(plain, ("SCALAR",))[:, 0].tolist() == values.astype(np.float32).tolist()


@pytest.mark.parametrize("index_type", [np.uint8, np.uint16, np.uint32])
@pytest.mark.parametrize("based", [True, False])
def test_sparse_accessor_replaces_elements(tmp_path: Path, index_type: type, based: bool) -> None:
    base = np.arange(30, dtype=np.float32).reshape(10, 3)
    rows, new = np.array([1, 4, 9], index_type), np.full((3, 3), -1, np.float32)
    builder = GltfBuilder()
    sparse = {
        "count": 3,
        "indices": {
            "bufferView": builder.view(b"xxxx" + rows.tobytes()),
            "byteOffset": 4,
            "componentType": {1: 5121, 2: 5123, 4: 5125}[rows.itemsize],
        },
        "values": {"bufferView": builder.view(new.tobytes())},
    }
    index = builder.accessor(base, sparse=sparse, **({} if based else {"bufferView": None}))
    expected = base.copy() if based else np.zeros_like(base)
    for row in (1, 4, 9):
        expected[row] = -1.0
    assert (opened(builder, tmp_path).stored(index) == expected).all()


@pytest.mark.parametrize("change", [{"count": 4}, {"count": 10**12}])
def test_sparse_accessor_past_its_end_is_refused(tmp_path: Path, change: dict[str, int]) -> None:
    builder = GltfBuilder()
    sparse = {
        "count": 1,
        "indices": {"bufferView": builder.view(bytes([0, 1, 2, 3])), "componentType": 5121},
        "values": {"bufferView": builder.view(bytes(16))},
    }
    index = builder.accessor(np.zeros(3, np.float32), sparse=sparse | change)
    with pytest.raises(SceneError, match="sparse"):
        opened(builder, tmp_path).stored(index)
    builder.json["accessors"][index]["sparse"] = sparse | {
        "count": 2,
        "indices": {"bufferView": 0, "componentType": 5123},
    }
    with pytest.raises(SceneError, match="sparse index 770"):  # bytes 2, 3 as uint16
        opened(builder, tmp_path).stored(index)


def test_accessor_may_end_with_its_last_element(tmp_path: Path) -> None:
    builder = GltfBuilder()
    view = builder.view(bytes(16 * 2 + 12), byteStride=16)  # the last stride is not filled
    record = {"bufferView": view, "componentType": 5126, "type": "VEC3", "count": 3}
    fits = builder.put("accessors", record)
    too_long = builder.put("accessors", record | {"byteOffset": 4})
    file = opened(builder, tmp_path)
    assert file.stored(fits).shape == (3, 3)
    with pytest.raises(SceneError, match="accessor 1 ends at byte 48 of buffer view 0, which has 44"):
        file.stored(too_long)


def test_quantized_positions_are_placed_by_the_node(tmp_path: Path) -> None:
    steps = np.array([[0, 0, 0], [32767, 0, 0], [0, 0, -32767]], np.int16)
    padded = np.zeros((3, 4), np.int16)  # elements start at multiples of 4 bytes
    padded[:, :3] = steps
    builder = GltfBuilder(extensionsRequired=["KHR_mesh_quantization"])
    view = builder.view(padded.tobytes(), byteStride=8)
    record = {"bufferView": view, "componentType": 5122, "count": 3, "type": "VEC3"}
    for normalized in (True, False):
        position = builder.put("accessors", record | {"normalized": normalized})
        mesh = builder.put("meshes", {"primitives": [{"attributes": {"POSITION": position}}]})
        builder.node(mesh=mesh, scale=[2, 2, 2])
    scene = builder.load(tmp_path)
    unit, raw = (node.parts[0].mesh.positions for node in scene.nodes)
    assert (unit == [[0, 0, 0], [1, 0, 0], [0, 0, -1]]).all()
    assert (raw == steps).all()


@pytest.mark.parametrize(
    "name", ["own_sparse_ubyte_base", "own_sparse_ushort_base", "own_sparse_uint_nobase"]
)
def test_sparse_assets_lift_the_vertices_they_say(name: str) -> None:
    scene = load(assets() / "generator" / f"{name}.gltf")
    heights = scene.nodes[0].parts[0].mesh.positions[:, 2]
    assert (np.sort(heights[heights != 0.0]) == [-0.5, 0.5, 1.0]).all()
