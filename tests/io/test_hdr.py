"""Pictures of radiance: what their bytes say, and what is said of those that cannot be used."""

import math
import warnings

import numpy as np
import pytest
from rgbe import HEAD, hdr, texels_of

from ispm.errors import SceneError, SceneWarning
from ispm.io import hdr as reader
from ispm.io.hdr import read_environment
from ispm.io.image import write_exr
from ispm.scene.environment import Environment, fewer_columns, fewer_rows


def texels(height=6, width=40):
    """Noise with runs in it."""
    random = np.random.default_rng(4)
    found = random.integers(2, 256, (height, width, 4), np.uint8)
    found[..., 3] = random.integers(120, 136, (height, width))
    found[1, width // 8 :], found[2], found[3, ::2] = found[1, width // 8], found[2, 0], 0
    return found


def written(folder, data, name="a.hdr"):
    path = folder / name
    path.write_bytes(data)
    return path


def test_rgbe_is_mantissa_over_256_times_a_power_of_two(tmp_path):
    """By hand: 128/256 2^0 = 0.5; 255/256 2^(140-128) = 4080; 1/256 2^(1-128); and e = 0 is black."""
    shown = np.array([[[128, 64, 0, 128], [255, 1, 2, 140], [1, 255, 0, 1], [9, 9, 9, 0]]], np.uint8)
    light = read_environment(written(tmp_path, hdr(shown)))
    assert light.dtype == np.float32 and light.shape == (1, 4, 3)
    assert light.tolist() == [
        [[0.5, 0.25, 0.0], [4080.0, 16.0, 32.0], [2.0**-135, 255 * 2.0**-135, 0.0], [0.0, 0.0, 0.0]]
    ]


@pytest.mark.parametrize("form", ["flat", "old", "new"])
@pytest.mark.parametrize("width", [8, 40, 300])
def test_every_way_to_shorten_runs_gives_the_same_pixels(tmp_path, form, width):
    shown = texels(5, width)
    e = shown[..., 3:].astype(float)
    expected = np.where(e > 0, shown[..., :3] / 256.0 * 2.0 ** (e - 128), 0.0)
    light = read_environment(written(tmp_path, hdr(shown, form)))
    assert (light == expected.astype(np.float32)).all()


@pytest.mark.parametrize("width", [3, 7, 33000])
def test_rows_too_short_or_long_for_channels_have_whole_pixels(tmp_path, monkeypatch, width):
    monkeypatch.setattr(reader, "WIDEST", 1 << 16)
    shown = texels(4, width)
    shown[0, 0] = 2, 2, 0, width & 255  # which would begin channels elsewhere
    assert (read_environment(written(tmp_path, hdr(shown))) == reader.radiance_of(shown)).all()


@pytest.mark.parametrize(
    ("size", "turned"), [("-Y {} +X {}", (1, 1)), ("+Y {} +X {}", (-1, 1)), ("-Y {} -X {}", (1, -1))]
)
def test_rows_and_columns_stand_as_the_file_says(tmp_path, size, turned):
    shown = texels()
    light = read_environment(written(tmp_path, hdr(shown, size=size)))
    assert (light == reader.radiance_of(shown)[:: turned[0], :: turned[1]]).all()


def test_rows_are_decoded_a_few_at_a_time(tmp_path, monkeypatch):
    monkeypatch.setattr(reader, "_AT_ONCE", 100)
    shown = texels(7, 40)
    light = read_environment(written(tmp_path, hdr(shown, "new")))
    assert (light == reader.radiance_of(shown)).all()


def test_a_header_may_have_comments_and_other_words(tmp_path):
    head = b"#?RGBE\n# by hand\nSOFTWARE=none\nGAMMA=1\nFORMAT=32-bit_rle_rgbe\n\n"
    shown = texels()
    assert (read_environment(written(tmp_path, hdr(shown, head=head))) == reader.radiance_of(shown)).all()


def test_an_exposure_is_told_and_not_taken_off(tmp_path):
    head = b"#?RADIANCE\nEXPOSURE=2.0\n\n"
    path = written(tmp_path, hdr(texels(), head=head))
    with pytest.warns(SceneWarning, match=r"a.hdr: EXPOSURE=2.0 in its header is not taken off"):
        light = read_environment(path)
    assert (light == reader.radiance_of(texels())).all()


def test_an_exr_is_read_as_it_is(tmp_path):
    image = np.random.default_rng(1).random((4, 8, 3), np.float32) * 1e5
    path = tmp_path / "a.exr"
    write_exr(path, {"full": image}, float=True)
    assert (read_environment(path) == image).all()


def test_values_below_zero_become_zero_with_a_line(tmp_path):
    image = np.ones((2, 4, 3), np.float32)
    image[0, 1, 2], image[1, 0] = -0.5, -1.0
    write_exr(tmp_path / "a.exr", {"full": image}, float=True)
    with pytest.warns(SceneWarning, match="2 pixels below 0 are taken as 0"):
        light = read_environment(tmp_path / "a.exr")
    assert (light == np.maximum(image, 0.0)).all()


BODY = texels().tobytes()
HARM = {
    "nothing": (b"", "it is no Radiance picture"),
    "another format": (b"\x89PNG\r\n\x1a\n" + bytes(99), "it is no Radiance picture"),
    "no end of the header": (b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n", "its header does not end"),
    "no line of its size": (HEAD + b"-Y 6 +X 40", "its header does not end"),
    "colors of another kind": (
        b"#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n-Y 6 +X 40\n" + BODY,
        "its format is 32-bit_rle_xyze",
    ),
    "columns first": (HEAD + b"+X 40 -Y 6\n" + BODY, "its size is given as"),
    "a size that is none": (HEAD + b"-Y six +X 40\n" + BODY, "its size is given as"),
    "no rows": (HEAD + b"-Y 0 +X 40\n" + BODY, "0 pixels"),
    "too many pixels": (HEAD + b"-Y 99999999 +X 99999999\n" + BODY, "are read"),
    "many more pixels than bytes": (HEAD + b"-Y 8192 +X 16384\n" + BODY, "the file ends within"),
    "fewer bytes": (HEAD + b"-Y 6 +X 40\n" + BODY[:-1], "the file ends within its pixels"),
    "a channel cut off": (hdr(texels(), "new")[:-3], "the file ends within its pixels"),
    "a channel of another width": (
        HEAD + b"-Y 1 +X 40\n" + bytes((2, 2, 0, 41)) + BODY,
        "a run of pixels does not fit",
    ),
    "a run beyond its row": (
        HEAD + b"-Y 1 +X 8\n" + bytes((2, 2, 0, 8, 128 + 9, 7)) + BODY,
        "a run of pixels does not fit its row",
    ),
    "values beyond their row": (
        HEAD + b"-Y 1 +X 8\n" + bytes((2, 2, 0, 8, 9)) + BODY,
        "a run of pixels does not fit its row",
    ),
    "a run of none": (HEAD + b"-Y 1 +X 8\n" + bytes((2, 2, 0, 8, 0)) + BODY, "does not fit its row"),
    "a repeat of nothing": (HEAD + b"-Y 1 +X 8\n" + bytes((1, 1, 1, 3)) + BODY, "does not fit its row"),
    "a repeat without end": (
        HEAD + b"-Y 1 +X 8\n" + bytes((9, 9, 9, 9)) + bytes((1, 1, 1, 0)) * 40 + b"\1\1\1\1" + BODY,
        "does not fit its row",
    ),
}


@pytest.mark.parametrize("harm", HARM)
def test_a_damaged_file_is_one_line(tmp_path, harm):
    data, says = HARM[harm]
    path = written(tmp_path, data)
    with pytest.raises(SceneError) as told:
        read_environment(path)
    assert str(told.value).startswith(f"{path}: ") and says in str(told.value)
    assert str(told.value).isprintable()


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("none.hdr", "none.hdr: there is no such file"),
        ("none.png", "environments are read from .hdr .exr"),
        ("", "environments are read from"),
        (".", "environments are read from"),
        ("a.exr", "a.exr: cannot be read as .exr"),
    ],
)
def test_a_file_that_is_none_of_these_is_one_line(tmp_path, monkeypatch, name, says):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.exr").write_bytes(b"v/1\1" + bytes(64))
    with pytest.raises(SceneError, match=says) as told:
        read_environment(name)
    assert str(told.value).isprintable()


def test_pixels_that_are_no_numbers_are_told_by_their_place(tmp_path):
    image = np.ones((2, 4, 3), np.float32)
    image[1, 2, 0] = np.inf
    write_exr(tmp_path / "a.exr", {"full": image}, float=True)
    with pytest.raises(SceneError, match=r"a\.exr: the pixel in row 1, column 2 is no finite number"):
        read_environment(tmp_path / "a.exr")


def solid_angles(height):
    return -np.diff(np.cos(np.pi * np.arange(height + 1) / height))


@pytest.mark.parametrize(("height", "width"), [(64, 128), (60, 100), (33, 70)])
def test_fewer_pixels_give_the_same_light(height, width):
    """The integral over the sphere is kept, and a constant is, to float32's rounding."""
    image = np.random.default_rng(2).random((height, width, 3)).astype(np.float32) ** 8
    small = fewer_rows(fewer_columns(image, 32), 16)
    assert small.shape == (16, 32, 3) and small.dtype == np.float32
    before = (image.mean(axis=1) * solid_angles(height)[:, None]).sum(axis=0)
    after = (small.mean(axis=1) * solid_angles(16)[:, None]).sum(axis=0)
    np.testing.assert_allclose(after, before, rtol=1e-5)
    flat = fewer_rows(fewer_columns(np.full_like(image, 3.0), 32), 16)
    np.testing.assert_allclose(flat, 3.0, rtol=1e-6)


def test_a_large_picture_is_averaged_with_a_line(tmp_path):
    shown = np.zeros((2, 8192, 4), np.uint8)
    shown[:, ::2] = 128, 64, 32, 129  # 1, .5, .25
    path = written(tmp_path, hdr(shown, "new"))
    with pytest.warns(SceneWarning, match=r"its 8192 x 2 pixels are averaged to 4096 x 2"):
        light = read_environment(path)
    assert light.shape == (2, 4096, 3)
    assert (light == np.float32([0.5, 0.25, 0.125])).all()
    with pytest.warns(SceneWarning, match="environment 'big': its 8192 x 2 pixels are averaged"):
        around = Environment(np.ones((2, 8192, 3)), name="big")
    assert around.image.shape == (2, 4096, 3)


def test_floats_survive_their_way_through_rgbe(tmp_path):
    """The largest of three is off by half a step of 1/128 at most; the others by no more, absolutely."""
    image = np.random.default_rng(6).random((16, 32, 3)) * 10.0 ** np.random.default_rng(7).uniform(
        -8, 8, (16, 32, 1)
    )
    light = read_environment(written(tmp_path, hdr(texels_of(image), "new")))
    assert (np.abs(light - image).max(axis=2) <= image.max(axis=2) / 256 * (1 + 1e-6)).all()
    assert math.isclose(light.sum(), image.sum(), rel_tol=1e-2)


def test_reading_says_nothing_where_nothing_is_amiss(tmp_path):
    path = written(tmp_path, hdr(texels(), "new"))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        around = Environment(path, 0.5)
    assert (around.name, around.file, around.image.shape) == ("a", str(path), (6, 40, 3))
