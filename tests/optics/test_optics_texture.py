"""Mip levels keep the mean light of a picture."""

import numpy as np
import pytest

from ispm.optics.texture import TextureTable, mip_chain, sample_texture
from ispm.scene.material import Texture, Wrap


def linear(pixels: np.ndarray) -> np.ndarray:
    """IEC 61966-2-1 of bytes, written once more."""
    v = pixels[..., :3] / 255
    return np.where(v <= 0.04045, v / 12.92, ((v + 0.055) / 1.055) ** 2.4)


def noise(width: int, height: int) -> np.ndarray:
    return np.random.default_rng(1).integers(0, 256, (height, width, 4), dtype=np.uint8)


def test_mip_chain_ends_at_one_texel_for_any_size():
    shapes = [level.shape for level in mip_chain(Texture(noise(7, 5)))]
    assert shapes == [(5, 7, 4), (2, 3, 4), (1, 1, 4)]
    assert [level.shape for level in mip_chain(Texture(noise(1, 4)))] == [(4, 1, 4), (2, 1, 4), (1, 1, 4)]


def test_mip_chain_keeps_mean_linear_light():
    for size in ((64, 64), (63, 37)):
        pixels = noise(*size)
        levels = mip_chain(Texture(pixels, srgb=True))
        # each level rounds to bytes, whose steps are at most 1/110 of linear light; rounding averages out
        np.testing.assert_allclose(linear(levels[3]).mean((0, 1)), linear(pixels).mean((0, 1)), atol=2e-3)
        data = mip_chain(Texture(pixels, srgb=False))
        np.testing.assert_allclose(data[1].mean((0, 1)), pixels.mean((0, 1)), atol=0.1)


def test_black_and_white_checker_averages_to_half_the_light_not_half_the_code():
    pixels = np.full((2, 2, 4), 255, np.uint8)
    pixels[0, 0, :3] = pixels[1, 1, :3] = 0
    assert mip_chain(Texture(pixels, srgb=True))[1][0, 0].tolist() == [188, 188, 188, 255]
    assert mip_chain(Texture(pixels, srgb=False))[1][0, 0].tolist() == [128, 128, 128, 255]


@pytest.mark.parametrize("sizes", [((64, 64), (64, 64)), ((36, 21), (36, 21)), ((64, 32), (16, 64))], ids=str)
def test_metal_is_averaged_by_what_it_reflects(sizes):
    """Base times metalness is what metal reflects, base times the rest what paint does: in the mean, too."""
    (wide, high), (colors_wide, colors_high) = sizes
    y, x = np.indices((high, wide))
    is_metal = x % 8 == 0 if high == 32 else (x + 3 * y) % 8 == 0
    metal = np.full((high, wide, 4), 255, np.uint8)
    metal[..., 2] = 255 * is_metal
    base = np.full((high, wide, 4), 255, np.uint8)
    base[..., :3] = np.where(is_metal[..., None], 230, (60, 50, 55))
    base = base[np.arange(colors_high) * high // colors_high][:, np.arange(colors_wide) * wide // colors_wide]
    color, data = Texture(base), Texture(metal, srgb=False)
    *_, base_mean = mip_chain(color)
    *_, metal_mean = mip_chain(data, color)
    bright, share = linear(base_mean)[0, 0], metal_mean[0, 0, 2] / 255
    rows, columns = np.indices((max(high, colors_high), max(wide, colors_wide)))  # texels of both, aligned
    light = linear(base)[rows * colors_high // len(rows), columns * colors_wide // len(rows[0])]
    light = light * is_metal[rows * high // len(rows), columns * wide // len(rows[0])][..., None]
    # half a byte of each of at most seven levels, and of base by one, whose steps are at most 1/110
    steps = 7 * 0.5 / 255 * bright + share * 7 * 0.5 / 110
    assert (abs(bright * share - light.mean((0, 1))) < steps).all()
    plain = mip_chain(data)[-1][0, 0]
    np.testing.assert_array_equal(metal_mean[0, 0, [0, 1, 3]], plain[[0, 1, 3]])  # roughness is as it was


def test_black_metal_is_averaged_by_its_area():
    metal, black = Texture(noise(16, 8), srgb=False), Texture(np.zeros((8, 16, 4), np.uint8))
    for mean, plain in zip(mip_chain(metal, black), mip_chain(metal), strict=True):
        np.testing.assert_allclose(mean.astype(int), plain, atol=1)  # halves of bytes round either way


def test_texture_without_mipmaps_has_one_level():
    assert len(mip_chain(Texture(noise(8, 8), mipmaps=False))) == 1


def test_table_keeps_textures_apart_and_texel_centres_exact():
    first, second = Texture(noise(3, 2), srgb=False), Texture(noise(4, 5), srgb=False, wrap_u=Wrap.CLAMP)
    table = TextureTable.pack([first, second])
    u, v = np.float32(2.5 / 4), np.float32(3.5 / 5)
    found = sample_texture(table.texels, table.rows, 1, u, v, np.float32(0))
    np.testing.assert_allclose(found, second.pixels[3, 2] / 255, atol=1e-6)


def test_broken_coordinates_stay_inside_the_table():
    table = TextureTable.pack([Texture(noise(4, 4), wrap_u=wrap, wrap_v=wrap) for wrap in Wrap])
    for bad in (np.nan, np.inf, -np.inf, 3e38):
        for row in range(3):
            sample_texture(table.texels, table.rows, row, np.float32(bad), np.float32(bad), np.float32(bad))
