"""Openings: where light of the environment comes in to what the eye sees, as a survey found them.

In a room most of a sky's light ends outside, on walls and roof, and most of what a place within draws of it
ends on walls within. Boxes stand for openings: photons are sent through them, and places draw light from the
directions in which they see those that lines from near them pass.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ispm.lights.boxes import NO_BOXES, Boxes, box_pdf, draw_in_box
from ispm.optics.jit import jit
from ispm.optics.vector import dot, facing, scale, sub

f32, i64 = np.float32, np.int64

CELLS = 12  # along each axis, in which places are guided alike
NEAREST = 32  # lines, nearest to a cell, which tell how its draws are shared among boxes
WAY = math.cos(math.radians(15.0))  # of half the angle about a way that photons take


class GuidedCells(NamedTuple):
    """Cells of the box about what the eye sees.

    guided          (6, cells^3) bool, whether openings guide draws in a cell, by the side that places face
    low, per_metre  (3,) float32, m and 1/m
    """

    guided: np.ndarray
    low: np.ndarray
    per_metre: np.ndarray


class Ways(NamedTuple):
    """Ways in for photons.

    boxes       k of them, about openings;  lined: about these and what lines them
    to_sky      (k,) float32, of the photons from the darker parts of a sky, those through each
    to_sun      (k,) likewise from its sun
    directions  (l, 3) float32, unit, of lines to the sky, those through each box after the others
    firsts      (k + 1,) int64, of each the first, and the number of all
    share       of the places seen, those where draws are guided
    cells       where these are: there photons are inside
    """

    boxes: Boxes
    lined: Boxes
    to_sky: np.ndarray
    to_sun: np.ndarray
    directions: np.ndarray
    firsts: np.ndarray
    share: float
    cells: GuidedCells


class Openings(NamedTuple):
    """What a survey found.

    boxes           k of them, which open lines pass
    weights         (cells^3, k) float32, with what chance places in a cell draw from each
    cells           where draws are guided
    ways            in, for photons
    """

    boxes: Boxes
    weights: np.ndarray
    cells: GuidedCells
    ways: Ways


_NONE = np.zeros(0, f32)
NO_CELLS = GuidedCells(np.zeros((6, 0), np.bool_), np.zeros(3, f32), np.zeros(3, f32))
NO_WAYS = Ways(NO_BOXES, NO_BOXES, _NONE, _NONE, np.zeros((0, 3), f32), np.zeros(1, np.int64), 0.0, NO_CELLS)
NO_OPENINGS = Openings(NO_BOXES, np.zeros((0, 0), f32), NO_CELLS, NO_WAYS)


@jit
def opening_cell(cells, x):
    """Return (cell, whether openings guide draws there) of a SurfacePoint: the nearest of the GuidedCells."""
    if cells.guided.shape[1] == 0:
        return i64(0), False
    cell = i64(0)
    for axis in (2, 1, 0):
        at = (x.position[axis] - cells.low[axis]) * cells.per_metre[axis]
        cell = cell * CELLS + i64(min(max(at, f32(0)), f32(CELLS - 1)))
    return cell, cells.guided[facing(x.ng), cell]


@jit
def is_inside(cells, x):
    """Return whether a SurfacePoint lies in the GuidedCells, and is lit through openings."""
    for axis in range(3):
        at = (x.position[axis] - cells.low[axis]) * cells.per_metre[axis]
        if not f32(-1) < at < f32(CELLS + 1):
            return False
    return opening_cell(cells, x)[1]


@jit
def draw_opening(openings, cell, position, u0, u1, u2):
    """Return a direction, unit, from a position, m, in a cell to a random point of one of its boxes; u0, u1,
    u2: random in [0, 1)."""
    weights, k = openings.weights, i64(0)
    while k < weights.shape[1] - 1 and u0 >= weights[cell, k]:
        u0 -= weights[cell, k]
        k += 1
    u0 = min(u0 / max(weights[cell, k], f32(1e-30)), f32(1))  # the last takes what rounding leaves
    off = sub(draw_in_box(openings.boxes, k, u0, u1, u2), position)
    return scale(f32(1) / f32(math.sqrt(max(dot(off, off), f32(1e-30)))), off)


@jit
def opening_pdf(openings, cell, position, d):
    """Return the density, 1/sr, with which `draw_opening` draws d."""
    total = f32(0)
    for k in range(openings.weights.shape[1]):
        total += openings.weights[cell, k] * box_pdf(openings.boxes, k, position, d)
    return total
