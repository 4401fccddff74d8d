"""Photons to receivers through tiles of the screen, on the CPU; `tiled` does the same in compute shaders."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from ispm.optics.bsdf import gloss
from ispm.optics.density import cosine_ratio, density_kernel, photon_counts
from ispm.optics.jit import jit
from ispm.optics.records import PHOTON, RECEIVER
from ispm.optics.vector import add, dot, sub
from ispm.tracer.simd import address, alloca, atomic_add, ldf, ldu, stf
from ispm.tracer.threads import run_threads, thread_count

f32, f64, i32, i64, u32, uint64 = np.float32, np.float64, np.int32, np.int64, np.uint32, np.uint64

CHANNELS = 16
_SIDE = 8  # receivers along a tile's edge
_TILE = _SIDE * _SIDE
_LANES = 8  # receivers of a block, 4 x 2 of the tile's: what one vector instruction works on
_BLOCKS = _TILE // _LANES
_CHUNKS = 16  # of photons, for binning; any number gives the same lists
_FAR = f32(1e15)  # m; its square is a float too


def _word(record: np.dtype, name: str) -> int:
    """Place of a field in its record, in 4 bytes."""
    assert record.fields is not None
    return int(record.fields[name][1]) // 4


_ALPHA, _NG, _VALID, _N, _WO = (_word(RECEIVER, name) for name in ("alpha", "ng", "valid", "n", "wo"))
_RADIUS, _FLUX, _WI, _NORMAL, _HEIGHT = (
    _word(PHOTON, name) for name in ("radius", "flux", "wi", "normal", "height")
)
_WORDS = PHOTON.itemsize // 4
assert RECEIVER.itemsize == PHOTON.itemsize and _word(RECEIVER, "position") == _word(PHOTON, "position") == 0

# A tile's receivers as it works on them: rows of 64 floats, sums behind.
_ROW_NG, _ROW_N, _ROW_WO, _ROW_ALPHA, _ROW_SUMS = 3, 6, 9, 12, 13
_ROWS = _ROW_SUMS + CHANNELS
_WORK_SIZE = _ROWS * _TILE // 2  # in 8 bytes
# Bounds of a tile and of its blocks: low and high corners.
_BOX = 6
_BOXES_SIZE = _BOX * _BLOCKS // 2


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
        out = np.zeros((len(receivers), CHANNELS), f32)
        if not len(photons) or not len(receivers):
            return out
        receivers, photons = np.ascontiguousarray(receivers), np.ascontiguousarray(photons)
        tiles = -(-size[0] // _SIDE), -(-size[1] // _SIDE)
        boxes = np.empty((tiles[0] * tiles[1], _BOX), f32)
        self._run(_bound, address(receivers), size, tiles, len(boxes), address(boxes))
        starts, members = self._bin(photons, np.asarray(clip_from_world, f64), size, tiles, boxes)
        self._run(
            _gather, address(receivers), address(photons), size, tiles[0], starts, members, address(out)
        )
        return out

    def close(self) -> None:
        """Nothing to free."""

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
        visited = address(photons), tiles[0], address(boxes), spans
        self._run(_visit, *visited, np.empty(0, i32), counts)
        ends = np.cumsum(counts.T.ravel(), dtype=i64)
        cursors = np.ascontiguousarray((ends - counts.T.ravel()).reshape(-1, _CHUNKS).T)
        starts, members = np.append(cursors[0], ends[-1]), np.empty(ends[-1], i32)
        self._run(_visit, *visited, members, cursors)
        return starts, members

    def _run(self, kernel: Callable[..., None], *arguments: Any) -> None:
        """Call `kernel` from all threads with a shared counter of work."""
        counter = np.zeros(8, i64)
        run_threads(lambda _: kernel(address(counter), *arguments), self._threads)


@jit
def _vector(base, first):
    """Three floats in a row."""
    return ldf(base, first), ldf(base, first + 1), ldf(base, first + 2)


@jit
def _row_of(k, size, tile, tiles_x):
    """Place of a tile's receiver k among all, -1 off the screen; 4 x 2 neighbors make a block."""
    block, lane = k // _LANES, k % _LANES
    x = (tile % tiles_x) * _SIDE + (block % 2) * 4 + lane % 4
    y = (tile // tiles_x) * _SIDE + (block // 2) * 2 + lane // 4
    return y * size[0] + x if x < size[0] and y < size[1] else i64(-1)


@jit
def _bound(counter, receivers, size, tiles, tile_count, boxes):
    """Find the world boxes of the tiles' receivers; inside out where a tile has none."""
    while True:
        tile = atomic_add(counter, i64(1))
        if tile >= tile_count:
            return
        _empty_box(boxes, tile)
        for k in range(_TILE):
            i = _row_of(k, size, tile, tiles[0])
            if i >= 0 and ldu(receivers, i * _WORDS + _VALID):
                _extend_box(boxes, tile, _vector(receivers, i * _WORDS))


@jit
def _empty_box(boxes, box):
    for axis in range(3):
        stf(boxes, box * _BOX + axis, _FAR)
        stf(boxes, box * _BOX + 3 + axis, -_FAR)


@jit
def _extend_box(boxes, box, point):
    for axis in range(3):
        low, high = box * _BOX + axis, box * _BOX + 3 + axis
        stf(boxes, low, min(ldf(boxes, low), point[axis]))
        stf(boxes, high, max(ldf(boxes, high), point[axis]))


@jit
def _chunk(chunk, count):
    """First photon of a chunk, and the first of the next."""
    return chunk * count // _CHUNKS, (chunk + 1) * count // _CHUNKS


@jit
def _project(counter, photons, clip, size, tiles, spans):
    """Find the first and last tile, along x and along y, that each photon's ellipsoid may be seen in."""
    while True:
        chunk = atomic_add(counter, i64(1))
        if chunk >= _CHUNKS:
            return
        first, end = _chunk(chunk, len(spans))
        for p in range(first, end):
            photon = photons + uint64(p * _WORDS * 4)
            x0, x1 = _extent(photon, clip, 0, size[0], tiles[0])
            y0, y1 = _extent(photon, clip, 1, size[1], tiles[1])
            spans[p, 0], spans[p, 1], spans[p, 2], spans[p, 3] = x0, x1, y0, y1


@jit
def _extent(photon, clip, axis, pixels, tile_count):
    """First and last tile along an axis; the last is before the first if the photon is behind the eye.

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
    """A row of the matrix applied to the photon's center."""
    x, y, z = _vector(photon, 0)
    return clip[row, 0] * f64(x) + clip[row, 1] * f64(y) + clip[row, 2] * f64(z) + clip[row, 3]


@jit
def _form(photon, clip, i, j):
    """The ellipsoid's quadratic form of two rows: a^T (r^2 (1 - n n^T) + h^2 n n^T) b."""
    x, y, z = _vector(photon, _NORMAL)
    r, h = f64(ldf(photon, _RADIUS)), f64(ldf(photon, _HEIGHT))
    an = clip[i, 0] * f64(x) + clip[i, 1] * f64(y) + clip[i, 2] * f64(z)
    bn = clip[j, 0] * f64(x) + clip[j, 1] * f64(y) + clip[j, 2] * f64(z)
    ab = clip[i, 0] * clip[j, 0] + clip[i, 1] * clip[j, 1] + clip[i, 2] * clip[j, 2]
    return r * r * (ab - an * bn) + h * h * an * bn


@jit
def _visit(counter, photons, tiles_x, boxes, spans, members, cursors):
    """Advance cursors[chunk, tile] for each photon in it, and put its index there if `members` has room."""
    while True:
        chunk = atomic_add(counter, i64(1))
        if chunk >= _CHUNKS:
            return
        first, end = _chunk(chunk, len(spans))
        for p in range(first, end):
            photon = photons + uint64(p * _WORDS * 4)
            for y in range(spans[p, 2], spans[p, 3] + 1):
                for x in range(spans[p, 0], spans[p, 1] + 1):
                    tile = y * tiles_x + x
                    if _meets(photon, boxes + uint64(tile * _BOX * 4)):
                        if len(members):
                            members[cursors[chunk, tile]] = p
                        cursors[chunk, tile] += 1


@jit
def _meets(photon, box):
    """Whether a photon's ellipsoid may reach into a box: its sphere does, and its slab does."""
    x, n = _vector(photon, 0), _vector(photon, _NORMAL)
    low, high = _vector(box, 0), _vector(box, 3)
    d2 = (
        _outside2(x[0], low[0], high[0]) + _outside2(x[1], low[1], high[1]) + _outside2(x[2], low[2], high[2])
    )
    half = (high[0] - low[0]) * abs(n[0]) + (high[1] - low[1]) * abs(n[1]) + (high[2] - low[2]) * abs(n[2])
    along = dot(add(low, high), n) - f32(2) * dot(x, n)
    # a little more than reach, for the rounding of the sums
    radius, height = ldf(photon, _RADIUS) * f32(1.0001), ldf(photon, _HEIGHT) * f32(1.0001)
    reach = max(radius, height)
    return (d2 < reach * reach) & (abs(along) - half * f32(1.0001) < f32(2) * height)


@jit
def _outside2(x, low, high):
    """Squared distance of x from an interval."""
    d = max(max(low - x, x - high), f32(0))
    return d * d


@jit
def _gather(counter, receivers, photons, size, tiles_x, starts, members, out):
    """Sum each tile's photons at its receivers."""
    work, boxes = alloca(_WORK_SIZE), alloca(_BOXES_SIZE)
    while True:
        tile = atomic_add(counter, i64(1))
        if tile >= len(starts) - 1:
            return
        if starts[tile] == starts[tile + 1]:
            continue
        glossy = _load(receivers, size, tile, tiles_x, work, boxes)
        for m in range(starts[tile], starts[tile + 1]):
            photon = photons + uint64(i64(members[m]) * _WORDS * 4)
            for block in range(_BLOCKS):
                if _meets(photon, boxes + uint64(block * _BOX * 4)):
                    if glossy:
                        _add_glossy(photon, work + uint64(block * _LANES * 4))
                    else:
                        _add_diffuse(photon, work + uint64(block * _LANES * 4))
        _store(size, tile, tiles_x, work, out)


@jit
def _load(receivers, size, tile, tiles_x, work, boxes):
    """Spread a tile's receivers over the rows of `work`, empty the sums and find the blocks' boxes.

    -> whether any receiver has a glossy lobe
    """
    for word in range(_ROWS * _TILE):
        stf(work, word, f32(0))
    glossy = False
    for block in range(_BLOCKS):
        _empty_box(boxes, block)
    for k in range(_TILE):
        i = _row_of(k, size, tile, tiles_x)
        if i < 0 or ldu(receivers, i * _WORDS + _VALID) == u32(0):
            stf(work, k, _FAR)  # beyond the reach of any photon
            continue
        _extend_box(boxes, k // _LANES, _vector(receivers, i * _WORDS))
        for axis in range(3):
            stf(work, axis * _TILE + k, ldf(receivers, i * _WORDS + axis))
            stf(work, (_ROW_NG + axis) * _TILE + k, ldf(receivers, i * _WORDS + _NG + axis))
            stf(work, (_ROW_N + axis) * _TILE + k, ldf(receivers, i * _WORDS + _N + axis))
            stf(work, (_ROW_WO + axis) * _TILE + k, ldf(receivers, i * _WORDS + _WO + axis))
        alpha = ldf(receivers, i * _WORDS + _ALPHA)
        stf(work, _ROW_ALPHA * _TILE + k, alpha)
        glossy = glossy or alpha > f32(0)
    return glossy


@jit
def _row(work, row, k):
    """A vector of one receiver, from three rows."""
    return ldf(work, row * _TILE + k), ldf(work, (row + 1) * _TILE + k), ldf(work, (row + 2) * _TILE + k)


@jit
def _add_diffuse(photon, work):
    """Add a photon to the sums of a block whose receivers have no glossy lobe."""
    position, normal, wi = _vector(photon, 0), _vector(photon, _NORMAL), _vector(photon, _WI)
    flux, radius, height = _vector(photon, _FLUX), ldf(photon, _RADIUS), ldf(photon, _HEIGHT)
    for k in range(_LANES):
        kappa, light = _arrival(work, k, position, normal, wi, radius, height)
        _add(work, 0, k, light, flux)
        _add_one(work, 3, k, kappa)


@jit
def _add_glossy(photon, work):
    """Add a photon to the sums of a block."""
    position, normal, wi = _vector(photon, 0), _vector(photon, _NORMAL), _vector(photon, _WI)
    flux, radius, height = _vector(photon, _FLUX), ldf(photon, _RADIUS), ldf(photon, _HEIGHT)
    for k in range(_LANES):
        kappa, light = _arrival(work, k, position, normal, wi, radius, height)
        alpha, n, wo = ldf(work, _ROW_ALPHA * _TILE + k), _row(work, _ROW_N, k), _row(work, _ROW_WO, k)
        # gloss() without its gate: a branch would keep the loop from becoming vectors
        dv, fc = gloss(alpha, n, wo, wi)
        visible = (alpha > f32(0)) & (dot(n, wo) > f32(0)) & (dot(n, wi) > f32(0))
        dv = dv if visible else f32(0)
        fc = fc if visible else f32(0)
        _add(work, 0, k, light, flux)
        _add_one(work, 3, k, kappa)
        _add(work, 4, k, light * fc, flux)
        _add(work, 8, k, light * dv * (f32(1) - fc), flux)
        _add(work, 12, k, light * dv * fc, flux)


@jit
def _arrival(work, k, position, normal, wi, radius, height):
    """Density kernel and its product with the cosine ratio at receiver k; zero where the photon is gated."""
    ng = _row(work, _ROW_NG, k)
    wi_ng = dot(wi, ng)
    kappa = density_kernel(sub(_row(work, 0, k), position), normal, radius, height)
    kappa = kappa if photon_counts(wi_ng, dot(normal, ng)) else f32(0)
    ratio = cosine_ratio(dot(wi, _row(work, _ROW_N, k)), wi_ng)
    return kappa, (kappa * ratio if kappa > f32(0) else f32(0))


@jit
def _add(work, channel, k, weight, flux):
    """Add weight times flux to three sums of receiver k."""
    _add_one(work, channel, k, weight * flux[0])
    _add_one(work, channel + 1, k, weight * flux[1])
    _add_one(work, channel + 2, k, weight * flux[2])


@jit
def _add_one(work, channel, k, value):
    place = (_ROW_SUMS + channel) * _TILE + k
    stf(work, place, ldf(work, place) + value)


@jit
def _store(size, tile, tiles_x, work, out):
    """Write a tile's sums to its receivers' rows."""
    for k in range(_TILE):
        i = _row_of(k, size, tile, tiles_x)
        if i >= 0:
            for channel in range(CHANNELS):
                stf(out, i * CHANNELS + channel, ldf(work, (_ROW_SUMS + channel) * _TILE + k))
