"""The mean of light among neighbors: of rough glass and of sheen, which few paths or draws found."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ispm.kernels.share import run_shared, shared_rows
from ispm.optics.jit import jit

f32, i64 = np.float32, np.int64

_REACH = 5  # pixels on each side over which light is averaged, at most
_OUTLIER = f32(3)  # times the mean about a pixel, above which its light goes farther: in the first pass
_CHUNK = 256


def denoise(
    light: np.ndarray, pixels: np.ndarray, width: int, firsts: np.ndarray, smoothing: float, threads: int
) -> None:
    """Average the noise out of light, (n, c), among pixels that show alike surfaces, in place.

    pixels     (n,) numbers y width + x, sorted
    firsts     (n,) FIRST_VERTEX, what they show; those without `blur`, and lobes, which are for
               `resolve_lobes`, are left as they are
    smoothing  as of Settings
    Light is averaged over `blur`, of rough glass a fifth of what it blurs, at most 11 x 11 pixels, whose
    paths went out in different directions. What is above some times the mean about a pixel, as of single
    paths that found a light's image through two rough faces, goes over all of these, so that none is lost.
    """
    rough = (firsts["blur"] > 0.0) & (firsts["reflectance"][:, 0] == 0.0)
    if not rough.any():
        return
    rows = np.full((int(pixels[-1]) // width + 1, width), -1, np.int32)
    rows[pixels // width, pixels % width] = np.where(rough, np.arange(len(pixels)), -1)
    given = _Given(firsts, rows, pixels[rough], f32(smoothing))
    found, kept = light.copy(), light.copy()
    excess = np.zeros(light.shape, np.float32)
    run_shared(lambda counter: _cut(given, found, counter, kept, excess), threads)
    run_shared(lambda counter: _write_means(given, kept, excess, counter, found), threads)
    light[:] = found


class _Given(NamedTuple):
    """(n,) FIRST_VERTEX, the surfaces that pixels show; (h, w) int32, the row of each pixel of the picture,
    -1 where it is left as it is; (m,) numbers of the others; and the settings' smoothing."""

    firsts: np.ndarray
    rows: np.ndarray
    pixels: np.ndarray
    smoothing: np.float32


@jit
def _cut(given, light, counter, kept, excess):
    """Split (n, c) light, of as many pixels as a thread gets, into what is kept and what stands out."""
    limit = _OUTLIER / max(given.smoothing**6, f32(1e-9))  # grows with the passes' number
    for k in shared_rows(counter, _CHUNK, len(given.pixels)):
        i, x, y = _place(given, k)
        for c in range(light.shape[1]):
            kept[i, c] = f32(0)
        _add_mean(given, i, x, y, max(_radius(given, i), f32(2)), light, kept)
        share = min(limit * _sum(kept, i) / max(_sum(light, i), f32(1e-30)), f32(1))
        for c in range(light.shape[1]):
            kept[i, c] = share * light[i, c]
            excess[i, c] = light[i, c] - kept[i, c]


@jit
def _write_means(given, kept, excess, counter, light):
    """Write (n, c) light, the mean of both parts, of as many pixels as a thread gets."""
    for k in shared_rows(counter, _CHUNK, len(given.pixels)):
        i, x, y = _place(given, k)
        for c in range(light.shape[1]):
            light[i, c] = f32(0)
        _add_mean(given, i, x, y, _radius(given, i), kept, light)
        _add_mean(given, i, x, y, f32(_REACH), excess, light)


@jit
def _place(given, k):
    """The row, and the pixel's column and row in the picture, of pixel `k` of a _Given."""
    width = given.rows.shape[1]
    x, y = i64(given.pixels[k]) % width, i64(given.pixels[k]) // width
    return i64(given.rows[y, x]), x, y


@jit
def _radius(given, i):
    """Pixels over which row `i` is averaged, float32."""
    return min(given.smoothing * given.firsts[i].blur, f32(_REACH))


@jit
def _add_mean(given, i, x, y, radius, light, into):
    """Add to row `i` the mean light of the pixels about (x, y) that show the same surface, alike in normal.

    radius  pixels
    """
    firsts, rows, _, _ = given
    reach = i64(radius)
    whole, inverse = f32(0), f32(1) / ((radius + f32(1)) * (radius + f32(1)))
    for adds in range(2):  # the sum of weights first
        for row in range(max(y - reach, 0), min(y + reach + 1, rows.shape[0])):
            for column in range(max(x - reach, 0), min(x + reach + 1, rows.shape[1])):
                k = rows[row, column]
                if k < 0:
                    continue
                away = f32((row - y) * (row - y) + (column - x) * (column - x))
                w = _likeness(firsts[i], firsts[k]) * max(f32(1) - away * inverse, f32(0))
                if adds == 0:
                    whole += w
                elif w > f32(0):
                    for c in range(light.shape[1]):
                        into[i, c] += w / whole * light[k, c]


@jit
def _sum(light, i):
    """Sum of all channels of row `i` of (n, c) light."""
    total = f32(0)
    for c in range(light.shape[1]):
        total += light[i, c]
    return total


@jit
def _likeness(a, b):
    """Weight, float32 in [0, 1], of two FIRST_VERTEX: 1 for surfaces that blur alike."""
    if a.instance != b.instance or b.blur <= f32(0) or abs(a.tint - b.tint) > f32(0.02):
        return f32(0)
    bend = f32(0)
    for k in range(3):
        bend += (a.n[k] - b.n[k]) * (a.n[k] - b.n[k])
    return max(f32(1) - f32(4) * bend / (a.alpha * a.alpha), f32(0))
