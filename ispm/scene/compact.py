"""Triangles renumbered over the vertices that they use."""

from __future__ import annotations

import numpy as np

SPARSE = 8  # span of vertex numbers over the count of corners, above which a sort is faster than a table


def compact(triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return (T, 3) uint32 triangles renumbered over the vertices they use, and those vertices' rows, (V,)
    int64.

    triangles  (T, 3) integers, rows of vertices
    """
    if not triangles.size:
        return np.zeros((0, 3), np.uint32), np.zeros(0, np.int64)
    first, last = int(triangles.min()), int(triangles.max())
    if last - first > SPARSE * triangles.size:  # far apart: time follows the triangles, not the span
        rows, numbers = np.unique(triangles, return_inverse=True)
        return numbers.reshape(-1, 3).astype(np.uint32), rows.astype(np.int64)
    used = np.zeros(last - first + 1, bool)
    shifted = triangles - triangles.dtype.type(first)
    used[shifted] = True
    number = np.cumsum(used, dtype=np.uint32) - np.uint32(1)
    renumbered: np.ndarray = number[shifted]
    return renumbered, np.flatnonzero(used) + first
