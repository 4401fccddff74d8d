"""The light of narrow lobes, which few paths from each pixel find, averaged over pixels nearby.

Passes of 3 x 3 pixels, 1 to 16 apart, each as strong as brings the sum of their variances to what a
pixel's own lobe allows: its width, and how far what it reflects lies, tell how little is seen of it. Two
pixels give each other the same share, the less of what either wants, so that no light is gained or lost.
Light is divided by what the surface reflects before, so that textures stay sharp. What stands out far, as a
lamp's image in a second lobe does that one path found, is spread as far as passes go.
Source: edge-avoiding a-trous wavelets, Dammertz et al., HPG 2010.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ispm.kernels.share import run_shared, shared_rows
from ispm.kernels.simd import address, aligned, ldf, splat8, stf, vfma, vload8, vmul, vstore8
from ispm.optics.jit import jit
from ispm.optics.records import NO_HIT
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


_LANES = 16  # floats of a pixel's light: a line of cache, whose last is the number of paths
_PATHS = _LANES - 1

# Of the lobe that a pixel shows: normals, alpha, position and a pixel's width there in m, and the instance,
# NO_HIT without a lobe. Less than a line of cache: each is compared with its neighbours many times.
_LOBE = np.dtype([
    ("n", "<f4", 3), ("alpha", "<f4"), ("ng", "<f4", 3), ("width", "<f4"), ("position", "<f4", 3),
    ("instance", "<u4"),
])  # fmt: skip


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
        _find_lonely(_picture(given), np.ascontiguousarray(given.firsts["samples"]), lonely)
    return np.flatnonzero(lonely)


def resolve_lobes(light: np.ndarray, given: Shown, smoothing: float, threads: int) -> None:
    """Average the light of pixels that show narrow lobes, (n, c) float32, c in threes up to 15, in place.

    smoothing  factor on the deviation
    """
    if not _has_lobes(given):
        return
    picture, firsts = _picture(given), given.firsts
    count = len(picture.pixels)
    blur, values, excess = np.zeros(count, np.float32), _lanes(count), _lanes(count)
    run_shared(lambda counter: _begin(picture, firsts, f32(smoothing), light, counter, blur, values), threads)
    limit = f32(_OUTLIER / max(smoothing**6, 1e-9))  # grows with the passes' number
    excess[:] = values
    run_shared(lambda counter: _cut(picture, limit, blur, excess, counter, values), threads)
    excess[:, :_PATHS] -= values[:, :_PATHS]
    stands_out = excess[:, :_PATHS].any()
    values = _averaged(picture, values, blur, _BENT, threads)
    if stands_out:
        values += _averaged(picture, excess, np.full_like(blur, np.inf), _LENIENT, threads)
    _finish(picture, firsts, values, light)


class _Picture(NamedTuple):
    """Pixels and rows of a Shown, and (n,) _LOBE."""

    pixels: np.ndarray
    rows: np.ndarray
    lobes: np.ndarray


def _picture(given: Shown) -> _Picture:
    lobes, firsts = np.empty(len(given.pixels), _LOBE), given.firsts[: len(given.pixels)]
    for name in ("n", "ng", "alpha"):
        lobes[name] = firsts[name]
    lobes["position"], lobes["width"] = given.positions, given.widths
    lobes["instance"] = np.where(firsts["reflectance"][:, 0] > 0.0, firsts["instance"], np.uint32(NO_HIT))
    return _Picture(given.pixels, given.rows, lobes)


def _lanes(count: int) -> np.ndarray:
    """(n, _LANES) float32 zeros, each row a line of cache: light over reflectance, and the paths of which it
    is the mean."""
    return aligned(count * _LANES).reshape(count, _LANES)


def _averaged(
    picture: _Picture, values: np.ndarray, blur: np.ndarray, bent: np.float32, threads: int
) -> np.ndarray:
    """Return values, (n, _LANES), averaged to a variance, (n,) pixels^2, as far as passes go; overwrites
    them."""
    after, spent = _lanes(len(values)), 0.0
    for stride in _STRIDES:
        after[:] = 0.0
        run_shared(_one_pass(picture, stride, bent, blur, spent, values, after), threads)
        spent += float(_KERNEL) * stride**2
        values, after = after, values
    return values


def _one_pass(
    picture: _Picture,
    stride: int,
    bent: np.float32,
    blur: np.ndarray,
    spent: float,
    before: np.ndarray,
    after: np.ndarray,
) -> Callable[[np.uint64], None]:
    """Return what threads call to make one pass."""
    places = address(before), address(after)
    return lambda counter: _average(picture, i64(stride), bent, blur, f32(spent), counter, *places)


def _has_lobes(given: Shown) -> bool:
    return bool((given.firsts["reflectance"][: len(given.pixels), 0] > 0.0).any())


@jit
def _find_lonely(picture, samples, lonely):
    """Mark (n,) bool, as `lonely_rows` says; samples: (n,) uint32 or more, paths from each."""
    for i in range(len(picture.pixels)):
        if picture.lobes[i].instance != u32(NO_HIT) and samples[i] == u32(0):
            weight = f32(0)
            for k in range(9):
                j = _beside(picture, i, k, i64(1))
                if j >= i64(0) and samples[j] > u32(0):
                    weight += f32(samples[j]) * _likeness(picture, i, j, i64(1), _BENT)
            lonely[i] = weight <= f32(0)


@jit
def _beside(picture, i, k, stride):
    """The row, int64, of neighbor `k` of 9 of row `i`, -1: there is none; stride: pixels between them."""
    height, across = picture.rows.shape
    x = picture.pixels[i] % across + stride * i64(k % 3 - 1)
    y = picture.pixels[i] // across + stride * i64(k // 3 - 1)
    if x < i64(0) or y < i64(0) or x >= across or y >= height:
        return i64(-1)
    return i64(picture.rows[y, x])


@jit
def _likeness(picture, i, j, stride, bent):
    """Weight, float32 in [0, 1], of two rows to each other, `stride` pixels apart: 1 on a flat surface.

    bent  by what a bend is weighed
    """
    a, b = picture.lobes[i], picture.lobes[j]
    if a.instance != b.instance:
        return f32(0)
    bend = f32(0)
    for k in range(3):
        bend += (a.n[k] - b.n[k]) * (a.n[k] - b.n[k])
    wider = max(a.alpha, b.alpha)
    apart = (a.alpha - b.alpha) / wider
    way = sub(vec3(b.position), vec3(a.position))
    off = max(abs(dot(way, vec3(a.ng))) / a.width, abs(dot(way, vec3(b.ng))) / b.width)
    off /= _OFF_PLANE + f32(stride)
    straight = max(f32(1) - bent * bend / (wider * wider), f32(0))
    return straight * max(f32(1) - _ALIKE * apart * apart, f32(0)) * max(f32(1) - off * off, f32(0))


@jit
def _begin(picture, firsts, smoothing, light, counter, blur, values):
    """Write the variance wanted, (n,) pixels^2, and (n, _LANES) values; firsts: (n,) FIRST_VERTEX or more."""
    for i in shared_rows(counter, _CHUNK, len(picture.pixels)):
        if picture.lobes[i].instance == u32(NO_HIT):
            continue
        first = firsts[i]
        values[i, _PATHS] = f32(first.samples)
        for c in range(light.shape[1]):
            values[i, c] = light[i, c] / first.reflectance[c % 3]
        total, inverse = f32(0), f32(0)
        for stride in range(1, 3):
            for k in range(9):
                j = _beside(picture, i, k, i64(stride))
                if j >= i64(0) and firsts[j].blur > f32(0):
                    w = _likeness(picture, i, j, i64(stride), _BENT)
                    total += w
                    inverse += w / firsts[j].blur
        deviation = smoothing * (total / inverse if inverse > f32(0) else max(-first.blur, f32(0)))
        blur[i] = deviation * deviation


@jit
def _cut(picture, limit, blur, whole, counter, values):
    """Lessen values, (n, _LANES), that exceed `limit` times the mean about them: paths that few would find.

    whole  (n, _LANES) copy of values
    Where pixels nearby may differ, as their `blur` is less than a pixel, nothing is cut.
    """
    for i in shared_rows(counter, _CHUNK, len(picture.pixels)):
        own = _sum(whole, i) if whole[i, _PATHS] > f32(0) else f32(0)
        if own <= f32(0) or blur[i] < f32(1):
            continue
        total, paths = f32(0), f32(0)
        for k in range(18):
            stride = i64(1 + k // 9)
            j = _beside(picture, i, k % 9, stride)
            if j >= i64(0) and k % 9 != 4:
                w = whole[j, _PATHS] * _likeness(picture, i, j, stride, _BENT)
                paths += w
                total += w * _sum(whole, j)
        if paths > f32(0) and own * paths > limit * total:
            less = limit * total / (paths * own)
            for c in range(_PATHS):
                values[i, c] *= less


@jit
def _sum(values, i):
    """Sum of the light of row `i` of (n, _LANES) values."""
    total = f32(0)
    for c in range(_PATHS):
        total += values[i, c]
    return total


@jit
def _average(picture, stride, bent, blur, spent, counter, before, after):
    """Write one pass over the values at the address `before` to those, zeros, at `after`.

    bent   as of `_likeness`
    blur   (n,) variance that is wanted;  spent  what passes before have brought where it was wanted
    The middle keeps what it does not give away. A pixel without paths takes all that neighbors have.
    """
    whole = _KERNEL * f32(stride * stride)
    for i in shared_rows(counter, _CHUNK, len(picture.pixels)):
        if picture.lobes[i].instance == u32(NO_HIT):
            continue
        empty = ldf(before, i * _LANES + _PATHS) == f32(0)
        wanted = whole if empty else min(max(blur[i] - spent, f32(0)), whole)
        rest, paths, low, high = f32(1), f32(0), splat8(f32(0)), splat8(f32(0))
        for step in range(9):
            k = (step + 5) % 9  # the middle last
            j = _beside(picture, i, k, stride) if k == 4 or wanted > f32(0) else i64(-1)
            if j < i64(0):
                continue
            w = rest
            if k != 4:
                both = wanted if empty else min(max(blur[j] - spent, f32(0)), wanted)
                w = f32((2 - abs(k % 3 - 1)) * (2 - abs(k // 3 - 1))) * f32(0.0625) * both / whole
                w *= _likeness(picture, i, j, stride, bent)
                rest -= w
            w *= ldf(before, j * _LANES + _PATHS)
            if w <= f32(0):
                continue
            paths += w
            low = vfma(vload8(before, j * _LANES), splat8(w), low)
            high = vfma(vload8(before, j * _LANES + 8), splat8(w), high)
        if paths > f32(0):
            share = splat8(f32(1) / paths)
            vstore8(after, i * _LANES, vmul(low, share))
            vstore8(after, i * _LANES + 8, vmul(high, share))
            stf(after, i * _LANES + _PATHS, f32(1))


@jit
def _finish(picture, firsts, values, light):
    """Write the light, (n, c), of pixels with lobes."""
    for i in range(len(picture.pixels)):
        if picture.lobes[i].instance != u32(NO_HIT):
            for c in range(light.shape[1]):
                light[i, c] = values[i, c] * firsts[i].reflectance[c % 3]
