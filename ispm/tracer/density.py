"""How dense the photons lie, from which each gets the width of its kernel.

A k-nearest-neighbour search would serve too; counting in cells of doubling size costs a tenth of it
and, since kernels conserve flux at any width, what the cruder count costs is a little noise or blur.
"""

from __future__ import annotations

import math

import numpy as np

from ispm.optics.jit import jit
from ispm.optics.vector import dot

f32, u32, i64 = np.float32, np.uint32, np.int64

NEIGHBORS = 15  # photons within a kernel; 10 to 25 differ by under 2 % in error after the filter
_WANTED = 32  # photons that a cell must hold to be counted: 18 % noise in density, 9 % in radius
_RADIUS_MIN, _RADIUS_MAX = 0.002, 0.1  # of the scene's diagonal
_SLANT_MAX = 8.0  # that a pixel is stretched on a surface seen aslant
_PIXEL_SHARE = 0.75  # least radius over a receiver's pixel: between smaller kernels light falls unseen
_WIDTH_SHARE = 0.25  # of an object's width
_HEIGHT = 0.25  # of a kernel over its radius: thin, so that it does not reach other surfaces
_LEVELS = 8  # cell sizes, each twice the one before
_SHIFTS = ((0.0, 0.0, 0.0), (0.381, 0.618, 0.236))  # of the cells, so that no border shows

# columns of a PHOTON record seen as 16 words
_RADIUS, _NX, _H = 3, 12, 15


def measure_radii(
    photons: np.ndarray,
    diagonal: float,
    smoothing: float = 1.0,
    pixel: np.ndarray | None = None,
    widths: np.ndarray | None = None,
    eye: tuple[float, ...] | np.ndarray = (0.0, 0.0, 0.0, 0.0),
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
    cell = f32(diagonal * 0.004)
    log_density = np.zeros(len(photons), np.float32)
    low = words[:, :3].min(axis=0) - f32(2.0) * cell
    for shift in _SHIFTS:
        keys = np.empty(len(photons), np.uint64)
        _cell_keys(words, low - np.array(shift, np.float32) * cell * f32(0.9), cell, keys)
        order = np.argsort(keys, kind="stable")
        _add_log_density(words, keys[order], order, cell, log_density)
    _write_radii(
        words, _reach_on_objects(photons, widths), log_density / f32(len(_SHIFTS)), f32(smoothing),
        f32(diagonal * _RADIUS_MIN), f32(diagonal * _RADIUS_MAX),
        (np.zeros(4) if pixel is None else _PIXEL_SHARE * pixel).astype(np.float32),
        np.asarray(eye, np.float32),
    )  # fmt: skip


def _reach_on_objects(photons: np.ndarray, widths: np.ndarray | None) -> np.ndarray:
    """(N,) float32: the largest radius that suits the object under each photon."""
    if widths is None:
        return np.full(len(photons), np.inf, np.float32)
    return np.asarray((f32(_WIDTH_SHARE) * widths)[photons["instance"]])


@jit
def _spread(x):
    """Put two zero bits behind each of the low 20 bits of x (Morton order)."""
    x = np.uint64(x) & np.uint64(0xFFFFF)
    x = (x | (x << np.uint64(32))) & np.uint64(0x1F00000000FFFF)
    x = (x | (x << np.uint64(16))) & np.uint64(0x1F0000FF0000FF)
    x = (x | (x << np.uint64(8))) & np.uint64(0x100F00F00F00F00F)
    x = (x | (x << np.uint64(4))) & np.uint64(0x10C30C30C30C30C3)
    return (x | (x << np.uint64(2))) & np.uint64(0x1249249249249249)


@jit
def _facing(x, y, z):
    """Which of the six sides of a cube the normal points to, 0 to 5."""
    ax, ay, az = abs(x), abs(y), abs(z)
    if ax >= ay and ax >= az:
        return i64(0) if x > f32(0) else i64(1)
    if ay >= az:
        return i64(2) if y > f32(0) else i64(3)
    return i64(4) if z > f32(0) else i64(5)


@jit
def _cell_keys(words, low, cell, keys):
    """The facing above the Morton code of the finest cell, so that shifting by 3 bits gives its parent."""
    for i in range(len(words)):
        code = np.uint64(0)
        for axis in range(3):
            place = i64(max((words[i, axis] - low[axis]) / cell, f32(0)))
            code |= _spread(np.uint64(min(place, i64(0xFFFFF)))) << np.uint64(axis)
        facing = _facing(words[i, _NX], words[i, _NX + 1], words[i, _NX + 2])
        keys[i] = code | (np.uint64(facing) << np.uint64(60))


@jit
def _add_log_density(words, keys, order, cell, log_density):
    """Add the logarithm of each photon's density (1/m^2), from the smallest cell with enough photons."""
    n = len(keys)
    count = np.zeros(n, np.float32)
    side = np.zeros(n, np.float32)
    for level in range(_LEVELS - 1, -1, -1):
        shift = np.uint64(3 * level)
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
        log_density[p] += f32(math.log(count[i] * tilt / (side[i] * side[i])))


@jit
def _write_radii(words, widest, log_density, smoothing, low, high, least, eye):
    for i in range(len(words)):
        density = f32(math.exp(log_density[i]))
        radius = f32(math.sqrt(f32(NEIGHBORS) / (f32(math.pi) * density)))
        radius = min(min(max(radius, low), high) * smoothing, widest[i])
        x, y, z = words[i, 0], words[i, 1], words[i, 2]
        seen = least[0] * x + least[1] * y + least[2] * z + least[3]
        wo = (eye[0] - eye[3] * x, eye[1] - eye[3] * y, eye[2] - eye[3] * z)
        aslant = abs(dot(wo, (words[i, _NX], words[i, _NX + 1], words[i, _NX + 2])))
        distance = f32(math.sqrt(dot(wo, wo)))
        slant = min(distance / max(aslant, f32(1e-12)), f32(_SLANT_MAX)) if distance > f32(0) else f32(1)
        radius = max(radius, min(seen * slant, high))
        words[i, _RADIUS] = radius
        words[i, _H] = f32(_HEIGHT) * radius
