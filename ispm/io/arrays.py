"""Arrays that come from files: which of their values can be used, and which vertices."""

from __future__ import annotations

import numpy as np

from ispm.scene.values import FARTHEST


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
