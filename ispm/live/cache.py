"""A cache of irradiance in the world: a table of cells that remember what was estimated in them.

The ends of gather rays, and what mirrors and glass show, are many points of which few are worth an estimate
of their own each frame: a cell's mean over frames has less noise than that, and costs a look-up.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ispm.optics.incident import channels
from ispm.optics.jit import jit
from ispm.optics.records import take
from ispm.optics.rng import random4
from ispm.optics.vector import dot, vec3

f32, i64, u32 = np.float32, np.int64, np.uint32

CELL = 0.015  # width of a cell, of the scene's diagonal
_SLOTS = 1 << 18  # a power of two; `atrium` fills 57,000
_FULL = _SLOTS // 2  # cells, of more all are forgotten
_PROBES = 16  # slots looked at for one cell
_REFRESHED = 1 / 8  # of the points that are estimated anew, by lot
_YOUNG = 2.0  # estimates of a cell below which all its points are
_MOST = 512.0  # estimates that a mean remembers
_CHANGED = 4.0  # likewise once light has changed
_KEY_BITS = 20  # of a cell's number along each axis
_DIMENSION = 1 << 24  # of the random numbers that jitter points


class WorldCache:
    """Irradiance from photons by cells of `width` m and six sides.

    Points are jittered by up to half a cell in their tangent plane, so that cells do not show.
    """

    def __init__(self, width: float) -> None:
        self.width = width
        self._keys = np.zeros(_SLOTS, np.int64)  # 0: a slot is free
        self._light = np.zeros((_SLOTS, 3), np.float32)
        self._counts = np.zeros(_SLOTS, np.float32)
        self._used = 0

    def change(self, share: float) -> None:
        """Forget, where a `share` of the light has changed: little of it, or all where that is 1."""
        np.minimum(self._counts, f32(_CHANGED * (1.0 - share)), out=self._counts)

    def light(
        self, points: np.ndarray, estimate: Callable[[np.ndarray], np.ndarray], seed: int
    ) -> np.ndarray:
        """Return the light at (n,) RECEIVER points, (n, 16) as estimators do; learn from some of them.

        estimate  returns what (m,) RECEIVER points get from photons, (m, 16); asked for a few of them, and
                  for all that are glossy, whose light depends on where they are seen from
        seed      of the frame's random numbers
        """
        if self._used > _FULL:
            self._keys[:], self._counts[:], self._used = 0, 0.0, 0
        slots, inverse = np.empty(len(points), np.int64), f32(1.0 / self.width)
        self._used += _find(points, inverse, u32(seed), u32(0), self._keys, True, slots)
        rows = np.arange(len(points), dtype=np.uint32)
        chosen = np.empty(len(points), bool)
        _choose(points, slots, self._counts, u32(seed), chosen)
        asked = np.flatnonzero(chosen)
        found = np.zeros((len(points), 16), np.float32)
        found[asked] = estimate(take(points, asked))
        _learn(asked, slots, found, self._light, self._counts)
        near = np.empty(len(points), np.int64)
        _find(points, inverse, u32(seed), u32(1), self._keys, False, near)
        _look_up(rows, slots, near, self._light, self._counts, found)
        return found


@jit
def _find(points, inverse, seed, draw, keys, insert, slots):
    """Write the slot of each of (n,) RECEIVER points, -1: there is none; return how many were taken.

    inverse  1 / m of the cells;  seed, draw  of the random numbers
    insert   whether cells that are not there yet take one
    """
    mask, taken = i64(len(keys) - 1), i64(0)
    for i in range(len(points)):
        slots[i] = i64(-1)
        if points[i].valid == u32(0):
            continue
        key = _key(points[i], inverse, random4(u32(i), u32(_DIMENSION) + draw, u32(0), seed))
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
    return (key << i64(3)) | i64(side + 1)


@jit
def _choose(points, slots, counts, seed, chosen):
    """Write which points are estimated: (n,) bool."""
    for i in range(len(points)):
        u, _, _, _ = random4(u32(i), u32(_DIMENSION + 2), u32(0), seed)
        slot = slots[i]
        new = slot < i64(0) or counts[slot] < f32(_YOUNG)
        chosen[i] = points[i].valid != u32(0) and (u < f32(_REFRESHED) or new or points[i].alpha > f32(0))


@jit
def _learn(asked, slots, found, light, counts):
    """Add what was estimated at the points `asked`, (m,) of (n, 16) `found`, to the means of their cells."""
    for k in range(len(asked)):
        i = asked[k]
        slot = slots[i]
        if slot >= i64(0):
            count = min(counts[slot], f32(_MOST))
            for c in range(3):
                light[slot, c] += (found[i, c] - light[slot, c]) / (count + f32(1))
            counts[slot] = count + f32(1)


@jit
def _look_up(rows, slots, near, light, counts, found):
    """Write the irradiance of each point's cell, where one is known, else leave what was estimated."""
    for k in range(len(rows)):
        i = i64(rows[k])
        slot = near[i] if near[i] >= i64(0) and counts[near[i]] >= f32(_YOUNG) else slots[i]
        if slot >= i64(0) and counts[slot] > f32(0):
            for c in range(3):
                found[i, c] = light[slot, c]
