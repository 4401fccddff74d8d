"""Textures look the same to the CPU as to the graphics hardware."""

from pathlib import Path

import numpy as np
import pytest

from ispm.optics.jit import jit
from ispm.optics.texture import TextureTable, mip_chain, sample_texture
from ispm.scene.material import Texture, Wrap

SHADER = str(Path(__file__).with_name("texture.wgsl"))
ADDRESS = {Wrap.REPEAT: "repeat", Wrap.CLAMP: "clamp-to-edge", Wrap.MIRROR: "mirror-repeat"}


@jit
def sample_rows(texels, rows, lookups, out):
    for i in range(len(lookups)):
        out[i] = sample_texture(texels, rows, 0, lookups[i, 0], lookups[i, 1], lookups[i, 2])


def on_gpu(gpu, texture: Texture, lookups: np.ndarray) -> np.ndarray:
    levels = mip_chain(texture)
    picture = gpu.texture("picture", "rgba8unorm-srgb" if texture.srgb else "rgba8unorm", usage=("sampled",))
    picture.sized(texture.pixels.shape[1::-1], levels=len(levels))
    for i, level in enumerate(levels):
        picture.write(level, level=i)
    wrap = (ADDRESS[texture.wrap_u], ADDRESS[texture.wrap_v])
    result = gpu.buffer("result").sized(len(lookups) * 16)
    with gpu.frame() as frame:
        gpu.compute(SHADER)(
            frame, over=len(lookups), picture=picture, result=result,
            filtering=gpu.sampler(wrap, linear=texture.linear, mipmaps=texture.mipmaps),
            lookups=gpu.buffer("lookups").write(lookups),
        )  # fmt: skip
    return gpu.read_buffer(result, np.float32, len(lookups) * 4).reshape(-1, 4)


def random_texture(width: int, height: int, **how) -> Texture:
    pixels = np.random.default_rng(width).integers(0, 256, (height, width, 4), dtype=np.uint8)
    return Texture(pixels, **how)


@pytest.mark.parametrize(
    "texture",
    [
        random_texture(16, 8, srgb=True),
        random_texture(13, 7, srgb=False, wrap_u=Wrap.MIRROR, wrap_v=Wrap.CLAMP),
        random_texture(5, 9, wrap_u=Wrap.CLAMP, wrap_v=Wrap.REPEAT, mipmaps=False),
        random_texture(1, 3, wrap_v=Wrap.MIRROR),
    ],
    ids=["srgb-repeat", "odd-mirror-clamp", "no-mipmaps", "one-wide"],
)
def test_texture_filter_matches_hardware(gpu, texture):
    random = np.random.default_rng(5)
    lookups = random.uniform(-2, 3, (2000, 4)).astype(np.float32)
    lookups[:, 2] = random.uniform(-1, 6, 2000)
    table = TextureTable.pack([texture])
    expected = np.zeros((2000, 4), np.float32)
    sample_rows(table.texels, table.rows, lookups, expected)
    # Hardware may quantise each of the three weights (u, v, level) to 8 bits (Vulkan subTexelPrecisionBits
    # and mipmapPrecisionBits), each moving a blend of values in 0..1 by 1/256; some also decode sRGB to 8.
    assert np.abs(on_gpu(gpu, texture, lookups) - expected).max() < 3 / 256 + 1e-4


def test_nearest_texel_matches_hardware(gpu):
    texture = random_texture(11, 6, linear=False, srgb=False, wrap_u=Wrap.MIRROR)
    random = np.random.default_rng(6)
    # texel centres with a margin: on an edge between texels either one is right
    texel = random.integers(-30, 30, (2000, 2)) + random.uniform(0.1, 0.9, (2000, 2))
    lookups = np.zeros((2000, 4), np.float32)
    lookups[:, :2] = texel / (11, 6)
    table = TextureTable.pack([texture])
    expected = np.zeros((2000, 4), np.float32)
    sample_rows(table.texels, table.rows, lookups, expected)
    # Some decode 8 bits to 16 and may be one of those off; another texel would be one of 8 bits off at least.
    np.testing.assert_allclose(on_gpu(gpu, texture, lookups), expected, rtol=0.0, atol=1 / 65535 + 1e-6)
