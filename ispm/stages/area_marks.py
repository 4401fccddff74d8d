"""Marks of pixels that draw again from lamps with a surface and from the environment, see `area_draws.py`.

Of narrow penumbrae a pixel's square of 4 x 4 tells, and the eight about it: their draws together are of all
parts of what is drawn from, whichever part a pixel drew itself.
"""

from __future__ import annotations

import numpy as np

from ispm.lights.area_parts import SIDE
from ispm.optics.jit import jit

f32, i64 = np.float32, np.int64

_NARROW = f32(6)  # pixels that the filter reaches there, less than which its wider squares have no weight
# Pixels that lamps' light is averaged over: below the first the filter's widest squares count in part, below
# 12 those of its first stride. 2, 4, 8 and 16 draws make some 1,800 of what is averaged, from 9 pixels on.
_CLOSE = f32(36), f32(25), f32(20), f32(9)
_IS_NARROW, _IS_REACHED = 1, 2  # marks: of what casts a shadow, of light; two bits for each kind of Samples
_CLOSE_BIT, _CLOSE_BITS = 6, 15  # and from this bit on: of what lamps bring, which of _CLOSE it is below
_AROUND = 2  # pixels to each side that tell of penumbrae and of lamps


@jit
def mark_of(samples, i):
    """Return what row i of the KindsOfSamples is marked with after its first draw."""
    mark, near = i64(0), samples.lamps.near
    for kind in range(len(samples)):
        if len(samples[kind].reach) > 0:
            mark |= _mark(samples[kind], i) << (2 * kind)
    if len(near) > 0:
        for level in range(len(_CLOSE)):
            mark |= i64(near[i] < _CLOSE[level]) << (_CLOSE_BIT + level)
    return mark


@jit
def _mark(samples, i):
    """_IS_NARROW and _IS_REACHED of row i of the Samples."""
    is_reached = False
    for c in range(3):
        gloss = samples.gloss[c, i] + samples.gloss[3 + c, i]
        is_reached = is_reached or samples.diffuse[c, i] > f32(0) or gloss > f32(0)
    return _IS_NARROW * i64(samples.reach[i] < _NARROW) + _IS_REACHED * i64(is_reached)


def marks_about_squares(marks: np.ndarray) -> np.ndarray:
    """Return all that marks, (rows, columns), tell of each square of pixels and of the eight about it."""
    rows, columns = (np.arange(0, size, SIDE) for size in marks.shape)
    squares = np.bitwise_or.reduceat(np.bitwise_or.reduceat(marks, rows, axis=0), columns, axis=1)
    padded, about = np.pad(squares, 1), np.zeros_like(squares)
    for down, right in np.ndindex(3, 3):
        about |= padded[down : down + len(rows), right : right + len(columns)]
    return about


@jit
def square_of(about, view, i):
    """Return what `marks_about_squares` tell, int64, of the square of row i."""
    return i64(about[i // view.columns // SIDE, i % view.columns // SIDE])


@jit
def draws_more(square):
    """Return whether pixels of a square draw more than once, by what marks tell of it."""
    return is_any(are_partly_shaded(square)) or square >> _CLOSE_BIT > 0


@jit
def are_partly_shaded(marks):
    """Return whether marks tell of narrow shadows and of light, of each kind of Samples."""
    partly = _IS_NARROW | _IS_REACHED
    return marks & partly == partly, marks >> 2 & partly == partly, marks >> 4 & partly == partly


@jit
def is_any(kinds):
    """Return whether any of three is true."""
    return kinds[0] or kinds[1] or kinds[2]


@jit
def closeness(marks):
    """Return 0, 1, 3, 7 or 15 of marks: the closer lamps are, the more."""
    return marks >> _CLOSE_BIT & _CLOSE_BITS  # below one of _CLOSE is below those before


@jit
def marks_around(marks, i, columns):
    """Return all that marks tell of the pixels about row i, but for i itself."""
    row, column, rows, every = i // columns, i % columns, i64(len(marks)) // columns, i64(0)
    for y in range(max(row - _AROUND, 0), min(row + _AROUND, rows - 1) + 1):
        for x in range(max(column - _AROUND, 0), min(column + _AROUND, columns - 1) + 1):
            if y != row or x != column:
                every |= i64(marks[y * columns + x])
    return every
