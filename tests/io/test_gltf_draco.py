"""KHR_draco_mesh_compression: decoded within its quantization, without plain data or beside it."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from assets import assets
from gltf_builder import QUAD, QUAD_INDICES, GltfBuilder

import ispm
from ispm.errors import SceneError
from ispm.io import apart
from ispm.io.budget import Budget
from ispm.settings import LoadLimits

needs_decoder = pytest.mark.skipif(not apart.has("draco"), reason="DracoPy is not installed")

NAME = "KHR_draco_mesh_compression"
BITS = 14


def patch(n: int = 6) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(n^2, 3) positions, (n^2, 2) texture coordinates and (T, 3) triangles of a bent patch."""
    uv = np.stack(np.meshgrid(np.linspace(0, 1, n), np.linspace(0, 1, n)), axis=-1).reshape(-1, 2)
    positions = np.column_stack([2.0 * uv, np.sin(3.0 * uv[:, 0])]).astype(np.float32)
    v = np.arange(n * n).reshape(n, n)
    a, b, c, d = v[:-1, :-1], v[:-1, 1:], v[1:, :-1], v[1:, 1:]
    triangles = np.stack([a, b, c, b, d, c], axis=-1).reshape(-1, 3).astype(np.uint32)
    return positions, uv, triangles


def packed(
    stream: bytes, numbers: dict[str, int], kinds: dict[str, str], vertices: int, corners: int, **more: Any
) -> GltfBuilder:
    """A node with a mesh whose accessors have no data but the stream's.

    numbers  of the attributes in the stream;  kinds  their types
    """
    builder = GltfBuilder(extensionsUsed=[NAME], extensionsRequired=[NAME])
    view = builder.view(stream)
    attributes = {
        name: builder.put("accessors", {"componentType": 5126, "count": vertices, "type": kinds[name]})
        for name in numbers
    }
    indices = builder.put("accessors", {"componentType": 5125, "count": corners, "type": "SCALAR"})
    extension = {NAME: {"bufferView": view, "attributes": numbers}}
    primitive = {"attributes": attributes, "indices": indices, "extensions": extension, **more}
    builder.node(mesh=builder.put("meshes", {"primitives": [primitive]}))
    return builder


def of_patch(level: int = 1, **changes: Any) -> GltfBuilder:
    import DracoPy

    positions, uv, triangles = patch()
    stream = DracoPy.encode(positions, triangles, quantization_bits=BITS, compression_level=level,
                            tex_coord=uv, preserve_order=True, tex_coord_quantization_bits=BITS)  # fmt: skip
    found = {a["attribute_type"]: a["unique_id"] for a in DracoPy.decode(stream).attributes}
    asked = {"stream": stream, "numbers": {"POSITION": found[0], "TEXCOORD_0": found[3]},
             "kinds": {"POSITION": "VEC3", "TEXCOORD_0": "VEC2"}, "vertices": len(positions),
             "corners": triangles.size} | changes  # fmt: skip
    return packed(**asked)


@needs_decoder
@pytest.mark.parametrize("level", [0, 1, 10])
def test_a_mesh_is_decoded_within_half_a_step_of_its_quantization(tmp_path: Path, level: int) -> None:
    positions, uv, triangles = patch()
    scene = of_patch(level).load(tmp_path)
    (part,) = scene.nodes[0].parts
    assert scene.warnings == []
    assert scene.extensions_honoured == [NAME]
    wanted = np.concatenate([positions[triangles], uv[triangles]], axis=2)
    got = np.concatenate([part.mesh.positions, part.mesh.uv0], axis=1)[part.mesh.triangles]
    step = np.array([2.0, 2.0, 2.0, 1.0, 1.0]) / ((1 << BITS) - 1)  # of the greatest extent
    turned = [  # triangles may come in another order, and begin with another corner
        np.abs(np.roll(got, k, axis=1)[:, None] - wanted[None]) <= 0.501 * step for k in range(3)
    ]
    met = np.any([t.all(axis=(2, 3)) for t in turned], axis=0)
    assert met.shape == (len(triangles),) * 2
    assert (met.sum(axis=0) == 1).all()
    assert (met.sum(axis=1) == 1).all()


@needs_decoder
def test_draco_assets_are_those_without_it() -> None:
    folder = assets() / "scenes"
    plain, coded = ispm.load(folder / "CesiumMan.glb"), ispm.load(folder / "variants/CesiumMan-Draco.glb")
    assert coded.triangle_count == plain.triangle_count == 4672
    assert np.abs(coded.bounds - plain.bounds).max() < 1e-3


@needs_decoder
@pytest.mark.parametrize(
    ("changes", "said"),
    [({"vertices": 35}, r"36 x 3 numbers are not the 35 VEC3"),
     ({"corners": 3}, "150 x 1 numbers are not the 3"),
     ({"kinds": {"POSITION": "VEC3", "TEXCOORD_0": "VEC3"}}, "36 x 2 numbers are not the 36 VEC3"),
     ({"numbers": {"POSITION": 77}}, "it has no attribute 77"), ({"mode": 5}, "strips"),
     ({"stream": b"DRACO"}, "cannot be decoded"), ({"stream": b"\0" * 99}, "cannot be decoded")],
)  # fmt: skip
def test_what_is_wrong_with_a_stream_is_one_line(tmp_path: Path, changes: dict[str, Any], said: str) -> None:
    with pytest.raises(SceneError, match=f"mesh 0: .*{said}"):
        of_patch(**changes).load(tmp_path)


@needs_decoder
def test_points_are_no_mesh(tmp_path: Path) -> None:
    import DracoPy

    with pytest.raises(SceneError, match="it holds points, not triangles"):
        of_patch(stream=DracoPy.encode(QUAD)).load(tmp_path)


@needs_decoder
def test_sizes_count_before_anything_is_decoded(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"mesh 0: there is no memory left .* max_memory"):
        of_patch(vertices=100_000_000).load(tmp_path)
    with pytest.raises(SceneError, match="max_elements"):
        of_patch(corners=1_000_000_000).load(tmp_path)


@needs_decoder
def test_damaged_streams_end_in_an_error_or_arrays() -> None:
    import DracoPy

    positions, uv, triangles = patch()
    rng, refused = np.random.default_rng(5), 0
    decoder = apart.Apart(Budget(LoadLimits()))
    for attempt in range(400):
        level = (0, 1, 5, 10)[attempt % 4]
        stream = bytearray(DracoPy.encode(positions, triangles, compression_level=level, tex_coord=uv))
        for _ in range(1 + attempt % 3):
            stream[rng.integers(11, len(stream))] = rng.integers(256)
        if attempt % 3 == 0:
            del stream[rng.integers(len(stream)) :]
        try:
            assert "faces" in decoder.decode("draco", bytes(stream))
        except SceneError as error:
            refused += 1
            assert "\n" not in str(error)
    decoder.close()
    assert refused >= 130  # those that are cut


def beside_plain() -> GltfBuilder:
    """A quad with plain data and a stream that ends within."""
    builder = GltfBuilder(extensionsUsed=[NAME])
    extension = {NAME: {"bufferView": builder.view(b"DRACO"), "attributes": {"POSITION": 0}}}
    builder.node(mesh=builder.mesh(QUAD_INDICES, more={"extensions": extension}, POSITION=QUAD))
    return builder


def test_without_the_decoder_plain_data_are_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(apart.MODULES, "draco", "no_such_module")
    scene = beside_plain().load(tmp_path)
    assert scene.triangle_count == 2
    assert scene.warnings == [
        "meshes compressed by Draco are read from plain data; for the others: pip install 'ispm[gltf]'"
    ]
    assert scene.extensions_honoured == []


def test_without_the_decoder_one_line_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(apart.MODULES, "draco", "no_such_module")
    builder = packed(b"DRACO", {"POSITION": 0}, {"POSITION": "VEC3"}, 4, 6)
    said = rf"it uses {NAME}, whose decoder is not installed: pip install 'ispm\[gltf\]'$"
    with pytest.raises(SceneError, match=said):
        builder.load(tmp_path)
    del builder.json["extensionsRequired"]
    with pytest.raises(SceneError, match=f"mesh 0: {said}"):
        builder.load(tmp_path)
