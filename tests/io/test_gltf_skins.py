"""Skins and morph targets of glTF files, against numbers that are read and evaluated here once more."""

import base64
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from alike import assert_alike
from assets import assets
from gltf_builder import QUAD, GltfBuilder

import ispm
from ispm.errors import SceneError
from ispm.scene.packed import pack, to_world
from ispm.scene.scene import Scene

KINDS = {5120: "i1", 5121: "u1", 5122: "i2", 5123: "u2", 5125: "u4", 5126: "f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
SKINNED = [
    "scenes/SimpleSkin.gltf", "scenes/CesiumMan.glb", "scenes/RiggedSimple.glb",
    "scenes/variants/CesiumMan-Quantized.glb",
    *(f"generator/Animation_Skin/Animation_Skin_0{k}.gltf" for k in (0, 2, 4, 6)),
    *(f"generator/Animation_SkinType/Animation_SkinType_0{k}.gltf" for k in (0, 2)),
]  # fmt: skip
MORPHED = ["SimpleMorph.gltf", "AnimatedMorphCube.glb", "variants/AnimatedMorphCube-Quantized.glb"]


class Raw:
    """A glTF file's JSON, and its accessors as float64, read in a few lines."""

    def __init__(self, path: Path) -> None:
        data = path.read_bytes()
        if data[:4] == b"glTF":
            (length,) = struct.unpack_from("<I", data, 12)
            self.json, self.buffers = json.loads(data[20 : 20 + length]), [data[28 + length :]]
        else:
            self.json = json.loads(data)
            uris = [buffer["uri"] for buffer in self.json["buffers"]]
            self.buffers = [
                base64.b64decode(uri.split(",")[1])
                if uri.startswith("data:")
                else (path.parent / uri).read_bytes()
                for uri in uris
            ]

    def array(self, index: int) -> np.ndarray:
        accessor = self.json["accessors"][index]
        view = self.json["bufferViews"][accessor["bufferView"]]
        kind, width = np.dtype(KINDS[accessor["componentType"]]), WIDTHS[accessor["type"]]
        first = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        stride = view.get("byteStride", kind.itemsize * width)
        shape, strides = (accessor["count"], width), (stride, kind.itemsize)
        values = np.ndarray(shape, kind, self.buffers[view["buffer"]], first, strides).astype(np.float64)
        return values / np.iinfo(kind).max if accessor.get("normalized") else values

    def world(self, index: int, scene: Scene) -> np.ndarray:
        """(4, 4) of a node where it stands in a scene, by the product of its ancestors' own matrices."""
        nodes = self.json["nodes"]
        parent = next((k for k, node in enumerate(nodes) if index in node.get("children", [])), None)
        above = np.eye(4) if parent is None else self.world(parent, scene)
        return above @ self.local(index, scene)

    def local(self, index: int, scene: Scene) -> np.ndarray:
        return {id(n): m for n, m in zip(scene.nodes, (n.local_matrix() for n in scene.nodes), strict=True)}[
            id(self.order(scene)[index])
        ]

    def order(self, scene: Scene) -> dict[int, Any]:
        """The nodes of a loaded scene by their numbers in the file: both are walked in the same order."""
        numbers: list[int] = []
        stack = list(reversed(self.json["scenes"][self.json.get("scene", 0)]["nodes"]))
        while stack:
            numbers.append(stack.pop())
            stack += reversed(self.json["nodes"][numbers[-1]].get("children", []))
        return dict(zip(numbers, scene.nodes, strict=True))


def world_corners(scene: Scene) -> np.ndarray:
    """(3 T, 3) corners as they are packed, in world space, sorted by where their nodes are."""
    packed = pack(scene)
    found = []
    for number in np.argsort(packed.ids):
        row = packed.instances[number]
        matrix = to_world(row).astype(np.float64)
        corners = packed.geometry.indices[row["first_index"] :][: 3 * row["triangle_count"]]
        found.append(packed.geometry.vertices["position"][corners] @ matrix[:, :3].T + matrix[:, 3])
    return np.concatenate(found)


def expected_corners(raw: Raw, scene: Scene) -> np.ndarray:
    """The same by glTF's formula, vertex by vertex, in float64."""
    found = []
    order = raw.order(scene)
    for number in order:
        record = raw.json["nodes"][number]
        if "mesh" not in record:
            continue
        skin = raw.json["skins"][record["skin"]]
        count = len(skin["joints"])
        bind = np.tile(np.eye(4), (count, 1, 1))
        if "inverseBindMatrices" in skin:
            bind = raw.array(skin["inverseBindMatrices"]).reshape(-1, 4, 4).transpose(0, 2, 1)
        joints = [raw.world(joint, scene) @ own for joint, own in zip(skin["joints"], bind, strict=True)]
        for primitive in raw.json["meshes"][record["mesh"]]["primitives"]:
            points, which, weights = (
                raw.array(primitive["attributes"][name]) for name in ("POSITION", "JOINTS_0", "WEIGHTS_0")
            )
            placed = np.zeros_like(points)
            for v, point in enumerate(points):
                for joint, weight in zip(which[v].astype(int), weights[v] / weights[v].sum(), strict=True):
                    placed[v] += weight * (joints[joint] @ [*point, 1.0])[:3]
            found.append(placed[raw.array(primitive["indices"])[:, 0].astype(int)])
    return np.concatenate(found)


@pytest.mark.parametrize("name", SKINNED)
def test_every_skin_among_the_assets_bends_as_the_formula_says(name: str) -> None:
    path = assets() / name
    scene, raw = ispm.load(path), Raw(path)
    assert not [line for line in scene.warnings if "extension" not in line]
    times = (0.0, 0.37, 1.3) if scene.animations else (0.0,)
    for time in times:
        moment = scene.at(time)
        corners = expected_corners(raw, moment)
        # float32 of positions, and of the instances' matrices: a few 2^-24 of the size each
        np.testing.assert_allclose(world_corners(moment), corners, atol=1e-6 * np.abs(corners).max())
        np.testing.assert_allclose(moment.bounds, [corners.min(axis=0), corners.max(axis=0)], atol=1e-5)


@pytest.mark.parametrize("name", MORPHED)
def test_every_morph_among_the_assets_adds_as_the_formula_says(name: str) -> None:
    path = assets() / "scenes" / name
    scene, raw = ispm.load(path), Raw(path)
    assert not [line for line in scene.warnings if "extension" not in line]
    ((number, node),) = [(k, node) for k, node in raw.order(scene).items() if node.parts]
    ((primitive),) = raw.json["meshes"][raw.json["nodes"][number]["mesh"]]["primitives"]
    (channel,) = raw.json["animations"][0]["channels"]
    sampler = raw.json["animations"][0]["samplers"][channel["sampler"]]
    times, keys = raw.array(sampler["input"])[:, 0], raw.array(sampler["output"])
    keys = keys.reshape(len(times), len(primitive["targets"]))
    for time in (0.0, 0.4, 1.1, 2.6):
        weights = [np.interp(time, times, column) for column in keys.T]  # both are linear
        points = raw.array(primitive["attributes"]["POSITION"])
        for weight, target in zip(weights, primitive["targets"], strict=True):
            points = points + weight * raw.array(target["POSITION"])
        moment = scene.at(time)
        place = raw.world(number, moment)
        corners = points[raw.array(primitive["indices"])[:, 0].astype(int)] @ place[:3, :3].T + place[:3, 3]
        np.testing.assert_allclose(world_corners(moment), corners, atol=1e-6 * np.abs(corners).max())
    assert node.weights is not None


@pytest.mark.parametrize("name", [*SKINNED, *(f"scenes/{name}" for name in MORPHED)])
@pytest.mark.parametrize("ending", ["glb", "gltf"])
def test_what_deforms_is_saved_and_loads_back_equal(name: str, ending: str, tmp_path: Path) -> None:
    scene = ispm.load(assets() / name)
    back = ispm.load(ispm.save(scene, tmp_path / f"room.{ending}"))
    back.name = scene.name
    assert_alike(scene, back)


JOINTS = np.array([[0, 1, 0, 0]] * 4, np.uint8)
WEIGHTS = np.array([[1, 0, 0, 0], [1, 3, 0, 0], [0.5, 0.5, 0, 0], [0, 1, 0, 0]], np.float32)


def quad_skin(joints: np.ndarray = JOINTS, weights: np.ndarray = WEIGHTS, **more: np.ndarray) -> GltfBuilder:
    """A quad that follows two joints, the second 1 m higher; QUAD lies at y = 0."""
    builder = GltfBuilder()
    mesh = builder.mesh(POSITION=QUAD, JOINTS_0=joints, WEIGHTS_0=weights, **more)
    builder.node(mesh=mesh, skin=0)
    builder.node(name="low", children=[2])
    builder.node(name="high", translation=[0, 1, 0])
    builder.put("skins", {"joints": [1, 2]})
    return builder


def heights(scene: Scene) -> list[float]:
    """Where the four corners of the quad are."""
    mesh = pack(scene).geometry.ranges[0].mesh
    return mesh.positions[:, 1].tolist()


def test_weights_of_all_kinds_count_by_their_sum(tmp_path: Path) -> None:
    expected = [0.0, 0.75, 0.5, 1.0]
    assert heights(quad_skin().load(tmp_path)) == expected
    for kind in (np.uint8, np.uint16):
        weights = (WEIGHTS * 40).astype(kind)  # sums of 40 and 160: less than 1
        builder = quad_skin(JOINTS.astype(np.uint16), weights)
        builder.json["accessors"][2]["normalized"] = True
        scene = builder.load(tmp_path)
        assert scene.warnings == []
        np.testing.assert_allclose(heights(scene), expected, atol=1e-7)


def test_a_second_set_of_joints_counts(tmp_path: Path) -> None:
    second = quad_skin(JOINTS_1=np.ones((4, 4), np.uint8), WEIGHTS_1=np.eye(4, dtype=np.float32) * 2)
    np.testing.assert_allclose(heights(second.load(tmp_path)), [2 / 3, 5 / 6, 2.5 / 3, 1.0], rtol=1e-6)


def test_morph_targets_may_be_sparse_and_named(tmp_path: Path) -> None:
    builder = GltfBuilder()
    indices, values = (
        builder.view(np.array([2], np.uint8).tobytes()),
        builder.view(np.float32([0, 3, 0]).tobytes()),
    )
    sparse = {
        "count": 1,
        "indices": {"bufferView": indices, "componentType": 5121},
        "values": {"bufferView": values},
    }
    record = {"componentType": 5126, "count": 4, "type": "VEC3"}
    target = builder.put("accessors", {**record, "sparse": sparse})
    nothing = builder.put("accessors", record)
    targets = [{"POSITION": target}, {"POSITION": nothing}]
    mesh = builder.mesh(more={"targets": targets}, POSITION=QUAD)
    builder.json["meshes"][mesh] |= {"weights": [0.5, 1.0], "extras": {"targetNames": ["up", "idle"]}}
    builder.node(mesh=mesh, name="by mesh")
    builder.node(mesh=mesh, name="by node", weights=[2, 0])
    scene = builder.load(tmp_path)
    assert scene.warnings == []
    assert [morph.name for morph in scene["by mesh"].parts[0].mesh.morphs] == ["up", "idle"]
    assert scene["by mesh"].parts[0].mesh is scene["by node"].parts[0].mesh
    found = [r.mesh.positions[:, 1].tolist() for r in pack(scene).geometry.ranges]
    assert found == [[0, 0, 1.5, 0], [0, 0, 6, 0]]
    back = ispm.load(ispm.save(scene, tmp_path / "again.glb"))
    assert [r.mesh.positions[:, 1].tolist() for r in pack(back).geometry.ranges] == found


@pytest.mark.parametrize("how", ["LINEAR", "STEP", "CUBICSPLINE"])
def test_channels_move_weights_by_all_interpolations(how: str, tmp_path: Path) -> None:
    builder = GltfBuilder()
    lift = builder.accessor(np.tile(np.float32([0, 1, 0]), (4, 1)))
    builder.node(mesh=builder.mesh(more={"targets": [{"POSITION": lift}] * 2}, POSITION=QUAD))
    times = np.array([0.0, 2.0], np.float32)
    keys = np.array([[0.0, 1.0], [1.0, 5.0]], np.float32)
    if how == "CUBICSPLINE":  # of 0, 0: by s^2 (3 - 2 s)
        keys = np.stack([0 * keys, keys, 0 * keys], axis=1)
    sampler = {"input": builder.accessor(times), "output": builder.accessor(keys.reshape(-1))}
    channel = {"sampler": 0, "target": {"node": 0, "path": "weights"}}
    builder.put("animations", {"channels": [channel], "samplers": [sampler | {"interpolation": how}]})
    scene = builder.load(tmp_path)
    assert scene.warnings == []
    share = {"LINEAR": 0.25, "STEP": 0.0, "CUBICSPLINE": 0.25**2 * 2.5}[how]
    np.testing.assert_allclose(heights(scene.at(0.5)), 1.0 + 5.0 * share, rtol=1e-6)
    np.testing.assert_allclose(heights(scene.at(7.0)), 6.0)
    back = ispm.load(ispm.save(scene, tmp_path / "again.glb"))
    np.testing.assert_allclose(heights(back.at(0.5)), 1.0 + 5.0 * share, rtol=1e-6)


def _nan(builder: GltfBuilder) -> None:
    builder.json["skins"][0]["inverseBindMatrices"] = builder.accessor(np.full((2, 16), np.nan, np.float32))


def _short(builder: GltfBuilder) -> None:
    builder.json["skins"][0]["inverseBindMatrices"] = builder.accessor(
        np.eye(4, dtype=np.float32).reshape(1, 16)
    )


def _elsewhere(builder: GltfBuilder) -> None:
    builder.json["scenes"] = [{"nodes": [0]}]


@pytest.mark.parametrize(
    ("spoil", "line"),
    [
        (lambda b: b.json["skins"][0]["joints"].append(55), "joint 55 does not exist; the file has 3 nodes"),
        (lambda b: b.json["skins"].clear(), "skin 0 does not exist"),
        (lambda b: b.json["skins"][0].update(joints=[]), "skin 0 has no joints"),
        (lambda b: b.json["skins"][0].update(joints=[1]), "is drawn as bound: a vertex follows joint 1 of 1"),
        (lambda b: b.json["skins"][0].update(inverseBindMatrices=0), "are not of type MAT4"),
        (_nan, "inverse bind matrices are not finite"),
        (_short, "it has 1 of the 2 inverse bind matrices"),
        (_elsewhere, "is not in the scene"),
        (lambda b: b.json["meshes"][0]["primitives"][0]["attributes"].pop("WEIGHTS_0"), "without WEIGHTS_0"),
        (lambda b: b.json["meshes"][0]["primitives"][0]["attributes"].update(JOINTS_0=2), "8 or 16 bits"),
        (lambda b: b.json["accessors"][2].update(count=3), "length of WEIGHTS_0 is not that of POSITION"),
        (lambda b: b.json["accessors"][1].update(type="VEC2"), "JOINTS_0 is not a VEC4"),
    ],
)  # fmt: skip
def test_what_follows_no_joints_is_drawn_as_bound(spoil: Any, line: str, tmp_path: Path) -> None:
    builder = quad_skin()
    spoil(builder)
    scene = builder.load(tmp_path)
    assert any(line in each for each in scene.warnings), scene.warnings
    assert not [each for each in scene.warnings if "\n" in each]
    assert heights(scene) == [0, 0, 0, 0]


def test_weights_that_cannot_be_used_count_as_0(tmp_path: Path) -> None:
    weights = np.array([[np.nan, 1, 0, 0], [-5, 1, 0, 0], [0, 0, 0, 0], [np.inf, 0, 0, 0]], np.float32)
    scene = quad_skin(weights=weights).load(tmp_path)
    assert any("negative or not finite" in line for line in scene.warnings)
    assert any("all 0 follow their first joint: 2" in line for line in scene.warnings)
    assert heights(scene) == [1, 1, 0, 0]


def test_morph_targets_with_faults_are_told(tmp_path: Path) -> None:
    builder = GltfBuilder()
    wild = builder.accessor(np.full((4, 3), np.nan, np.float32))
    short, flat = builder.accessor(np.ones((3, 3), np.float32)), builder.accessor(np.ones((4, 2), np.float32))
    targets = [{"POSITION": wild}, {"POSITION": short}, {"POSITION": flat}]
    mesh = builder.mesh(more={"targets": targets}, POSITION=QUAD)
    builder.node(mesh=mesh, weights=[1, 1, 1, 1])
    scene = builder.load(tmp_path)
    for line in (
        "0: values that are not finite",
        "1 is left out: its length",
        "2 is left out: it is not a VEC3",
    ):
        assert any(line in each for each in scene.warnings), line
    assert any("4 weights for 3 morph targets" in line for line in scene.warnings)
    assert heights(scene) == [0, 0, 0, 0]


def test_channels_of_weights_that_do_not_fit_are_told(tmp_path: Path) -> None:
    builder = GltfBuilder()
    lift = builder.accessor(np.ones((4, 3), np.float32))
    builder.node(mesh=builder.mesh(more={"targets": [{"POSITION": lift}]}, POSITION=QUAD))
    builder.node(mesh=builder.mesh(POSITION=QUAD))
    times, values = builder.accessor(np.float32([0, 1])), builder.accessor(np.float32([0, 1, 2]))
    channels = [{"sampler": 0, "target": {"node": k, "path": "weights"}} for k in range(2)]
    builder.put("animations", {"channels": channels, "samplers": [{"input": times, "output": values}]})
    scene = builder.load(tmp_path)
    assert any("2 times and 3 values for 1 morph targets" in line for line in scene.warnings)
    assert any("has no morph targets whose weights" in line for line in scene.warnings)
    assert scene.animations == []


def test_shapes_count_against_the_limits(tmp_path: Path) -> None:
    """Nodes that each bend a mesh of their own take more than those that share one as it is."""
    builder = quad_skin()
    for _ in range(2000):
        builder.node(mesh=0, skin=0)
    memory = 4_000_000
    with pytest.raises(SceneError, match="max_memory"):
        builder.load(tmp_path, max_memory=memory - 1_500_000)
    for node in builder.json["nodes"]:
        node.pop("skin", None)
    builder.load(tmp_path, max_memory=memory - 1_500_000)
