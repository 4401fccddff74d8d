"""Frames in files and notebooks: what was seen comes back, and how it was made."""

import json
import struct
import warnings
import zlib

import numpy as np
import pytest
from PIL import Image

from ispm.errors import OutputError, SceneWarning, SettingsError
from ispm.io.about import read_about
from ispm.io.image import read_picture, write_jpeg, write_npy, write_npz, write_png
from ispm.io.png import encode_png
from ispm.renderer.picture import Frame
from ispm.renderer.statistics import Stats
from ispm.settings import Settings
from ispm.stages.tonemap import tonemap

SIZE = (12, 7)
K = np.array([[10.1, 0.0, 6.0], [0.0, 10.3, 3.5], [0.0, 0.0, 1.0]])
COMMAND = "ispm render 'my room.glb' --photons 4000 --seed 7 -o a.png"


def frame(**changes):
    """A frame of random light; on the left nothing is, in the middle half a pixel."""
    random = np.random.default_rng(2)
    settings = Settings(size=SIZE, seed=7, photons=4000, exposure=0.5, **changes)
    alpha = np.repeat([0.0, 0.5, 1.0], 4).astype(np.float32) * np.ones((7, 1), np.float32)
    full = random.random((7, 12, 3), np.float32) * alpha[..., None]
    layers = {"full": full, "direct": full / 2, "alpha": alpha, "depth": full[..., 0] + 1, "normal": full}
    camera = {"pose": np.eye(4), "clip_from_world": np.eye(4), "intrinsics": K}
    return Frame(layers, Stats(), settings, camera, "my room", COMMAND)


def decode_16(data):
    """Text and pixels of a 16-bit PNG whose rows are filtered by Up alone: a decoder of its own."""
    at, text, body = 8, {}, b""
    while at < len(data):
        length, kind = struct.unpack_from(">I4s", data, at)
        content = data[at + 8 : at + 8 + length]
        assert struct.unpack_from(">I", data, at + 8 + length)[0] == zlib.crc32(kind + content)
        if kind == b"IHDR":
            width, height, bits, color, *rest = struct.unpack(">IIBBBBB", content)
            assert (bits, rest) == (16, [0, 0, 0])
        elif kind == b"iTXt":
            key, _, words = content.partition(b"\0\0\0\0\0")
            text[key.decode()] = words.decode()
        elif kind == b"IDAT":
            body += content
        at += 12 + length
    channels = {2: 3, 6: 4}[color]
    rows = np.frombuffer(zlib.decompress(body), np.uint8).reshape(height, -1)
    assert (rows[:, 0] == 2).all()
    pixels = np.cumsum(rows[:, 1:], axis=0, dtype=np.uint8)
    return text, pixels.view(">u2").reshape(height, width, channels)


@pytest.mark.parametrize("channels", [3, 4])
def test_a_png_of_16_bits_keeps_every_bit_and_its_text(channels):
    pixels = np.random.default_rng(1).integers(0, 65536, (9, 5, channels), np.uint16)
    text, back = decode_16(encode_png(pixels, {"name": "Zoë ☀"}))
    np.testing.assert_array_equal(back, pixels)
    assert text == {"name": "Zoë ☀"}


def test_a_png_of_16_bits_is_one_to_others(tmp_path):
    pixels = np.random.default_rng(1).integers(0, 65536, (9, 5, 3), np.uint16)
    write_png(tmp_path / "a.png", pixels, {"key": "words"})
    with Image.open(tmp_path / "a.png") as picture:
        assert picture.text == {"key": "words"}
        assert picture.info["srgb"] == 0
        np.testing.assert_array_equal(np.asarray(picture), pixels >> 8)  # all that Pillow reads


def test_16_bits_are_those_of_the_light(tmp_path):
    made = frame()
    text, pixels = decode_16(made.save(tmp_path / "a.png", bits=16).read_bytes())
    np.testing.assert_array_equal(pixels, tonemap(made.radiance, 0.5, bits=16))
    assert np.abs(pixels / 257.0 - made.image).max() < 0.62
    assert json.loads(text["ispm:settings"])["seed"] == 7


@pytest.mark.parametrize("view", ["full", "direct", "split", "depth", "normal"])
def test_views_of_16_bits_look_like_those_of_8(view):
    made = frame()
    assert np.abs(made.view(view, bits=16) / 257.0 - made.view(view)).max() < 0.62


def test_alpha_is_straight_in_a_png(tmp_path):
    made = frame(background="transparent")
    made.save(tmp_path / "a.png")
    with Image.open(tmp_path / "a.png") as picture:
        pixels = np.asarray(picture)
    np.testing.assert_array_equal(pixels, made.image)
    assert set(pixels[..., 3].ravel()) == {0, 128, 255}
    half = slice(None), slice(4, 8)  # the color of the half that is covered, not mixed with black
    np.testing.assert_array_equal(pixels[half][..., :3], tonemap(made.radiance[half] * 2.0, 0.5))
    _, fine = decode_16(made.save(tmp_path / "b.png", bits=16).read_bytes())
    assert np.abs(fine / 257.0 - pixels).max() < 0.62


def test_a_jpeg_shows_black_where_a_png_is_transparent_and_says_so(tmp_path):
    made = frame(background="transparent")
    with pytest.warns(SceneWarning, match="a JPEG has no transparency"):
        made.save(tmp_path / "a.jpg")
    with Image.open(tmp_path / "a.jpg") as picture:
        assert picture.mode == "RGB"
        assert np.asarray(picture)[:, :3].max() < 30  # next to colors, 8 x 8 blocks ring
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        frame().save(tmp_path / "a.jpg")


def test_a_jpeg_keeps_colors_as_fine_as_light(tmp_path):
    pixels = np.zeros((16, 16, 3), np.uint8)
    pixels[:, ::2] = (250, 30, 30)
    pixels[:, 1::2] = (30, 30, 250)
    write_jpeg(tmp_path / "a.jpg", pixels)
    with Image.open(tmp_path / "a.jpg") as picture:
        assert np.abs(np.asarray(picture).astype(int) - pixels).mean() < 4  # 4:2:0 would give over 50


@pytest.mark.parametrize("ending", ["png", "jpg", "exr", "npz"])
def test_every_file_says_how_it_was_made(tmp_path, ending):
    found = read_about(frame().save(tmp_path / f"a.{ending}"))
    assert (found.width, found.height) == SIZE
    assert found.made["command"] == COMMAND
    assert found.made["scene"] == "my room"
    assert found.made["seed"] == "7"
    assert found.made["Software"].startswith("ispm ")
    assert Settings(**json.loads(found.made["settings"])) == frame().settings
    assert json.loads(found.made["camera"]) == np.eye(4).tolist()
    assert json.loads(found.made["intrinsics"]) == K.tolist()


def test_an_exr_has_its_camera_as_matrices(tmp_path):
    import OpenEXR

    header = OpenEXR.File(str(frame().save(tmp_path / "a.exr")), header_only=True).header()
    np.testing.assert_array_equal(header["pose"], np.eye(4))
    np.testing.assert_array_equal(header["intrinsics"], K.astype(np.float32))


@pytest.mark.parametrize(
    ("ending", "options", "channels", "bits"),
    [
        ("png", {}, ["R", "G", "B"], [8]),
        ("png", {"bits": 16}, ["R", "G", "B"], [16]),
        ("jpg", {}, ["R", "G", "B"], [8]),
        ("exr", {"layers": ["full", "alpha"]}, ["A", "B", "G", "R"], [16]),
        ("exr", {"layers": ["full", "depth"]}, ["B", "G", "R", "depth.Z"], [16, 32]),
        ("npz", {"layers": ["alpha"]}, ["alpha 7x12 float32"], [32]),
        ("npy", {"show": "depth"}, ["a 7x12 float32"], [32]),
    ],
)
def test_channels_are_told(tmp_path, ending, options, channels, bits):
    found = read_about(frame().save(tmp_path / f"a.{ending}", **options))
    assert (found.channels, found.bits) == (channels, bits)


def test_how_it_was_made_is_no_layer_of_an_npz(tmp_path):
    frame().save(tmp_path / "a.npz", layers=["full"])
    np.testing.assert_array_equal(read_picture(tmp_path / "a.npz"), frame().radiance)
    frame().save(tmp_path / "b.npz")
    with pytest.raises(OutputError, match=r"one of full, direct, alpha, depth, normal$"):
        read_picture(tmp_path / "b.npz", "none")


def test_pictures_of_others_are_told_without_words(tmp_path):
    write_png(tmp_path / "a.png", np.zeros((2, 3, 3), np.uint8), {"Author": "me", "Software": "x"})
    Image.new("RGB", (3, 2)).save(tmp_path / "a.jpg", comment=b"\xff not ours")
    write_npz(tmp_path / "a.npz", {"a": np.zeros((2, 3))})
    write_npy(tmp_path / "a.npy", np.zeros((2, 3, 3)))
    for ending in ("png", "jpg", "npz", "npy"):
        found = read_about(tmp_path / f"a.{ending}")
        assert (found.width, found.height, found.made) == (3, 2, {})


@pytest.mark.parametrize("ending", ["png", "jpg", "exr", "npz", "npy"])
@pytest.mark.parametrize("share", [0.0, 0.02, 0.3])
def test_a_broken_picture_is_one_line(tmp_path, ending, share):
    path = frame().save(tmp_path / f"a.{ending}")
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    try:
        read_about(path)
    except OutputError as error:
        assert str(error).startswith(f"{path}: cannot be read") and "\n" not in str(error)
    else:
        assert share == 0.3  # the header alone is read


@pytest.mark.parametrize(("name", "says"), [("a.tif", "is no picture"), ("none.png", "no such file")])
def test_what_is_no_picture_is_refused(tmp_path, name, says):
    with pytest.raises(OutputError, match=says):
        read_about(tmp_path / name)


@pytest.mark.parametrize(("name", "bits"), [("a.png", 12), ("a.jpg", 16), ("a.exr", 16)])
def test_bits_that_a_file_does_not_have_are_refused(tmp_path, name, bits):
    with pytest.raises(SettingsError, match=f"bits: {bits} is not possible"):
        frame().save(tmp_path / name, bits=bits)
    assert list(tmp_path.iterdir()) == []


def test_a_notebook_shows_the_frame_as_a_picture():
    # As IPython looks for it: no answer to a canary, no method of its own for everything, then the kinds.
    made = frame(background="transparent")
    for name in ("_ipython_canary_method_should_not_exist_", "_ipython_display_", "_repr_html_",
                 "_repr_mimebundle_"):  # fmt: skip
        assert getattr(made, name, None) is None
    data = made._repr_png_()
    assert data.startswith(b"\x89PNG")
    assert repr(made) == "<Frame 12x7 of 'my room', 4,000 photons>"
