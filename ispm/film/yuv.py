"""What video codecs hold: luma, and chroma at half the resolution, of BT.709 in its limited range."""

from __future__ import annotations

import numpy as np

_RED, _GREEN, _BLUE = 0.2126, 0.7152, 0.0722  # ITU-R BT.709-6, item 3.2


def to_yuv(pixels: np.ndarray, bits: int, rows_halved: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the planes Y, Cb and Cr of (h, w, 3) uint8 or uint16 pixels, w even, and h if `rows_halved`.

    bits         of a sample in the planes, 8 or 10
    rows_halved  4:2:0, whose chroma lies between two rows, else 4:2:2; in both it lies on each second column
    Source: ITU-R BT.709-6, items 3.2 to 3.5; the place of chroma as H.264, table E-3, type 0.
    """
    most = np.float32(np.iinfo(pixels.dtype).max)
    red, green, blue = np.moveaxis(pixels.astype(np.float32) / most, -1, 0)
    luma = np.float32(_RED) * red + np.float32(_GREEN) * green + np.float32(_BLUE) * blue
    planes = [luma * 219.0 + 16.0]
    for color, weight in ((blue, _BLUE), (red, _RED)):
        chroma = (color - luma) / np.float32(2.0 * (1.0 - weight))
        planes.append(_halved(chroma, rows_halved) * 224.0 + 128.0)
    scale, kind = np.float32(2 ** (bits - 8)), np.uint8 if bits == 8 else np.uint16
    y, cb, cr = (np.rint(plane * scale).astype(kind) for plane in planes)
    return y, cb, cr


def _halved(plane: np.ndarray, rows: bool) -> np.ndarray:
    """Each second column, with half of its two neighbours in it; of two rows the mean."""
    left = np.concatenate([plane[:, :1], plane[:, 1:-1:2]], axis=1)
    columns = 0.5 * plane[:, ::2] + 0.25 * (left + plane[:, 1::2])
    return np.asarray(0.5 * (columns[::2] + columns[1::2]) if rows else columns)
