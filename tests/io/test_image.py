"""Pictures in files: what is written comes back, and is whole or not there."""

import os
import socket
import stat
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from ispm.errors import OutputError
from ispm.io import image
from ispm.io.atomic import replacing, require_writable
from ispm.io.image import (
    read_array,
    read_picture,
    require_ending,
    srgb_to_linear,
    write_exr,
    write_jpeg,
    write_npy,
    write_npz,
    write_png,
)


@pytest.fixture
def picture():
    return np.random.default_rng(1).random((9, 14, 3), np.float32) * 4


def test_png_keeps_pixels_text_and_says_srgb(tmp_path):
    pixels = np.random.default_rng(1).integers(0, 256, (5, 8, 4), np.uint8)
    write_png(tmp_path / "a.png", pixels, {"settings": '{"seed": 1}', "name": "Zoë ☀"})
    with Image.open(tmp_path / "a.png") as image:
        np.testing.assert_array_equal(np.asarray(image), pixels)
        assert image.text == {"settings": '{"seed": 1}', "name": "Zoë ☀"}
        assert image.info["srgb"] == 0


def test_png_is_read_as_linear_light(tmp_path):
    pixels = np.arange(256, dtype=np.uint8).repeat(3).reshape(16, 16, 3)
    write_png(tmp_path / "a.png", pixels)
    linear = read_picture(tmp_path / "a.png")
    np.testing.assert_array_equal(linear, srgb_to_linear(pixels))
    assert linear[0, 10, 0] == pytest.approx(10 / 255 / 12.92, rel=1e-6)  # the straight part
    assert linear[11, 12, 0] == pytest.approx(((188 / 255 + 0.055) / 1.055) ** 2.4, rel=1e-6)


def test_jpeg_is_near_the_pixels(tmp_path):
    pixels = np.full((16, 16, 3), (200, 120, 40), np.uint8)
    write_jpeg(tmp_path / "a.jpg", pixels)
    with Image.open(tmp_path / "a.jpg") as image:
        assert np.abs(np.asarray(image).astype(int) - pixels).max() <= 3


def test_exr_float_gives_every_layer_back_exactly(tmp_path, picture):
    depth = np.where(picture[..., 0] > 3.9, np.inf, picture[..., 0] * 1000).astype(np.float32)
    ids = np.arange(9 * 14, dtype=np.int32).reshape(9, 14) - 1
    layers = {"full": picture, "direct": picture / 2, "normal": picture - 2, "depth": depth, "instance": ids}
    write_exr(tmp_path / "a.exr", layers, float=True)
    np.testing.assert_array_equal(read_picture(tmp_path / "a.exr"), picture)
    for name in ("direct", "normal", "depth"):
        np.testing.assert_array_equal(read_array(f"{tmp_path}/a.exr:{name}"), layers[name])
    np.testing.assert_array_equal(read_array(tmp_path / "a.exr", "instance"), ids.astype(np.uint32))


def test_exr_half_rounds_color_but_not_depth_and_never_overflows(tmp_path, picture):
    picture[0, 0] = 1e6
    depth = picture[..., 0] * 1234.567
    write_exr(tmp_path / "a.exr", {"full": picture, "depth": depth})
    back = read_picture(tmp_path / "a.exr")
    assert back[0, 0].tolist() == [65504.0] * 3
    np.testing.assert_allclose(back[1:], picture[1:], rtol=2**-11, atol=2**-24)
    np.testing.assert_array_equal(read_array(tmp_path / "a.exr", "depth"), depth)


def test_exr_names_its_channels_as_the_contract_says_and_keeps_metadata(tmp_path, picture):
    import OpenEXR

    layers = {"full": picture, "direct": picture, "normal": picture, "depth": picture[..., 0]}
    layers["material"] = np.zeros((9, 14), np.uint32)
    metadata = {"ispm:seed": 7, "ispm:settings": "{}", "camera": np.eye(4)}
    write_exr(tmp_path / "a.exr", layers, metadata)
    file = OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True)
    expected = {"R", "G", "B", "depth.Z", "material.ID"}
    expected |= {f"direct.{c}" for c in "RGB"} | {f"normal.{c}" for c in "XYZ"}
    assert set(file.channels()) == expected
    header = file.header()
    assert (header["ispm:seed"], header["ispm:settings"]) == (7, "{}")
    np.testing.assert_array_equal(header["camera"], np.eye(4))
    assert header["compression"] == OpenEXR.ZIP_COMPRESSION


def test_npy_and_npz_give_arrays_back(tmp_path, picture):
    write_npy(tmp_path / "a.npy", picture)
    write_npz(tmp_path / "a.npz", {"full": picture, "depth": picture[..., 0]})
    np.testing.assert_array_equal(read_picture(tmp_path / "a.npy"), picture)
    np.testing.assert_array_equal(read_picture(f"{tmp_path}/a.npz:full"), picture)
    np.testing.assert_array_equal(read_array(tmp_path / "a.npz", "depth"), picture[..., 0])


@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 0.9])
@pytest.mark.parametrize("ending", ["exr", "npy", "npz", "png"])
def test_a_file_cut_short_is_refused_in_one_line(tmp_path, picture, ending, share):
    path = tmp_path / f"a.{ending}"
    writers = {
        "exr": lambda: write_exr(path, {"full": picture}),
        "npy": lambda: write_npy(path, picture),
        "npz": lambda: write_npz(path, {"full": picture}),
        "png": lambda: write_png(path, (picture * 60).astype(np.uint8)),
    }
    writers[ending]()
    whole = path.read_bytes()
    path.write_bytes(whole[: int(len(whole) * share)])
    with pytest.raises(OutputError, match=f"a.{ending}"):
        read_picture(path)


def test_an_exr_that_claims_a_huge_picture_is_refused_before_it_is_read(tmp_path, picture):
    path = tmp_path / "a.exr"
    write_exr(path, {"full": picture})
    data = path.read_bytes()
    window = np.array([0, 0, 13, 8], "<i4").tobytes()
    path.write_bytes(data.replace(window, np.array([0, 0, 10**6, 10**6], "<i4").tobytes()))
    with pytest.raises(OutputError, match="1000001 x 1000001 pixels"):
        read_picture(path)


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("parts.npz", "holds several arrays; write parts.npz:KEY with one of direct, depth"),
        ("a.npz:depht", "has no array 'depht'"),
        ("none.npy", "there is no such file"),
        ("a.tif", "not '.tif'"),
        ("shape.npy", "not that of a picture"),
    ],
)
def test_a_picture_that_is_not_there_is_named(tmp_path, picture, name, says):
    write_npz(tmp_path / "a.npz", {"full": picture, "depth": picture[..., 0]})
    write_npz(tmp_path / "parts.npz", {"direct": picture, "depth": picture[..., 0]})
    write_npy(tmp_path / "shape.npy", np.zeros(4))
    with pytest.raises(OutputError, match=says):
        read_picture(f"{tmp_path}/{name}")


def test_the_picture_of_a_file_of_layers_is_the_whole_one(tmp_path, picture):
    write_npz(tmp_path / "a.npz", {"depth": picture[..., 0], "full": picture})
    assert (read_picture(tmp_path / "a.npz") == picture).all()


def test_pickled_arrays_are_not_opened(tmp_path):
    np.save(tmp_path / "a.npy", np.array([{}], object), allow_pickle=True)
    with pytest.raises(OutputError, match="cannot be read"):
        read_picture(tmp_path / "a.npy")


@pytest.mark.parametrize("name", ["a.tif", "a", "a.pngx"])
def test_an_unknown_ending_is_refused_with_the_known_ones(name):
    with pytest.raises(OutputError, match=r"use one of \.png, \.jpg"):
        require_ending(name)
    assert require_ending("A.PNG") == ".png"


@pytest.mark.parametrize("error", [KeyboardInterrupt, RuntimeError, OSError(28, "No space left on device")])
def test_a_write_that_fails_leaves_the_old_file_and_nothing_else(tmp_path, error):
    path = tmp_path / "a.png"
    path.write_text("old")
    with pytest.raises((KeyboardInterrupt, RuntimeError, OutputError)), replacing(path) as beside:
        beside.write_text("half")
        raise error
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["a.png"]


def test_a_full_disk_leaves_nothing_and_says_so(tmp_path):
    # A limit on the size of files stands in for the full disk: writing fails part way, as there.
    script = f"""
import os, resource, sys
import numpy as np
from ispm.errors import OutputError
from ispm.io import image
import OpenEXR, PIL.PngImagePlugin
noise = np.random.default_rng(1).random((200, 200, 3), np.float32)
whole = {str(tmp_path)!r} + "/whole.exr"
image.write_exr(whole, {{"full": noise}})
size = os.path.getsize(whole)
os.unlink(whole)
resource.setrlimit(resource.RLIMIT_FSIZE, (size - 1, size - 1))
try:
    image.write_exr(whole, {{"full": noise}})
    sys.exit("was written without its last byte")
except OutputError:
    pass
resource.setrlimit(resource.RLIMIT_FSIZE, (5000, 5000))
for write in (
    lambda: image.write_exr({str(tmp_path)!r} + "/a.exr", {{"full": noise}}),
    lambda: image.write_npy({str(tmp_path)!r} + "/a.npy", noise),
    lambda: image.write_npz({str(tmp_path)!r} + "/a.npz", {{"full": noise}}),
    lambda: image.write_png({str(tmp_path)!r} + "/a.png", (noise * 255).astype(np.uint8)),
    lambda: image.write_jpeg({str(tmp_path)!r} + "/a.jpg", (noise * 255).astype(np.uint8)),
):
    try:
        write()
        sys.exit("was written")
    except OutputError as error:
        print(error)
"""
    run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    lines = run.stdout.splitlines()
    assert [line.split(":")[0][-3:] for line in lines] == ["exr", "npy", "npz", "png", "jpg"]
    assert all("cannot be written: " in line for line in lines)
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize("room", [20, 60])
def test_a_disk_that_is_truly_full_leaves_nothing_and_says_so(tmp_path, room):
    """Some libraries overlook that it is; files of every kind are longer than `room` KiB."""
    script = """
import os
import numpy as np
from ispm.errors import OutputError
from ispm.io import image
light = np.random.default_rng(1).random((200, 200, 3), np.float32)
pixels = (light * 255).astype(np.uint8)
image.write_exr("warm.exr", {"full": light[:2]})  # what libraries open is open
os.chdir("full")
for ending, write in {
    "exr": lambda path: image.write_exr(path, {"full": light}),
    "npy": lambda path: image.write_npy(path, light),
    "npz": lambda path: image.write_npz(path, {"full": light}),
    "png": lambda path: image.write_png(path, pixels),
    "jpg": lambda path: image.write_jpeg(path, pixels),
}.items():
    try:
        write("a." + ending)
    except OutputError as error:
        print(error)
print(os.listdir("."))
"""
    (tmp_path / "full").mkdir()
    mounted = f"mount -t tmpfs -o size={room}k none full && exec {sys.executable} -c '{script}'"
    if subprocess.run(["unshare", "-rm", "true"], capture_output=True).returncode:
        pytest.skip("this user may not mount anything")
    run = subprocess.run(
        ["unshare", "-rm", "sh", "-c", mounted], cwd=tmp_path,
        capture_output=True, text=True,
    )  # fmt: skip
    assert run.returncode == 0, run.stderr
    kinds = ["exr", "npy", "npz", "png", "jpg"]
    assert run.stdout.splitlines() == [
        *(f"a.{kind}: cannot be written: No space left on device" for kind in kinds), "[]"
    ]  # fmt: skip


def test_a_result_gets_the_usual_permissions_and_its_folders(tmp_path):
    mask = os.umask(0o022)
    try:
        write_npy(tmp_path / "new" / "folder" / "a.npy", np.zeros(3))
    finally:
        os.umask(mask)
    assert (tmp_path / "new" / "folder" / "a.npy").stat().st_mode & 0o777 == 0o644


def test_a_link_is_written_through(tmp_path):
    (tmp_path / "there").mkdir()
    (tmp_path / "link.npy").symlink_to(tmp_path / "there" / "a.npy")
    write_npy(tmp_path / "link.npy", np.zeros(3))
    assert (tmp_path / "link.npy").is_symlink()
    assert (tmp_path / "there" / "a.npy").is_file()


@pytest.mark.parametrize("mode", [0o600, 0o640, 0o444])
def test_what_is_replaced_keeps_its_mode(tmp_path, mode):
    path, mask = tmp_path / "a.npy", os.umask(0o022)
    try:
        path.touch()
        path.chmod(mode)
        write_npy(path, np.zeros(3))
    finally:
        os.umask(mask)
    assert path.stat().st_mode & 0o777 == mode and np.load(path).shape == (3,)


def bind_socket(path):
    with socket.socket(socket.AF_UNIX) as made:
        made.bind(str(path))


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has none of these")
@pytest.mark.parametrize(
    ("make", "kind"),
    [
        (lambda path: path.symlink_to("/dev/null"), "a device"),
        (os.mkfifo, "a FIFO"),
        (bind_socket, "a socket"),
        (Path.mkdir, "a folder"),
        (lambda path: path.symlink_to(path.parent), "a folder"),
        (lambda path: path.symlink_to(path), "symbolic links"),
    ],
)
def test_what_is_no_file_is_not_replaced(tmp_path, monkeypatch, make, kind):
    monkeypatch.chdir(tmp_path)  # a socket's path must be short
    path = Path("n.png")
    make(path)
    before = path.lstat()
    for write in (require_writable, lambda p: image.write_png(p, np.zeros((2, 2, 3), np.uint8))):
        with pytest.raises(OutputError, match=kind):
            write(path)
    assert path.lstat().st_ino == before.st_ino
    assert stat.S_ISCHR(os.stat("/dev/null").st_mode) and os.listdir() == ["n.png"]


@pytest.mark.parametrize("name", ["é" * 121 + ".npy", "a" * 251 + ".npy"])
def test_the_longest_names_can_be_written(tmp_path, name):
    require_writable(tmp_path / name)
    write_npy(tmp_path / name, np.zeros(3))
    assert os.listdir(tmp_path) == [name]


@pytest.mark.parametrize("name", ["é" * 126 + ".npy", "a\udcff.png"])
def test_names_that_cannot_be_written_are_found_before_the_work(tmp_path, name):
    with pytest.raises(OutputError, match=r"File name too long|is no UTF-8") as caught:
        require_writable(tmp_path / name)
    assert str(caught.value).isprintable()
    assert os.listdir(tmp_path) == []


def test_what_a_killed_process_left_is_swept(tmp_path):
    old, new, other = (
        tmp_path / name for name in (".ispm-01234567-a.npy", ".ispm-89abcdef-a.npy", ".ispm-x")
    )
    for path in (old, new, other):
        path.touch()
    for path in (old, other):
        os.utime(path, (1e9, 1e9))
    folder = tmp_path / ".ispm-00000000-folder"
    folder.mkdir()
    os.utime(folder, (1e9, 1e9))
    write_npy(tmp_path / "b.npy", np.zeros(3))
    assert {path.name for path in tmp_path.iterdir()} == {new.name, other.name, folder.name, "b.npy"}


@pytest.mark.parametrize("path", ["/proc/none/a.png", "/dev/null/a.png"])
def test_an_unwritable_place_is_found_before_the_work(path):
    with pytest.raises(OutputError, match="cannot be written"):
        require_writable(path)


def test_a_folder_is_not_a_picture(tmp_path):
    with pytest.raises(OutputError, match="is a folder"):
        require_writable(tmp_path)
