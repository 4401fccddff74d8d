"""Runs of pixels of a row, and what lies aside of them: what filters of direct light work on.

In kernels `i` and `k` are the first pixel of a run, or of a part of it, and the first of those that lie aside
of it alike.
"""

from __future__ import annotations

import numpy as np

from ispm.optics.jit import jit

f32, i64, u32 = np.float32, np.int64, np.uint32

RUN = 128  # pixels, whose numbers and those of the rows about them fit in a cache of the first level


@jit
def runs(columns):
    """Return how many runs a row has."""
    return (columns + RUN - 1) // RUN


@jit
def run_of(number, columns, word):
    """Return (first pixel, its column, size) of a run without what shows nothing at its ends; size 0: nothing
    is shown. word: of all pixels, 0 where one shows nothing."""
    row, first = number // runs(columns), number % runs(columns) * RUN
    until = min(first + i64(RUN), columns)
    while first < until and word[row * columns + first] == u32(0):
        first += i64(1)
    while until > first and word[row * columns + until - 1] == u32(0):
        until -= i64(1)
    return row * columns + first, first, until - first


@jit
def part(i, first, size, down, right, columns, count):
    """Return (low, high, k): of which part of a run that begins at pixel i, in the column `first`, the pixels
    that lie `down` and `right` of it are in the picture; and the first of these. Nothing: high <= low."""
    low, high = max(i64(0), -(first + right)), min(size, columns - first - right)
    k = i + down * columns + right + low
    return (low, high, k) if 0 <= i + down * columns < count else (low, low, k)


@jit
def part_aside(i, first, size, stride, tap, columns, count):
    """Return `part` of the pixels at place `tap` of 9, `stride` apart, about a run."""
    return part(i, first, size, stride * (tap // 3 - 1), stride * (tap % 3 - 1), columns, count)


@jit
def take_least(values, i, first, columns, stride, reach, out):
    """Write the least of the values about each pixel of a run, as many strides to each side."""
    size, count = i64(len(out)), i64(len(values))
    out[:] = f32(np.inf)
    for down in range(-reach, reach + 1):
        for right in range(-reach, reach + 1):
            low, high, k = part(i, first, size, stride * down, stride * right, columns, count)
            if high > low:
                least, other = out[low:high], values[k : k + high - low]
                for x in range(high - low):
                    least[x] = min(least[x], other[x])


@jit
def take_between(values, share, limit, i, first, columns, reach, counts, sums, out):
    """Write what lies between the least of the values about each pixel of a run, as far to each side as
    `reach`, and the harmonic mean of those that are below a limit: a share of the way to it.

    `counts` and `sums` are room for as many values."""
    size, count = i64(len(out)), i64(len(values))
    take_least(values, i, first, columns, i64(1), reach, out)
    counts[:] = f32(0)
    sums[:] = f32(0)
    for down in range(-reach, reach + 1):
        for right in range(-reach, reach + 1):
            low, high, k = part(i, first, size, i64(down), i64(right), columns, count)
            if high > low:
                taken, total, other = counts[low:high], sums[low:high], values[k : k + high - low]
                for x in range(high - low):
                    counted = f32(1) if other[x] < limit else f32(0)
                    taken[x] += counted
                    total[x] += counted / max(other[x], f32(1e-6))
    for x in range(size):
        mean = counts[x] / max(sums[x], f32(1e-6))
        out[x] += share * (mean - out[x]) if counts[x] > f32(0) else f32(0)


@jit
def forget_unshown(word, values):
    """Make the values infinite where nothing is shown, whose `word` is 0: no neighbor is to ask for less."""
    for x in range(len(values)):
        values[x] = f32(np.inf) if word[x] == u32(0) else values[x]


@jit
def copy(values, out):
    """Write values."""
    for x in range(len(out)):
        out[x] = values[x]


@jit
def add(weights, values, sums):
    """Add weighted values to sums."""
    for x in range(len(sums)):
        sums[x] += weights[x] * values[x]


@jit
def divide(values, by, out):
    """Write the ratios of values."""
    for x in range(len(out)):
        out[x] = values[x] / by[x]
