"""Directions spread evenly over the sphere."""

from __future__ import annotations

import math

import numpy as np


def even_directions(count: int) -> np.ndarray:
    """Return (count, 3) float32 unit directions (a Fibonacci lattice)."""
    k = np.arange(count) + 0.5
    y = 1.0 - 2.0 * k / count
    r, phi = np.sqrt(1.0 - y * y), k * (math.pi * (3.0 - math.sqrt(5.0)))
    return np.stack([r * np.cos(phi), y, r * np.sin(phi)], axis=1).astype(np.float32)
