"""Files of passes: whose they are, and what is done with those that are spoiled."""

import contextlib
import io
import json
import re
import tracemalloc
import zipfile

import numpy as np
import pytest

from ispm import __version__
from ispm.cli.main import main
from ispm.errors import IspmError, OutputError, SettingsError
from ispm.io.named import builtin
from ispm.renderer import Renderer
from ispm.renderer.progress import Progress
from ispm.scene.camera import Camera
from ispm.settings import Settings

SETTINGS = Settings(size=(16, 9), photons=1000)


@pytest.fixture(scope="module")
def scene():
    return builtin("cornell-box")


def renderer(gpu, scene, camera=None, **changes):
    return Renderer(scene, SETTINGS.replace(**changes), camera, gpu=gpu)


def npy(array):
    out = io.BytesIO()
    np.save(out, array, allow_pickle=True)
    return out.getvalue()


def zipped(parts, method=zipfile.ZIP_STORED):
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", method) as archive:
        for name, data in parts.items():
            archive.writestr(name, data)
    return out.getvalue()


@pytest.fixture(scope="module")
def kept(gpu, scene, tmp_path_factory):
    """The parts of a file of passes."""
    path = tmp_path_factory.mktemp("kept") / "kept.npz"
    with renderer(gpu, scene) as other:
        next(other.converge(2))
        other.save_progress(path)
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def moved(scene):
    scene.lights[0].translation = (0.1, 0.1, 0.1)


def turned(scene):
    scene["room"].translation = (0.0, 0.01, 0.0)


def painted(scene):
    scene["room"].parts[0].material.base_color = (0.1, 0.2, 0.3, 1.0)


def squeezed(scene):
    mesh = scene["room"].parts[0].mesh
    mesh.positions = mesh.positions * np.float32(0.9)


def renamed(scene):
    moved(scene)
    scene.name = "another"


ANOTHER = {
    "seed": (None, {"seed": 1}, "seed 0 (here 1)"),
    "size": (None, {"size": (32, 18)}, "size 16x9 (here 32x18)"),
    "settings": (None, {"photons": 900, "bounces": 2}, "photons 1000 (here 900), bounces 32 (here 2)"),
    "background": (None, {"background": (0.5, 0, 0)}, "background 0,0,0 (here 0.5,0,0)"),
    "preset": (None, {"preset": "fast"}, "gather auto (here 0)"),
    "light": (moved, {}, "other lights"),
    "place": (turned, {}, "other places of nodes"),
    "material": (painted, {}, "other materials"),
    "mesh": (squeezed, {}, "other meshes"),
    "scene": (renamed, {}, "scene 'cornell-box' (here 'another'), other lights"),
    "camera": (None, {"camera": Camera.look_at((0, 0, 1), (0, 0, 0), 0.7)}, "another camera (pose, yfov)"),
}  # fmt: skip


@pytest.mark.parametrize("how", ANOTHER)
@pytest.mark.parametrize("passes", [1, 2])  # at its end already, or not
def test_what_differs_of_passes_of_another_picture_is_said(gpu, kept, tmp_path, how, passes):
    change, settings, said = ANOTHER[how]
    path = tmp_path / "passes.npz"
    path.write_bytes(zipped(kept))
    scene = builtin("cornell-box")
    if change:
        change(scene)
    line = re.escape(f"passes.npz: holds 1 pass of another picture, with {said}; continue with the same, or ")
    with renderer(gpu, scene, **settings) as other, pytest.raises(SettingsError, match=line):
        next(other.converge(passes, resume=path))


def test_passes_go_on_with_what_changes_no_light(gpu, scene, kept, tmp_path):
    path = tmp_path / "kept.npz"
    path.write_bytes(zipped(kept))
    with renderer(gpu, scene, exposure=1.0, tonemap="agx", time_limit=60.0) as other:
        assert next(other.converge(2, resume=path)).stats.passes == 2


def test_there_are_no_passes_before_the_first(gpu, scene, tmp_path):
    with renderer(gpu, scene) as first, pytest.raises(IspmError, match="no passes"):
        first.save_progress(tmp_path / "kept.npz")


def without(name):
    return lambda parts: parts.pop(f"{name}.npy")


def array_with(name, change):
    def spoil(parts):
        parts[f"{name}.npy"] = npy(change(np.load(io.BytesIO(parts[f"{name}.npy"]))))

    return spoil


def about_with(change):
    """What the file says of itself, changed by a function of that, as JSON or text."""

    def spoil(parts):
        about = json.loads(json.loads(str(np.load(io.BytesIO(parts["__about__.npy"]))))["ispm:progress"])
        said = change(about)
        text = said if isinstance(said, str) else json.dumps(about if said is None else said)
        parts["__about__.npy"] = npy(np.array(json.dumps({"ispm:progress": text})))

    return spoil


def saying(where, value):
    """One value of it replaced, `where` by a path of keys; ...: left out."""

    def change(about):
        *path, last = where.split("/")
        for key in path:
            about = about[key]
        if value is ...:
            del about[last]
        else:
            about[last] = value

    return about_with(change)


def header(shape, dtype="<f4", data=b"0" * 100, version=(1, 0)):
    """An array's bytes with a header of its own."""
    out = io.BytesIO()
    write = (
        np.lib.format.write_array_header_1_0 if version == (1, 0) else np.lib.format.write_array_header_2_0
    )
    write(out, {"shape": shape, "fortran_order": False, "descr": dtype})
    return lambda parts: parts.update({"sum.direct.npy": out.getvalue() + data})


def written(name, data):
    return lambda parts: parts.update({name: data})


FLOATS = ("halves", "sum.direct", "sum.indirect", "sum.emission", "sum.irradiance", "sum.alpha",
          "first.depth", "first.normal", "first.albedo", "camera.pose", "camera.clip_from_world",
          "camera.intrinsics")  # fmt: skip
IDS = ("first.instance", "first.material")
OPTIONAL = ("camera.intrinsics",)
FORMS = {
    "narrow": lambda a: a[..., :-1],
    "within another": lambda a: a[None],
    "one number": lambda a: a.dtype.type(0),
    "empty": lambda a: a[:0],
    "transposed": lambda a: np.concatenate([a, a], axis=0),
    "of other bits": lambda a: a.astype(np.float16),
    "swapped": lambda a: a.astype(a.dtype.newbyteorder(">")),
    "complex": lambda a: a.astype(np.complex128),
    "text": lambda a: a.astype("U3"),
    "objects": lambda a: a.astype(object),
    "times": lambda a: a.astype("M8[s]"),
    "records": lambda a: a.astype([("a", "f4")]),
}


def one(value):
    def change(array):
        array.flat[array.size // 2] = value
        return array

    return change


SPOILED = {
    **{f"{n} missing": without(n) for n in ("__about__", *FLOATS, *IDS) if n not in OPTIONAL},
    **{f"{n} {how}": array_with(n, change) for n in (*FLOATS, *IDS) for how, change in FORMS.items()},
    **{f"{n} with nan": array_with(n, one(np.nan)) for n in FLOATS},
    **{f"{n} with -inf": array_with(n, one(-np.inf)) for n in FLOATS},
    **{f"{n} with inf": array_with(n, one(np.inf)) for n in FLOATS if n != "first.depth"},
    **{f"{n} below 0": array_with(n, one(-2)) for n in (
        "halves", "sum.alpha", "first.albedo", *IDS)},
    **{f"a shape of {shape}": header(shape) for shape in (
        (1 << 20, 1 << 20, 3), (1 << 62, 1 << 62, 3), (-9, 16, 3), (9, -16, -3), (0,), (9.5, 16, 3), ("a",))},
    **{f"an array of {dtype!r}": header((9, 16, 3), dtype) for dtype in (
        "", "nothing", "<f99999", "O", "S1000000000", [("a", "<f4")], "<f4,<f4")},
    "a header of version 2": header((9, 16, 3), data=bytes(9 * 16 * 12), version=(2, 0)),
    "bytes behind an array": header((9, 16, 3), data=bytes(9 * 16 * 12 + 1)),
    "bytes missing of an array": header((9, 16, 3), data=bytes(9 * 16 * 12 - 1)),
    "a header alone": written("sum.direct.npy", b"\x93NUMPY"),
    "a header of version 9": written("sum.direct.npy", b"\x93NUMPY\x09\x00" + bytes(200)),
    "a header that computes": written(
        "sum.direct.npy", b"\x93NUMPY\x01\x00\x46\x00" + b"{'descr': __import__('os')}".ljust(70)),
    "a deep header": written("sum.direct.npy", b"\x93NUMPY\x01\x00\xff\xff" + b"(" * 65535),
    "a pickle": written("sum.direct.npy", b"\x80\x04\x95\x00\x00\x00\x00\x00\x00\x00\x00."),
    "no bytes": written("sum.direct.npy", b""),
    "another array": written("sum.other.npy", npy(np.zeros(3))),
    "another camera's array": written("camera.other.npy", npy(np.zeros(3))),
    "a background": written("sum.background.npy", npy(np.zeros((9, 16, 3), np.float32))),
    "a file of another kind": written("readme.txt", b"nothing"),
    "a way out": written("../../etc/passwd", b"nothing"),
    "nothing": lambda parts: parts.clear(),
    **{f"{where} {value if value is not ... else 'missing'}"[:40]: saying(where, value) for where, value in (
        ("version", ...), ("version", "0.0.0"), ("version", 1), ("version", ["a"] * 1000),
        ("passes", ...), ("passes", None), ("passes", 0), ("passes", -1), ("passes", True), ("passes", "2"),
        ("passes", 1.5), ("passes", 10**30), ("passes", float("nan")), ("passes", [1]),
        ("scene", ...), ("scene", 3), ("scene", None), ("scene", {}),
        ("made_of", ...), ("made_of", None), ("made_of", 1), ("made_of", "00ff"), ("made_of", []),
        ("made_of", {}), ("made_of/settings", ...), ("made_of/settings", 3), ("made_of/settings", {}),
        ("made_of/settings/photons", ...), ("made_of/settings/photons", -1),
        ("made_of/settings/photons", "many"), ("made_of/settings/photons", None),
        ("made_of/settings/size", [16]), ("made_of/settings/size", [32, 18]),
        ("made_of/settings/size", [1e9, 1e9]), ("made_of/settings/size", float("nan")),
        ("made_of/settings/background", [1, 0, 0]), ("made_of/settings/kernel", "round"),
        ("made_of/settings/gather", 3), ("made_of/settings/another", 1),
        ("made_of/camera", ...), ("made_of/camera", None), ("made_of/camera/yfov", ...),
        ("made_of/camera/lens", 1), ("made_of/scene", ...), ("made_of/scene", []),
        ("made_of/scene/lights", ...), ("made_of/scene/more", "00"),
        ("stats", ...), ("stats", None), ("stats", 3), ("stats", {}), ("stats", [1, 2]),
        ("stats/nothing", 1), ("stats/width", ...), ("stats/width", "wide"), ("stats/width", -16),
        ("stats/width", True), ("stats/total_ms", []), ("stats/total_ms", None), ("stats/adapter", 3))},
    "JSON cut short": about_with(lambda about: json.dumps(about)[:-5]),
    "JSON that is deep": about_with(lambda about: "[" * 100_000),
    "JSON that is none": about_with(lambda about: "passes"),
    "JSON that is a number": about_with(lambda about: "1"),
    "JSON of many digits": about_with(lambda about: "9" * 5000),
    "no JSON about it": written("__about__.npy", npy(np.array("passes"))),
    "a list about it": written("__about__.npy", npy(np.array("[1]"))),
    "a picture's words": written("__about__.npy", npy(np.array('{"ispm:scene": "room"}'))),
    "numbers about it": written("__about__.npy", npy(np.arange(3.0))),
    "broken text about it": written("__about__.npy", npy(np.array(b"\xff\xfe"))),
}  # fmt: skip


def end_of(path):
    """The line that loading ends in."""
    with pytest.raises(OutputError) as caught:
        Progress.load(path)
    line = str(caught.value)
    assert "\n" not in line and line.isprintable() and len(line) < len(str(path)) + 200
    return line


@pytest.mark.parametrize("how", SPOILED)
def test_every_spoiled_file_of_passes_is_refused_in_a_line_that_says_why(kept, tmp_path, how):
    path, parts = tmp_path / "spoiled.npz", dict(kept)
    SPOILED[how](parts)
    path.write_bytes(zipped(parts))
    line = end_of(path)
    assert "spoiled.npz: does not hold passes to continue: " in line
    assert line.endswith("; name another file, or remove it")


def test_the_whole_is_not_refused(kept, tmp_path):
    path = tmp_path / "whole.npz"
    path.write_bytes(zipped(kept))
    assert Progress.load(path).passes == 1
    assert len(SPOILED) > 250
    assert set(kept) == {f"{name}.npy" for name in ("__about__", *FLOATS, *IDS)}


REASONS = {
    "sum.direct missing": "sum.direct is missing",
    "sum.direct of other bits": "direct is float16 of shape (9, 16, 3), not float32 of shape (9, 16, 3)",
    "first.depth narrow": "depth is float32 of shape (9, 15), not float32 of shape (9, 16)",
    "sum.alpha with nan": "alpha has values that are no number, or below 0",
    "sum.direct with inf": "direct has values that are not finite",
    "first.instance below 0": "instance has values that are no number, or below -1",
    "another array": "it has sum.other, which no passes have",
    "nothing": "it was not written by --resume",
    "a picture's words": "it is a picture",
    "version 0.0.0": f"they are of ispm 0.0.0, and this is {__version__}",
    "passes -1": "their number makes no sense",
    "made_of/settings/photons -1": "photons: -1 is outside 0 to 16000000",
    "made_of/camera missing": "it does not say the camera they were made with",
    "stats/width -16": "the number width of its statistics makes no sense",
    "a shape of (1048576, 1048576, 3)": "sum.direct.npy is longer or shorter than it says",
    "sum.direct objects": "sum.direct.npy is an array of another kind",
}


@pytest.mark.parametrize("how", REASONS)
def test_the_reason_is_the_right_one(kept, tmp_path, how):
    path, parts = tmp_path / "spoiled.npz", dict(kept)
    SPOILED[how](parts)
    path.write_bytes(zipped(parts))
    assert f"to continue: {REASONS[how]}; name" in end_of(path)


def listed_as(at, data):
    """A file in whose list entries have other `data` from byte `at` on (APPNOTE 4.3.12)."""

    def make(kept):
        entries = zipped(kept).split(b"PK\1\2")
        return b"PK\1\2".join(
            [entries[0], *(e[: at - 4] + data + e[at - 4 + len(data) :] for e in entries[1:])]
        )

    return make


def cut(begin, end):
    """The part of a file between two shares of its length."""

    def make(kept):
        whole = zipped(kept)
        return whole[int(begin * len(whole)) : int(end * len(whole))]

    return make


FILES = {
    "compressed": lambda kept: zipped(kept, zipfile.ZIP_DEFLATED),
    "compressed by bzip2": lambda kept: zipped(kept, zipfile.ZIP_BZIP2),
    "compressed by LZMA": lambda kept: zipped(kept, zipfile.ZIP_LZMA),
    "twice the same name": lambda kept: zipped(kept | {"sum.direct.npx": kept["sum.direct.npy"]}).replace(
        b"sum.direct.npx", b"sum.direct.npy"),
    "no bytes": lambda kept: b"",
    "text": lambda kept: b"passes\n" * 100,
    "zeros": lambda kept: bytes(10_000),
    "an array alone": lambda kept: npy(np.zeros((9, 16, 3), np.float32)),
    "a PNG": lambda kept: b"\x89PNG\r\n\x1a\n" + bytes(100),
    "an end alone": lambda kept: b"PK\5\6" + bytes(18),
    "another end": lambda kept: zipped(kept)[:-22] + b"PK\5\6" + b"\xff" * 18,
    "encrypted": listed_as(8, b"\1"),
    "another method": listed_as(10, b"\7"),
    "larger than it is": listed_as(24, b"\xff\xff\xff\x7f"),
    "without checksums": listed_as(16, b"abcd"),
    "headers elsewhere": listed_as(42, b"\xff\xff\xff\x7f"),
    "headers that are none": lambda kept: zipped(kept).replace(b"PK\3\4", b"PK\7\7"),
    "other names within": lambda kept: zipped(kept).replace(b"sum.direct.npy", b"sum.dirext.npy", 1),
    **{f"cut at {k} of 40": cut(0, k / 40) for k in range(1, 40)},
    **{f"begun at {k} of 8": cut(k / 8, 1) for k in range(1, 8)},
}  # fmt: skip


@pytest.mark.parametrize("how", FILES)
def test_every_file_that_holds_nothing_whole_is_refused_in_a_line(kept, tmp_path, how):
    path = tmp_path / "spoiled.npz"
    path.write_bytes(FILES[how](kept))
    assert end_of(path).endswith("; name another file, or remove it")


def test_what_is_no_file_is_refused_in_a_line(tmp_path):
    (tmp_path / "folder.npz").mkdir()
    assert "cannot be read: Is a directory" in end_of(tmp_path / "folder.npz")
    assert "cannot be read: No such file" in end_of(tmp_path / "nothing.npz")


@pytest.mark.parametrize("seed", range(60))
def test_damaged_files_of_passes_are_refused_or_whole(kept, tmp_path, seed):
    """Bits that are turned and bytes that are lost, anywhere."""
    rng, path, data = np.random.default_rng(seed), tmp_path / "damaged.npz", bytearray(zipped(kept))
    for _ in range(rng.integers(1, 4)):
        data[rng.integers(len(data))] ^= 1 << rng.integers(8)
    path.write_bytes(data[: rng.integers(len(data))] if seed % 4 == 0 else data)
    with contextlib.suppress(OutputError):
        Progress.load(path)


def test_bombs_are_not_expanded(kept, tmp_path):
    path = tmp_path / "bomb.npz"
    bomb = dict(kept) | {"sum.direct.npy": npy(np.zeros((4000, 4000, 3), np.float32))}
    path.write_bytes(zipped(bomb, zipfile.ZIP_DEFLATED))
    tracemalloc.start()
    end_of(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert path.stat().st_size < 1e6 and peak < 4e6


def test_the_command_line_says_it_in_a_line(kept, tmp_path, capsys):
    words = ["render", "cornell-box", "--size", "16x9", "--photons", "900", "--quiet"]
    words += ["-o", str(tmp_path / "a.png"), "--resume", str(tmp_path / "kept.npz")]
    (tmp_path / "kept.npz").write_bytes(zipped(kept))
    for said in ("with photons 1000 (here 900); continue", "sum.direct is missing; name another"):
        assert main(words) == 2
        out, err = capsys.readouterr()
        assert out == "" and err.count("\n") == 1
        assert err.startswith("ispm: ") and said in err
        (tmp_path / "kept.npz").write_bytes(zipped({k: v for k, v in kept.items() if k != "sum.direct.npy"}))
    assert not (tmp_path / "a.png").exists()
