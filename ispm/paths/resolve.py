"""The light of narrow lobes, which few paths from each pixel find, averaged over pixels nearby.

Passes of 3 x 3 pixels, 1 to 16 apart, each as strong as brings the sum of their variances to what a
pixel's own lobe allows: its width, and how far what it reflects lies, tell how little is seen of it. Two
pixels give each other the same share, the less of what either wants, so that no light is gained or lost.
Light is divided by what the surface reflects before, so that textures stay sharp. What stands out far, as a
lamp's image in a second lobe does that one path found, is spread as far as passes go.
Source: edge-avoiding a-trous wavelets, Dammertz et al., HPG 2010.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import NamedTuple

import numpy as np

from ispm.kernels.share import run_shared, shared_rows
from ispm.kernels.simd import address, aligned, ldf, splat8, stf, vfma, vload8, vmul, vstore8
from ispm.lights.nee import greatest
from ispm.optics.jit import jit
from ispm.optics.records import NO_HIT
from ispm.optics.vector import dot, sub, vec3
from ispm.paths.branch import STRONG
from ispm.paths.vertices import SEVERAL

f32, i64, u32 = np.float32, np.int64, np.uint32

_STRIDES = (1, 2, 4, 8, 16)  # pixels
_HALO = sum(_STRIDES) + 2  # pixels above and below that tell in what becomes of one: passes', and `_cut`'s
_BAND = 1 << 18  # pixels that are averaged at a time, about
_CHUNK = 256
_BENT = f32(4)  # over alpha^2: what the square of the difference of normals is weighed by
_LENIENT = f32(0.25)  # likewise for what stands out
_ALIKE = f32(4)  # likewise that of two alphas, over the larger one
_OFF_PLANE = f32(2)  # pixels, and as many as the stride, off the plane of a surface at which another begins
_OUTLIER = 4.0  # times the mean about a pixel, above which its light goes farther: in the first pass
_CLOSE = f32(1)  # pixels of width, below which a pixel wants paths of its own
_COMPANY = f32(2)  # pixels that are alike of the eight about one, below which it does, too
_KERNEL = f32(0.5)  # variance of a whole pass, squares of its stride


_LANES = 16  # floats of a pixel's light: a line of cache, whose last is the number of paths
_PATHS = _LANES - 1

# Of the lobe that a pixel shows: normals, alpha, pixels per m there, position in m, and the instance, NO_HIT
# without a lobe. Less than a line of cache: each is compared with its neighbors many times.
_LOBE = np.dtype([
    ("n", "<f4", 3), ("alpha", "<f4"), ("ng", "<f4", 3), ("density", "<f4"), ("position", "<f4", 3),
    ("instance", "<u4"),
])  # fmt: skip


class Shown(NamedTuple):
    """What is shown where light is to be averaged.

    pixels  (n,) uint32 numbers y width + x, sorted
    rows    (h, w) int32, the row of each pixel of the picture, -1 where it has none
    firsts  (n,) FIRST_VERTEX, what they show
    lobes   (n,) _LOBE of these
    """

    pixels: np.ndarray
    rows: np.ndarray
    firsts: np.ndarray
    lobes: np.ndarray


def shown(
    pixels: np.ndarray,
    across: int,
    firsts: np.ndarray,
    positions: np.ndarray,
    widths: np.ndarray,
    threads: int,
) -> Shown:
    """Return what n pixels show.

    pixels     (n,) numbers y width + x, sorted;  across  pixels in a row of the picture
    firsts     (n,) FIRST_VERTEX, of which numbers of paths and `blur` may change afterwards
    positions  (n, 3) float32 m;  widths  (n,) float32 m, of a pixel there
    """
    pixels, lobes = pixels.astype(np.uint32), np.empty(len(pixels), _LOBE)
    run_shared(lambda counter: _describe(firsts, positions, widths, counter, lobes), threads)
    return Shown(pixels, _rows_of(pixels, across), firsts, lobes)


def lonely_rows(given: Shown) -> np.ndarray:
    """Return the rows of pixels from whose lobe no path went out, nor from any beside them, sorted."""
    lonely = np.zeros(len(given.pixels), np.bool_)
    if _has_lobes(given):
        _find_lonely(given, lonely)
    return np.flatnonzero(lonely)


def contact_rows(given: Shown, most: float, threads: int) -> np.ndarray:
    """Return the rows of pixels with one path or none that are averaged over less than a pixel, or whose
    strong lobe hardly any beside them is like, as they curve; of more than `most` the former alone, or none.
    Sorted.

    Their neighbors' paths tell, not their own: else what one finds close by would be drawn anew, and what it
    finds far off would stay.
    """
    close, alone = (np.zeros(len(given.pixels), np.bool_) for _ in range(2))
    if _has_lobes(given):
        run_shared(lambda counter: _find_contacts(given, counter, close, alone), threads)
    either = close | alone
    chosen = either if np.count_nonzero(either) <= most else close
    return np.flatnonzero(chosen) if np.count_nonzero(chosen) <= most else np.zeros(0, np.int64)


def resolve_lobes(light: np.ndarray, given: Shown, smoothing: float, threads: int) -> None:
    """Average the light of pixels that show narrow lobes, (n, c) float32, c in threes up to 15, in place.

    smoothing  factor on the deviation
    Large pictures are averaged in bands, which takes less memory.
    """
    if not _has_lobes(given):
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
    return Shown(pixels, _rows_of(pixels, across), given.firsts[part], given.lobes[part])


def _rows_of(pixels: np.ndarray, across: int) -> np.ndarray:
    """`rows` of a Shown."""
    rows = np.full((int(pixels[-1]) // across + 1 if len(pixels) else 1, across), -1, np.int32)
    rows.reshape(-1)[pixels] = np.arange(len(pixels), dtype=np.int32)
    return rows


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
    spent = 0.0
    for stride in _STRIDES:
        places = tuple(map(address, (*before, *after)))
        told = given, i64(stride), blur, f32(spent), len(excess) > 0
        run_shared(partial(_average, *told, places), threads)
        spent += float(_KERNEL) * stride**2
        before, after = after, before
    return before


def _has_lobes(given: Shown) -> bool:
    return bool((given.lobes["instance"] != NO_HIT).any())


@jit
def _describe(firsts, positions, widths, counter, lobes):
    """Write (n,) _LOBE of (n,) FIRST_VERTEX; positions, widths: as of `shown`."""
    for i in shared_rows(counter, _CHUNK, len(lobes)):
        first, lobe = firsts[i], lobes[i]
        for c in range(3):
            lobe.n[c], lobe.ng[c], lobe.position[c] = first.n[c], first.ng[c], positions[i, c]
        lobe.alpha, lobe.density = first.alpha, f32(1) / widths[i]
        lobe.instance = first.instance if first.reflectance[0] > f32(0) else u32(NO_HIT)


@jit
def _find_lonely(given, lonely):
    """Mark (n,) bool, as `lonely_rows` says."""
    firsts = given.firsts
    for i in range(len(given.pixels)):
        if given.lobes[i].instance != u32(NO_HIT) and firsts[i].samples == u32(0):
            weight = f32(0)
            for k in range(9):
                j = _beside(given, i, k, i64(1))
                if j >= i64(0) and firsts[j].samples > u32(0):
                    weight += f32(firsts[j].samples) * _likeness(given, i, j, i64(1))
            lonely[i] = weight <= f32(0)


@jit
def _find_contacts(given, counter, close, alone):
    """Mark (n,) bool, those averaged over less than a pixel, and strong lobes that hardly any is like."""
    for i in shared_rows(counter, _CHUNK, len(given.pixels)):
        if given.lobes[i].instance != u32(NO_HIT) and given.firsts[i].samples < u32(2):
            width = _width_about(given, i, False)
            close[i] = width > f32(0) and width < _CLOSE
            alone[i] = greatest(given.firsts[i].reflectance) >= STRONG and _alike_about(given, i) < _COMPANY


@jit
def _alike_about(given, i):
    """How many of the eight pixels about a row are alike, float32: 8 on a flat surface."""
    total = f32(0)
    for k in range(9):
        j = _beside(given, i, k, i64(1)) if k != 4 else i64(-1)
        total += _likeness(given, i, j, i64(1)) if j >= i64(0) else f32(0)
    return total


@jit
def _width_about(given, i, own):
    """Harmonic mean of how far the light about a row may be averaged, pixels, 0: there is no path; own:
    whether it counts itself.

    That is `beyond` of paths that met the same instance first, and `blur` of others, for an edge is near.
    """
    firsts = given.firsts
    total, inverse, one = f32(0), f32(0), i64(-1)
    for stride in range(1, 4):
        # one of 2 x 2 pixels may have a path, and all beside this one may be lost in the surface
        for step in range(9 if stride < 3 or inverse == f32(0) else 0):
            k = (step + 4) % 9  # the middle first
            j = _beside(given, i, k, i64(stride))
            if j >= i64(0) and firsts[j].blur > f32(0) and (own or k != 4):
                w = _likeness(given, i, j, i64(stride))
                one = j if one < i64(0) and w > f32(0) else one
                if w > f32(0):
                    total += w
                    alike = firsts[j].met == firsts[one].met and firsts[j].met != u32(SEVERAL)
                    inverse += w / (firsts[j].beyond if alike else firsts[j].blur)
    return total / inverse if inverse > f32(0) else f32(0)


@jit
def _beside(given, i, k, stride):
    """The row, int64, of neighbor `k` of 9 of row `i`, -1: there is none; stride: pixels between them."""
    height, across = given.rows.shape
    pixel = given.pixels[i]
    x = i64(pixel % u32(across)) + stride * i64(k % 3 - 1)
    y = i64(pixel // u32(across)) + stride * i64(k // 3 - 1)
    if x < i64(0) or y < i64(0) or x >= across or y >= height:
        return i64(-1)
    return i64(given.rows[y, x])


@jit
def _likeness(given, i, j, stride):
    """Weight, float32 in [0, 1], of two rows to each other, `stride` pixels apart: 1 on a flat surface."""
    alike, bend = _compared(given, i, j, stride)
    return alike * max(f32(1) - _BENT * bend, f32(0))


@jit
def _compared(given, i, j, stride):
    """The weight of two rows to each other but for how their normals differ, and the square of that over
    alpha^2, float32."""
    a, b = given.lobes[i], given.lobes[j]
    if a.instance != b.instance:
        return f32(0), f32(0)
    bend = f32(0)
    for k in range(3):
        bend += (a.n[k] - b.n[k]) * (a.n[k] - b.n[k])
    sharp = f32(1) / max(a.alpha, b.alpha)
    apart = (a.alpha - b.alpha) * sharp
    way = sub(vec3(b.position), vec3(a.position))
    off = max(abs(dot(way, vec3(a.ng))) * a.density, abs(dot(way, vec3(b.ng))) * b.density)
    off *= f32(1) / (_OFF_PLANE + f32(stride))
    alike = max(f32(1) - _ALIKE * apart * apart, f32(0)) * max(f32(1) - off * off, f32(0))
    return alike, bend * sharp * sharp


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
        width = _width_about(given, i, True)
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
            j = _beside(given, i, k % 9, stride)
            if j >= i64(0) and k % 9 != 4:
                w = values[j, _PATHS] * _likeness(given, i, j, stride)
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
def _average(given, stride, blur, spent, stands_out, places, counter):
    """Write one pass over values and, where there are any, over what stands out.

    blur    (n,) variance that is wanted;  spent  what passes before have brought where it was wanted
    places  addresses of the values and of what stands out, before and after
    The middle keeps what it does not give away. A pixel without paths takes all that neighbors have.
    """
    before, outliers, after, outliers_after = places
    whole = _KERNEL * f32(stride * stride)
    for i in shared_rows(counter, _CHUNK, len(given.pixels)):
        if given.lobes[i].instance == u32(NO_HIT):
            continue
        empty = ldf(before, i * _LANES + _PATHS) == f32(0)
        wanted = whole if empty else min(max(blur[i] - spent, f32(0)), whole)
        rest, paths, low, high = f32(1), f32(0), splat8(f32(0)), splat8(f32(0))
        rest_out, paths_out, low_out, high_out = f32(1), f32(0), splat8(f32(0)), splat8(f32(0))
        for step in range(9):
            k = (step + 5) % 9  # the middle last
            j = _beside(given, i, k, stride) if k == 4 or wanted > f32(0) or stands_out else i64(-1)
            if j < i64(0):
                continue
            w, w_out = rest, rest_out
            if k != 4:
                both = wanted if empty else min(max(blur[j] - spent, f32(0)), wanted)
                alike, bend = _compared(given, i, j, stride)
                alike *= f32((2 - abs(k % 3 - 1)) * (2 - abs(k // 3 - 1))) * f32(0.0625)
                w = alike * max(f32(1) - _BENT * bend, f32(0)) * both / whole
                w_out = alike * max(f32(1) - _LENIENT * bend, f32(0))
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
