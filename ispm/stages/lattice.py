"""How far the filter reaches, and whom it asks there: a lattice of taps over an ellipse on the screen."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from ispm.accel.mesh import word_of
from ispm.optics.incident import INCIDENT
from ispm.optics.jit import jit
from ispm.optics.records import RECEIVER
from ispm.optics.vector import dot, scale, sub, vec3

f32, i64 = np.float32, np.int64

REACH = 0.075  # of the scene's diagonal: the filter's radius where photons are few
_PHOTONS = 1600.0  # within the radius elsewhere: 3 % noise in their mean
_LEAST_PIXELS, _MAX_PIXELS = f32(1.5), 96.0  # reach on the screen, low-resolution pixels
TAPS = 8  # on each side, as many as (2 * 8 + 1)^2 in all; wider reaches are strided
_NARROWEST = 0.02  # of a reach on the screen, across its length: of surfaces seen aslant

# Cosines of two normals above which they are the same to a fit, whose ridge is some ten times the square of
# that angle, .01; and below which surfaces share nothing.
_SAME, OTHER_FACING = 1.0 - 5e-5, 0.5

_NG, _WO, _SLANT = (word_of(RECEIVER, name) for name in ("ng", "wo", "slant"))
DENSITY = word_of(INCIDENT, "density")


class Limits(NamedTuple):
    """Of the filter's radius: the widest, m, and the factor of the settings, float32."""

    widest: Any
    smoothing: Any


class Place(NamedTuple):
    """What is filtered for: row `p` of points, (n, 16) words of RECEIVER, which lies in pixel (x, y)."""

    points: Any
    p: Any
    x: Any
    y: Any


class Lattice(NamedTuple):
    """Taps: strides right and down in pixels, and how many of them on each side."""

    strides: Any
    taps: Any


def radius_of(estimate: np.ndarray, receivers: np.ndarray, diagonal: float, smoothing: float) -> np.ndarray:
    """Return the filter's radius at each receiver, (n,) float32 m, as its density and bounds have it."""
    wanted = smoothing * np.sqrt(_PHOTONS / math.pi / np.maximum(estimate[:, DENSITY], f32(1e-12)))
    foot = receivers["footprint"]
    most = np.minimum(f32(diagonal * REACH * smoothing), f32(_MAX_PIXELS) * foot)
    return np.asarray(np.maximum(np.minimum(wanted, most), _LEAST_PIXELS * foot), np.float32)


def set_radius(estimate: np.ndarray, radius: np.ndarray, smoothing: float) -> None:
    """Let `radius_of` be (n,) m, as far as its bounds allow; in place."""
    wanted = np.maximum(radius / smoothing, 1e-12)
    estimate[:, DENSITY] = _PHOTONS / math.pi / (wanted * wanted)


def set_reach(estimate: np.ndarray, receivers: np.ndarray, reach: np.ndarray, diagonal: float) -> None:
    """Let the filter's radius at each receiver be `reach`, (n,) m, as far as its bounds allow.

    In place, by a density of as many photons within as the filter wants.
    """
    reach = np.minimum(np.minimum(reach, REACH * diagonal), f32(_MAX_PIXELS) * receivers["footprint"])
    reach = np.maximum(reach, f32(1e-12))
    estimate[:, DENSITY] = _PHOTONS / math.pi / (reach * reach)


def normals_differ(receivers: np.ndarray, size: tuple[int, int]) -> bool:
    """Return whether shading normals differ among receivers in a plane, so that there is something to fit."""
    return bool(_normals_differ(receivers, size[0], size[1]))


@jit
def _normals_differ(receivers, width, height):
    """Whether receivers beside each other, or `TAPS` apart, lie in a plane and have other shading normals."""
    for row in range(len(receivers)):
        x, y, here = row % width, row // width, receivers[row]
        n, ng, place = vec3(here.n), vec3(here.ng), vec3(here.position)
        for lag in (1, TAPS):
            for across in (True, False):
                if x < lag if across else y < lag:
                    continue
                there = receivers[row - lag if across else row - lag * width]
                cosine = dot(n, vec3(there.n))
                apart = abs(dot(sub(place, vec3(there.position)), ng))
                turned = cosine > f32(OTHER_FACING) and cosine < f32(_SAME)
                if turned and apart < f32(lag) * here.footprint:
                    return True
    return False


@jit
def reach_of(foot, density, limits):
    """Return the filter's radius, m, where a pixel is `foot` m wide and photons are so dense, per m2."""
    wanted = limits.smoothing * f32(math.sqrt(f32(_PHOTONS / math.pi) / max(density, f32(1e-12))))
    pixels = min(min(limits.widest, wanted) / foot, f32(_MAX_PIXELS))
    return foot * max(pixels, _LEAST_PIXELS)


@jit
def widths(at, words, size):
    """Half the width and the height on the screen of a disc on a point's surface, of a radius of 1.

    at  Place;  words  (h w, 16) of RECEIVER;  size  (w, h)
    Along a unit axis a the disc of normal n is sqrt(1 - (n.a)^2) wide; which
    way the picture's rows go in space is seen by the receivers beside it.
    """
    points, p, x, y = at
    left, right = y * size[0] + max(x - i64(1), i64(0)), y * size[0] + min(x + i64(1), size[0] - i64(1))
    left = left if words[left, _SLANT] > f32(0) else y * size[0] + x
    right = right if words[right, _SLANT] > f32(0) else y * size[0] + x
    way = (
        words[right, 0] - words[left, 0],
        words[right, 1] - words[left, 1],
        words[right, 2] - words[left, 2],
    )
    wo = points[p, _WO], points[p, _WO + 1], points[p, _WO + 2]
    across = sub(way, scale(dot(way, wo), wo))
    length = math.sqrt(dot(across, across))
    if not length > f32(0):
        return f32(1), f32(1)
    across = scale(f32(1) / length, across)
    n = points[p, _NG], points[p, _NG + 1], points[p, _NG + 2]
    sine, cosine = dot(n, across), dot(n, wo)
    least = f32(_NARROWEST * _NARROWEST)
    wide = math.sqrt(max(f32(1) - sine * sine, least))
    return wide, math.sqrt(max(sine * sine + cosine * cosine, least))


@jit
def lattice_of(wide, high):
    """Return the taps of an ellipse that reaches so many pixels, float32, to its sides and up and down."""
    narrow, long = min(wide, high), max(wide, high)
    stride = max(i64(1), i64(math.ceil(narrow / f32(TAPS))))
    taps = max(i64(1), i64(narrow / f32(stride)))
    most = (i64((2 * TAPS + 1) ** 2) // (i64(2) * taps + i64(1)) - i64(1)) // i64(2)
    longer = max(i64(1), i64(math.ceil(long / f32(most))))
    more = max(i64(1), i64(long / f32(longer)))
    if wide < high:
        return Lattice((stride, longer), (taps, more))
    return Lattice((longer, stride), (more, taps))


@jit
def gap_of(stride, part, most):
    """Return the pixels from tap to tap over a gap of `stride` / `part`, and how many taps on each side."""
    gap = (stride + part - i64(1)) // part
    step = (gap + most - i64(1)) // most
    if part > i64(1) and gap == i64(1):
        return step, i64(0)
    return step, (gap + step - i64(1)) // step
