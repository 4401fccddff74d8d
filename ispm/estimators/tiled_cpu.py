"""Photons to receivers through tiles of the screen, on the CPU; `tiled` does the same in compute shaders."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from ispm.kernels.share import run_shared, shared_rows
from ispm.kernels.simd import address, alloca, ldf
from ispm.kernels.threads import thread_count
from ispm.optics.incident import no_light
from ispm.optics.jit import jit
from ispm.optics.records import PHOTON, RECEIVER
from ispm.photons.blocks import (
    BLOCKS,
    BOX,
    HEIGHT,
    LANES,
    NORMAL,
    RADIUS,
    TILE,
    WORDS,
    WORK,
    add_to_tile,
    clear,
    empty_box,
    extend_box,
    is_valid,
    meets,
    put,
    take_out,
    vector,
)

f32, f64, i32, i64, uint64 = np.float32, np.float64, np.int32, np.int64, np.uint64

_SIDE = 8  # receivers along a tile's edge
assert _SIDE * _SIDE == TILE
_CHUNKS = 16  # of photons, for binning; any number gives the same lists


class TiledCpu:
    """The `tiled` estimator on the CPU, see `estimators.Estimator`.

    A tile has the photons whose ellipsoids reach the box round its receivers; eight receivers at a time
    are summed in one vector. The same bytes for any number of threads: a photon list is in photon order.
    """

    def __init__(self, threads: int | None = None) -> None:
        self._threads = thread_count(threads)

    def __call__(
        self, receivers: np.ndarray, photons: np.ndarray, clip_from_world: np.ndarray, size: tuple[int, int]
    ) -> np.ndarray:
        """Return (h*w, 16) float32 channels, see `estimators.Estimator`."""
        # the kernels read by address
        assert receivers.dtype == RECEIVER and photons.dtype == PHOTON and len(receivers) == size[0] * size[1]
        out = no_light(len(receivers))
        if not len(photons) or not len(receivers):
            return out
        receivers, photons = np.ascontiguousarray(receivers), np.ascontiguousarray(photons)
        across, down = tiles = -(-size[0] // _SIDE), -(-size[1] // _SIDE)
        boxes = np.empty((across * down, BOX), f32)
        self._run(_bound, address(receivers), size, across, len(boxes), address(boxes))
        starts, members = self._bin(photons, np.asarray(clip_from_world, f64), size, tiles, boxes)
        self._run(_gather, address(receivers), address(photons), size, across, starts, members, address(out))
        return out

    def _bin(
        self,
        photons: np.ndarray,
        clip: np.ndarray,
        size: tuple[int, int],
        tiles: tuple[int, int],
        boxes: np.ndarray,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Photons of each tile: those of tile t are members[starts[t] : starts[t + 1]], in their order."""
        spans = np.empty((len(photons), 4), i32)
        self._run(_project, address(photons), np.ascontiguousarray(clip), size, tiles, spans)
        counts = np.zeros((_CHUNKS, len(boxes)), i64)
        across, _ = tiles
        visited = address(photons), across, address(boxes), spans
        self._run(_visit, *visited, np.empty(0, i32), counts)
        ends = np.cumsum(counts.T.ravel(), dtype=i64)
        cursors = np.ascontiguousarray((ends - counts.T.ravel()).reshape(-1, _CHUNKS).T)
        starts, members = np.append(cursors[0], ends[-1]), np.empty(ends[-1], i32)
        self._run(_visit, *visited, members, cursors)
        return starts, members

    def _run(self, kernel: Callable[..., None], *arguments: Any) -> None:
        """Call `kernel` from all threads with a shared counter of work."""
        run_shared(lambda counter: kernel(counter, *arguments), self._threads)


@jit
def _row_of(k, size, tile, across):
    """Row of a tile's receiver k among all, int64, -1 off the screen; 4 x 2 neighbors make a block.

    size  receivers across and down;  across  tiles
    """
    block, lane = k // LANES, k % LANES
    x = (tile % across) * _SIDE + (block % 2) * 4 + lane % 4
    y = (tile // across) * _SIDE + (block // 2) * 2 + lane // 4
    return y * size[0] + x if x < size[0] and y < size[1] else i64(-1)


@jit
def _bound(counter, receivers, size, across, tile_count, boxes):
    """Write the world-space boxes of the tiles' receivers, (tiles, BOX) float32; inside out where a tile has
    none. receivers, boxes: addresses."""
    for tile in shared_rows(counter, 1, tile_count):
        empty_box(boxes, tile)
        for k in range(TILE):
            i = _row_of(k, size, tile, across)
            if i >= 0 and is_valid(receivers, i):
                extend_box(boxes, tile, vector(receivers, i * WORDS))


@jit
def _chunk(chunk, count):
    """First photon of a chunk, and the first of the next, int64."""
    return chunk * count // _CHUNKS, (chunk + 1) * count // _CHUNKS


@jit
def _project(counter, photons, clip, size, tiles, spans):
    """Write the first and last tile, along x and along y, that each PHOTON's ellipsoid may be seen in.

    photons  address;  clip  (4, 4) float64;  tiles  across and down;  spans  (N, 4) int32
    """
    (width, height), (across, down) = size, tiles
    for chunk in shared_rows(counter, 1, _CHUNKS):
        first, end = _chunk(chunk, len(spans))
        for p in range(first, end):
            photon = photons + uint64(p * WORDS * 4)
            x0, x1 = _extent(photon, clip, 0, width, across)
            y0, y1 = _extent(photon, clip, 1, height, down)
            spans[p, 0], spans[p, 1], spans[p, 2], spans[p, 3] = x0, x1, y0, y1


@jit
def _extent(photon, clip, axis, pixels, tile_count):
    """First and last tile along an axis, int32; the last is before the first if the photon is behind the eye.

    A plane through the eye, clip[axis] - s clip[3], touches the ellipsoid where its value at the center
    squared equals its quadratic form: an equation of second degree in s. Exact for any projection.
    """
    center, w = _plane_at(photon, clip, axis), _plane_at(photon, clip, 3)
    aa, ab, bb = _form(photon, clip, axis, axis), _form(photon, clip, axis, 3), _form(photon, clip, 3, 3)
    a, b = w * w - bb, center * w - ab
    if not (a > 0.0 and b * b >= 0.0):
        return i32(0), i32(tile_count - 1)  # it reaches around the eye, or is not a number
    if w < 0.0:
        return i32(0), i32(-1)
    root = math.sqrt(max(b * b - a * (center * center - aa), 0.0))
    low, high = (b - root) / a, (b + root) / a
    if axis == 1:
        low, high = -high, -low  # rows count from the top
    # One pixel of slack: the low resolution need not divide the picture, and pixels may be jittered.
    first = max(((low * 0.5 + 0.5) * pixels - 1.0) / _SIDE, 0.0)
    last = min(((high * 0.5 + 0.5) * pixels + 1.0) / _SIDE, tile_count - 1.0)
    return i32(math.floor(min(first, 1e9))), i32(math.floor(max(last, -1.0)))


@jit
def _plane_at(photon, clip, row):
    """A row of the matrix applied to the photon's center, float64."""
    x, y, z = vector(photon, 0)
    return clip[row, 0] * f64(x) + clip[row, 1] * f64(y) + clip[row, 2] * f64(z) + clip[row, 3]


@jit
def _form(photon, clip, i, j):
    """The ellipsoid's quadratic form of two rows, float64: a^T (r^2 (1 - n n^T) + h^2 n n^T) b."""
    x, y, z = vector(photon, NORMAL)
    r, h = f64(ldf(photon, RADIUS)), f64(ldf(photon, HEIGHT))
    an = clip[i, 0] * f64(x) + clip[i, 1] * f64(y) + clip[i, 2] * f64(z)
    bn = clip[j, 0] * f64(x) + clip[j, 1] * f64(y) + clip[j, 2] * f64(z)
    ab = clip[i, 0] * clip[j, 0] + clip[i, 1] * clip[j, 1] + clip[i, 2] * clip[j, 2]
    return r * r * (ab - an * bn) + h * h * an * bn


@jit
def _visit(counter, photons, across, boxes, spans, members, cursors):
    """Advance cursors[chunk, tile] for each photon in the tile, and put its row there if `members` has room.

    photons, boxes  addresses;  spans  (N, 4) int32;  members  int32;  cursors  (chunks, tiles) int64
    """
    for chunk in shared_rows(counter, 1, _CHUNKS):
        first, end = _chunk(chunk, len(spans))
        for p in range(first, end):
            photon = photons + uint64(p * WORDS * 4)
            for y in range(spans[p, 2], spans[p, 3] + 1):
                for x in range(spans[p, 0], spans[p, 1] + 1):
                    tile = y * across + x
                    if meets(photon, boxes + uint64(tile * BOX * 4)):
                        if len(members):
                            members[cursors[chunk, tile]] = p
                        cursors[chunk, tile] += 1


@jit
def _gather(counter, receivers, photons, size, across, starts, members, out):
    """Sum each tile's photons at its receivers, to 16 float32 each; receivers, photons, out: addresses."""
    work = alloca(WORK)
    for tile in shared_rows(counter, 1, len(starts) - 1):
        if starts[tile] == starts[tile + 1]:
            continue
        clear(work)
        glossy = False
        for k in range(TILE):
            i = _row_of(k, size, tile, across)
            glossy |= i >= 0 and put(work, k, receivers, i)
        for m in range(starts[tile], starts[tile + 1]):
            add_to_tile(work, photons + uint64(i64(members[m]) * WORDS * 4), BLOCKS, glossy)
        for k in range(TILE):
            i = _row_of(k, size, tile, across)
            if i >= 0:
                take_out(work, k, out, i)
