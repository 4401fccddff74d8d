"""How dense the photons lie, from which each gets the width of its kernel.

Photons that have scattered light smoothly, and a filter comes after: it is enough to count them in cells of
doubling size. Caustics are as sharp as their kernels are narrow: theirs reach to the nearest neighbors.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ispm.kernels.share import run_shared, shared_rows
from ispm.kernels.simd import address, alloca, ldf, ldu
from ispm.kernels.threads import run_threads
from ispm.optics.dispersion import ALL_BANDS, only_band
from ispm.optics.jit import jit
from ispm.optics.records import INNER
from ispm.optics.vector import dot, scale, sub, vec3
from ispm.photons.cells import BITS, SMALLEST, bounds_of, sort_by_cell
from ispm.photons.nearest import DIMENSIONS, STACK_WORDS, NearestTree, find_nearest

f32, u32, i64 = np.float32, np.uint32, np.int64

NEIGHBORS = 15  # photons within a kernel; 10 to 25 differ by under 2 % in error after the filter
_WANTED = 32  # photons that a cell must hold to be counted: 18 % noise in density, 9 % in radius
_RADIUS_MIN, _RADIUS_MAX = 0.002, 0.1  # of the scene's diagonal
_SLANT_MAX = 8.0  # that a pixel is stretched on a surface seen aslant
_PIXEL_SHARE = 0.75  # least radius over a receiver's pixel: between smaller kernels light falls unseen
WIDTH_SHARE = 0.25  # of an object's width
_HEIGHT = 0.25  # of a kernel over its radius: thin, so that it does not reach other surfaces
_CELLS = (1 << BITS) - 4  # of the smallest ones along an axis, the shifts' left out
_LEVELS = 8  # cell sizes, each twice the one before
_SHIFTS = ((0.0, 0.0, 0.0), (0.381, 0.618, 0.236))  # of the cells, so that no border shows

CAUSTIC_NEIGHBORS = 12  # photons from which a caustic photon's kernel is measured
FOCUSED_NEIGHBORS = 96  # likewise where light from all sides is focused, and photons are not in line
_COVERED = 0.5  # of the disc that holds them: over all of it, the radii's own noise would be larger
_CROWDED = 4.0  # times as dense as the mean
_CAUSTIC_RADIUS_MIN, _CAUSTIC_RADIUS_MAX = 1e-5, 0.05  # of the scene's diagonal
TURN = 0.1  # of the diagonal: how far a radian between normals counts as away
_CLOSE = 0.5  # of a radius: what a wall close by leaves of it, or few photons would outshine the rest
_SAGITTA = 1.5  # a kernel's height over that of the curved surface it spans
_PIXEL_RADIUS = f32(math.sqrt(2.0 / 3.0))  # over a pixel: a kernel's variance r^2 / 8 is its 1 / 12 then
_NEIGHBORS_MAX = 128
_ROOM = _NEIGHBORS_MAX // 2  # uint64 that hold as many float32 squares, or uint32 rows
_CHUNK = 256  # photons a thread takes at a time


class Pixels(NamedTuple):
    """How wide pixels are on surfaces, world space.

    plane  (4,) its value at (x, y, z, 1) is the width in m of a pixel there that is seen face on
    eye    (4,) its position and 1, or the direction to it and 0 (orthographic): where it sees a surface
           aslant, a pixel covers more of it
    """

    plane: np.ndarray
    eye: np.ndarray


class _Limits(NamedTuple):
    """Least and largest radius, m, and the factor on every radius."""

    low: np.float32
    high: np.float32
    smoothing: np.float32


class _Neighbors(NamedTuple):
    """Photons and their neighbors: address of a NearestTree's nodes, and its starts; (N,) uint32, the photon
    of each of its points; and the number of neighbors to look for."""

    nodes: np.uint64
    starts: np.ndarray
    order: np.ndarray
    wanted: np.int64


def measure_radii(
    photons: np.ndarray,
    diagonal: float,
    smoothing: float = 1.0,
    pixels: Pixels | None = None,
    widths: np.ndarray | None = None,
    threads: int = 1,
) -> None:
    """Write `radius` and `height` of each photon's kernel, from the density of photons around it.

    photons    (N,) PHOTON, changed in place
    diagonal   of the scene, metres: no radius is below 0.002 or above 0.1 of it
    smoothing  factor on every radius
    pixels     of the receivers, at most 4/3 of a radius wide; None: receivers lie anywhere
    widths     (I,) float32 m, of the instances: a kernel wider than its object would lose its light past
               the edges, so none is wider than a quarter of it; None: objects are wide
    The radius is that of a disc that holds `NEIGHBORS` photons. Density is counted in the smallest
    cell of a hierarchy that holds enough photons facing the same way: a plane cuts a cell of side c
    in c^2 / (|nx| + |ny| + |nz|) on average over its offset in the cell. A photon of more flux than
    their mean spreads over as much more area: it stands for more light that few photons carry.
    """
    if not len(photons):
        return
    limits = _Limits(f32(diagonal * _RADIUS_MIN), f32(diagonal * _RADIUS_MAX), f32(smoothing))
    around, widest = _count_around(photons, diagonal, threads), _reach_on_objects(photons, widths)
    _write_radii(photons, *around, widest, limits, for_kernels(pixels, _PIXEL_SHARE))


def for_kernels(pixels: Pixels | None, share: float = 1.0) -> Pixels:
    """Return float32 pixels of a share of the width; None: their width is 0."""
    plane, eye = pixels or (np.zeros(4), np.zeros(4))
    return Pixels((share * plane).astype(np.float32), np.asarray(eye, np.float32))


def is_crowded(photons: np.ndarray, diagonal: float, threads: int = 1) -> np.ndarray:
    """Return (N,) bool: photons that lie four times as dense as the mean over the surfaces that they light.

    The mean, not the median: most photons may be in the caustics. It is the same for any number of photons.
    """
    if not len(photons):
        return np.zeros(0, np.bool_)
    log_density, _ = _count_around(photons, diagonal, threads)
    area = np.exp(-log_density.astype(np.float64))
    area = np.minimum(area, math.pi * (_RADIUS_MAX * diagonal) ** 2 / NEIGHBORS)
    return np.asarray(area < area.mean() / _CROWDED)


def _count_around(photons: np.ndarray, diagonal: float, threads: int) -> np.ndarray:
    """(2, N) float32: the logarithm of the photons per m2 around each, and the mean of their flux, lm."""
    low, high = bounds_of(photons)
    cell = f32(max(diagonal * SMALLEST, float((high - low).max()) / _CELLS))
    around = np.empty((len(_SHIFTS), 2, len(photons)), np.float32)
    low -= f32(2.0) * cell

    def work(thread: int) -> None:
        for k in range(thread, len(_SHIFTS), used):
            shift = np.array(_SHIFTS[k], np.float32) * cell * f32(0.9)
            keys, order = sort_by_cell(photons, low - shift, float(cell))
            _write_count(photons, keys, order, cell, around[k])

    used = min(threads, len(_SHIFTS))
    run_threads(work, used)
    return np.asarray(around.mean(axis=0))


def _reach_on_objects(photons: np.ndarray, widths: np.ndarray | None) -> np.ndarray:
    """(N,) float32: the largest radius that suits the object under each photon."""
    if widths is None:
        return np.full(len(photons), np.inf, np.float32)
    return np.asarray((f32(WIDTH_SHARE) * widths)[photons["instance"] & ~np.uint32(INNER)])


@jit(allocates=True)
def _write_count(photons, keys, order, cell, around):
    """Write the logarithm of the density, 1/m2, of (N,) PHOTON and their mean flux, lm, from the smallest
    cell with enough photons.

    keys, order  as of `sort_by_cell`;  cell  m, width of the smallest;  around  (2, N)
    """
    n = len(keys)
    count = np.zeros(n, np.float32)
    side = np.zeros(n, np.float32)
    brought = np.zeros(n + 1, np.float64)  # by photons up to each, in order
    for i in range(n):
        brought[i + 1] = brought[i] + _flux(photons[order[i]], ALL_BANDS)
    for level in range(_LEVELS - 1, -1, -1):
        shift = u32(3 * level)
        first = 0
        for i in range(1, n + 1):
            if i == n or keys[i] >> shift != keys[first] >> shift:
                if i - first >= _WANTED or level == _LEVELS - 1:
                    mean = f32((brought[i] - brought[first]) / (i - first))
                    for j in range(first, i):
                        count[j] = f32(i - first)
                        side[j] = cell * f32(1 << level)
                        around[1, order[j]] = mean
                first = i
    for i in range(n):
        p = order[i]
        nx, ny, nz = vec3(photons[p].normal)
        tilt = abs(nx) + abs(ny) + abs(nz)
        around[0, p] = f32(math.log(count[i] * tilt / (side[i] * side[i])))


@jit
def _write_radii(photons, log_density, mean_flux, widest, limits, pixels):
    """Write radius and height of (N,) PHOTON; mean_flux: (N,) float32 lm, around each; widest: (N,) m."""
    for i in range(len(photons)):
        photon, density = photons[i], f32(math.exp(log_density[i]))
        least = _width(photon, pixels) * _slant(photon, pixels)
        heavier = max(_flux(photon, ALL_BANDS) / max(mean_flux[i], f32(1e-30)), f32(1))
        radius = f32(math.sqrt(f32(NEIGHBORS) * heavier / (f32(math.pi) * density)))
        photon.radius = _limited(radius, limits, widest[i], least)
        photon.height = f32(_HEIGHT) * photon.radius


@jit
def _limited(radius, limits, widest, least):
    """Return a radius in m within _Limits, at most `widest`, and at least `least` all the same."""
    radius = min(min(max(radius, limits.low), limits.high) * limits.smoothing, widest)
    return max(radius, min(least, limits.high))


@jit
def _width(photon, pixels):
    """Width in m of a pixel at a PHOTON."""
    return dot(pixels.plane, photon.position) + pixels.plane[-1]


@jit
def _slant(photon, pixels):
    """How much longer a pixel is on the surface at a PHOTON than it is wide, to a limit."""
    wo = sub(vec3(pixels.eye), scale(pixels.eye[-1], vec3(photon.position)))
    distance = f32(math.sqrt(dot(wo, wo)))
    if distance == f32(0):
        return f32(1)
    return min(distance / max(abs(dot(wo, photon.normal)), f32(1e-12)), f32(_SLANT_MAX))


def measure_caustic_radii(
    photons: np.ndarray,
    diagonal: float,
    smoothing: float = 1.0,
    pixels: Pixels | None = None,
    widths: np.ndarray | None = None,
    neighbors: int = CAUSTIC_NEIGHBORS,
    threads: int = 1,
    clear: np.ndarray | None = None,
) -> None:
    """Write `radius` and `height` of each caustic photon's kernel, from the photons next to it.

    photons    (N,) PHOTON, caustic ones alone, changed in place
    diagonal   of the scene, metres: no radius is below 1e-5 or above 0.05 of it
    pixels     of the picture: no kernel is narrower than they are, or much of its light would fall between
               their centres
    neighbors  a kernel covers half the disc that holds so many, of those that face the same way: a turn of a
               radian is as far as 0.1 of the diagonal
    clear      (N,) float32 m that a radius should not exceed, though it may take off half of it at most: the
               distance to the mirror or glass that the photon comes from, behind which its light would show
    smoothing, widths  as in `measure_radii`
    A photon of more flux than its neighbours spreads over as much more area, so that it stands out as
    little; one of a single band is compared by what they have in that. Where the surface bends, kernels are
    high enough to reach down to it. The same bytes for any number of threads.
    """
    if not len(photons):
        return
    assert 0 < neighbors <= _NEIGHBORS_MAX
    points, order = points_in_order(photons, f32(TURN * diagonal))
    tree = NearestTree(points)
    near = _Neighbors(address(tree.nodes), tree.starts, order, i64(neighbors))
    low, high = _CAUSTIC_RADIUS_MIN * diagonal, _CAUSTIC_RADIUS_MAX * diagonal
    limits, seen = _Limits(f32(low), f32(high), f32(smoothing)), for_kernels(pixels)
    widest = _reach_on_objects(photons, widths)
    free = np.full(len(photons), np.inf, np.float32) if clear is None else clear
    run_shared(lambda count: _write_caustic_radii(photons, near, widest, free, limits, seen, count), threads)


def points_in_order(photons: np.ndarray, turn: np.float32) -> tuple[np.ndarray, np.ndarray]:
    """Return (N, 6) float32 positions and normals times `turn`, along a curve through space, and (N,) uint32,
    the photon of each."""
    position = photons["position"]
    low, high = position.min(axis=0), position.max(axis=0)
    _, order = sort_by_cell(photons, low, max(float((high - low).max()) / (1 << BITS), 1e-30))
    points = np.empty((len(photons), DIMENSIONS), np.float32)
    points[:, :3] = position[order]
    points[:, 3:] = photons["normal"][order] * turn
    return points, order


@jit
def _write_caustic_radii(photons, neighbors, widest, clear, limits, pixels, counter):
    """Write radius and height of as many of (N,) PHOTON as a thread gets; widest, clear: (N,) float32 m."""
    squares, rows, stack = alloca(_ROOM), alloca(_ROOM), alloca(STACK_WORDS)
    nodes, starts, order, wanted = neighbors
    reach = f32(math.sqrt(f32(1.0 / _COVERED))) * limits.high
    for point in shared_rows(counter, _CHUNK, len(order)):
        found = find_nearest(nodes, starts, i64(point), wanted, reach, squares, rows, stack)
        i = order[point]
        photon, radius = photons[i], limits.high
        if found == wanted:
            band = only_band(vec3(photon.flux))
            around = max(_flux_of(photons, order, rows, found, band), f32(1e-30))
            brighter = max(f32(wanted) * _flux(photon, band) / around, f32(1))
            radius = f32(math.sqrt(f32(_COVERED) * ldf(squares, wanted - i64(1)) * brighter))
        radius = _limited(radius, limits, widest[i], least_radius(photon, pixels))
        radius = min(radius, max(clear[i], f32(_CLOSE) * radius))
        photon.radius = radius
        sagitta = f32(_SAGITTA) * _bend(photons, photon, order, rows, found) * radius
        photon.height = min(max(f32(_HEIGHT), sagitta), f32(1)) * radius


@jit
def least_radius(photon, pixels):
    """Return the radius in m of a disc at a PHOTON whose kernel blurs as much as a pixel's square does."""
    return _PIXEL_RADIUS * _width(photon, pixels) * f32(math.sqrt(_slant(photon, pixels)))


@jit
def _flux(photon, band):
    """Sum of a PHOTON's channels, or what it has in a band alone, lm."""
    if band != ALL_BANDS:
        return photon.flux[band]
    return photon.flux[0] + photon.flux[1] + photon.flux[2]


@jit
def _flux_of(photons, order, rows, found, band):
    """Sum of the neighbors' `_flux`, lm; rows: address of `found` uint32 of the order."""
    total = f32(0)
    for k in range(found):
        total += _flux(photons[order[i64(ldu(rows, i64(k)))]], band)
    return total


@jit
def _bend(photons, photon, order, rows, found):
    """Half the curvature of the surface, 1/m: the most that it falls away under a neighbor, half its
    distance times its turn, over the square of the farthest one's distance. The rest as of `_flux_of`."""
    most, farthest = f32(0), f32(1e-30)
    for k in range(found):
        other = photons[order[i64(ldu(rows, i64(k)))]]
        away2, turn2 = f32(0), f32(0)
        for axis in range(3):
            away, turn = (
                other.position[axis] - photon.position[axis],
                other.normal[axis] - photon.normal[axis],
            )
            away2 += away * away
            turn2 += turn * turn
        most, farthest = max(most, away2 * turn2), max(farthest, away2)
    return f32(0.5) * f32(math.sqrt(most)) / farthest
