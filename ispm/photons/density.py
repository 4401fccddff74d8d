"""How dense the photons lie, from which each gets the width of its kernel.

Photons that have scattered light smoothly, and a filter comes after: to count them in cells of doubling
size does. Caustics are as sharp as their kernels are narrow: theirs reach to the neighbours themselves.
"""

from __future__ import annotations

import math

import numpy as np

from ispm.kernels.simd import address, alloca, atomic_add, ldf, ldu
from ispm.kernels.threads import run_threads
from ispm.optics.jit import jit
from ispm.optics.vector import dot
from ispm.photons.cells import BITS, SMALLEST, bounds_of, sort_by_cell
from ispm.photons.nearest import DIMENSIONS, STACK_WORDS, NearestTree, find_nearest

f32, u32, i64 = np.float32, np.uint32, np.int64

NEIGHBORS = 15  # photons within a kernel; 10 to 25 differ by under 2 % in error after the filter
_WANTED = 32  # photons that a cell must hold to be counted: 18 % noise in density, 9 % in radius
_RADIUS_MIN, _RADIUS_MAX = 0.002, 0.1  # of the scene's diagonal
_SLANT_MAX = 8.0  # that a pixel is stretched on a surface seen aslant
_PIXEL_SHARE = 0.75  # least radius over a receiver's pixel: between smaller kernels light falls unseen
_WIDTH_SHARE = 0.25  # of an object's width
_HEIGHT = 0.25  # of a kernel over its radius: thin, so that it does not reach other surfaces
_CELLS = (1 << BITS) - 4  # of the smallest ones along an axis, the shifts' left out
_LEVELS = 8  # cell sizes, each twice the one before
_SHIFTS = ((0.0, 0.0, 0.0), (0.381, 0.618, 0.236))  # of the cells, so that no border shows

CAUSTIC_NEIGHBORS = 12  # photons from which a caustic photon's kernel is measured
FOCUSED_NEIGHBORS = 96  # likewise where light from all sides is focused, and photons are not in line
_COVERED = 0.5  # of the disc that holds them: over all of it, the radii's own noise would be larger
_CROWDED = 4.0  # times as dense as the mean
_CAUSTIC_RADIUS_MIN, _CAUSTIC_RADIUS_MAX = 1e-5, 0.05  # of the scene's diagonal
_TURN = 0.1  # of the diagonal: how far a radian between normals counts as away
_CLOSE = 0.5  # of a radius: what a wall close by leaves of it, or few photons would outshine the rest
_SAGITTA = 1.5  # a kernel's height over that of the curved surface it spans
_PIXEL_RADIUS = f32(math.sqrt(2.0 / 3.0))  # over a pixel: a kernel's variance r^2 / 8 is its 1 / 12 then
_NEIGHBORS_MAX = 128
_ROOM = _NEIGHBORS_MAX // 2  # uint64
_CHUNK = 256  # photons a thread takes at a time

# columns of a PHOTON record seen as 16 words
_RADIUS, _FLUX, _NX, _H = 3, 4, 12, 15


def measure_radii(
    photons: np.ndarray,
    diagonal: float,
    smoothing: float = 1.0,
    pixel: np.ndarray | None = None,
    widths: np.ndarray | None = None,
    eye: tuple[float, ...] | np.ndarray = (0.0, 0.0, 0.0, 0.0),
    threads: int = 1,
) -> None:
    """Write `radius` and `height` of each photon's kernel, from the density of photons around it.

    photons    (N,) PHOTON, changed in place
    diagonal   of the scene, metres: no radius is below 0.002 or above 0.1 of it
    smoothing  factor on every radius
    pixel      (4,) plane whose value at (x, y, z, 1) is the width in metres of a receiver's pixel there, at
               most 4/3 of a radius; None: receivers lie anywhere
    widths     (I,) float32 m, of the instances: a kernel wider than its object would lose its light past
               the edges, so none is wider than a quarter of it; None: objects are wide
    eye        (4,) its place and 1, or the direction to it and 0 (orthographic): where it sees a surface
               aslant, a pixel covers more of it
    The radius is that of a disc that holds `NEIGHBORS` photons. Density is counted in the smallest
    cell of a hierarchy that holds enough photons facing the same way: a plane cuts a cell of side c
    in c^2 / (|nx| + |ny| + |nz|) on average over its place in the cell.
    """
    if not len(photons):
        return
    words = photons.view(np.float32).reshape(-1, 16)
    _write_radii(
        words, _reach_on_objects(photons, widths), _log_density(photons, diagonal, threads), f32(smoothing),
        f32(diagonal * _RADIUS_MIN), f32(diagonal * _RADIUS_MAX),
        (np.zeros(4) if pixel is None else _PIXEL_SHARE * pixel).astype(np.float32),
        np.asarray(eye, np.float32),
    )  # fmt: skip


def is_crowded(photons: np.ndarray, diagonal: float, threads: int = 1) -> np.ndarray:
    """Return (N,) bool: photons that lie four times as dense as the mean over the surfaces that they light.

    The mean, not the median: most photons may be in the caustics. It is the same for any number of photons.
    """
    if not len(photons):
        return np.zeros(0, np.bool_)
    area = np.exp(-_log_density(photons, diagonal, threads).astype(np.float64))
    area = np.minimum(area, math.pi * (_RADIUS_MAX * diagonal) ** 2 / NEIGHBORS)
    return np.asarray(area < area.mean() / _CROWDED)


def _log_density(photons: np.ndarray, diagonal: float, threads: int) -> np.ndarray:
    """(N,) float32: logarithm of the photons per m2 around each."""
    words = photons.view(np.float32).reshape(-1, 16)
    low, high = bounds_of(photons)
    cell = f32(max(diagonal * SMALLEST, float((high - low).max()) / _CELLS))
    log_density = np.empty((len(_SHIFTS), len(photons)), np.float32)
    low -= f32(2.0) * cell

    def work(thread: int) -> None:
        for k in range(thread, len(_SHIFTS), used):
            shift = np.array(_SHIFTS[k], np.float32) * cell * f32(0.9)
            keys, order = sort_by_cell(photons, low - shift, float(cell))
            _write_log_density(words, keys, order, cell, log_density[k])

    used = min(threads, len(_SHIFTS))
    run_threads(work, used)
    return np.asarray(log_density.mean(axis=0))


def _reach_on_objects(photons: np.ndarray, widths: np.ndarray | None) -> np.ndarray:
    """(N,) float32: the largest radius that suits the object under each photon."""
    if widths is None:
        return np.full(len(photons), np.inf, np.float32)
    return np.asarray((f32(_WIDTH_SHARE) * widths)[photons["instance"]])


@jit
def _write_log_density(words, keys, order, cell, log_density):
    """Write the logarithm of each photon's density (1/m^2), from the smallest cell with enough photons."""
    n = len(keys)
    count = np.zeros(n, np.float32)
    side = np.zeros(n, np.float32)
    for level in range(_LEVELS - 1, -1, -1):
        shift = u32(3 * level)
        first = 0
        for i in range(1, n + 1):
            if i == n or keys[i] >> shift != keys[first] >> shift:
                if i - first >= _WANTED or level == _LEVELS - 1:
                    for j in range(first, i):
                        count[j] = f32(i - first)
                        side[j] = cell * f32(1 << level)
                first = i
    for i in range(n):
        p = order[i]
        tilt = abs(words[p, _NX]) + abs(words[p, _NX + 1]) + abs(words[p, _NX + 2])
        log_density[p] = f32(math.log(count[i] * tilt / (side[i] * side[i])))


@jit
def _write_radii(words, widest, log_density, smoothing, low, high, least, eye):
    for i in range(len(words)):
        density = f32(math.exp(log_density[i]))
        radius = f32(math.sqrt(f32(NEIGHBORS) / (f32(math.pi) * density)))
        radius = min(min(max(radius, low), high) * smoothing, widest[i])
        radius = max(radius, min(_at(least, words, i) * _slant(words, i, eye), high))
        words[i, _RADIUS] = radius
        words[i, _H] = f32(_HEIGHT) * radius


@jit
def _at(plane, words, i):
    """A plane's value at photon `i`."""
    return plane[0] * words[i, 0] + plane[1] * words[i, 1] + plane[2] * words[i, 2] + plane[3]


@jit
def _slant(words, i, eye):
    """How much longer a pixel of `eye` is on the surface at photon `i` than it is wide, to a limit."""
    x, y, z = words[i, 0], words[i, 1], words[i, 2]
    wo = (eye[0] - eye[3] * x, eye[1] - eye[3] * y, eye[2] - eye[3] * z)
    distance = f32(math.sqrt(dot(wo, wo)))
    if distance == f32(0):
        return f32(1)
    aslant = abs(dot(wo, (words[i, _NX], words[i, _NX + 1], words[i, _NX + 2])))
    return min(distance / max(aslant, f32(1e-12)), f32(_SLANT_MAX))


def measure_caustic_radii(
    photons: np.ndarray,
    diagonal: float,
    smoothing: float = 1.0,
    pixel: np.ndarray | None = None,
    widths: np.ndarray | None = None,
    eye: tuple[float, ...] | np.ndarray = (0.0, 0.0, 0.0, 0.0),
    neighbors: int = CAUSTIC_NEIGHBORS,
    threads: int = 1,
    clear: np.ndarray | None = None,
) -> None:
    """Write `radius` and `height` of each caustic photon's kernel, from the photons next to it.

    photons    (N,) PHOTON, caustic ones alone, changed in place
    diagonal   of the scene, metres: no radius is below 1e-5 or above 0.05 of it
    pixel      (4,) as in `measure_radii`, but of the picture's own pixels: no kernel is narrower than
               they are, or much of its light would fall between their centres
    neighbors  a kernel covers half the disc that holds so many, of those that face the same way: a turn of a
               radian is as far as 0.1 of the diagonal
    clear      (N,) float32 m that a kernel should not exceed, to half its radius at least: how far away the
               mirror or glass is that the photon comes from, behind which its light would show
    smoothing, widths, eye  as in `measure_radii`
    A photon of more flux than its neighbours spreads over as much more area, so that it stands out as
    little. Where the surface bends, kernels are high enough to reach down to it. The same bytes for any
    number of threads.
    """
    if not len(photons):
        return
    assert 0 < neighbors <= _NEIGHBORS_MAX
    words = photons.view(np.float32).reshape(-1, 16)
    points, order = _points_in_order(photons, f32(_TURN * diagonal))
    tree = NearestTree(points)
    low, high = _CAUSTIC_RADIUS_MIN * diagonal, _CAUSTIC_RADIUS_MAX * diagonal
    limits = np.array([low, high, smoothing], np.float32)
    least = np.zeros(4, np.float32) if pixel is None else pixel.astype(np.float32)
    widest, eye = _reach_on_objects(photons, widths), np.asarray(eye, np.float32)
    counter = np.zeros(8, np.int64)
    free = np.full(len(photons), np.inf, np.float32) if clear is None else clear

    def work(_: int) -> None:
        _write_caustic_radii(
            address(counter), address(tree.nodes), tree.starts, points, order, i64(neighbors), words, widest,
            free, limits, least, eye,
        )  # fmt: skip

    run_threads(work, threads)


def _points_in_order(photons: np.ndarray, turn: np.float32) -> tuple[np.ndarray, np.ndarray]:
    """Return (N, 6) positions and normals times `turn`, along a curve through space, and (N,) photons."""
    words = photons.view(np.float32).reshape(-1, 16)
    low, high = words[:, :3].min(axis=0), words[:, :3].max(axis=0)
    _, order = sort_by_cell(photons, low, max(float((high - low).max()) / (1 << BITS), 1e-30))
    points = np.empty((len(words), DIMENSIONS), np.float32)
    points[:, :3] = words[order, :3]
    points[:, 3:] = words[order, _NX : _NX + 3] * turn
    return points, order


@jit
def _write_caustic_radii(
    counter, nodes, starts, points, order, wanted, words, widest, clear, limits, least, eye
):  # fmt: skip
    squares, rows, stack = alloca(_ROOM), alloca(_ROOM), alloca(STACK_WORDS)
    low, high, smoothing = limits[0], limits[1], limits[2]
    reach = f32(math.sqrt(f32(1.0 / _COVERED))) * high
    while True:
        first = atomic_add(counter, i64(_CHUNK))
        if first >= len(points):
            return
        for point in range(first, min(first + i64(_CHUNK), len(points))):
            found = find_nearest(nodes, starts, i64(point), wanted, reach, squares, rows, stack)
            i = order[point]
            radius = high
            if found == wanted:
                around = max(_flux_of(words, order, rows, found), f32(1e-30))
                brighter = max(f32(wanted) * _flux(words, i) / around, f32(1))
                radius = f32(math.sqrt(f32(_COVERED) * ldf(squares, wanted - i64(1)) * brighter))
            radius = min(min(max(radius, low), high) * smoothing, widest[i])
            radius = max(radius, min(least_radius(words, i, least, eye), high))
            radius = min(radius, max(clear[i], f32(_CLOSE) * radius))
            words[i, _RADIUS] = radius
            sagitta = f32(_SAGITTA) * _bend(words, i, order, rows, found) * radius
            words[i, _H] = min(max(f32(_HEIGHT), sagitta), f32(1)) * radius


@jit
def least_radius(words, i, pixel, eye):
    """Return the radius of a disc at photon `i` whose kernel blurs as much as a pixel's square does."""
    return _PIXEL_RADIUS * _at(pixel, words, i) * f32(math.sqrt(_slant(words, i, eye)))


@jit
def _flux(words, i):
    return words[i, _FLUX] + words[i, _FLUX + 1] + words[i, _FLUX + 2]


@jit
def _flux_of(words, order, rows, found):
    """The neighbours' flux together."""
    total = f32(0)
    for k in range(found):
        total += _flux(words, order[i64(ldu(rows, i64(k)))])
    return total


@jit
def _bend(words, i, order, rows, found):
    """Half the curvature of the surface, 1/m: the most that it falls away under a neighbour, half its
    distance times its turn, over the square of the farthest one's distance."""
    most, farthest = f32(0), f32(1e-30)
    for k in range(found):
        j = order[i64(ldu(rows, i64(k)))]
        away2, turn2 = f32(0), f32(0)
        for axis in range(3):
            away, turn = words[j, axis] - words[i, axis], words[j, _NX + axis] - words[i, _NX + axis]
            away2 += away * away
            turn2 += turn * turn
        most, farthest = max(most, away2 * turn2), max(farthest, away2)
    return f32(0.5) * f32(math.sqrt(most)) / farthest
