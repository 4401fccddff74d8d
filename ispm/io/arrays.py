"""Arrays that come from files: which of their values can be used, and which vertices."""

from __future__ import annotations

import numpy as np

from ispm.scene.values import FARTHEST

SPARSE = 8  # vertices in the range of a triangle's corner, from which on sorting is quicker than a table


def wild(values: np.ndarray) -> np.ndarray:
    """Return where `values` are NaN, infinite or too large to reckon with."""
    result: np.ndarray = ~(np.abs(values) < FARTHEST)
    return result


def compact(triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return (T, 3) uint32 triangles renumbered over the vertices they use, and those vertices' rows."""
    if not triangles.size:
        return np.zeros((0, 3), np.uint32), np.zeros(0, np.int64)
    first, last = int(triangles.min()), int(triangles.max())
    if last - first > SPARSE * triangles.size:  # few of many: in time of their own number
        rows, numbers = np.unique(triangles, return_inverse=True)
        return numbers.reshape(-1, 3).astype(np.uint32), rows.astype(np.int64)
    used = np.zeros(last - first + 1, bool)
    shifted = triangles - triangles.dtype.type(first)
    used[shifted] = True
    number = np.cumsum(used, dtype=np.uint32) - np.uint32(1)
    renumbered: np.ndarray = number[shifted]
    return renumbered, np.flatnonzero(used) + first
