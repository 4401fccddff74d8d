"""A cache of irradiance in the world: a table of cells that remember what was estimated in them.

The ends of gather rays, and what mirrors and glass show, are many points of which few are worth an estimate
of their own each frame: a cell's mean over frames has less noise than that, and costs a look-up.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ispm.optics.jit import jit
from ispm.optics.records import INNER, take
from ispm.optics.rng import random4
from ispm.optics.vector import dot, vec3

f32, i64, u32 = np.float32, np.int64, np.uint32

CELL = 0.015  # width of a cell, of the scene's diagonal
_SLOTS = 1 << 18  # a power of two; `atrium` fills 57,000
_FULL = _SLOTS // 2  # cells, of more all are forgotten
_PROBES = 16  # slots looked at for one cell
_REFRESHED = 1 / 8  # of the points that are estimated anew, by lot
_YOUNG = 2.0  # batches that a cell was estimated by, below which all its points are
_MOST = 512.0  # batches that a mean remembers
_CHANGED = 4.0  # likewise once light has changed
_KEY_BITS = 20  # of a cell's number along each axis
_DIMENSION = 1 << 24  # of the random numbers that jitter points


# The mean of the batches of photons before, how many they were, and the sum of estimates by this one. These
# share their noise, so that however many they are, they count once in the mean.
_CELL = np.dtype(
    [
        ("light", np.float32, 3),
        ("batches", np.float32),
        ("sum", np.float32, 3),
        ("count", np.float32),
        ("batch", np.uint32),
    ]
)


class WorldCache:
    """Irradiance from photons by cells of `width` m and six sides.

    Points are jittered by up to half a cell in their tangent plane, so that cells do not show.
    """

    def __init__(self, width: float) -> None:
        self.width = width
        self._keys = np.zeros(_SLOTS, np.int64)  # 0: a slot is free
        self._cells = np.zeros(_SLOTS, _CELL)
        self._used = 0

    def change(self, share: float) -> None:
        """Forget, where a `share` of the light has changed: little of it, or all where that is 1."""
        _close(self._cells, f32(_CHANGED * (1.0 - share)))

    def light(
        self, points: np.ndarray, estimate: Callable[[np.ndarray], np.ndarray], batch: int, draw: int
    ) -> np.ndarray:
        """Return the light at (n,) RECEIVER points, (n, 16) as estimators do; learn from some of them.

        estimate  returns what (m,) RECEIVER points get from photons, (m, 16); asked for a few of them, and
                  for all that are glossy, whose light depends on where they are seen from
        batch     number of the photons, which may serve several frames
        draw      a number of its own, that selects the random numbers
        """
        if self._used > _FULL:
            self._keys[:], self._cells[:], self._used = 0, 0, 0
        found, inverse = np.zeros((len(points), 16), np.float32), f32(1.0 / self.width)
        own, other = np.empty((2, len(points)), np.int64)
        seed = u32(draw), u32(_DIMENSION)
        self._used += _find(points, inverse, seed, self._keys, True, own)
        chosen = np.empty(len(points), bool)
        _choose(points, own, self._cells, seed, chosen)
        asked = np.flatnonzero(chosen)
        found[asked] = estimate(take(points, asked))
        _learn(asked, own, found, u32(batch), self._cells)
        _find(points, inverse, (seed[0], u32(seed[1] + 1)), self._keys, False, other)
        _look_up(own, other, self._cells, found)
        return found


@jit
def _close(cells, most):
    """Make the sums part of the means, and let these remember so many batches at most."""
    for k in range(len(cells)):
        _fold(cells[k])
        cells[k].batches = min(cells[k].batches, most)


@jit
def _fold(cell):
    """Make a cell's sum part of its mean."""
    if cell.count > f32(0):
        batches = min(cell.batches, f32(_MOST))
        for c in range(3):
            cell.light[c] += (cell.sum[c] / cell.count - cell.light[c]) / (batches + f32(1))
            cell.sum[c] = f32(0)
        cell.batches, cell.count = batches + f32(1), f32(0)


@jit
def _find(points, inverse, seed, keys, insert, slots):
    """Write the slot of each of (n,) RECEIVER points, -1: there is none; return how many were taken.

    inverse  1 / m of the cells;  seed  draw and dimension of the random numbers
    insert   whether cells that are not there yet take one
    """
    mask, taken = i64(len(keys) - 1), i64(0)
    for i in range(len(points)):
        slots[i] = i64(-1)
        if points[i].valid == u32(0):
            continue
        key = _key(points[i], inverse, random4(u32(i), seed[1], seed[0], u32(0)))
        hashed = key * i64(-7046029254386353131)  # 2^64 over the golden ratio
        first = hashed ^ (hashed >> i64(29))
        for step in range(_PROBES):
            slot = (first + i64(step)) & mask
            if keys[slot] == key:
                slots[i] = slot
                break
            if keys[slot] == i64(0):
                if insert:
                    keys[slot] = key
                    slots[i] = slot
                    taken += i64(1)
                break
    return taken


@jit
def _key(point, inverse, u):
    """The number of the cell, int64 above 0, that a RECEIVER jittered by `u` lies in."""
    ng = vec3(point.ng)
    offset = u[0] - f32(0.5), u[1] - f32(0.5), u[2] - f32(0.5)
    away = dot(offset, ng)
    axis, most = 0, f32(0)
    key = i64(0)
    for c in range(3):
        at = point.position[c] * inverse + offset[c] - away * ng[c]
        key = (key << i64(_KEY_BITS)) | (i64(np.floor(at)) & i64((1 << _KEY_BITS) - 1))
        if abs(ng[c]) > most:
            axis, most = c, abs(ng[c])
    side = 2 * axis + (1 if ng[axis] > f32(0) else 0)
    key = (key << i64(3)) | i64(side + 1)
    # the highest bit of x: half of all cells away from those in the same plane that are not INNER
    return key ^ (i64(1) << i64(3 * _KEY_BITS + 2)) if point.valid & u32(INNER) else key


@jit
def _choose(points, slots, cells, seed, chosen):
    """Write which points are estimated: (n,) bool."""
    for i in range(len(points)):
        u, _, _, _ = random4(u32(i), seed[1] + u32(2), seed[0], u32(0))
        new = slots[i] < i64(0) or cells[slots[i]].batches < f32(_YOUNG)
        chosen[i] = points[i].valid != u32(0) and (u < f32(_REFRESHED) or new or points[i].alpha > f32(0))


@jit
def _learn(asked, slots, found, batch, cells):
    """Add what was estimated at the points `asked`, (m,) of (n, 16) `found`, to their cells."""
    for k in range(len(asked)):
        i = asked[k]
        if slots[i] >= i64(0):
            cell = cells[slots[i]]
            if cell.batch != batch:
                _fold(cell)
                cell.batch = batch
            for c in range(3):
                cell.sum[c] += found[i, c]
            cell.count += f32(1)


@jit
def _look_up(own, other, cells, found):
    """Write the irradiance of each point's cell, where one is known, else leave what was estimated.

    other  (n,) the cells of points jittered anew, which are asked where they are known well
    """
    for i in range(len(found)):
        slot = other[i] if other[i] >= i64(0) and cells[other[i]].batches >= f32(_YOUNG) else own[i]
        if slot >= i64(0):
            cell = cells[slot]
            batches = cell.batches + (f32(1) if cell.count > f32(0) else f32(0))
            if batches > f32(0):
                for c in range(3):
                    now = cell.sum[c] / cell.count if cell.count > f32(0) else f32(0)
                    found[i, c] = (cell.batches * cell.light[c] + now) / batches
