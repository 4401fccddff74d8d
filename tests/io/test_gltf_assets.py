"""Every asset loads, with the triangles and places that others find in it."""

import json
import time
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from assets import assets

from ispm.errors import SceneError
from ispm.io import apart
from ispm.io.load import load
from ispm.scene.light import PointLight, SpotLight
from ispm.scene.scene import Scene

REFUSED = {
    "Compatibility_04.gltf": "version 2.1",
    "Compatibility_05.gltf": "FAKE_materials_quantumRendering",
}
DECODED = {
    "Box-Draco.glb": "draco",
    "CesiumMan-Draco.glb": "draco",
    "MorphPrimitivesTest-Draco.glb": "draco",
    "BoxTextured-KTX2-ETC1S.glb": "ktx2",
    "BoxTextured-KTX2-UASTC.glb": "ktx2",
}
REFUSED |= {name: "is not installed" for name, kind in DECODED.items() if not apart.has(kind)}
OTHER_COUNT = {
    "MultipleScenes.gltf": 2,  # of the default scene; the manifest counts all scenes
    "SimpleInstancing.glb": 12 * 125,  # the manifest does not count the copies of EXT_mesh_gpu_instancing
}
PLACED = [
    "BoxAnimated.glb", "BoxInterleaved.glb", "Cameras.gltf", "living_room_godot.glb",
    "NegativeScaleTest.glb", "OrientationTest.glb", "TransmissionTest.glb",
    "LightsPunctualLamp.glb", "variants/AnimatedMorphCube-Quantized.glb",
]  # fmt: skip


def test_assets_have_the_triangles_of_the_manifest() -> None:
    folder = assets()
    entries = json.loads((folder / "manifest.json").read_text())
    counts, refusals = {}, {}
    for entry in entries:
        path = folder / entry["file"]
        try:
            counts[path.name] = load(path).triangle_count
        except SceneError as error:
            refusals[path.name] = str(error)
    expected = {Path(e["file"]).name: e["triangles"] for e in entries} | OTHER_COUNT
    assert counts == {name: count for name, count in expected.items() if name not in REFUSED}
    assert set(refusals) == set(REFUSED)
    assert all(REFUSED[name] in message for name, message in refusals.items())


def test_assets_have_the_features_of_the_manifest() -> None:
    folder = assets()
    for entry in json.loads((folder / "manifest.json").read_text()):
        path = folder / entry["file"]
        if path.suffix in (".gltf", ".glb") and path.name not in REFUSED:  # those of OBJ are not in the list
            scene = load(path)
            assert len(scene.cameras) == entry["cameras"], path
            assert sum(m.emissive for m in scene.materials) == entry["emissive_materials"], path
            assert len(scene.lights) == int(entry["lights"].rstrip("psd")), path
            assert all(np.isfinite(world).all() for _, world in scene.placed()), path


def corners(scene: Scene) -> np.ndarray:
    """(3 T, 3) corners of all triangles in world space."""
    found = [
        (part.mesh.positions[part.mesh.triangles] @ world[:3, :3].T + world[:3, 3]).reshape(-1, 3)
        for node, world in scene.placed()
        for part in node.parts
    ]
    return np.concatenate(found)


@pytest.mark.parametrize("name", PLACED)
def test_triangles_are_where_trimesh_has_them(name: str) -> None:
    """Corners sorted by each coordinate, as their order is free; 1e-5 for the float32 of either side."""
    trimesh = pytest.importorskip("trimesh")
    path = assets() / "scenes" / name
    theirs = trimesh.load_scene(path, process=False).to_mesh().triangles.reshape(-1, 3)
    ours = corners(load(path))
    size = np.ptp(theirs, axis=0).max()
    assert len(ours) == len(theirs)
    np.testing.assert_allclose(np.sort(ours, axis=0), np.sort(theirs, axis=0), atol=1e-5 * size)


def test_level_loads_within_a_second() -> None:
    path = assets() / "scenes" / "level_zdm2_lit.glb"
    start = time.perf_counter()
    scene = load(path)
    assert time.perf_counter() - start < 1.0
    assert scene.triangle_count == 70754
    assert Counter(type(node.light) for node in scene.lights) == {PointLight: 13, SpotLight: 3}
    assert len(scene.materials) == 84
    assert scene.warnings == []


def test_instances_share_their_mesh() -> None:
    scene = load(assets() / "scenes" / "MetalRoughSpheresNoTextures.glb")
    shown = Counter(id(part.mesh) for node in scene.nodes for part in node.parts)
    assert max(shown.values()) > 50
