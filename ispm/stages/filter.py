"""The normalised world-space filter: noise out of the estimate without darkening its edges.

Each receiver takes the weighted mean of the estimates around it on its own surface. Because the
weights are divided by their sum, light is not lost past an edge, as it is by a wide photon kernel:
small kernels and this filter halve the error of wide kernels at less cost.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from ispm.accel.mesh import word_of
from ispm.kernels.share import run_shared, shared_rows
from ispm.kernels.simd import address, aligned, splat8, stf, vfma, vload8, vmul, vstore8
from ispm.optics.bsdf import NARROW_ALPHA
from ispm.optics.incident import CHANNELS, INCIDENT
from ispm.optics.jit import jit
from ispm.optics.records import RECEIVER
from ispm.optics.vector import dot, scale, sub

f32, i64 = np.float32, np.int64

REACH = 0.075  # of the scene's diagonal: the filter's radius where photons are few
_PHOTONS = 1600.0  # within the radius elsewhere: 3 % noise in their mean
_TAPS = 8  # on each side, as many as (2 * 8 + 1)^2 in all; wider reaches are strided
_SMOOTH_TAPS = 4  # on each side, in the second pass
_LEAST_PIXELS, _MAX_PIXELS = f32(1.5), 96.0  # reach on the screen, low-resolution pixels
_FLATNESS = 0.26  # half thickness of the filter, b, over its radius
_NARROWEST = 0.02  # of a reach on the screen, across its length: of surfaces seen aslant
_MIN_TURNED_WEIGHT = 0.01  # least weight of receivers of another orientation where photons are few
_MIN_PHOTONS = 200.0  # photons within the radius, below which they are few

_ALPHA, _NG, _N = word_of(RECEIVER, "alpha"), word_of(RECEIVER, "ng"), word_of(RECEIVER, "n")
_FOOTPRINT, _WO, _SLANT = (word_of(RECEIVER, name) for name in ("footprint", "wo", "slant"))
DENSITY, MET = word_of(INCIDENT, "density"), word_of(INCIDENT, "met")
_GLOSS = word_of(INCIDENT, "gloss")  # what surfaces of another roughness do not share begins here
# Receivers that a mean is enough of. Of fewer it is noise: dashes along faces one to three pixels wide. Of 12
# none are seen at 1:1; 16 and 24 ask for half and three times as many pixels that get light of their own.
_MIN_RECEIVERS = 12


class _Image(NamedTuple):
    """What is filtered: words (h w, 16) of RECEIVER, estimate (h w, 16), size (w, h); gloss: is there any?"""

    words: Any
    estimate: Any
    size: Any
    gloss: Any


class _Place(NamedTuple):
    """What is filtered for: row `p` of points, (n, 16) words of RECEIVER, which lies in pixel (x, y)."""

    points: Any
    p: Any
    x: Any
    y: Any


class _Limits(NamedTuple):
    """Of the filter's radius: the widest, m, and the factor of the settings, float32."""

    widest: Any
    smoothing: Any


class _Lattice(NamedTuple):
    """Taps: strides right and down in pixels, and how many of them on each side."""

    strides: Any
    taps: Any


def filter_estimate(
    receivers: np.ndarray,
    estimate: np.ndarray,
    size: tuple[int, int],
    diagonal: float,
    smoothing: float,
    threads: int,
    *,
    once: bool = False,
) -> np.ndarray:
    """Return the filtered estimate at each receiver, (h w, 16) float32.

    receivers  (h w,) RECEIVER, row by row
    estimate   (h w, 16) float32 channels of an estimator
    size       (w, h)
    diagonal   of the scene, metres
    smoothing  factor on the filter's radius
    once       leave it at the first pass, which reaches all that the three do
    Three passes: the first reaches h, with strided taps where that is many pixels; the others, each as
    wide as the stride before, remove the comb that strided taps leave. The disc of that reach is an ellipse
    on the screen, as wide as what its box holds: a ceiling seen aslant has long strides along its rows, and
    none from row to row. Things narrower than the strides have them along their length alone, as columns and
    shelves, or none where they stand aslant.
    Weights: (1 - d^2/h^2)^2 (n.n')^16 (1 - z^2/b^2)^2 dA; d and z are the distances from the point and
    from its tangent plane, dA the area that a receiver stands for, n the shading normals, or bumps would
    be averaged away. Where even h holds few photons, as on small round things, (n.n')^4 and twice the b,
    and never quite 0: noise hides what the normals would tell there, and a thin rim that no photon met is
    better lit as what is around it than black.
    """
    words = _words(receivers)
    spread = _run(_spread, words, words, estimate, size, diagonal, smoothing, threads)
    if once:
        return spread
    smooth = _run(_smooth, words, words, spread, size, diagonal, smoothing, threads)
    light = _run(_finish, words, words, smooth, size, diagonal, smoothing, threads)
    light[:, MET] = spread[:, MET]
    return light


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


def filter_points(
    points: np.ndarray,
    pixels: np.ndarray,
    receivers: np.ndarray,
    estimate: np.ndarray,
    size: tuple[int, int],
    diagonal: float,
    smoothing: float,
    threads: int,
) -> np.ndarray:
    """Return the filtered estimate at points that are not receivers, (n, 16) float32.

    points    (n,) RECEIVER
    pixels    (n,) int: the receiver whose pixel each point lies in
    Channel MET tells how many receivers on its surface were near a point, over what is enough.
    """
    given = _words(points), np.ascontiguousarray(pixels, np.int64)
    return _run(_spread_points, given, _words(receivers), estimate, size, diagonal, smoothing, threads)


def _words(receivers: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(receivers).view(np.float32).reshape(-1, 16)


def _run(
    kernel: Any,
    points: Any,
    words: np.ndarray,
    estimate: np.ndarray,
    size: tuple[int, int],
    diagonal: float,
    smoothing: float,
    threads: int,
) -> np.ndarray:
    """Call `kernel` from all threads with a shared counter; return what it writes."""
    rows, *_ = points if isinstance(points, tuple) else (points,)
    out = aligned(CHANNELS * len(rows)).reshape(-1, CHANNELS)
    if address(estimate) % 64:
        estimate, given = aligned(estimate.size).reshape(-1, CHANNELS), estimate
        estimate[:] = given
    limits = _Limits(f32(diagonal * REACH * smoothing), f32(smoothing))
    image = _Image(words, estimate, size, bool((words[:, _ALPHA] > 0.0).any()))
    run_shared(lambda counter: kernel(counter, points, image, limits, out), threads)
    return out


@jit
def _spread(counter, points, image, limits, out):
    """First pass: strided taps over the reach."""
    words, size = image.words, image.size
    for y in shared_rows(counter, 1, size[1]):
        for x in range(size[0]):
            p = y * size[0] + x
            if words[p, _SLANT] > f32(0):
                density = image.estimate[p, DENSITY]
                reach = _reach(words[p, _FOOTPRINT], density, limits)
                few = density * f32(math.pi) * reach * reach < f32(_MIN_PHOTONS)
                _spread_one(_Place(points, p, x, y), reach, few, image, out)


@jit
def _smooth(counter, points, image, limits, out):
    """Second pass: as wide as the strides, strided where these are wide."""
    _fill_gaps(counter, points, image, limits, out, i64(1), i64(_SMOOTH_TAPS))


@jit
def _finish(counter, points, image, limits, out):
    """Third pass: over the gaps that the second may leave, every receiver."""
    _fill_gaps(counter, points, image, limits, out, i64(_SMOOTH_TAPS), i64(64))


@jit
def _fill_gaps(counter, points, image, limits, out, part, most):
    """Average over gaps of 1 / `part` of the first pass's strides, with at most `most` taps a side."""
    words, estimate, size = image.words, image.estimate, image.size
    for y in shared_rows(counter, 1, size[1]):
        for x in range(size[0]):
            p = y * size[0] + x
            if words[p, _SLANT] > f32(0):
                foot = words[p, _FOOTPRINT]
                reach = _reach(foot, estimate[p, DENSITY], limits)
                at = _Place(points, p, x, y)
                wide, high = _widths(at, image)
                stride_x, stride_y = _lattice(reach / foot * wide, reach / foot * high).strides
                step_x, taps_x = _gap(stride_x, part, most)
                step_y, taps_y = _gap(stride_y, part, most)
                across = f32((taps_x + 1) * step_x) * min(f32(1) / wide, f32(3))
                down = f32((taps_y + 1) * step_y) * min(f32(1) / high, f32(3))
                lattice = _Lattice((step_x, step_y), (taps_x, taps_y))
                _mean_about(at, foot * max(across, down), lattice, False, image, out)


@jit
def _gap(stride, part, most):
    """Return the pixels from tap to tap over a gap of `stride` / `part`, and how many taps on each side."""
    gap = (stride + part - i64(1)) // part
    step = (gap + most - i64(1)) // most
    if part > i64(1) and gap == i64(1):
        return step, i64(0)
    return step, (gap + step - i64(1)) // step


@jit
def _spread_points(counter, points, image, limits, out):
    """The first pass, for points that are no receivers."""
    given, pixels = points
    width, _ = image.size
    for i in shared_rows(counter, 64, len(given)):
        p = pixels[i]
        reach = _reach(given[i, _FOOTPRINT], image.estimate[p, DENSITY], limits)
        _spread_one(_Place(given, i, p % width, p // width), reach, False, image, out)


@jit
def _spread_one(at, reach, few, image, out):
    """Write the mean over `reach` m about a place, and how many receivers it met over what is enough."""
    wide, high = _widths(at, image)
    pixels = reach / at.points[at.p, _FOOTPRINT]
    wanted = _lattice(pixels * wide, pixels * high)
    (stride_x, stride_y), (taps_x, taps_y) = wanted
    met = _mean_about(at, reach, wanted, few, image, out)
    if met < i64(_MIN_RECEIVERS) and max(stride_x, stride_y) > i64(1):
        dense_x, dense_y = min(i64(_TAPS), stride_x * taps_x), min(i64(_TAPS), stride_y * taps_y)
        taps = dense_x, taps_y
        met = _mean_about(at, reach, _Lattice((i64(1), stride_y), taps), few, image, out)
        if met < i64(_MIN_RECEIVERS):
            taps = taps_x, dense_y
            met = _mean_about(at, reach, _Lattice((stride_x, i64(1)), taps), few, image, out)
        if met < i64(_MIN_RECEIVERS):
            taps = dense_x, dense_y
            met = _mean_about(at, reach, _Lattice((i64(1), i64(1)), taps), few, image, out)
        taps_x, taps_y = taps
    box = (i64(2) * taps_x + i64(1)) * (i64(2) * taps_y + i64(1))
    enough = min(i64(_MIN_RECEIVERS), box // i64(4))  # a short reach holds few, and light is even over it
    stf(np.uint64(out.ctypes.data), at.p * CHANNELS + MET, f32(met) / f32(enough))


@jit
def _reach(foot, density, limits):
    """Return the filter's radius, m, where a pixel is `foot` m wide and photons are so dense, per m2."""
    wanted = limits.smoothing * f32(math.sqrt(f32(_PHOTONS / math.pi) / max(density, f32(1e-12))))
    pixels = min(min(limits.widest, wanted) / foot, f32(_MAX_PIXELS))
    return foot * max(pixels, _LEAST_PIXELS)


@jit
def _widths(at, image):
    """Half the width and the height on the screen of a disc on a point's surface, of a radius of 1.

    Along a unit axis a the disc of normal n is sqrt(1 - (n.a)^2) wide; which
    way the picture's rows go in space is seen by the receivers beside it.
    """
    points, p, x, y = at
    words, size = image.words, image.size
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
def _lattice(wide, high):
    """Return the taps of an ellipse that reaches so many pixels, float32, to its sides and up and down."""
    narrow, long = min(wide, high), max(wide, high)
    stride = max(i64(1), i64(math.ceil(narrow / f32(_TAPS))))
    taps = max(i64(1), i64(narrow / f32(stride)))
    most = (i64((2 * _TAPS + 1) ** 2) // (i64(2) * taps + i64(1)) - i64(1)) // i64(2)
    longer = max(i64(1), i64(math.ceil(long / f32(most))))
    more = max(i64(1), i64(long / f32(longer)))
    if wide < high:
        return _Lattice((stride, longer), (taps, more))
    return _Lattice((longer, stride), (more, taps))


@jit
def _mean_about(at, reach, lattice, few, image, out):
    """Write the weighted mean of the estimates within `reach` m of a place; return of how many, int64.

    few  photons are few there, and the weights lenient
    """
    points, p, x, y = at
    words, estimate, size, gloss = image
    (stride_x, stride_y), (taps_x, taps_y) = lattice
    base = np.uint64(estimate.ctypes.data)
    px, py, pz = points[p, 0], points[p, 1], points[p, 2]
    nx, ny, nz = points[p, _NG], points[p, _NG + 1], points[p, _NG + 2]
    sx, sy, sz = points[p, _N], points[p, _N + 1], points[p, _N + 2]
    alpha = points[p, _ALPHA]
    inv_reach2 = f32(1) / (reach * reach)
    inv_thick2 = inv_reach2 * f32(1.0 / (_FLATNESS * _FLATNESS))
    if few:
        inv_thick2 *= f32(0.25)
    plain, glossy = splat8(f32(0)), splat8(f32(0))
    weight, gloss_weight = f32(0), f32(0)
    met = i64(0)
    for row in range(y - taps_y * stride_y, y + taps_y * stride_y + 1, stride_y):
        if row < 0 or row >= size[1]:
            continue
        for column in range(x - taps_x * stride_x, x + taps_x * stride_x + 1, stride_x):
            if column < 0 or column >= size[0]:
                continue
            q = row * size[0] + column
            dx, dy, dz = words[q, 0] - px, words[q, 1] - py, words[q, 2] - pz
            d2 = (dx * dx + dy * dy + dz * dz) * inv_reach2
            z = dx * nx + dy * ny + dz * nz
            z2 = z * z * inv_thick2
            alike = sx * words[q, _N] + sy * words[q, _N + 1] + sz * words[q, _N + 2]
            if d2 >= f32(1) or ((z2 >= f32(1) or alike <= f32(0.5)) and not (few and alike > f32(0))):
                continue
            alike *= alike
            alike *= alike
            if not few:
                alike *= alike
                alike *= alike
            flat = max(f32(1) - z2, f32(0))
            likeness = flat * flat * alike
            if few:
                likeness = max(likeness, f32(_MIN_TURNED_WEIGHT))
            near = f32(1) - d2
            foot = words[q, _FOOTPRINT]
            w = near * near * likeness * foot * foot * words[q, _SLANT]
            weight += w
            met += i64(1)
            plain = vfma(vload8(base, q * CHANNELS), splat8(w), plain)
            other = words[q, _ALPHA]
            same_gloss = f32(1) - f32(4) * abs(other - alpha)
            alike_narrow = (other < NARROW_ALPHA) == (alpha < NARROW_ALPHA)
            if gloss and other > f32(0) and same_gloss > f32(0) and alike_narrow:
                w *= same_gloss
                gloss_weight += w
                glossy = vfma(vload8(base, q * CHANNELS + _GLOSS), splat8(w), glossy)
    place = np.uint64(out.ctypes.data)
    vstore8(place, p * CHANNELS, vmul(plain, splat8(_inverse(weight))))
    vstore8(place, p * CHANNELS + _GLOSS, vmul(glossy, splat8(_inverse(gloss_weight))))
    return met


@jit
def _inverse(weight):
    """1 / a float32 weight, 0 of 0."""
    return f32(1) / weight if weight > f32(0) else f32(0)
