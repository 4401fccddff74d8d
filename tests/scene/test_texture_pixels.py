"""Pictures given to textures: files, gray, RGB and RGBA, of bytes and of floats."""

import warnings

import numpy as np
import pytest
from PIL import Image

from ispm.errors import SceneError, SceneWarning
from ispm.scene.material import DATA, Material, Texture, TextureUse

RANDOM = np.random.default_rng(4)
BYTES = RANDOM.integers(0, 256, (3, 5, 4), np.uint8)


def srgb(light):
    """IEC 61966-2-1, number by number."""
    return 12.92 * light if light <= 0.0031308 else 1.055 * light ** (1 / 2.4) - 0.055


@pytest.mark.parametrize("shape", [(3, 5), (3, 5, 1)])
def test_gray_is_gray_and_opaque(shape):
    pixels = Texture(BYTES[..., 0].reshape(shape)).pixels
    for channel in range(3):
        np.testing.assert_array_equal(pixels[..., channel], BYTES[..., 0])
    assert (pixels[..., 3] == 255).all() and pixels.dtype == np.uint8


def test_two_channels_are_gray_and_alpha_three_are_opaque_colors():
    pixels = Texture(BYTES[..., :2]).pixels
    np.testing.assert_array_equal(pixels, BYTES[..., [0, 0, 0, 1]])
    pixels = Texture(BYTES[..., :3]).pixels
    np.testing.assert_array_equal(pixels[..., :3], BYTES[..., :3])
    assert (pixels[..., 3] == 255).all()


def test_rgba_bytes_are_kept_as_they_are():
    assert Texture(BYTES).pixels is BYTES


@pytest.mark.parametrize("kind", [np.float16, np.float32, np.float64])
@pytest.mark.parametrize("encoded", [True, False])
def test_floats_are_linear_light(encoded, kind):
    light = RANDOM.random((3, 5, 4)).astype(kind)
    pixels = Texture(light, encoded).pixels
    expected = light.astype(float)
    if encoded:
        expected[..., :3] = np.vectorize(srgb)(expected[..., :3])
    assert np.abs(pixels - 255.0 * expected).max() <= (1.0 if kind == np.float16 else 0.5 + 1e-4)
    assert Texture(np.full((1, 1), 0.5)).pixels.tolist() == [[[188, 188, 188, 255]]]


def test_sixteen_bits_are_cut_to_eight_as_of_files(tmp_path):
    values = RANDOM.integers(0, 65536, (3, 5), np.uint16)
    Image.fromarray(values).save(tmp_path / "deep.png")
    np.testing.assert_array_equal(Texture(values).pixels, Texture(tmp_path / "deep.png").pixels)


@pytest.mark.parametrize("mode", ["L", "LA", "RGB", "RGBA", "P"])
@pytest.mark.parametrize("as_text", [True, False])
def test_files_are_what_they_show(tmp_path, mode, as_text):
    picture = Image.fromarray(BYTES).convert(mode)
    path = tmp_path / "wood.png"
    picture.save(path)
    texture = Texture(str(path) if as_text else path, srgb=False)
    np.testing.assert_array_equal(texture.pixels, np.asarray(picture.convert("RGBA")))
    assert (texture.name, texture.srgb) == ("wood", False)
    assert Texture(path, name="oak").name == "oak"


def test_a_file_that_is_no_picture_is_one_line(tmp_path):
    (tmp_path / "a.png").write_bytes(b"no")
    for path, says in ((tmp_path / "a.png", "a.png: it is none of PNG, JPEG"), (tmp_path, "no such file"),
                       ("a\0b", "no such file"), ("/dev/null", "no such file")):  # fmt: skip
        with pytest.raises(SceneError, match=says):
            Texture(path)


def test_pixels_set_later_are_brought_to_form_as_well():
    texture = Texture(BYTES)
    texture.pixels = np.full((2, 2, 3), 0.5)
    texture.check()
    assert texture.pixels.shape == (2, 2, 4) and texture.pixels[0, 0].tolist() == [188, 188, 188, 255]
    texture.pixels = np.full((2, 2, 3), 2.0)
    with pytest.raises(SceneError, match="must be 0 to 1"):
        texture.check()


@pytest.mark.parametrize("slot", DATA)
@pytest.mark.parametrize("use", [Texture, lambda *given: TextureUse(Texture(*given))])
def test_data_given_as_colors_is_told(slot, use):
    with pytest.warns(SceneWarning, match=f"material 'tin': {slot} is read as sRGB colors") as said:
        Material(name="tin", **{slot: use(BYTES)})
    assert said[0].filename == __file__
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        Material(name="tin", base_color_texture=Texture(BYTES), **{slot: use(BYTES, False)})
