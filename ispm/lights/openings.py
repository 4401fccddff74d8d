"""Openings: where light of the environment comes in to what the eye sees, as a survey found them.

In a room most of a sky's light ends outside, on walls and roof, and most of what a place within draws of it
ends on walls within. A sphere stands for each part of an opening: photons are sent through them, and places
draw light from the directions in which they see those that lines from near them pass.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ispm.optics.jit import jit
from ispm.optics.sampling import in_cone
from ispm.optics.vector import dot, facing, scale, sub, vec3

f32, i64 = np.float32, np.int64

CELLS = 12  # along each axis, in which places are guided alike
NEAREST = 32  # lines, nearest to a cell, whose spheres guide there
WAY = math.cos(math.radians(15.0))  # of half the angle about a way that photons take


class Ways(NamedTuple):
    """Ways in for photons.

    spheres     (k, 4) float32, middle and radius, m, in openings, from each of which the darker parts of a
                sky are seen in its direction, unit, of directions  (k, 3) float32
    to_sun      (l, 4) float32 spheres from which its sun is seen
    share       of the places seen, those where draws are guided
    """

    spheres: np.ndarray
    directions: np.ndarray
    to_sun: np.ndarray
    share: float


class Openings(NamedTuple):
    """What a survey found.

    spheres         (m, 4) float32, middle and radius, m, about which lines pass an opening
    nearest         (cells^3, 32) int32 rows of these, of lines that end nearest to a cell
    draws           (6, cells^3) int32 guided draws that places in a cell want, by the side that they face,
                    for each that is not; 0: none
    low, per_metre  (3,) float32, m and 1/m, of the cells
    ways            in, for photons
    """

    spheres: np.ndarray
    nearest: np.ndarray
    draws: np.ndarray
    low: np.ndarray
    per_metre: np.ndarray
    ways: Ways


_NO_SPHERES, _NO_CORNER = np.zeros((0, 4), f32), np.zeros(3, f32)
NO_WAYS = Ways(_NO_SPHERES, np.zeros((0, 3), f32), _NO_SPHERES, 0.0)
NO_OPENINGS = Openings(
    _NO_SPHERES,
    np.zeros((0, NEAREST), np.int32),
    np.zeros((6, 0), np.int32),
    _NO_CORNER,
    _NO_CORNER,
    NO_WAYS,
)


@jit
def opening_cell(openings, x):
    """Return (cell, guided draws for each other) of a SurfacePoint; no draws: nothing guides there."""
    if openings.draws.shape[1] == 0:
        return i64(0), i64(0)
    cell = i64(0)
    for axis in (2, 1, 0):
        at = (x.position[axis] - openings.low[axis]) * openings.per_metre[axis]
        cell = cell * CELLS + i64(min(max(at, f32(0)), f32(CELLS - 1)))
    return cell, i64(openings.draws[facing(x.ng), cell])


@jit
def draw_opening(openings, cell, position, u0, u1, u2):
    """Return a direction, unit, in which a position, m, in a cell sees its spheres; u0, u1, u2: random in
    [0, 1)."""
    k = min(i64(u0 * f32(NEAREST)), i64(NEAREST - 1))
    sphere = openings.spheres[openings.nearest[cell, k]]
    off = sub(vec3(sphere), position)
    square, radius = dot(off, off), sphere[3] * sphere[3]
    if square <= radius:
        return in_cone((f32(0), f32(0), f32(1)), f32(-1), u1, u2)
    axis = scale(f32(1) / f32(math.sqrt(square)), off)
    return in_cone(axis, f32(math.sqrt(f32(1) - radius / square)), u1, u2)


@jit
def opening_pdf(openings, cell, position, d):
    """Return the density, 1/sr, with which `draw_opening` draws d."""
    total = f32(0)
    for k in range(NEAREST):
        sphere = openings.spheres[openings.nearest[cell, k]]
        off = sub(vec3(sphere), position)
        square, radius, along = dot(off, off), sphere[3] * sphere[3], dot(off, d)
        if square <= radius:
            total += f32(0.5)
        elif along > f32(0) and square - along * along <= radius:
            share = radius / square  # 1 - cosine is lost in float32 where this is small
            total += (f32(1) + f32(math.sqrt(f32(1) - share))) / share
    return total * f32(1 / (2 * math.pi * NEAREST))
