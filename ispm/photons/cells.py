"""The cells of an octree that points on surfaces lie in, one tree for each of six facings of surfaces.

A key is one of six facings above the Morton code of the smallest cell. Without their last 3 n bits
keys are those of cells 2^n times as wide, so points sorted by key lie cell by cell at all sizes.
"""

from __future__ import annotations

import numpy as np

from ispm.optics.jit import jit
from ispm.optics.vector import facing

f32, i64, u32 = np.float32, np.int64, np.uint32

BITS = 9  # of a cell's number along each axis
SMALLEST = 0.004  # of the scene's diagonal: a cell's width, so that the scene has half as many as bits allow


def sort_by_cell(points: np.ndarray, low: np.ndarray, cell: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the keys of (N,) PHOTON in ascending order, (N,) uint32, and the photons' rows in that order.

    low   (3,) m, below all points;  cell  width of the smallest cells, m
    """
    keys = np.empty(len(points), np.uint64)
    _pack_keys(points.view(np.float32).reshape(-1, 16), low.astype(np.float32), f32(1.0 / cell), keys)
    keys.sort()
    return (keys >> np.uint64(32)).astype(np.uint32), keys.astype(np.uint32)


@jit(allocates=True)
def bounds_of(points):
    """Return the corners of the bounds of records with a position, (2, 3) float32 m."""
    bounds = np.empty((2, 3), np.float32)
    bounds[0], bounds[1] = f32(np.inf), f32(-np.inf)
    for i in range(len(points)):
        for axis in range(3):
            bounds[0, axis] = min(bounds[0, axis], points[i].position[axis])
            bounds[1, axis] = max(bounds[1, axis], points[i].position[axis])
    return bounds


@jit
def cell_key(position, normal, low, per_metre):
    """Return the uint32 key of a point; position, normal: world space.

    low        (3,) float32 m, corner of the cells;  per_metre  one over the width of the smallest, 1/m
    """
    key = facing(normal) << u32(3 * BITS)
    for axis in range(3):
        number = min(max((position[axis] - low[axis]) * per_metre, f32(0)), f32((1 << BITS) - 1))
        key |= _spread(u32(number)) << u32(axis)
    return key


@jit
def _pack_keys(words, low, per_metre, keys):
    """Write (N,) uint64 keys above the rows of points, PHOTON records as (N, 16) words: sorted, equal keys
    keep their order. The rest as of `cell_key`."""
    for i in range(len(words)):
        position, normal = (words[i, 0], words[i, 1], words[i, 2]), (words[i, 12], words[i, 13], words[i, 14])
        key = cell_key(position, normal, low, per_metre)
        keys[i] = np.uint64(key) << np.uint64(32) | np.uint64(i)


@jit
def _spread(x):
    """Put two zero bits behind each of the low 10 bits of x, uint32."""
    x = (x | (x << u32(16))) & u32(0x030000FF)
    x = (x | (x << u32(8))) & u32(0x0300F00F)
    x = (x | (x << u32(4))) & u32(0x030C30C3)
    return (x | (x << u32(2))) & u32(0x09249249)
