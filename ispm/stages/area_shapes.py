"""What pixels show, for means of direct light over pixels of one surface: which of them are of the same.

It works on runs of pixels of a row, as `area_filter.py` does.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ispm.kernels.share import shared_rows
from ispm.optics.jit import jit
from ispm.stages.pixels import TURNED, plane_at

f32 = np.float32

_BENT = math.radians(16.0)  # between normals, within which it is one surface that is averaged over
_CHUNK = 64  # pixels a thread takes at a time


class Shapes(NamedTuple):
    """What n pixels show, a row for each coordinate, float32 but for the first.

    word          (n,) uint32, of the material
    point         (3, n) m
    normal, flat  (3, n) shading and geometric normal, unit
    off           (n,) m, that neighbors lie off the pixel's plane at most
    bent          cosine of the angle between normals of one surface at least, see `least_cosine`
    """

    word: np.ndarray
    point: np.ndarray
    normal: np.ndarray
    flat: np.ndarray
    off: np.ndarray
    bent: np.float32


def least_cosine(smoothing: float) -> np.float32:
    """Return the cosine of the angle between normals within which pixels are averaged: less in later passes,
    for on what is curved the share of light that passes is not the same."""
    return f32(math.cos(_BENT * smoothing))


@jit
def lay_out(pixels, view, counter, shapes):
    """Write the Shapes of as many of the Pixels as a thread gets."""
    for i in shared_rows(counter, _CHUNK, len(pixels.points)):
        plane = plane_at(pixels, view, i)
        shapes.word[i], shapes.off[i] = pixels.points[i, 3], plane.off
        for c in range(3):
            shapes.point[c, i], shapes.normal[c, i] = plane.position[c], plane.n[c]
            shapes.flat[c, i] = plane.ng[c]


@jit
def keep_alike(shapes, i, k, room, turn, weights):
    """Set the weights to 0 where pixels from k on are not of the material of those from i on and of the same
    surface; the cosine between shading normals, `turn`, is written. room: three rows as long to work in.

    The same is what lies in the mean of both pixels' planes, 0 off it on a ball, and is turned little, by the
    geometric normals or by shading normals: bumps lie on facets, and facets of few pixels on what is smooth.
    """
    size, (flat, smooth, bend) = len(weights), room
    _compare(shapes.point, shapes.flat, i, k, flat, bend)
    for c in range(3):
        one, other = shapes.normal[c, i : i + size], shapes.normal[c, k : k + size]
        if c == 0:
            for x in range(size):
                turn[x] = one[x] * other[x]
        else:
            for x in range(size):
                turn[x] += one[x] * other[x]
    word, others, off = shapes.word[i : i + size], shapes.word[k : k + size], shapes.off[i : i + size]
    for x in range(size):
        weights[x] = weights[x] if (word[x] == others[x]) & (turn[x] > TURNED) else f32(0)
    doubtful = 0
    for x in range(size):
        is_flat = (bend[x] > shapes.bent) & (abs(flat[x]) <= off[x])
        flat[x] = f32(1) if is_flat else f32(0)
        doubtful |= (weights[x] > f32(0)) & (not is_flat)
    if not doubtful:
        return
    _compare(shapes.point, shapes.normal, i, k, smooth, bend)
    for x in range(size):
        is_smooth = (bend[x] > shapes.bent) & (abs(smooth[x]) <= off[x])
        weights[x] *= max(flat[x], f32(1) if is_smooth else f32(0))


@jit
def _compare(point, normal, i, k, height, cosine):
    """Write how high, m, pixels from k on lie above the mean of their planes and those of pixels from i on,
    by (3, n) normals, and the cosine between these."""
    for c in range(3):
        here, there = point[c, i : i + len(height)], point[c, k : k + len(height)]
        one, other = normal[c, i : i + len(height)], normal[c, k : k + len(height)]
        if c == 0:
            for x in range(len(height)):
                height[x] = f32(0.5) * (one[x] + other[x]) * (there[x] - here[x])
                cosine[x] = one[x] * other[x]
        else:
            for x in range(len(height)):
                height[x] += f32(0.5) * (one[x] + other[x]) * (there[x] - here[x])
                cosine[x] += one[x] * other[x]
