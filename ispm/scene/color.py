"""Colors as they are encoded in files."""

from __future__ import annotations

import numpy as np


def encoded(light: np.ndarray) -> np.ndarray:
    """Return the sRGB-encoded colors in [0, 1] of linear ones in [0, 1] (IEC 61966-2-1)."""
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)


def linear(encoded: np.ndarray) -> np.ndarray:
    """Return the float32 light that sRGB-encoded colors in [0, 1] stand for (IEC 61966-2-1)."""
    low = encoded / 12.92
    high = ((np.maximum(encoded, 0.0) + 0.055) / 1.055) ** 2.4
    return np.where(encoded <= 0.04045, low, high).astype(np.float32)
