"""Directions in which the environment is open: what pixels found guides further draws of their neighbors.

In a room most directions end at walls, and few of a pixel's draws pass through the windows. Those that passed
tell where these are: squares of pixels keep some, each of which stands for a cap of directions about it, and
draws from such caps mostly pass. Squares of three sizes count alike, for the smaller ones know the windows as
they are seen from there, and the larger ones know of those that no draw near by has found. A pixel asks what
others found, never itself: a mean is off if what is drawn says how it is weighed.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ispm.kernels.share import run_shared, shared_rows
from ispm.optics.jit import jit
from ispm.optics.sampling import to_world
from ispm.optics.vector import dot, vec3

f32, i64 = np.float32, np.int64

# marks, beside those of `area_draws.py`: pixels that drew from the environment, and those whose draw passed
DREW, PASSED = 64, 128
_SIDE, _LEVELS, _STEP = 16, 3, 4  # pixels of the smallest squares; sizes, each so many times the one before
_MOST = 32  # directions that a square keeps
_RARE = 16  # draws to each that passes, from where draws are guided
_DRAWS = 4  # guided ones at most
_CAPS = tuple(math.cos(math.radians(angle)) for angle in (5.0, 8.0, 12.0))  # half the angle, by size


class Openings(NamedTuple):
    """Directions of a picture that are open.

    drew, passed  (s,) int32 pixels of each of the smallest squares, row by row: see the marks
    kept          (m,) int32 of the directions that each square has, the smallest squares first
    pixels        (m, 32) int32, that found them
    directions    (m, 32, 3) float32, unit
    """

    drew: np.ndarray
    passed: np.ndarray
    kept: np.ndarray
    pixels: np.ndarray
    directions: np.ndarray


def find_openings(marks: np.ndarray, found: np.ndarray, columns: int, threads: int) -> Openings:
    """Return the Openings of n pixels.

    marks  (n,) uint8;  found  (n, 3) float32 directions of draws that passed
    columns  pixels in a row
    """
    sizes = [_grid(i64(len(marks)), i64(columns), level) for level in range(_LEVELS)]
    counts = [across * down for across, down in sizes]
    squares = sum(counts)
    drew, passed = np.zeros((2, counts[0]), np.int32)
    directions = np.empty((squares, _MOST, 3), np.float32)
    openings = Openings(
        drew, passed, np.zeros(squares, np.int32), np.empty((squares, _MOST), np.int32), directions
    )
    run_shared(lambda counter: _keep(marks, found, i64(columns), counter, openings), threads)
    for level in range(1, _LEVELS):
        _join(openings, i64(len(marks)), i64(columns), level)
    return openings


def closed() -> Openings:
    """Return Openings of which there is none."""
    none, squares = np.zeros(0, np.int32), np.zeros((0, _MOST), np.int32)
    return Openings(none, none, none, squares, np.zeros((0, _MOST, 3), np.float32))


class Around(NamedTuple):
    """The squares that a pixel asks: their rows, how many directions of others each has, and where its own
    is among them, -1: nowhere. `sizes` counts those that have any; `draws` are guided, the more the fewer
    pass unguided, or none."""

    rows: tuple[np.int64, np.int64, np.int64]
    others: tuple[np.int64, np.int64, np.int64]
    own: tuple[np.int64, np.int64, np.int64]
    sizes: np.int64
    draws: np.int64


@jit
def no_openings():
    """An Around that guides nothing."""
    none = i64(0), i64(0), i64(0)
    return Around(none, none, none, i64(0), i64(0))


@jit
def openings_around(openings, marks, i, columns):
    """Return the Around of pixel i: where of its neighbors' draws few passed, but some near or far."""
    near = _square(i, columns, 0)
    drew = i64(openings.drew[near]) - i64(marks[i] & DREW != 0)
    passed = i64(openings.passed[near]) - i64(marks[i] & PASSED != 0)
    if marks[i] & DREW == 0 or passed * _RARE > drew:
        return no_openings()
    count = i64(len(marks))
    row_1 = _first_square(count, columns, 1) + _square(i, columns, 1)
    row_2 = _first_square(count, columns, 2) + _square(i, columns, 2)
    (others, own), (others_1, own_1) = _others(openings, near, i), _others(openings, row_1, i)
    others_2, own_2 = _others(openings, row_2, i)
    sizes, draws = i64(others > 0) + i64(others_1 > 0) + i64(others_2 > 0), i64(0)
    if sizes > 0:
        draws = min(drew // (_RARE * max(passed, i64(1))), i64(_DRAWS))
    return Around((near, row_1, row_2), (others, others_1, others_2), (own, own_1, own_2), sizes, draws)


@jit
def draw_opening(openings, around, u0, u1, u2):
    """Return a direction, unit, drawn from the caps that an Around knows; u0, u1, u2: random in [0, 1)."""
    pick = u0 * f32(around.sizes)
    for level in range(_LEVELS):
        others = around.others[level]
        if others == 0:
            continue
        if pick >= f32(1):
            pick -= f32(1)
            continue
        k = min(i64(pick * f32(others)), others - 1)
        own = around.own[level]
        k += i64(own >= 0 and k >= own)
        z = f32(1) - u1 * (f32(1) - f32(_CAPS[level]))
        r, angle = f32(math.sqrt(max(f32(1) - z * z, f32(0)))), f32(2 * math.pi) * u2
        local = r * f32(math.cos(angle)), r * f32(math.sin(angle)), z
        return to_world(local, vec3(openings.directions[around.rows[level], k]))
    return f32(0), f32(0), f32(1)  # roundings aside, never


@jit
def opening_pdf(openings, around, d):
    """Return the density, 1/sr, with which `draw_opening` draws d; 0 where nothing is guided."""
    total = f32(0)
    for level in range(_LEVELS):
        others, row, own = around.others[level], around.rows[level], around.own[level]
        if others == 0:
            continue
        within, least = i64(0), f32(_CAPS[level])
        for k in range(others + i64(own >= 0)):
            within += i64(k != own and dot(vec3(openings.directions[row, k]), d) >= least)
        solid_angle = f32(2 * math.pi) * (f32(1) - least)
        total += f32(within) / (f32(others) * solid_angle)
    return total / f32(max(around.sizes, 1))


@jit
def _others(openings, row, i):
    """(how many directions of a square are not of pixel i, where its own is)."""
    kept, own = i64(openings.kept[row]), i64(-1)
    for k in range(kept):
        if openings.pixels[row, k] == i:
            own = i64(k)
    return kept - i64(own >= 0), own


@jit
def _grid(count, columns, level):
    """(squares in a row, rows of them) of so many pixels."""
    side = i64(_SIDE * _STEP**level)
    return (columns + side - 1) // side, (count // columns + side - 1) // side


@jit
def _first_square(count, columns, level):
    """The row of the first square of a size, after all smaller ones."""
    first = i64(0)
    for smaller in range(level):
        across, down = _grid(count, columns, smaller)
        first += across * down
    return first


@jit
def _square(i, columns, level):
    """The square of a size that pixel i is in, row by row."""
    side = i64(_SIDE * _STEP**level)
    return i // columns // side * ((columns + side - 1) // side) + i % columns // side


@jit
def _keep(marks, found, columns, counter, openings):
    """Count what the smallest squares found, as many as a thread gets, and keep some, evenly."""
    rows = i64(len(marks)) // columns
    across, _ = _grid(i64(len(marks)), columns, 0)
    for square in shared_rows(counter, 4, len(openings.drew)):
        top, left = square // across * _SIDE, square % across * _SIDE
        bottom, right = min(top + _SIDE, rows), min(left + _SIDE, columns)
        passed = drew = i64(0)
        for y in range(top, bottom):
            for x in range(left, right):
                drew += i64(marks[y * columns + x] & DREW != 0)
                passed += i64(marks[y * columns + x] & PASSED != 0)
        openings.drew[square], openings.passed[square] = drew, passed
        nth = kept = i64(0)
        for y in range(top, bottom):
            for x in range(left, right):
                i = y * columns + x
                if marks[i] & PASSED == 0:
                    continue
                if passed <= _MOST or (nth + 1) * _MOST // passed > nth * _MOST // passed:
                    _copy(openings, square, kept, i, found[i])
                    kept += 1
                nth += 1
        openings.kept[square] = kept


@jit
def _join(openings, count, columns, level):
    """Have the squares of a size keep directions of those that they are made of, of each in turn."""
    before, first = _first_square(count, columns, level - 1), _first_square(count, columns, level)
    across, down = _grid(count, columns, level)
    parts_across, parts_down = _grid(count, columns, level - 1)
    for square in range(across * down):
        kept, top, left = i64(0), square // across * _STEP, square % across * _STEP
        for k in range(_MOST):
            for part in range(_STEP * _STEP):
                y, x = top + part // _STEP, left + part % _STEP
                if y >= parts_down or x >= parts_across or kept == _MOST:
                    continue
                other = before + y * parts_across + x
                if k < openings.kept[other]:
                    pixel, d = openings.pixels[other, k], openings.directions[other, k]
                    _copy(openings, first + square, kept, pixel, d)
                    kept += 1
        openings.kept[first + square] = kept


@jit
def _copy(openings, row, k, pixel, d):
    """Write what a square keeps as its direction k."""
    openings.pixels[row, k] = pixel
    for c in range(3):
        openings.directions[row, k, c] = d[c]
