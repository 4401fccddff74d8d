"""Points that are equal, found by a hash table."""

from __future__ import annotations

import numpy as np

from ispm.optics.jit import jit

i64, u32, u64 = np.int64, np.uint32, np.uint64

_FREE = 0xFFFFFFFF
_PROBES = 64  # places of the table that one point looks at, so that no file makes this slow


def weld(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the rows of points that differ, (V,) uint32 in order, and of each point its own one's number
    among them, (n,) uint32.

    points  (n, 3) float32, compared by their bits, so that 0 and -0 are two; a few equal ones may stay apart
    """
    words = np.ascontiguousarray(points).view(np.uint32)
    table = np.full(1 << max(2 * len(words) - 1, 1).bit_length(), _FREE, np.uint32)
    rows, numbers = np.empty(len(words), np.uint32), np.empty(len(words), np.uint32)
    count = number_points(words, table, rows, numbers)
    return rows[:count].copy(), numbers


@jit
def number_points(words, table, rows, numbers):
    """Write what `weld` returns; return how many points differ.

    words  (n, 3) uint32;  table  a power of two of uint32, all free;  rows, numbers  (n,) uint32, written
    """
    last = u64(len(table) - 1)
    count = i64(0)
    for i in range(len(words)):
        place = place_of(words, i) & last
        numbers[i] = u32(count)
        for _ in range(_PROBES):
            number = table[place]
            if number == u32(_FREE):
                table[place] = u32(count)
                break
            k = rows[number]
            if words[k, 0] == words[i, 0] and words[k, 1] == words[i, 1] and words[k, 2] == words[i, 2]:
                numbers[i] = number
                break
            place = (place + u64(1)) & last
        if numbers[i] == u32(count):
            rows[count] = u32(i)
            count += 1
    return count


@jit
def place_of(words, i):
    """Return a hash of row i of (n, 3) uint32 words, uint64 (after MurmurHash3's finalizer, Appleby 2011)."""
    h = u64(words[i, 0]) | u64(words[i, 1]) << u64(32)
    h = (h ^ (h >> u64(33))) * u64(0xFF51AFD7ED558CCD)
    h = (h ^ u64(words[i, 2])) * u64(0xC4CEB9FE1A85EC53)
    h = (h ^ (h >> u64(33))) * u64(0xFF51AFD7ED558CCD)
    return h ^ (h >> u64(33))
