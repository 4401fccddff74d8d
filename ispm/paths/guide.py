"""Guiding: gather rays go more often where, by the photons nearby, light comes from.

A receiver takes the photons of the smallest cell about it that has enough of them. The points where they
last scattered make a histogram over the square that `cosine_hemisphere` maps to directions, in which rays
distributed by cosine are uniform. A share of the rays stays uniform, so that no weight exceeds 1 over it.
Source: Jensen, Importance Driven Path Tracing using the Photon Map, EGWR 1995.
"""

from __future__ import annotations

import math

import numpy as np

from ispm.kernels.share import run_shared, shared_rows
from ispm.optics.jit import jit
from ispm.optics.records import take
from ispm.optics.sampling import to_local
from ispm.optics.vector import normalize, sub, vec3
from ispm.photons.cells import BITS, SMALLEST, cell_key, sort_by_cell

f32, i64, u32 = np.float32, np.int64, np.uint32

_RINGS, _SECTORS = 6, 12  # parts of the square: along u1, from the normal outwards, and u2, around it
_EVEN = f32(0.4)  # share of the rays that is uniform
_MIN_PHOTONS, _MAX_PHOTONS = 96, 256  # photons of a histogram: fewer are noise, more come from farther off
_BLOCK = 4  # receivers on a side of those that share one
_CHUNK = 16  # histograms a thread takes at a time


class Guide:
    """Photons by cell, for receivers to find where their light comes from.

    photons   (N,) PHOTON, `height` the length of their last flight, m
    gathered  (N,) bool, whether gather rays find a photon's light
    low       (3,) m, corner of the scene
    diagonal  of the scene, m
    """

    def __init__(self, photons: np.ndarray, gathered: np.ndarray, low: np.ndarray, diagonal: float) -> None:
        photons = take(photons, np.flatnonzero(gathered))
        self._low, self._cell = low.astype(np.float32), diagonal * SMALLEST
        self._keys, order = sort_by_cell(photons, self._low, self._cell)
        photons = take(photons, order)
        self._origins = photons["position"] + photons["height"][:, None] * photons["wi"]
        self._powers = photons["flux"].sum(axis=1)

    def densities(
        self, receivers: np.ndarray, blocks: np.ndarray, threads: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return densities of rays over the square, (m, rings, sectors + 1) float32, of mean 1, with the mean
        of each ring last, and the row that each receiver takes, (n,) int32.

        receivers  (n,) RECEIVER
        blocks     (n,) int: those of one block whose photons are the same share a row
        """
        cells = np.zeros(len(receivers), np.int64)
        if len(self._keys) >= _MIN_PHOTONS:
            _find_cells(receivers, self._keys, self._low, f32(1.0 / self._cell), cells)
        _, cell_rows = np.unique(cells, return_inverse=True)
        _, first, rows = np.unique(cell_rows << 32 | blocks, return_index=True, return_inverse=True)
        out = np.ones((len(first), _RINGS, _SECTORS + 1), np.float32)
        given = self._origins, self._powers, take(receivers, first), cells[first]
        run_shared(lambda counter: _describe(*given, counter, out), threads)
        return out, rows.astype(np.int32)


def square_blocks(size: tuple[int, int]) -> np.ndarray:
    """Return (h w,) the block of neighbours that each receiver of an image is in, row by row."""
    blocks = np.arange(size[1])[:, None] // _BLOCK * size[0] + np.arange(size[0]) // _BLOCK
    return blocks.reshape(-1)


def even_guide(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return (1, rings, sectors + 1) uniform densities as of `Guide.densities`, and `count` rows, int32."""
    return np.ones((1, _RINGS, _SECTORS + 1), np.float32), np.zeros(count, np.int32)


@jit
def guided(densities, row, u1, u2):
    """Return (u1, u2), uniform in [0, 1)^2, warped to the density of row `row`, and that density, of mean 1.

    densities  (m, rings, sectors + 1) float32, as of `Guide.densities`
    """
    u1 *= f32(_RINGS)
    ring = i64(0)
    while ring < _RINGS - 1 and u1 >= densities[row, ring, _SECTORS]:
        u1 -= densities[row, ring, _SECTORS]
        ring += 1
    mean = densities[row, ring, _SECTORS]
    u2 *= f32(_SECTORS) * mean
    sector = i64(0)
    while sector < _SECTORS - 1 and u2 >= densities[row, ring, sector]:
        u2 -= densities[row, ring, sector]
        sector += 1
    density = densities[row, ring, sector]
    most = f32(1.0 - 2.0**-24)
    u1 = (f32(ring) + min(u1 / mean, most)) * f32(1 / _RINGS)
    u2 = (f32(sector) + min(u2 / density, most)) * f32(1 / _SECTORS)
    return min(u1, most), min(u2, most), density


@jit
def _find_cells(receivers, keys, low, per_metre, cells):
    """Write the photons of each receiver's cell, int64: first << 32 | end, 0: there are not enough anywhere.

    receivers  (n,) RECEIVER;  keys  (N,) uint32 of the photons, ascending;  low, per_metre  as of `cell_key`
    """
    last, level, cell = u32(0xFFFFFFFF), i64(0), i64(0)
    for i in range(len(receivers)):
        if receivers[i].valid == u32(0):
            continue
        key = cell_key(receivers[i].position, receivers[i].ng, low, per_metre)
        finer = u32(3 * max(level - i64(1), i64(0)))
        if key >> finer != last >> finer:  # else it is in the cell of the one before
            last, level, cell = key, i64(0), i64(0)
            while level <= BITS and cell == i64(0):
                first, end = _lower(keys, key, level, i64(0)), _lower(keys, key, level, i64(1))
                if end - first >= _MIN_PHOTONS:
                    cell = first << i64(32) | end
                level += i64(cell == i64(0))
        cells[i] = cell


@jit
def _lower(keys, key, level, cell):
    """The number of (N,) uint32 keys before the cell of `key` that is 2^level of the smallest cells wide, or
    before the one that stands `cell` cells after it."""
    value = ((i64(key) >> i64(3) * level) + cell) << i64(3) * level
    first, end = i64(0), i64(len(keys))
    while first < end:
        middle = (first + end) >> i64(1)
        if i64(keys[middle]) < value:
            first = middle + i64(1)
        else:
            end = middle
    return first


@jit
def _describe(origins, powers, receivers, cells, counter, out):
    """Write the densities, (m, rings, sectors + 1), of as many of the (m,) RECEIVER as a thread gets.

    origins, powers  (N, 3) m and (N,) lm of the photons;  cells  (m,) as of `_find_cells`
    """
    for row in shared_rows(counter, _CHUNK, len(cells)):
        if cells[row] > i64(0):
            first, end = cells[row] >> i64(32), cells[row] & i64(0xFFFFFFFF)
            _describe_one(origins, powers, receivers[row], first, end, out[row])


@jit
def _describe_one(origins, powers, receiver, first, end, out):
    """Write the (rings, sectors + 1) densities of a RECEIVER's rays, from the photons first to end."""
    step = max((end - first) // i64(_MAX_PHOTONS), i64(1))
    n, position = vec3(receiver.n), vec3(receiver.position)
    out[:] = f32(0)
    for k in range(first, end, step):
        x, y, z = to_local(normalize(sub(vec3(origins[k]), position)), n)
        if z <= f32(0):
            continue
        around = f32(math.atan2(y, x)) * f32(0.5 / math.pi)
        u1 = min(max(f32(1) - z * z, f32(0)), f32(1))
        _add(out, u1 * f32(_RINGS) - f32(0.5), (around + f32(1)) * f32(_SECTORS) - f32(0.5), powers[k])
    total = f32(0)
    for ring in range(_RINGS):
        for sector in range(_SECTORS):
            total += out[ring, sector]
    if total == f32(0):  # they all come from behind
        out[:] = f32(1)
        return
    share = (f32(1) - _EVEN) * f32(_RINGS * _SECTORS) / total
    for ring in range(_RINGS):
        for sector in range(_SECTORS):
            out[ring, sector] = _EVEN + share * out[ring, sector]
            out[ring, _SECTORS] += out[ring, sector] * f32(1 / _SECTORS)


@jit
def _add(out, ring, sector, power):
    """Add a photon's power, lm, to the four parts of a (rings, sectors + 1) histogram about (ring, sector),
    by bilinear weights; the first part's centre is at (0, 0)."""
    r0, s0 = i64(math.floor(ring)), i64(math.floor(sector))
    across, around = ring - f32(r0), sector - f32(s0)
    for k in range(4):
        r, s = min(max(r0 + (k & 1), 0), _RINGS - 1), (s0 + (k >> 1)) % _SECTORS
        w = (across if k & 1 else f32(1) - across) * (around if k >> 1 else f32(1) - around)
        out[r, s] += w * power
