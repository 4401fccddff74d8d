"""What pixels with narrow lobes show: which beside one are alike, and which want paths of their own."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ispm.kernels.share import run_shared, shared_rows
from ispm.lights.nee import greatest
from ispm.optics.jit import jit
from ispm.optics.records import NO_HIT
from ispm.optics.vector import dot, sub, vec3
from ispm.paths.branch import STRONG
from ispm.paths.pixel_rays import Screen
from ispm.paths.vertices import SEVERAL

f32, i64, u32 = np.float32, np.int64, np.uint32

_CHUNK = 256
BENT = f32(4)  # over alpha^2: what the square of the difference of normals is weighed by
_ALIKE = f32(4)  # likewise that of two alphas, over the larger one
_OFF_PLANE = f32(2)  # pixels, and as many as the stride, off the plane of a surface at which another begins
_CLOSE = f32(1)  # pixels of width, below which a pixel wants paths of its own
_COMPANY = f32(2)  # pixels that are alike of the eight about one, below which it does, too

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
    drawn   (n, 3) float32: how what a lobe reflects is drawn out, along which way right and down, unit, and
            the cosine by which it is narrower across that
    """

    pixels: np.ndarray
    rows: np.ndarray
    firsts: np.ndarray
    lobes: np.ndarray
    drawn: np.ndarray


def shown(
    pixels: np.ndarray,
    screen: Screen,
    firsts: np.ndarray,
    positions: np.ndarray,
    directions: np.ndarray,
    widths: np.ndarray,
    threads: int,
) -> Shown:
    """Return what n pixels show.

    pixels      (n,) numbers y width + x, sorted
    firsts      (n,) FIRST_VERTEX, of which numbers of paths and `blur` may change afterwards
    positions   (n, 3) float32 m;  directions  (n, 3) float32, unit, of the rays that end there
    widths      (n,) float32 m, of a pixel there
    """
    pixels, lobes = pixels.astype(np.uint32), np.empty(len(pixels), _LOBE)
    drawn = np.zeros((len(pixels), 3), np.float32)
    told = firsts, positions, directions, widths, screen
    run_shared(lambda counter: _describe(*told, counter, lobes, drawn), threads)
    rows = picture_rows(pixels, int(screen.columns))
    return Shown(pixels, rows, firsts, lobes, drawn)


def lonely_rows(given: Shown) -> np.ndarray:
    """Return the rows of pixels from whose lobe no path went out, nor from any beside them, sorted."""
    lonely = np.zeros(len(given.pixels), np.bool_)
    if has_lobes(given):
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
    if has_lobes(given):
        run_shared(lambda counter: _find_contacts(given, counter, close, alone), threads)
    either = close | alone
    chosen = either if np.count_nonzero(either) <= most else close
    return np.flatnonzero(chosen) if np.count_nonzero(chosen) <= most else np.zeros(0, np.int64)


def picture_rows(pixels: np.ndarray, across: int) -> np.ndarray:
    """`rows` of a Shown."""
    rows = np.full((int(pixels[-1]) // across + 1 if len(pixels) else 1, across), -1, np.int32)
    rows.reshape(-1)[pixels] = np.arange(len(pixels), dtype=np.int32)
    return rows


def has_lobes(given: Shown) -> bool:
    return bool((given.lobes["instance"] != NO_HIT).any())


@jit
def _describe(firsts, positions, directions, widths, screen, counter, lobes, drawn):
    """Write (n,) _LOBE of (n,) FIRST_VERTEX and `drawn` of a Shown; other arguments as of `shown`."""
    for i in shared_rows(counter, _CHUNK, len(lobes)):
        first, lobe = firsts[i], lobes[i]
        for c in range(3):
            lobe.n[c], lobe.ng[c], lobe.position[c] = first.n[c], first.ng[c], positions[i, c]
        lobe.alpha, lobe.density = first.alpha, f32(1) / widths[i]
        lobe.instance = first.instance if first.reflectance[0] > f32(0) else u32(NO_HIT)
        if lobe.instance != u32(NO_HIT):
            _draw_out(vec3(lobe.n), vec3(directions[i]), screen, drawn[i])


@jit
def _draw_out(n, d, screen, drawn):
    """Write the (3,) numbers of `Shown.drawn` of a lobe about the normal n, seen along d, unit.

    Facets turned out of the plane of incidence turn light by the cosine less than those turned in it, whose
    trace in the picture is the projection of n.
    """
    ahead = 0.0 if screen.parallel else dot(n, screen.forward) / dot(d, screen.forward)
    x = (dot(n, screen.right) - ahead * dot(d, screen.right)) / dot(screen.right, screen.right)
    y = (dot(n, screen.down) - ahead * dot(d, screen.down)) / dot(screen.down, screen.down)
    length = math.sqrt(x * x + y * y)
    drawn[0], drawn[1] = (f32(x / length), f32(y / length)) if length > 0.0 else (f32(1), f32(0))
    drawn[2] = min(abs(dot(n, d)), f32(1)) if length > 0.0 else f32(1)


@jit
def _find_lonely(given, lonely):
    """Mark (n,) bool, as `lonely_rows` says."""
    firsts = given.firsts
    for i in range(len(given.pixels)):
        if given.lobes[i].instance != u32(NO_HIT) and firsts[i].samples == u32(0):
            weight = f32(0)
            for k in range(9):
                j = beside(given, i, k, i64(1))
                if j >= i64(0) and firsts[j].samples > u32(0):
                    weight += f32(firsts[j].samples) * likeness(given, i, j, i64(1))
            lonely[i] = weight <= f32(0)


@jit
def _find_contacts(given, counter, close, alone):
    """Mark (n,) bool, those averaged over less than a pixel, and strong lobes that hardly any is like."""
    for i in shared_rows(counter, _CHUNK, len(given.pixels)):
        if given.lobes[i].instance != u32(NO_HIT) and given.firsts[i].samples < u32(2):
            width = width_about(given, i, False)
            close[i] = width > f32(0) and width < _CLOSE
            is_strong = greatest(given.firsts[i].reflectance) >= STRONG
            alone[i] = is_strong and _alike_about(given, i, width if width > f32(0) else _CLOSE) < _COMPANY


@jit
def _alike_about(given, i, width):
    """How many of the eight pixels about a row are alike, float32: 8 on a flat surface that is seen straight
    on; where a lobe is narrower than a pixel across the way that it is drawn out, less.

    width  pixels, of what it may be averaged over, see `width_about`
    """
    total, (right, down, cosine) = f32(0), given.drawn[i]
    for k in range(9):
        j = beside(given, i, k, i64(1)) if k != 4 else i64(-1)
        if j >= i64(0):
            x, y = f32(k % 3 - 1), f32(k // 3 - 1)
            along = (right * x + down * y) * (right * x + down * y) / (x * x + y * y)
            reach = width * width * (along + (f32(1) - along) * cosine * cosine)
            total += min(reach, f32(1)) * likeness(given, i, j, i64(1))
    return total


@jit
def width_about(given, i, own):
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
            j = beside(given, i, k, i64(stride))
            if j >= i64(0) and firsts[j].blur > f32(0) and (own or k != 4):
                w = likeness(given, i, j, i64(stride))
                one = j if one < i64(0) and w > f32(0) else one
                if w > f32(0):
                    total += w
                    alike = firsts[j].met == firsts[one].met and firsts[j].met != u32(SEVERAL)
                    inverse += w / (firsts[j].beyond if alike else firsts[j].blur)
    return total / inverse if inverse > f32(0) else f32(0)


@jit
def beside(given, i, k, stride):
    """The row, int64, of neighbor `k` of 9 of row `i`, -1: there is none; stride: pixels between them."""
    height, across = given.rows.shape
    pixel = given.pixels[i]
    x = i64(pixel % u32(across)) + stride * i64(k % 3 - 1)
    y = i64(pixel // u32(across)) + stride * i64(k // 3 - 1)
    if x < i64(0) or y < i64(0) or x >= across or y >= height:
        return i64(-1)
    return i64(given.rows[y, x])


@jit
def likeness(given, i, j, stride):
    """Weight, float32 in [0, 1], of two rows to each other, `stride` pixels apart: 1 on a flat surface."""
    alike, bend = compared(given, i, j, stride)
    return alike * max(f32(1) - BENT * bend, f32(0))


@jit
def compared(given, i, j, stride):
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
