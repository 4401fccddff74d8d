"""Colors as video codecs hold them."""

import numpy as np
import pytest

from ispm.film.yuv import to_yuv

# ITU-R BT.709-6 for 8 bits; SMPTE RP 219-1 lists these of the full bars
BARS = {
    (255, 255, 255): (235, 128, 128),
    (0, 0, 0): (16, 128, 128),
    (255, 255, 0): (219, 16, 138),
    (0, 255, 255): (188, 154, 16),
    (0, 255, 0): (173, 42, 26),
    (255, 0, 255): (78, 214, 230),
    (255, 0, 0): (63, 102, 240),
    (0, 0, 255): (32, 240, 118),
}


@pytest.mark.parametrize(("bits", "rows"), [(8, True), (10, False)])
def test_bars_have_the_codes_of_the_standard(bits, rows):
    for color, codes in BARS.items():
        pixels = np.tile(np.array(color, np.uint16) * 257, (4, 6, 1))
        planes = to_yuv(pixels, bits, rows)
        assert [plane.shape for plane in planes] == [(4, 6)] + [(2 if rows else 4, 3)] * 2
        for plane, code in zip(planes, codes, strict=True):
            # the standard's table is rounded to 8 bits
            assert np.abs(plane / 2 ** (bits - 8) - code).max() <= (0.0 if bits == 8 else 0.5)


def test_deep_pixels_keep_what_8_bits_lose():
    ramp = np.repeat(np.linspace(0, 65535, 2048).round().astype(np.uint16)[None, :, None], 3, axis=2)
    luma, *_ = to_yuv(ramp, 10, False)
    assert len(np.unique(luma)) == 877  # 64 to 940


def test_chroma_lies_on_even_columns_between_rows():
    """On a ramp, which filters of odd symmetry leave alone, it is that of its place."""
    ramp = np.zeros((8, 16, 3), np.uint16)
    ramp[..., 2] = 2000 * np.arange(16) + 3000 * np.arange(8)[:, None]
    for rows, below in ((True, 0.5), (False, 0.0)):
        _, blue, _ = to_yuv(ramp, 10, rows)
        y = np.arange(blue.shape[0])[:, None] * (2 if rows else 1) + below
        value = (2000 * 2 * np.arange(8) + 3000 * y) / 65535
        exact = 4 * (128 + 224 * 0.5 * value)  # a blue of b has luma .0722 b
        assert np.abs(blue - exact)[:, 1:].max() <= 0.5 + 1e-3


def test_it_is_what_ffmpeg_makes_of_gray_and_smooth_color():
    av = pytest.importorskip("av", reason="PyAV is not installed")
    x, y = np.meshgrid(np.linspace(0, 1, 64), np.linspace(0, 1, 32))
    pixels = np.rint(255 * np.stack([x, y, 0.5 + 0.3 * (x - y)], axis=-1)).astype(np.uint8)
    frame = av.VideoFrame.from_ndarray(pixels, format="rgb24")
    theirs = frame.reformat(format="yuv444p", dst_colorspace="ITU709", dst_color_range="MPEG").to_ndarray()
    luma, *_ = to_yuv(pixels, 8, True)
    assert np.abs(luma.astype(int) - theirs[0].astype(int)).max() <= 1
