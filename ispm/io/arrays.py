"""Arrays that come from files: which of their values can be used, and which vertices."""

from __future__ import annotations

import numpy as np

FARTHEST = 1e18  # m; squares of larger coordinates do not fit a float32


def wild(values: np.ndarray) -> np.ndarray:
    """Return where `values` are NaN, infinite or too large to reckon with."""
    result: np.ndarray = ~(np.abs(values) < FARTHEST)
    return result


def compact(triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return (T, 3) uint32 triangles renumbered over the vertices they use, and those vertices' rows."""
    used = np.zeros(int(triangles.max()) + 1 if triangles.size else 0, bool)
    used[triangles] = True
    number = np.cumsum(used, dtype=np.uint32) - np.uint32(1)
    renumbered: np.ndarray = number[triangles]
    return renumbered, np.flatnonzero(used)


def linear(encoded: np.ndarray) -> np.ndarray:
    """Return the float32 light that sRGB-encoded colors in [0, 1] stand for (IEC 61966-2-1)."""
    low = encoded / 12.92
    high = ((np.maximum(encoded, 0.0) + 0.055) / 1.055) ** 2.4
    return np.where(encoded <= 0.04045, low, high).astype(np.float32)
