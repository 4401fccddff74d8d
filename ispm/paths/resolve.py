"""The light of narrow lobes, which few paths from each pixel find, averaged over pixels nearby.

Passes of 3 x 3 pixels, 1 to 16 apart, each as strong as brings the sum of their variances to what a
pixel's own lobe allows: its width, and how far what it reflects lies, tell how little is seen of it. Light is
divided by what the surface reflects before, so that textures stay sharp. What stands out far, as a lamp's
image in a second lobe does that one path found, is spread as far as passes go, and so no light is lost.
Source: edge-avoiding a-trous wavelets, Dammertz et al., HPG 2010.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ispm.kernels.share import run_shared, shared_rows
from ispm.optics.jit import jit
from ispm.optics.vector import dot, sub, vec3

f32, i64, u32 = np.float32, np.int64, np.uint32

_STRIDES = (1, 2, 4, 8, 16)  # pixels
_CHUNK = 256
_BENT = f32(4)  # over alpha^2: what the square of the difference of normals is weighed by
_LENIENT = f32(0.25)  # likewise for what stands out
_ALIKE = f32(4)  # likewise that of two alphas, over the larger one
_OFF_PLANE = f32(2)  # pixels, and as many as the stride, off the plane of a surface at which another begins
_OUTLIER = 4.0  # times the mean about a pixel, above which its light goes farther: in the first pass
_KERNEL = f32(0.5)  # variance of a whole pass, squares of its stride
_CENTER = f32(0.25)  # weight of the middle pixel in it


class Shown(NamedTuple):
    """What is shown where light is to be averaged.

    pixels     (n,) int64 numbers y width + x, sorted
    firsts     (n,) FIRST_VERTEX or more, what they show
    positions  (n, 3) float32 m
    widths     (n,) float32 m, of a pixel there
    rows       (h, w) int32, the row of each pixel of the picture, -1 where it has none
    """

    pixels: np.ndarray
    firsts: np.ndarray
    positions: np.ndarray
    widths: np.ndarray
    rows: np.ndarray


def shown(
    pixels: np.ndarray, across: int, firsts: np.ndarray, positions: np.ndarray, widths: np.ndarray
) -> Shown:
    """Return what n pixels show; across: pixels in a row of the picture."""
    pixels = pixels.astype(np.int64)
    rows = np.full((int(pixels[-1]) // across + 1 if len(pixels) else 1, across), -1, np.int32)
    rows[pixels // across, pixels % across] = np.arange(len(pixels))
    return Shown(pixels, firsts, positions.astype(np.float32), widths.astype(np.float32), rows)


def lonely_rows(given: Shown) -> np.ndarray:
    """Return the rows of pixels from whose lobe no path went out, nor from any beside them, sorted."""
    lonely = np.zeros(len(given.pixels), np.bool_)
    if _has_lobes(given):
        _find_lonely(given, lonely)
    return np.flatnonzero(lonely)


def resolve_lobes(light: np.ndarray, given: Shown, smoothing: float, threads: int) -> None:
    """Average the light of pixels that show narrow lobes, (n, c) float32, c in threes, in place.

    smoothing  factor on the deviation
    """
    if not _has_lobes(given):
        return
    blur, weights = np.zeros((2, len(given.pixels)), np.float32)
    values = np.zeros_like(light)
    run_shared(lambda counter: _begin(given, f32(smoothing), light, counter, blur, values, weights), threads)
    limit, excess = f32(_OUTLIER / max(smoothing**6, 1e-9)), values.copy()  # grows with the passes' number
    run_shared(lambda counter: _cut(given, limit, blur, excess, counter, values), threads)
    excess -= values
    values = _averaged(given, values, weights, blur, _BENT, threads)
    if excess.any():
        widest = np.full_like(blur, np.inf)
        values += _averaged(given, excess, weights, widest, _LENIENT, threads)
    _finish(given, values, light)


def _averaged(
    given: Shown, values: np.ndarray, weights: np.ndarray, blur: np.ndarray, bent: np.float32, threads: int
) -> np.ndarray:
    """Return values, (n, c), averaged to a variance, (n,) pixels^2, as far as passes go."""
    before, spent = _Averaged(values, weights), np.zeros_like(blur)
    for stride in _STRIDES:
        after = _Averaged(np.zeros_like(values), np.zeros_like(weights))
        run_shared(_one_pass(given, stride, bent, blur, spent, before, after), threads)
        before = after
    return before.values


def _one_pass(
    given: Shown,
    stride: int,
    bent: np.float32,
    blur: np.ndarray,
    spent: np.ndarray,
    before: _Averaged,
    after: _Averaged,
) -> Callable[[np.uint64], None]:
    """Return what threads call to make one pass."""
    return lambda counter: _average(given, i64(stride), bent, blur, spent, before, counter, after)


class _Averaged(NamedTuple):
    """Light over reflectance, (n, c) float32, and of how many paths each is the mean, (n,) float32."""

    values: np.ndarray
    weights: np.ndarray


def _has_lobes(given: Shown) -> bool:
    return bool((given.firsts["reflectance"][: len(given.pixels), 0] > 0.0).any())


@jit
def _find_lonely(given, lonely):
    """Mark (n,) bool, as `lonely_rows` says."""
    for i in range(len(given.pixels)):
        first = given.firsts[i]
        if first.reflectance[0] > f32(0) and first.samples == u32(0):
            weight = f32(0)
            for k in range(9):
                j = _beside(given, i, k, i64(1))
                if j >= i64(0):
                    weight += f32(given.firsts[j].samples) * _likeness(given, i, j, i64(1), _BENT)
            lonely[i] = weight <= f32(0)


@jit
def _beside(given, i, k, stride):
    """The row, int64, of neighbor `k` of 9 of row `i`, -1: there is none; stride: pixels between them."""
    height, across = given.rows.shape
    x = given.pixels[i] % across + stride * i64(k % 3 - 1)
    y = given.pixels[i] // across + stride * i64(k // 3 - 1)
    if x < i64(0) or y < i64(0) or x >= across or y >= height:
        return i64(-1)
    return i64(given.rows[y, x])


@jit
def _likeness(given, i, j, stride, bent):
    """Weight, float32 in [0, 1], of row `j` to row `i`, `stride` pixels apart: 1 for one flat surface.

    bent  by what a bend is weighed
    """
    a, b = given.firsts[i], given.firsts[j]
    if a.instance != b.instance or b.reflectance[0] <= f32(0):
        return f32(0)
    bend = f32(0)
    for k in range(3):
        bend += (a.n[k] - b.n[k]) * (a.n[k] - b.n[k])
    wider = max(a.alpha, b.alpha)
    apart = (a.alpha - b.alpha) / wider
    off = dot(sub(vec3(given.positions[j]), vec3(given.positions[i])), vec3(a.ng))
    off /= (_OFF_PLANE + f32(stride)) * given.widths[i]
    straight = max(f32(1) - bent * bend / (wider * wider), f32(0))
    return straight * max(f32(1) - _ALIKE * apart * apart, f32(0)) * max(f32(1) - off * off, f32(0))


@jit
def _begin(given, smoothing, light, counter, blur, values, weights):
    """Write the variance wanted, (n,) pixels^2, light over reflectance, (n, c), and the paths, (n,)."""
    for i in shared_rows(counter, _CHUNK, len(given.pixels)):
        first = given.firsts[i]
        if first.reflectance[0] <= f32(0):
            continue
        weights[i] = f32(first.samples)
        for c in range(light.shape[1]):
            values[i, c] = light[i, c] / first.reflectance[c % 3]
        total, inverse = f32(0), f32(0)
        for stride in range(1, 3):
            for k in range(9):
                j = _beside(given, i, k, i64(stride))
                if j >= i64(0) and given.firsts[j].blur > f32(0):
                    w = _likeness(given, i, j, i64(stride), _BENT)
                    total += w
                    inverse += w / given.firsts[j].blur
        if inverse > f32(0):
            deviation = smoothing * total / inverse
            blur[i] = deviation * deviation


@jit
def _cut(given, limit, blur, whole, counter, values):
    """Lessen values, (n, c), that exceed `limit` times the mean about them: paths that few would find.

    whole  (n, c) copy of values
    Where pixels nearby may differ, as their `blur` is less than a pixel, nothing is cut.
    """
    for i in shared_rows(counter, _CHUNK, len(given.pixels)):
        own = _sum(whole, i) if given.firsts[i].samples > u32(0) else f32(0)
        if own <= f32(0) or blur[i] < f32(1):
            continue
        total, paths = f32(0), f32(0)
        for k in range(18):
            stride = i64(1 + k // 9)
            j = _beside(given, i, k % 9, stride)
            if j >= i64(0) and k % 9 != 4:
                w = f32(given.firsts[j].samples) * _likeness(given, i, j, stride, _BENT)
                paths += w
                total += w * _sum(whole, j)
        if paths > f32(0) and own * paths > limit * total:
            less = limit * total / (paths * own)
            for c in range(values.shape[1]):
                values[i, c] *= less


@jit
def _sum(values, i):
    """Sum of row `i` of (n, c) values."""
    total = f32(0)
    for c in range(values.shape[1]):
        total += values[i, c]
    return total


@jit
def _average(given, stride, bent, blur, spent, before, counter, after):
    """Write one pass over _Averaged `before` to `after`, zeros.

    bent         as of `_likeness`
    blur, spent  (n,) variance that is wanted, and that passes before have brought
    """
    whole = _KERNEL * f32(stride * stride)
    for i in shared_rows(counter, _CHUNK, len(given.pixels)):
        if given.firsts[i].reflectance[0] <= f32(0):
            continue
        wanted = min(max(blur[i] - spent[i], f32(0)), whole)
        if before.weights[i] == f32(0) and stride == i64(1):
            wanted = whole
        spent[i] += wanted
        around = _CENTER * wanted / (whole - (f32(1) - _CENTER) * wanted)
        total, paths = f32(0), f32(0)
        for k in range(9):
            j = _beside(given, i, k, stride) if k == 4 or around > f32(0) else i64(-1)
            if j < i64(0):
                continue
            w = f32((2 - abs(k % 3 - 1)) * (2 - abs(k // 3 - 1))) * f32(0.0625)
            if k != 4:
                w *= around * _likeness(given, i, j, stride, bent)
            if w <= f32(0):
                continue
            total += w
            w *= before.weights[j]
            paths += w
            for c in range(after.values.shape[1]):
                after.values[i, c] += w * before.values[j, c]
        if paths > f32(0):
            after.weights[i] = paths / total
            for c in range(after.values.shape[1]):
                after.values[i, c] /= paths


@jit
def _finish(given, values, light):
    """Write the light, (n, c), of pixels with lobes."""
    for i in range(len(given.pixels)):
        first = given.firsts[i]
        if first.reflectance[0] > f32(0):
            for c in range(light.shape[1]):
                light[i, c] = values[i, c] * first.reflectance[c % 3]
