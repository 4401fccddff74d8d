"""Photons by place: a grid of cells in world space, each with the photons whose kernels reach into it.

It lights points that screen space cannot serve, at any place and in any number.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ispm.accel.normals import unit
from ispm.kernels.simd import address, alloca, atomic_add
from ispm.kernels.threads import run_threads
from ispm.optics.bsdf import gloss_terms
from ispm.optics.density import cosine_ratio, density_kernel, ellipse_kernel, photon_counts
from ispm.optics.jit import jit
from ispm.optics.records import CAUSTIC
from ispm.optics.vector import cross, dot, sub
from ispm.photons.blocks import LANES, TILE, WORDS, WORK, add_to_tile, clear, put, take_out
from ispm.photons.cells import bounds_of

f32, i64, u32 = np.float32, np.int64, np.uint32

_CELLS_MAX = 64  # per axis: 1 MB of counts
_CELL = 2.0  # mean radii: the width of a cell
_CHUNK = 1024  # receivers a thread takes at a time
_NOWHERE = (1 << 26) - 1  # the cell of receivers outside
_PARTS = 4  # of a cell along each axis, by which its receivers are sorted
_SCANNED = 48  # receivers that ask every photon sooner than the lists are made


class PhotonGrid:
    """Lists of photons by cell. The lists are in photon order, so results repeat to the bit.

    They are made when first needed; few points are found their light without.
    photons  (N,) PHOTON with radius and height set
    kernels  (N,) CAUSTIC, the same photons with kernels of their own; None: they have none
    finish   of photons whose flux is not final: called with them and (m,) uint32 rows, whose flux it changes
             in place; once for each that has a point in one of its cells
    """

    def __init__(
        self,
        photons: np.ndarray,
        kernels: np.ndarray | None = None,
        finish: Callable[[np.ndarray, np.ndarray], None] | None = None,
    ) -> None:
        self._kernels = np.zeros(0, CAUSTIC) if kernels is None else kernels
        if kernels is not None:  # balls round the kernels
            photons = photons.copy()
            reach = np.maximum(np.linalg.norm(kernels["u"], axis=1), kernels["height"])
            photons["radius"] = photons["height"] = reach
        self.photons = np.ascontiguousarray(photons)  # kernels read by address
        self._listed = False
        self._finish, self._final = finish, np.zeros(len(photons), bool)

    def _list(self) -> None:
        """Make the lists."""
        if self._listed:
            return
        self._listed, photons = True, self.photons
        reach, (low, high) = photons["radius"].max(), bounds_of(photons)
        low, extent = low - reach, high - low + f32(2) * reach
        wanted = _CELL * float(photons["radius"].mean())
        self._cell = f32(max(wanted, float(extent.max()) / _CELLS_MAX, 1e-30))
        self._low = low.astype(np.float32)
        self._shape = np.minimum(np.ceil(extent / self._cell), _CELLS_MAX).astype(np.int64) + 1
        starts = np.zeros(int(self._shape.prod()) + 1, np.int32)
        _count(photons, self._low, self._cell, self._shape, starts)
        self._starts = np.cumsum(starts, dtype=np.int32)
        self._ids = np.empty(int(self._starts[-1]), np.uint32)
        _fill(photons, self._low, self._cell, self._shape, self._starts[:-1].copy(), self._ids)

    def estimate(self, receivers: np.ndarray, threads: int) -> np.ndarray:
        """Return the light that arrives at points, (n, 16) float32 channels as all estimators do.

        receivers  (n,) RECEIVER
        """
        out = np.zeros((len(receivers), 16), np.float32)
        if not len(self.photons) or not len(receivers):
            return out
        receivers = np.ascontiguousarray(receivers)
        if len(receivers) <= _SCANNED and not self._listed and self._finish is None:
            if len(self._kernels):
                _scan_kernels(receivers, self._kernels, out)
            else:
                count = len(receivers), len(self.photons)
                _scan(address(receivers), address(self.photons), count, address(out))
            return out
        self._list()
        counter = np.zeros(8, np.int64)
        order = np.empty(len(receivers), np.uint64)
        _find_cells(receivers, self._low, self._cell, self._shape, order)
        order.sort()
        if self._finish is not None:
            near = np.zeros(len(self.photons), bool)
            _mark(order, self._starts, self._ids, near)
            near &= ~self._final
            self._finish(self.photons, np.flatnonzero(near).astype(np.uint32))
            self._final |= near

        def work(_: int) -> None:
            if len(self._kernels):
                _gather_kernels(
                    receivers, order, self._kernels, self._starts, self._ids, address(counter), out
                )
            else:
                _gather(
                    address(receivers), order, address(self.photons), self._starts, self._ids,
                    address(counter), address(out),
                )  # fmt: skip

        run_threads(work, threads)
        return out

    def count(self, receivers: np.ndarray, threads: int) -> np.ndarray:
        """Return how many kernels hold each point, (n,) int32, whether they light it or not.

        receivers  (n,) RECEIVER
        """
        out = np.zeros(len(receivers), np.int32)
        if len(self.photons) and len(receivers):
            self._list()
            edges = np.linspace(0, len(receivers), threads + 1).astype(np.int64)

            def work(k: int) -> None:
                rows = slice(edges[k], edges[k + 1])
                _count_kernels(
                    receivers[rows], self.photons, self._low, self._cell, self._shape, self._starts,
                    self._ids, out[rows],
                )  # fmt: skip

            run_threads(work, threads)
        return out


@jit
def _span(photon, low, cell, shape, axis):
    """First and last cell of a photon's ellipsoid along one axis."""
    along = photon.normal[axis] * photon.normal[axis]
    radius2, height2 = photon.radius * photon.radius, photon.height * photon.height
    half = np.sqrt(radius2 * (f32(1) - along) + height2 * along)
    place = photon.position[axis] - low[axis]
    first = i64(max((place - half) / cell, f32(0)))
    return first, min(i64((place + half) / cell), shape[axis] - 1)


@jit
def _count(photons, low, cell, shape, starts):
    for p in range(len(photons)):
        x0, x1 = _span(photons[p], low, cell, shape, 0)
        y0, y1 = _span(photons[p], low, cell, shape, 1)
        z0, z1 = _span(photons[p], low, cell, shape, 2)
        for x in range(x0, x1 + 1):
            for y in range(y0, y1 + 1):
                for z in range(z0, z1 + 1):
                    starts[(x * shape[1] + y) * shape[2] + z + 1] += 1


@jit
def _fill(photons, low, cell, shape, cursors, ids):
    for p in range(len(photons)):
        x0, x1 = _span(photons[p], low, cell, shape, 0)
        y0, y1 = _span(photons[p], low, cell, shape, 1)
        z0, z1 = _span(photons[p], low, cell, shape, 2)
        for x in range(x0, x1 + 1):
            for y in range(y0, y1 + 1):
                for z in range(z0, z1 + 1):
                    c = (x * shape[1] + y) * shape[2] + z
                    ids[cursors[c]] = u32(p)
                    cursors[c] += 1


@jit
def _find_cells(receivers, low, cell, shape, order):
    """Write each receiver's number below that of its cell and of its place there: sorted, those of one cell
    stand together, the nearest side by side. Receivers outside come last."""
    for r in range(len(receivers)):
        position, within = receivers[r].position, u32(0)
        for axis in range(3):
            part = i64((position[axis] - low[axis]) / cell * f32(_PARTS)) & i64(_PARTS - 1)
            within |= u32(part & i64(1)) << u32(axis) | u32(part >> i64(1)) << u32(3 + axis)
        c = _cell_at(position, low, cell, shape)
        c = np.uint64(c) if c >= i64(0) and receivers[r].valid != u32(0) else np.uint64(_NOWHERE)
        order[r] = (c << np.uint64(6) | np.uint64(within)) << np.uint64(32) | np.uint64(r)


@jit
def _run_end(order, first, most):
    """Where those end that stand in one cell with receiver `first` of the order, at `most` or before."""
    end = first + i64(1)
    while end < most and order[end] >> np.uint64(38) == order[first] >> np.uint64(38):
        end += i64(1)
    return end


@jit
def _mark(order, starts, ids, near):
    """Set `near` of the photons whose lists the ordered receivers ask for."""
    first = i64(0)
    while first < len(order):
        cell = i64(order[first] >> np.uint64(38))
        if cell != _NOWHERE:
            for k in range(starts[cell], starts[cell + 1]):
                near[ids[k]] = True
        first = _run_end(order, first, i64(len(order)))


@jit
def _gather(receivers, order, photons, starts, ids, counter, out):
    """Sum the photons of each cell at the receivers in it."""
    work = alloca(WORK)
    while True:
        first = atomic_add(counter, i64(_CHUNK))
        last = min(first + i64(_CHUNK), len(order))
        if first >= last:
            return
        while first < last:
            end = _run_end(order, first, min(first + i64(TILE), last))
            cell = i64(order[first] >> np.uint64(38))
            if cell != _NOWHERE and starts[cell] < starts[cell + 1]:
                _gather_tile(
                    receivers, order, first, end, photons, starts[cell], starts[cell + 1], ids, work, out
                )
            first = end


@jit
def _gather_tile(receivers, order, first, end, photons, start, stop, ids, work, out):
    clear(work)
    glossy = False
    for k in range(end - first):
        glossy |= put(work, k, receivers, i64(u32(order[first + k])))
    blocks = (end - first + i64(LANES - 1)) // i64(LANES)
    for m in range(start, stop):
        add_to_tile(work, photons + np.uint64(i64(ids[m]) * WORDS * 4), blocks, glossy)
    for k in range(end - first):
        take_out(work, k, out, i64(u32(order[first + k])))


@jit
def _gather_kernels(receivers, order, kernels, starts, ids, counter, out):
    """Likewise of photons with kernels of their own, one by one."""
    while True:
        first = atomic_add(counter, i64(_CHUNK))
        if first >= len(order):
            return
        for i in range(first, min(first + i64(_CHUNK), len(order))):
            cell, r = i64(order[i] >> np.uint64(38)), i64(u32(order[i]))
            if cell != _NOWHERE:
                for k in range(starts[cell], starts[cell + 1]):
                    _add_caustic(receivers[r], kernels[ids[k]], out, r)


@jit
def _scan(receivers, photons, count, out):
    """Light few receivers: the same sums as from the lists."""
    work, glossy, lanes = alloca(WORK), False, i64(LANES)
    clear(work)
    for k in range(count[0]):
        glossy |= put(work, k, receivers, i64(k))
    for m in range(count[1]):
        add_to_tile(work, photons + np.uint64(m * WORDS * 4), (count[0] + lanes - i64(1)) // lanes, glossy)
    for k in range(count[0]):
        take_out(work, k, out, i64(k))


@jit
def _scan_kernels(receivers, kernels, out):
    for k in range(len(kernels)):
        for r in range(len(receivers)):
            if receivers[r].valid != u32(0):
                _add_caustic(receivers[r], kernels[k], out, r)


@jit
def _count_kernels(receivers, photons, low, cell, shape, starts, ids, out):
    for r in range(len(receivers)):
        c = _cell_at(receivers[r].position, low, cell, shape)
        if receivers[r].valid == u32(0) or c < i64(0):
            continue
        at = receivers[r].position
        for k in range(starts[c], starts[c + 1]):
            photon = photons[ids[k]]
            normal = (photon.normal[0], photon.normal[1], photon.normal[2])
            place = photon.position
            offset = (at[0] - place[0], at[1] - place[1], at[2] - place[2])
            if density_kernel(offset, normal, photon.radius, photon.height) > f32(0):
                out[r] += 1


@jit
def _cell_at(position, low, cell, shape):
    """The number of the cell that holds a position, -1 outside."""
    c = i64(0)
    for axis in range(3):
        place = (position[axis] - low[axis]) / cell
        if not (place >= f32(0) and place < f32(shape[axis])):
            return i64(-1)
        c = c * shape[axis] + i64(place)
    return c


@jit
def _add_caustic(receiver, photon, out, r):
    """Add what a photon with a kernel of its own brings to receiver `r`. Twin of caustic.wgsl."""
    u, v = (photon.u[0], photon.u[1], photon.u[2]), (photon.v[0], photon.v[1], photon.v[2])
    offset, normal = _offset(receiver, photon), unit(cross(u, v))
    if dot(offset, (photon.front[0], photon.front[1], photon.front[2])) < -photon.reach:
        return
    kappa = ellipse_kernel(offset, u, v, normal, photon.height)
    if kappa > f32(0):
        _add_light(receiver, photon, normal, kappa, out, r)


@jit
def _offset(receiver, photon):
    position = (receiver.position[0], receiver.position[1], receiver.position[2])
    return sub(position, (photon.position[0], photon.position[1], photon.position[2]))


@jit
def _add_light(receiver, photon, normal, kappa, out, r):
    """Add a photon's light of the density kappa, if it lies on the receiver's surface."""
    ng = (receiver.ng[0], receiver.ng[1], receiver.ng[2])
    wi = (photon.wi[0], photon.wi[1], photon.wi[2])
    wi_ng = dot(wi, ng)
    if not photon_counts(wi_ng, dot(normal, ng)):
        return
    n = (receiver.n[0], receiver.n[1], receiver.n[2])
    arriving = kappa * cosine_ratio(dot(wi, n), wi_ng)
    out[r, 3] += kappa
    for channel in range(3):
        out[r, channel] += photon.flux[channel] * arriving
    if receiver.alpha > f32(0):
        wo = (receiver.wo[0], receiver.wo[1], receiver.wo[2])
        plain, grazing, fresnel = gloss_terms(receiver.alpha, n, wo, wi)
        for channel in range(3):
            irradiance = photon.flux[channel] * arriving
            out[r, 4 + channel] += fresnel * irradiance
            out[r, 8 + channel] += plain * irradiance
            out[r, 12 + channel] += grazing * irradiance
