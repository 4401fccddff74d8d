"""Arrays that come from files: which of their values can be used."""

from __future__ import annotations

import numpy as np

from ispm.scene.values import FARTHEST


def wild(values: np.ndarray) -> np.ndarray:
    """Return where `values` are NaN, infinite or not below FARTHEST, bool of their shape."""
    result: np.ndarray = ~(np.abs(values) < FARTHEST)
    return result
