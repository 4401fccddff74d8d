"""Malformed files end as a scene with warnings or as one line of SceneError, never otherwise."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from assets import assets
from gltf_builder import QUAD, QUAD_INDICES, GltfBuilder, quad

from ispm.errors import SceneError
from ispm.io.load import load

SECONDS = 10.0
PEAK_KIB = 1 << 20  # 1 GiB
LOAD_ALL = """
import json, resource, sys, time
from pathlib import Path
import numpy.ma
import PIL.Image
from ispm.errors import SceneError
from ispm.io.load import load
from ispm.io.weld import weld

PIL.Image.init()  # its modules are files, too, like those that numpy imports when it needs them
weld(numpy.zeros((3, 3), numpy.float32))  # and the kernel of this

def peak_kib():
    # Linux hands the peak of the process that starts another on in ru_maxrss; VmHWM is of this program.
    status = Path("/proc/self/status")
    if status.exists():
        lines = status.read_text().splitlines()
        return next(int(line.split()[1]) for line in lines if line.startswith("VmHWM:"))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak // (1024 if sys.platform == "darwin" else 1)

touched = []
def watch(event, args):
    if event == "open" or event.startswith(("socket.", "subprocess.", "os.exec")):
        touched.append([event, str(args[0]) if event == "open" else repr(args)])
sys.addaudithook(watch)

folder, ends = Path(sys.argv[1]), {}
for name in sys.argv[2:]:
    start = time.process_time()  # a busy machine is no fault of the loader
    try:
        scene = load(folder / name)
        end = "warn" if scene.warnings else "ok", scene.warnings
    except SceneError as error:
        end = "error", [str(error)]
    except BaseException as error:
        end = type(error).__name__, [str(error)]
    ends[name] = *end, time.process_time() - start
seen = list(touched)  # before /proc is read
print(json.dumps({"ends": ends, "peak_kib": peak_kib(), "touched": seen}))
"""


def negative_cases() -> dict[str, dict[str, Any]]:
    cases = json.loads((assets() / "negative" / "cases.json").read_text())
    return {case["file"]: case for case in cases}


@pytest.fixture(scope="module")
def outcome() -> Any:
    """How each case ended, in one process of its own."""
    folder = assets() / "negative"
    command = [sys.executable, "-c", LOAD_ALL, str(folder), *negative_cases()]
    return json.loads(subprocess.run(command, check=True, capture_output=True, text=True, timeout=120).stdout)


def test_negative_files_end_as_listed(outcome: Any) -> None:
    wrong = {
        name: outcome["ends"][name]
        for name, case in negative_cases().items()
        if outcome["ends"][name][0] not in case.get("accept", [case["expect"]])
    }
    assert not wrong


def test_negative_files_are_told_in_one_line_that_names_them(outcome: Any) -> None:
    for name, (end, lines, _) in outcome["ends"].items():
        assert all("\n" not in line for line in lines)
        assert end != "error" or lines[0].startswith(f"{name}: ")


def test_negative_files_take_little_time_and_memory(outcome: Any) -> None:
    assert max(seconds for _, _, seconds in outcome["ends"].values()) < SECONDS
    assert outcome["peak_kib"] < PEAK_KIB


def test_negative_files_lead_to_no_file_outside_their_folder(outcome: Any) -> None:
    folder = (assets() / "negative").resolve()
    strays = [
        t for t in outcome["touched"] if t[0] != "open" or not Path(t[1]).resolve().is_relative_to(folder)
    ]
    assert not strays


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (b"", "empty"),
        (b"hello", "neither GLB nor glTF"),
        (b'{"asset": {"version": "2.0"}', "JSON"),
        (b'{"asset": {}}', "version"),
        (b'{"asset": {"version": "1.0"}}', "version 1.0"),
        (b'{"asset": {"version": "2.1", "minVersion": "2.1"}}', "version 2.1"),
        (b'{"asset": {"version": "2.0"}, "extras": ' + b"[" * 100_000 + b"]" * 100_000 + b"}", "nested"),
        (b'{"asset": {"version": "2.0"}, "extras": NaN}', "JSON"),
        (b'{"asset": {"version": "2.0"}, "nodes": [{"translation": [1e400, 0, 0]}]}', "out of range"),
        (b'{"asset": {"version": "2.0"}, "nodes": [{"translation": [0, 0]}]}', "translation"),
        (b'{"asset": {"version": "2.0"}, "nodes": [{"name": "\xff"}]}', "UTF-8"),
        ('{"asset": {"version": "2.0"}}'.encode("utf-16"), "UTF-8"),
        (b"glTF", "header"),
    ],
)
def test_broken_text_is_refused(tmp_path: Path, text: bytes, reason: str) -> None:
    path = tmp_path / "broken.gltf"
    path.write_bytes(text)
    with pytest.raises(SceneError, match=rf"^broken\.gltf: .*{reason}"):
        load(path)


def test_every_cut_of_a_glb_is_refused(tmp_path: Path) -> None:
    whole = quad().save_glb(tmp_path / "whole.glb").read_bytes()
    path = tmp_path / "cut.glb"
    for length in range(0, len(whole), 7):
        path.write_bytes(whole[:length])
        with pytest.raises(SceneError, match=r"^cut\.glb: "):
            load(path)


@pytest.mark.parametrize(
    "uri",
    ["../secret.bin", "%2e%2e/secret.bin", "/etc/passwd", "file:///etc/passwd", "http://127.0.0.1:9/a.bin",
     "HTTPS://example.org/a.bin", "C:/secret.bin", "//host/share/a.bin", "link.bin", "a\0.bin", "", "."],
)  # fmt: skip
def test_buffers_outside_the_folder_are_refused(tmp_path: Path, uri: str) -> None:
    (tmp_path / "secret.bin").write_bytes(bytes(1000))
    inside = tmp_path / "inside"
    inside.mkdir()
    (inside / "link.bin").symlink_to(tmp_path / "secret.bin")
    builder = quad(buffers=[{"byteLength": 140, "uri": uri}])
    with pytest.raises(SceneError, match=r"^scene\.gltf: "):
        builder.load(inside)


def test_buffers_inside_the_folder_are_read(tmp_path: Path) -> None:
    builder = quad()
    (tmp_path / "sub folder").mkdir()
    (tmp_path / "sub folder" / "a.bin").write_bytes(builder.data)
    builder.json["buffers"] = [{"byteLength": len(builder.data), "uri": "sub%20folder/a.bin"}]
    assert builder.load(tmp_path).triangle_count == 2


@pytest.mark.parametrize(
    ("kind", "change", "reason"),
    [
        ("accessors", {"count": 10**12}, "elements"),
        ("accessors", {"count": 10**7}, "ends at byte"),
        ("accessors", {"byteOffset": 2**63}, "ends at byte"),
        ("accessors", {"bufferView": 99}, "buffer view 99"),
        ("accessors", {"type": "MAT4"}, "matrices"),
        ("accessors", {"type": "VEC2"}, "POSITION is not a VEC3"),
        ("accessors", {"bufferView": None, "count": 10**8}, "."),
        ("bufferViews", {"byteLength": 10**15}, "ends at byte"),
        ("bufferViews", {"byteStride": 4}, "stride"),
        ("bufferViews", {"buffer": 3}, "buffer 3"),
        ("nodes", {"mesh": 7}, "mesh 7"),
        ("nodes", {"camera": 7}, "camera 7"),
        ("nodes", {"children": [0]}, "own child"),
        ("nodes", {"children": [5]}, "child 5"),
    ],
)
def test_wrong_numbers_are_refused(tmp_path: Path, kind: str, change: dict[str, Any], reason: str) -> None:
    builder = quad()
    builder.json[kind][0] = {k: v for k, v in (builder.json[kind][0] | change).items() if v is not None}
    with pytest.raises(SceneError, match=rf"^scene\.gltf: .*{reason}"):
        builder.load(tmp_path)


def test_elements_without_bytes_are_bounded(tmp_path: Path) -> None:
    builder = GltfBuilder()
    zeros = builder.put("accessors", {"componentType": 5126, "count": 10**8, "type": "VEC3"})
    mesh = builder.put("meshes", {"primitives": [{"attributes": {"POSITION": zeros}}]})
    builder.node(mesh=mesh)
    with pytest.raises(SceneError, match="no buffer view"):
        builder.load(tmp_path)


@pytest.mark.parametrize(
    ("limits", "reason"),
    [
        ({"max_triangles": 3}, "max_triangles=3"),
        ({"max_nodes": 1}, "max_nodes=1"),
        ({"max_elements": 3}, "max_elements=3"),
        ({"max_file_bytes": 100}, "max_file_bytes=100"),
    ],
)
def test_limits_are_held(tmp_path: Path, limits: dict[str, int], reason: str) -> None:
    builder = quad()
    builder.node(mesh=0)
    assert builder.load(tmp_path).triangle_count == 4  # within the defaults
    with pytest.raises(SceneError, match=reason):
        builder.load(tmp_path, **limits)


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -float("inf"), 3e38])
def test_vertices_that_are_not_finite_take_their_triangles_with_them(tmp_path: Path, value: float) -> None:
    positions = QUAD.copy()
    positions[1, 2] = value  # used by the first triangle only
    builder = GltfBuilder()
    builder.node(mesh=builder.mesh(QUAD_INDICES, POSITION=positions))
    scene = builder.load(tmp_path)
    mesh = scene.nodes[0].parts[0].mesh
    assert scene.triangle_count == 1
    assert (mesh.positions[mesh.triangles] == QUAD[[[0, 3, 2]]]).all()
    assert len(mesh.positions) == 3
    assert "not finite" in scene.warnings[0]


def furnished() -> GltfBuilder:
    """A scene with a bit of everything."""
    builder = quad({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}})
    builder.picture(np.arange(48, dtype=np.uint8).reshape(4, 4, 3))
    builder.put("cameras", {"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1}})
    builder.json["extensions"] = {"KHR_lights_punctual": {"lights": [{"type": "point", "range": 9}]}}
    builder.node(camera=0, children=[0], extensions={"KHR_lights_punctual": {"light": 0}})
    keys = {"input": builder.accessor(np.arange(4, dtype=np.float32)), "output": builder.accessor(QUAD)}
    channel = {"sampler": 0, "target": {"node": 0, "path": "translation"}}
    builder.put("animations", {"channels": [channel], "samplers": [keys]})
    return builder


def test_random_damage_never_ends_otherwise(tmp_path: Path) -> None:
    """1000 copies of a file, each with 1 to 8 bytes overwritten; seed 1."""
    whole = np.frombuffer(furnished().save_glb(tmp_path / "whole.glb").read_bytes(), np.uint8)
    assert not load(tmp_path / "whole.glb").warnings
    random, path, refused = np.random.default_rng(1), tmp_path / "damaged.glb", 0
    for _ in range(1000):
        damaged = whole.copy()
        damaged[random.integers(0, len(whole), random.integers(1, 9))] = random.integers(0, 256)
        path.write_bytes(damaged.tobytes())
        try:
            meshes = [part.mesh for node in load(path).nodes for part in node.parts]
        except SceneError:
            refused += 1
        else:
            assert all(np.isfinite(mesh.positions).all() for mesh in meshes)
    assert 0 < refused < 1000


def test_names_cannot_break_a_line(tmp_path: Path) -> None:
    builder = quad({"name": "a\nb\x1b[31m", "alphaMode": "FOO"})
    (message,) = builder.load(tmp_path).warnings
    assert message.isprintable()
    assert "FOO" in message
