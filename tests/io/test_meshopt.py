"""EXT_meshopt_compression: streams of meshoptimizer are decoded to the last bit; damaged ones end."""

import base64
from pathlib import Path

import numpy as np
import pytest
from gltf_builder import QUAD, GltfBuilder
from meshopt_streams import PLAIN, STREAMS

import ispm
from ispm.errors import SceneError
from ispm.io.meshopt import decode

UNFILTERED = [name for name, (_, filtered, _) in PLAIN.items() if filtered == "NONE"]


def decoded(name: str, stream: bytes | None = None) -> np.ndarray:
    mode, filtered, values = PLAIN[name]
    stride = {"directions": 8, "directions8": 4, "rotations": 8}.get(name, values[0].nbytes)
    data = memoryview(base64.b85decode(STREAMS[name]) if stream is None else stream)
    return decode(data, mode, filtered, len(values), stride)


@pytest.mark.parametrize("name", UNFILTERED)
def test_plain_elements_are_decoded_exactly(name: str) -> None:
    values = PLAIN[name][2]
    got = decoded(name).reshape(-1).view(values.dtype).reshape(values.shape)
    if PLAIN[name][0] == "TRIANGLES":  # the codec may begin a triangle with another of its corners
        turned = [np.roll(got.reshape(-1, 3), k, axis=1) for k in range(3)]
        assert np.any([(t == values.reshape(-1, 3)).all(axis=1) for t in turned], axis=0).all()
    else:
        assert (got == values).all()


@pytest.mark.parametrize(
    ("name", "kind"), [("directions", "<i2"), ("directions8", "i1"), ("rotations", "<i2")]
)
def test_filters_give_unit_vectors_within_their_steps(name: str, kind: str) -> None:
    values = PLAIN[name][2]
    got = decoded(name).view(kind) / np.iinfo(kind).max
    # Stored in as many bits: half a step each for x and y, which z, or the greatest, adds to at most three
    # times, and half a step as the result is rounded.
    assert np.abs(got - values).max() < 3.5 / np.iinfo(kind).max


def test_the_exponential_filter_keeps_23_bits() -> None:
    values = PLAIN["exponents"][2]
    got = decoded("exponents").view("<f4")
    greatest = np.abs(values).max(axis=1, keepdims=True)  # which share an exponent
    assert (np.abs(got - values) <= greatest * 2.0**-22).all()


def test_indices_of_two_bytes() -> None:
    stream = memoryview(base64.b85decode(STREAMS["grid"]))
    four = decode(stream, "TRIANGLES", "NONE", len(PLAIN["grid"][2]), 4).reshape(-1).view("<u4")
    two = decode(stream, "TRIANGLES", "NONE", len(PLAIN["grid"][2]), 2).reshape(-1).view("<u2")
    assert (two == four).all()
    with pytest.raises(SceneError, match="damaged"):  # one is above 65535
        decode(memoryview(base64.b85decode(STREAMS["scattered"])), "TRIANGLES", "NONE", 60, 2)


@pytest.mark.parametrize("name", list(STREAMS))
def test_damaged_streams_end_in_an_error_or_in_as_many_elements(name: str) -> None:
    whole = base64.b85decode(STREAMS[name])
    rng = np.random.default_rng(3)
    refused = 0
    for attempt in range(300):
        stream = bytearray(whole)
        if attempt % 3 == 0:
            del stream[rng.integers(len(stream)) :]
        for _ in range(attempt % 3):
            stream[rng.integers(len(stream))] = rng.integers(256)
        try:
            assert len(decoded(name, bytes(stream))) == len(PLAIN[name][2])
        except SceneError as error:
            refused += 1
            assert "damaged" in str(error)
    assert refused >= 90  # of the 100 that are cut, nearly all


@pytest.mark.parametrize(
    ("mode", "filtered", "count", "stride"),
    [("ATTRIBUTES", "NONE", 1, 0), ("ATTRIBUTES", "NONE", 1, 6), ("ATTRIBUTES", "NONE", 1, 260),
     ("TRIANGLES", "NONE", 4, 4), ("TRIANGLES", "NONE", 3, 8), ("INDICES", "EXPONENTIAL", 3, 4)],
)  # fmt: skip
def test_numbers_that_do_not_go_together_are_refused(
    mode: str, filtered: str, count: int, stride: int
) -> None:
    with pytest.raises(SceneError, match="possible"):
        decode(memoryview(bytes(99)), mode, filtered, count, stride)


def test_filters_refuse_other_strides() -> None:
    with pytest.raises(SceneError, match="12 bytes have no filter QUATERNION"):
        decode(memoryview(base64.b85decode(STREAMS["single"])), "ATTRIBUTES", "QUATERNION", 1, 12)


def packed(**changes: object) -> GltfBuilder:
    """A quad whose indices are compressed, without plain data."""
    builder = GltfBuilder(extensionsRequired=["EXT_meshopt_compression"])
    # Two triangles: of three new corners; of the last edge, 0 to 2, and a new one. Then the table of pairs.
    stream = bytes([0xE1, 0xF0, 0x00]) + bytes(16)
    record = {"buffer": 0, "byteOffset": 0, "byteLength": len(stream), "byteStride": 4, "count": 6,
              "mode": "TRIANGLES", **changes}  # fmt: skip
    builder.view(stream)
    builder.put("bufferViews", {"buffer": 1, "byteLength": 24,
                                "extensions": {"EXT_meshopt_compression": record}})  # fmt: skip
    mesh = builder.mesh(None, POSITION=QUAD)
    accessor = {"bufferView": 1, "componentType": 5125, "count": 6, "type": "SCALAR"}
    builder.json["meshes"][mesh]["primitives"][0]["indices"] = builder.put("accessors", accessor)
    builder.node(mesh=mesh)
    return builder


def load(builder: GltfBuilder, folder: Path, **limits: int) -> ispm.Scene:
    document = builder.finished()
    builder.json = {**document, "buffers": [*document["buffers"], {"byteLength": 24}]}
    builder.data = b""
    return builder.load(folder, **limits)


def test_a_mesh_is_read_from_a_compressed_view(tmp_path: Path) -> None:
    scene = load(packed(), tmp_path)
    (part,) = scene.nodes[0].parts
    assert part.mesh.positions.shape == QUAD.shape
    assert scene.warnings == []
    assert (part.mesh.positions[part.mesh.triangles] == QUAD[[[0, 1, 2], [0, 2, 3]]]).all()


@pytest.mark.parametrize(
    ("changes", "said"),
    [({"count": 3}, "24 bytes, but its meshopt stream 12"), ({"mode": "INDICES"}, "buffer view 1: .*damaged"),
     ({"byteLength": 999}, "ends at byte 999"), ({"mode": "ACME"}, "breaks the schema"),
     ({"byteStride": 10**9, "count": 10**9}, "its meshopt stream 1000000000000000000")],
)  # fmt: skip
def test_what_is_wrong_with_a_compressed_view_is_one_line(tmp_path: Path, changes: dict, said: str) -> None:
    with pytest.raises(SceneError, match=said):
        load(packed(**changes), tmp_path)


def test_sizes_count_before_anything_is_decoded(tmp_path: Path) -> None:
    builder = packed(count=1 << 28)
    builder.json["bufferViews"][1]["byteLength"] = 1 << 30
    with pytest.raises(SceneError, match=r"buffer view 1: there is no memory left .* max_memory"):
        load(builder, tmp_path)
