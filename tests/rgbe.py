"""Radiance pictures made for tests, and what an environment is by its definition."""

from __future__ import annotations

import numpy as np

HEAD = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n"


def texels_of(radiance: np.ndarray) -> np.ndarray:
    """Return (h, w, 4) uint8 RGBE of (h, w, 3) radiance, rounded."""
    peak = radiance.max(axis=2)
    exponent = np.where(peak > 0.0, np.frexp(peak)[1], -128)
    exponent += np.rint(peak * 2.0 ** (8 - exponent)) > 255.0
    mantissa = np.rint(radiance * 2.0 ** (8.0 - exponent)[..., None])
    return np.concatenate([mantissa, (exponent + 128)[..., None]], axis=2).astype(np.uint8)


def hdr(texels: np.ndarray, form: str = "flat", head: bytes = HEAD, size: str = "-Y {} +X {}") -> bytes:
    """Return an .hdr file of (h, w, 4) RGBE texels: "flat", "old" run lengths, or "new" ones by channel."""
    height, width = texels.shape[:2]
    rows = {"flat": lambda row: row.tobytes(), "old": _old, "new": _new}[form]
    return head + size.format(height, width).encode() + b"\n" + b"".join(map(rows, texels))


def _old(row: np.ndarray) -> bytes:
    """Pixels, and 1 1 1 n for n more of the last one; beyond 255 another, for 256 n."""
    out, x = b"", 0
    while x < len(row):
        same = int((np.cumprod((row[x:] == row[x]).all(axis=1))).sum()) - 1
        out += row[x].tobytes()
        more = same
        while more:
            out += bytes((1, 1, 1, more & 255))
            more >>= 8
        x += 1 + same
    return out


def _new(row: np.ndarray) -> bytes:
    """2 2 and the width, then each channel: 128 + n and a value n times, or n and n values."""
    width = len(row)
    out = bytes((2, 2, width >> 8, width & 255))
    for values in row.T:
        x = 0
        while x < width:
            same = min(int(np.cumprod(values[x:] == values[x]).sum()), 127)
            if same > 2:
                out += bytes((128 + same, values[x]))
                x += same
            else:
                count = min(3, width - x)
                out += bytes((count, *values[x : x + count]))
                x += count
    return out


def direction_of(x: np.ndarray, y: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """Return (..., 3) unit directions of places in an image of size (w, h), pixels: by the convention."""
    phi, theta = 2.0 * np.pi * (np.asarray(x) / size[0] - 0.5), np.pi * np.asarray(y) / size[1]
    return np.stack([np.sin(theta) * np.sin(phi), np.cos(theta), -np.sin(theta) * np.cos(phi)], axis=-1)


def seen_along(image: np.ndarray, d: np.ndarray, rotation: float = 0.0) -> np.ndarray:
    """Return (..., 3) float64: the bilinear interpolant of an environment along (..., 3) directions."""
    height, width = image.shape[:2]
    c, s = np.cos(-rotation), np.sin(-rotation)
    a, b, z = c * d[..., 0] + s * d[..., 2], d[..., 1], c * d[..., 2] - s * d[..., 0]
    x = (np.arctan2(a, -z) / (2.0 * np.pi) + 0.5) * width - 0.5
    y = np.arccos(np.clip(b / np.linalg.norm(d, axis=-1), -1.0, 1.0)) / np.pi * height - 0.5
    column, row = np.floor(x).astype(int), np.floor(y).astype(int)
    right, down = (x - column)[..., None], (y - row)[..., None]
    pixel = lambda r, c: image[np.clip(r, 0, height - 1), c % width].astype(float)  # noqa: E731
    top = (1.0 - right) * pixel(row, column) + right * pixel(row, column + 1)
    low = (1.0 - right) * pixel(row + 1, column) + right * pixel(row + 1, column + 1)
    return (1.0 - down) * top + down * low
