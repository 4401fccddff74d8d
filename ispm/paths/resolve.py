"""The light of narrow lobes, which few paths from each pixel find, averaged over pixels nearby.

Passes of 3 x 3 pixels, 1 to 16 apart, each as strong as brings the sum of their variances to what a
pixel's own lobe allows: its width, and how far what it reflects lies, tell how little is seen of it. What is
reflected at grazing angles is drawn out, and averaged less across that. Two pixels give each other the same
share, the less of what either wants, so that no light is gained or lost.
Light is divided by what the surface reflects before, so that textures stay sharp. What stands out far, as a
lamp's image in a second lobe does that one path found, is spread as far as passes go.
Source: edge-avoiding a-trous wavelets, Dammertz et al., HPG 2010.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from ispm.kernels.share import run_shared, shared_rows
from ispm.kernels.simd import address, aligned, ldf, splat8, stf, vfma, vload8, vmul, vstore8
from ispm.optics.jit import jit
from ispm.optics.records import NO_HIT
from ispm.paths.shown import BENT, Shown, beside, compared, has_lobes, likeness, picture_rows, width_about

f32, i64, u32 = np.float32, np.int64, np.uint32

_STRIDES = (1, 2, 4, 8, 16)  # pixels
_HALO = sum(_STRIDES) + 2  # pixels above and below that tell in what becomes of one: passes', and `_cut`'s
_BAND = 1 << 18  # pixels that are averaged at a time, about
_CHUNK = 256
_LENIENT = f32(0.25)  # in place of BENT, for what stands out
_OUTLIER = 4.0  # times the mean about a pixel, above which its light goes farther: in the first pass
_ACROSS = f32(2)  # times a lobe's share of the variance across: that is a tenth wider, with less grain
_KERNEL = f32(0.5)  # variance of a whole pass, squares of its stride
_WAY_TO = (2, 1, 3, 0, -1, 0, 3, 1, 2)  # columns of `_weigh` for each of 3 x 3 pixels

_LANES = 16  # floats of a pixel's light: a line of cache, whose last is the number of paths
_PATHS = _LANES - 1


def resolve_lobes(light: np.ndarray, given: Shown, smoothing: float, threads: int) -> None:
    """Average the light of pixels that show narrow lobes, (n, c) float32, c in threes up to 15, in place.

    smoothing  factor on the deviation
    Large pictures are averaged in bands, which takes less memory.
    """
    if not has_lobes(given):
        return
    if len(given.pixels) <= _BAND:
        _resolve(light, given, smoothing, threads)
        return
    before = light[:0]
    for first, last in _bands(given):
        inner, outer = _rows_between(given, first, last), _rows_between(given, first - _HALO, last + _HALO)
        band = np.concatenate([before, light[inner.start : outer.stop]])
        _resolve(band, _between(given, max(first - _HALO, 0), outer), smoothing, threads)
        before = light[_rows_between(given, last - _HALO, last)].copy()  # as the next band wants it
        light[inner] = band[inner.start - outer.start :][: inner.stop - inner.start]


def _bands(given: Shown) -> Iterator[tuple[int, int]]:
    """Yield the first row of pixels of each band, and the last and one."""
    high = given.rows.shape[0]
    each = max(-(-high * _BAND // len(given.pixels)), _HALO)
    for first in range(0, high, each):
        yield first, min(first + each, high)


def _rows_between(given: Shown, first: int, last: int) -> slice:
    """The rows of what is shown from one row of pixels to before another."""
    ends = np.array([first, last]) * given.rows.shape[1]
    start, stop = np.searchsorted(given.pixels, np.maximum(ends, 0).astype(given.pixels.dtype))
    return slice(int(start), int(stop))


def _between(given: Shown, first: int, part: slice) -> Shown:
    """Some rows of what is shown, as if the picture began at the row of pixels `first`."""
    across = given.rows.shape[1]
    pixels = given.pixels[part] - np.uint32(first * across)
    rows = picture_rows(pixels, across)
    return Shown(pixels, rows, given.firsts[part], given.lobes[part], given.drawn[part])


def _resolve(light: np.ndarray, given: Shown, smoothing: float, threads: int) -> None:
    """`resolve_lobes` of all at once."""
    count, limit = len(given.pixels), f32(_OUTLIER / max(smoothing**6, 1e-9))  # grows with the passes' number
    blur, kept, values = np.zeros(count, np.float32), np.ones(count, np.float32), _lanes(count)
    run_shared(lambda counter: _begin(given, f32(smoothing), light, counter, blur, values), threads)
    run_shared(lambda counter: _cut(given, limit, blur, values, counter, kept), threads)
    excess = _lanes(count if (kept < 1.0).any() else 0)
    run_shared(lambda counter: _split(kept, counter, values, excess), threads)
    values, excess = _averaged(given, values, excess, blur, threads)
    run_shared(lambda counter: _finish(given, values, excess, counter, light), threads)


def _lanes(count: int) -> np.ndarray:
    """(n, _LANES) float32 zeros, each row a line of cache: light over reflectance, and the paths of which it
    is the mean."""
    return aligned(count * _LANES).reshape(count, _LANES)


def _averaged(
    given: Shown, values: np.ndarray, excess: np.ndarray, blur: np.ndarray, threads: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return values, (n, _LANES), averaged to a variance, (n,) pixels^2, and `excess`, likewise or without
    rows, averaged as far as passes go; overwrites both."""
    before, after = (values, excess), (_lanes(len(values)), _lanes(len(excess)))
    spent, farthest = 0.0, np.full(len(excess), float(_KERNEL) * sum(s * s for s in _STRIDES), np.float32)
    weights, outer = (np.empty((len(rows), 4), np.float32) for rows in (values, excess))
    for stride in _STRIDES:
        places = tuple(map(address, (*before, *after)))
        whole = float(_KERNEL) * stride**2
        for wanted, found, across in ((blur, weights, _ACROSS), (farthest, outer, f32(1))):
            run_shared(partial(_weigh, given, wanted, across, f32(spent), f32(whole), found), threads)
        run_shared(partial(_average, given, i64(stride), weights, outer, places), threads)
        spent += whole
        before, after = after, before
    return before


@jit
def _begin(given, smoothing, light, counter, blur, values):
    """Write the variance wanted, (n,) pixels^2, and (n, _LANES) values."""
    firsts = given.firsts
    for i in shared_rows(counter, _CHUNK, len(given.pixels)):
        if given.lobes[i].instance == u32(NO_HIT):
            continue
        first = firsts[i]
        values[i, _PATHS] = f32(first.samples)
        for c in range(light.shape[1]):
            values[i, c] = light[i, c] / first.reflectance[c % 3]
        width = width_about(given, i, True)
        deviation = smoothing * (width if width > f32(0) else max(-first.blur, f32(0)))
        blur[i] = deviation * deviation


@jit
def _cut(given, limit, blur, values, counter, kept):
    """Write what is kept, (n,) shares, of values, (n, _LANES), that exceed `limit` times the mean about them:
    paths that few would find.

    Where pixels nearby may differ, as their `blur` is less than a pixel, all is kept.
    """
    for i in shared_rows(counter, _CHUNK, len(given.pixels)):
        own = _sum(values, i) if values[i, _PATHS] > f32(0) else f32(0)
        if own <= f32(0) or blur[i] < f32(1):
            continue
        total, paths = f32(0), f32(0)
        for k in range(18):
            stride = i64(1 + k // 9)
            j = beside(given, i, k % 9, stride)
            if j >= i64(0) and k % 9 != 4:
                w = values[j, _PATHS] * likeness(given, i, j, stride)
                paths += w
                total += w * _sum(values, j)
        if paths > f32(0) and own * paths > limit * total:
            kept[i] = limit * total / (paths * own)


@jit
def _sum(values, i):
    """Sum of the light of row `i` of (n, _LANES) values."""
    total = f32(0)
    for c in range(_PATHS):
        total += values[i, c]
    return total


@jit
def _split(kept, counter, values, excess):
    """Leave values, (n, _LANES), what is kept, (n,) shares, and write the rest, if `excess` has rows."""
    for i in shared_rows(counter, _CHUNK, len(excess)):
        for c in range(_PATHS):
            excess[i, c] = (f32(1) - kept[i]) * values[i, c]
            values[i, c] *= kept[i]
        excess[i, _PATHS] = values[i, _PATHS]


@jit
def _weigh(given, blur, across, spent, whole, weights, counter):
    """Write (n, 4) the weights of neighbors right, below, right below and left below in a pass.

    blur    (n,) variance that is wanted along the way that a lobe is drawn out
    across  times its share of that across it, but no more
    spent   what passes before have brought where it was wanted;  whole  what this one may
    Steps to these neighbors, by their weights, have that ellipse as their covariance. One that lies aslant of
    all four ways needs some width: each pass keeps that, and takes in less along it where there is none.
    """
    scale = f32(0.25) / whole
    for i in shared_rows(counter, _CHUNK, len(blur)):
        right, down, cosine = given.drawn[i]
        low, high = min(abs(right), abs(down)), max(abs(right), abs(down))
        least = low * (high - low) / (high * (high + low)) if high > f32(0) else f32(0)
        narrow = min(across * cosine * cosine, f32(1)) * blur[i]
        along = min(blur[i], narrow / least) if least > f32(0) else blur[i]
        a = min(max(along - spent, f32(0)), whole)
        rest = max(narrow - least * along - (f32(1) - least) * spent, f32(0))
        b = least * a + min(rest, whole - least * a)
        xx, yy = scale * (a * right * right + b * down * down), scale * (a * down * down + b * right * right)
        xy = scale * (a - b) * right * down
        corners = max(f32(0.5) * min(xx, yy), abs(xy))
        weights[i, 0], weights[i, 1] = max(xx - corners, f32(0)), max(yy - corners, f32(0))
        weights[i, 2], weights[i, 3] = f32(0.5) * (corners + xy), f32(0.5) * (corners - xy)


@jit
def _average(given, stride, weights, outer, places, counter):
    """Write one pass over values and, where there are any, over what stands out.

    weights  (n, 4) as of `_weigh`, of half of all neighbors, for those opposite have the same
    outer    likewise of what stands out, or without rows
    places   addresses of the values and of what stands out, before and after
    The middle keeps what it does not give away. A pixel without paths takes all that neighbors have.
    """
    before, outliers, after, outliers_after = places
    stands_out = len(outer) > 0
    for i in shared_rows(counter, _CHUNK, len(given.pixels)):
        if given.lobes[i].instance == u32(NO_HIT):
            continue
        empty = ldf(before, i * _LANES + _PATHS) == f32(0)
        wanted = empty or weights[i, 0] + weights[i, 1] + weights[i, 2] + weights[i, 3] > f32(0)
        rest, paths, low, high = f32(1), f32(0), splat8(f32(0)), splat8(f32(0))
        rest_out, paths_out, low_out, high_out = f32(1), f32(0), splat8(f32(0)), splat8(f32(0))
        for step in range(9):
            k = (step + 5) % 9  # the middle last
            j = beside(given, i, k, stride) if k == 4 or wanted or stands_out else i64(-1)
            if j < i64(0):
                continue
            w, w_out = rest, rest_out
            if k != 4:
                way = _WAY_TO[k]
                both = min(weights[i, way], weights[j, way])
                if empty:
                    both = f32(1 / 8) if way < 2 else f32(1 / 16)
                alike, bend = compared(given, i, j, stride)
                w = alike * max(f32(1) - BENT * bend, f32(0)) * both
                if stands_out:
                    w_out = min(outer[i, way], outer[j, way]) * alike * max(f32(1) - _LENIENT * bend, f32(0))
                rest, rest_out = rest - w, rest_out - w_out
            w *= ldf(before, j * _LANES + _PATHS)
            if w > f32(0):
                paths += w
                low = vfma(vload8(before, j * _LANES), splat8(w), low)
                high = vfma(vload8(before, j * _LANES + 8), splat8(w), high)
            if stands_out:
                w_out *= ldf(outliers, j * _LANES + _PATHS)
                if w_out > f32(0):
                    paths_out += w_out
                    low_out = vfma(vload8(outliers, j * _LANES), splat8(w_out), low_out)
                    high_out = vfma(vload8(outliers, j * _LANES + 8), splat8(w_out), high_out)
        _store(after, i, paths, low, high)
        if stands_out:
            _store(outliers_after, i, paths_out, low_out, high_out)


@jit
def _store(place, i, paths, low, high):
    """Write row i at an address: the sum of lines over the weight of their paths, as of one path."""
    share = splat8(f32(1) / paths if paths > f32(0) else f32(0))
    vstore8(place, i * _LANES, vmul(low, share))
    vstore8(place, i * _LANES + 8, vmul(high, share))
    stf(place, i * _LANES + _PATHS, f32(1) if paths > f32(0) else f32(0))


@jit
def _finish(given, values, excess, counter, light):
    """Write the light, (n, c), of pixels with lobes: values and, where there is any, what stood out."""
    for i in shared_rows(counter, _CHUNK, len(given.pixels)):
        if given.lobes[i].instance != u32(NO_HIT):
            for c in range(light.shape[1]):
                value = values[i, c] + excess[i, c] if len(excess) > 0 else values[i, c]
                light[i, c] = value * given.firsts[i].reflectance[c % 3]
