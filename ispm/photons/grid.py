"""A grid of cells in world space, each with the photons whose kernels reach into it.

It lights points that screen space cannot serve: any points, in any number.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ispm.accel.normals import unit
from ispm.kernels.share import run_shared, shared_rows
from ispm.kernels.simd import address, alloca
from ispm.optics.density import density_kernel
from ispm.optics.incident import no_light
from ispm.optics.jit import jit
from ispm.optics.records import CAUSTIC
from ispm.optics.vector import cross, dot, sub, vec3
from ispm.photons.blocks import LANES, TILE, WORDS, WORK, add_to_tile, clear, put, take_out
from ispm.photons.cells import bounds_of
from ispm.photons.ellipses import ELLIPSE_BYTES, add_ellipse_to_tile

f32, i64, u32 = np.float32, np.int64, np.uint32

_CELLS_MAX = 64  # per axis: 1 MB of counts
_CELL = 2.0  # mean radii: the width of a cell
_CHUNK = 1024  # receivers a thread takes at a time
_NOWHERE = (1 << 26) - 1  # the cell of receivers outside
_PARTS = 4  # of a cell along each axis, by which its receivers are sorted
_ROUND = f32(1.0 + 1e-5)  # square of an ellipse's radius in its own units, with room for rounding
_SCANNED = 48  # receivers at most that ask every photon, in less time than the lists take to make


class _Lists(NamedTuple):
    """Cells and the photons of each.

    low     (3,) float32 m, corner of the grid
    cell    m, width of a cell
    shape   (3,) int64, cells along each axis
    starts  (cells + 1,) int32 and ids (n,) uint32: the photons of cell c are ids[starts[c] : starts[c + 1]]
    """

    low: np.ndarray
    cell: np.float32
    shape: np.ndarray
    starts: np.ndarray
    ids: np.ndarray


class PhotonGrid:
    """Lists of photons by cell. The lists are in photon order, so results repeat to the bit.

    They are made when first needed; few points are lit without them.
    photons  (N,) PHOTON with radius and height set
    kernels  (N,) CAUSTIC, the same photons with kernels of their own; None: they have none
    finish   of kernels that are not final: called with them, PHOTON or CAUSTIC, and (m,) uint32 rows, which
             it changes in place, but grows none; once for each that has a point in one of its cells
    """

    def __init__(
        self,
        photons: np.ndarray,
        kernels: np.ndarray | None = None,
        finish: Callable[[np.ndarray, np.ndarray], None] | None = None,
    ) -> None:
        self._kernels = np.zeros(0, CAUSTIC) if kernels is None else np.ascontiguousarray(kernels)
        self.photons = np.ascontiguousarray(photons)  # read by address
        self._lists: _Lists | None = None
        self._finish, self._final = finish, np.zeros(len(photons), bool)

    @property
    def _drawn(self) -> np.ndarray:
        """What is summed: (N,) CAUSTIC where photons have kernels of their own, else PHOTON."""
        return self._kernels if len(self._kernels) else self.photons

    def _listed(self) -> _Lists:
        """Return the lists, made where they are not yet."""
        if self._lists is None:
            photons, halves = self.photons, np.empty((len(self.photons), 3), np.float32)
            if len(self._kernels):
                mean = float(_kernel_halves(self._kernels, halves))
            else:
                _disc_halves(photons, halves)
                mean = float(photons["radius"].mean())
            reach, (low, high) = halves.max(), bounds_of(photons)
            low, extent = low - reach, high - low + f32(2) * reach
            wanted = _CELL * mean
            cell = f32(max(wanted, float(extent.max()) / _CELLS_MAX, 1e-30))
            shape = np.minimum(np.ceil(extent / cell), _CELLS_MAX).astype(np.int64) + 1
            starts, none = np.zeros(int(shape.prod()) + 1, np.int32), np.zeros(0, np.uint32)
            grid = _Lists(low.astype(np.float32), cell, shape, starts, none)
            _list(photons, halves, grid, starts[1:])
            starts = np.cumsum(starts, dtype=np.int32)
            self._lists = grid._replace(starts=starts, ids=np.empty(int(starts[-1]), np.uint32))
            _list(photons, halves, self._lists, starts[:-1].copy())
        return self._lists

    def estimate(self, receivers: np.ndarray, threads: int) -> np.ndarray:
        """Return the light that arrives at points, (n, 16) float32 channels as all estimators do.

        receivers  (n,) RECEIVER
        """
        out = no_light(len(receivers))
        if not len(self.photons) or not len(receivers):
            return out
        receivers = np.ascontiguousarray(receivers)
        if len(receivers) <= _SCANNED and self._lists is None and self._finish is None:
            self._gather(receivers, *_one_cell(receivers, len(self.photons)), 1, out)
            return out
        lists = self._listed()
        order = np.empty(len(receivers), np.uint64)
        run_shared(lambda counter: _find_cells(receivers, lists, counter, order), threads)
        order.sort()
        if self._finish is not None:
            near = np.zeros(len(self.photons), bool)
            _mark(order, lists, near)
            near &= ~self._final
            self._finish(self._drawn, np.flatnonzero(near).astype(np.uint32))
            self._final |= near
        self._gather(receivers, order, lists, threads, out)
        return out

    def _gather(
        self, receivers: np.ndarray, order: np.ndarray, lists: _Lists, threads: int, out: np.ndarray
    ) -> None:
        """Write the light at (n,) RECEIVER, ordered as `_find_cells` does, to (n, 16) float32 zeros."""
        ellipses = len(self._kernels) > 0
        photons = address(self._drawn)
        points, sums = address(receivers), address(out)
        run_shared(lambda count: _gather(points, order, photons, ellipses, lists, count, sums), threads)

    def each(self, receiver: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the photons that light a point, (m,) rows, and what each brings, (m, 3) float32 lx.

        receiver  (1,) RECEIVER
        Together they bring what `estimate` returns, but for the rounding of sums.
        """
        reach2 = self.photons["radius"] ** 2 + self.photons["height"] ** 2
        if len(self._kernels):
            u, v, height = (self._kernels[name] for name in ("u", "v", "height"))
            reach2 = (u * u).sum(axis=1) + (v * v).sum(axis=1) + height * height
        offsets = self.photons["position"] - receiver["position"]
        near = np.flatnonzero((offsets * offsets).sum(axis=1) <= _ROUND * reach2)
        if self._finish is not None:
            rows = near[~self._final[near]]
            self._finish(self._drawn, rows.astype(np.uint32))
            self._final[rows] = True
        # The point many times over, in cells of one photon each.
        points, count = np.repeat(receiver, len(near)), len(near)
        cells = np.arange(count, dtype=np.uint64)
        ids, starts = near.astype(np.uint32), np.arange(count + 1, dtype=np.int32)
        lists = _Lists(np.zeros(3, np.float32), f32(0), np.ones(3, np.int64), starts, ids)
        out = np.zeros((count, 16), np.float32)
        self._gather(points, cells << np.uint64(38) | cells, lists, 1, out)
        light = out[:, :3]
        rows = np.flatnonzero(light.any(axis=1))
        return near[rows], light[rows]

    def count(self, receivers: np.ndarray, threads: int) -> np.ndarray:
        """Return how many kernels hold each point, (n,) int32, whether they light it or not.

        receivers  (n,) RECEIVER
        """
        out = np.zeros(len(receivers), np.int32)
        if len(self.photons) and len(receivers):
            lists = self._listed()
            run_shared(lambda counter: _count_kernels(receivers, self.photons, lists, counter, out), threads)
        return out


def _one_cell(receivers: np.ndarray, photon_count: int) -> tuple[np.ndarray, _Lists]:
    """Return receivers in order, and lists by which each of them asks every photon."""
    cells = np.where(receivers["valid"] != 0, 0, _NOWHERE).astype(np.uint64)
    order = cells << np.uint64(38) | np.arange(len(receivers), dtype=np.uint64)
    starts, ids = np.array([0, photon_count], np.int32), np.arange(photon_count, dtype=np.uint32)
    return order, _Lists(np.zeros(3, np.float32), f32(0), np.ones(3, np.int64), starts, ids)


@jit
def _disc_halves(photons, halves):
    """Write half the extents, (N, 3) float32 m, of the ellipsoids of PHOTON kernels."""
    for p in range(len(photons)):
        radius2, height2 = photons[p].radius * photons[p].radius, photons[p].height * photons[p].height
        for axis in range(3):
            along = photons[p].normal[axis] * photons[p].normal[axis]
            halves[p, axis] = np.sqrt(radius2 * (f32(1) - along) + height2 * along)


@jit
def _kernel_halves(kernels, halves):
    """Write the same of (N,) CAUSTIC; return the mean radius of discs as large as their ellipses, m."""
    total = f32(0)
    for p in range(len(kernels)):
        u, v, height = vec3(kernels[p].u), vec3(kernels[p].v), kernels[p].height
        n = unit(cross(u, v))
        for axis in range(3):
            across = height * n[axis]
            halves[p, axis] = np.sqrt(u[axis] * u[axis] + v[axis] * v[axis] + across * across)
        total += np.sqrt(np.sqrt(dot(u, u) * dot(v, v)))
    return total / f32(len(kernels))


@jit
def _span(photon, half, grid, axis):
    """First and last cell, int64, of what reaches `half` m from a PHOTON along one axis."""
    center = photon.position[axis] - grid.low[axis]
    first = i64(max((center - half) / grid.cell, f32(0)))
    return first, min(i64((center + half) / grid.cell), grid.shape[axis] - 1)


@jit
def _list(photons, halves, grid, cursors):
    """Advance (cells,) int32 cursors for each PHOTON in a cell, and put its row there in `grid.ids`, if these
    have room.

    halves  (N, 3) float32 m of their kernels
    """
    for p in range(len(photons)):
        x0, x1 = _span(photons[p], halves[p, 0], grid, 0)
        y0, y1 = _span(photons[p], halves[p, 1], grid, 1)
        z0, z1 = _span(photons[p], halves[p, 2], grid, 2)
        for x in range(x0, x1 + 1):
            for y in range(y0, y1 + 1):
                for z in range(z0, z1 + 1):
                    c = (x * grid.shape[1] + y) * grid.shape[2] + z
                    if len(grid.ids):
                        grid.ids[cursors[c]] = u32(p)
                    cursors[c] += 1


@jit
def _find_cells(receivers, grid, counter, order):
    """Write the row of each of (n,) RECEIVER, to (n,) uint64, below the number of its cell and its position
    there: sorted, those of one cell stand together, the nearest side by side. Receivers outside come last."""
    for r in shared_rows(counter, _CHUNK, len(receivers)):
        position, within = receivers[r].position, u32(0)
        for axis in range(3):
            part = i64((position[axis] - grid.low[axis]) / grid.cell * f32(_PARTS)) & i64(_PARTS - 1)
            within |= u32(part & i64(1)) << u32(axis) | u32(part >> i64(1)) << u32(3 + axis)
        c = _cell_at(position, grid)
        c = np.uint64(c) if c >= i64(0) and receivers[r].valid != u32(0) else np.uint64(_NOWHERE)
        order[r] = (c << np.uint64(6) | np.uint64(within)) << np.uint64(32) | np.uint64(r)


@jit
def _run_end(order, first, most):
    """Row of the order, int64, at most `most`, behind the receivers in one cell with that of row `first`."""
    end = first + i64(1)
    while end < most and order[end] >> np.uint64(38) == order[first] >> np.uint64(38):
        end += i64(1)
    return end


@jit
def _mark(order, lists, near):
    """Set (N,) bool `near` of the photons in whose cells there are receivers of the order, (n,) uint64."""
    first = i64(0)
    while first < len(order):
        cell = i64(order[first] >> np.uint64(38))
        if cell != _NOWHERE:
            for k in range(lists.starts[cell], lists.starts[cell + 1]):
                near[lists.ids[k]] = True
        first = _run_end(order, first, i64(len(order)))


@jit
def _gather(receivers, order, photons, ellipses, lists, counter, out):
    """Sum the photons of each cell at the receivers in it, some cells a thread.

    receivers, out  addresses of RECEIVER and of 16 float32 a receiver
    photons         likewise, PHOTON or, if `ellipses`, CAUSTIC
    """
    work = alloca(WORK)
    for chunk in shared_rows(counter, 1, -(-len(order) // _CHUNK)):
        first, last = chunk * _CHUNK, min((chunk + 1) * _CHUNK, len(order))
        while first < last:
            end = _run_end(order, first, min(first + i64(TILE), last))
            cell = i64(order[first] >> np.uint64(38))
            if cell != _NOWHERE and lists.starts[cell] < lists.starts[cell + 1]:
                ids = lists.ids[lists.starts[cell] : lists.starts[cell + 1]]
                _gather_tile(receivers, order[first:end], photons, ellipses, ids, work, out)
            first = end


@jit
def _gather_tile(receivers, order, photons, ellipses, ids, work, out):
    """Sum some photons, (m,) uint32 rows, at up to 64 receivers, (k,) uint64; work: address of WORK words."""
    clear(work)
    glossy = False
    for k in range(len(order)):
        glossy |= put(work, k, receivers, i64(u32(order[k])))
    blocks = (len(order) + i64(LANES - 1)) // i64(LANES)
    for m in range(len(ids)):
        if ellipses:
            add_ellipse_to_tile(work, photons + np.uint64(i64(ids[m]) * ELLIPSE_BYTES), blocks, glossy)
        else:
            add_to_tile(work, photons + np.uint64(i64(ids[m]) * WORDS * 4), blocks, glossy)
    for k in range(len(order)):
        take_out(work, k, out, i64(u32(order[k])))


@jit
def _count_kernels(receivers, photons, lists, counter, out):
    """Write how many kernels of (N,) PHOTON hold each of (n,) RECEIVER to (n,) int32 zeros."""
    for r in shared_rows(counter, _CHUNK, len(receivers)):
        c = _cell_at(receivers[r].position, lists)
        if receivers[r].valid == u32(0) or c < i64(0):
            continue
        for k in range(lists.starts[c], lists.starts[c + 1]):
            photon = photons[lists.ids[k]]
            offset = sub(vec3(receivers[r].position), vec3(photon.position))
            if density_kernel(offset, vec3(photon.normal), photon.radius, photon.height) > f32(0):
                out[r] += 1


@jit
def _cell_at(position, grid):
    """The number of the cell that holds a position, int64, -1 outside."""
    c = i64(0)
    for axis in range(3):
        along = (position[axis] - grid.low[axis]) / grid.cell
        if not (along >= f32(0) and along < f32(grid.shape[axis])):
            return i64(-1)
        c = c * grid.shape[axis] + i64(along)
    return c
