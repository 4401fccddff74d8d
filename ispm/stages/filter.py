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
from ispm.kernels.simd import (
    address,
    aligned,
    ldf,
    splat4,
    splat8,
    stf,
    vfma,
    vget,
    vload4,
    vload8,
    vmul,
    vstore4,
    vstore8,
)
from ispm.optics.bsdf import NARROW_ALPHA
from ispm.optics.gradient import WORDS, Moments, fit_of, slope
from ispm.optics.incident import CHANNELS, INCIDENT, FilteredLight
from ispm.optics.jit import jit
from ispm.optics.records import RECEIVER, TAKES_NONE
from ispm.optics.sampling import orthonormal_basis
from ispm.stages.lattice import (
    DENSITY,
    OTHER_FACING,
    REACH,
    TAPS,
    Lattice,
    Limits,
    Place,
    gap_of,
    lattice_of,
    normals_differ,
    reach_of,
    widths,
)

f32, i64 = np.float32, np.int64

_SMOOTH_TAPS = 4  # on each side, in the second pass
_FLATNESS = 0.26  # half thickness of the filter, b, over its radius
_MIN_TURNED_WEIGHT = 0.01  # least weight of receivers of another orientation where photons are few
_MIN_PHOTONS = 200.0  # photons within the radius, below which they are few

_ALPHA, _NG, _N = word_of(RECEIVER, "alpha"), word_of(RECEIVER, "ng"), word_of(RECEIVER, "n")
_FOOTPRINT, _SLANT = word_of(RECEIVER, "footprint"), word_of(RECEIVER, "slant")
MET = word_of(INCIDENT, "met")
_GLOSS = word_of(INCIDENT, "gloss")  # what surfaces of another roughness do not share begins here
# Receivers that a mean is enough of. Of fewer it is noise: dashes along faces one to three pixels wide. Of 12
# none are seen at 1:1; 16 and 24 ask for half and three times as many pixels that get light of their own.
_MIN_RECEIVERS = 12
_MEAN, _FIT, _CARRY = 0, 1, 2  # what is made of irradiance: its mean, a fit to it, or the mean of fits
_NO_GRADIENT = aligned(0).reshape(0, WORDS)


class _Image(NamedTuple):
    """What is filtered: words (h w, 16) of RECEIVER, estimate (h w, 16), gradient (h w, WORDS) or no rows,
    size (w, h); gloss: is there any?; turned: do normals differ?"""

    words: Any
    estimate: Any
    gradient: Any
    size: Any
    gloss: Any
    turned: Any


class _Out(NamedTuple):
    """What is written: light (n, 16), and its gradient (n, WORDS), without rows where no normals differ."""

    light: Any
    gradient: Any


def filter_estimate(
    receivers: np.ndarray,
    estimate: np.ndarray,
    size: tuple[int, int],
    diagonal: float,
    smoothing: float,
    threads: int,
) -> FilteredLight:
    """Return the filtered estimate at each receiver, (h w, 16) float32.

    receivers  (h w,) RECEIVER, row by row
    estimate   (h w, 16) float32 channels of an estimator
    size       (w, h)
    diagonal   of the scene, metres
    smoothing  factor on the filter's radius
    Three passes: the first reaches h, with strided taps where that is many pixels; the others, each as
    wide as the stride before, remove the comb that strided taps leave. The disc of that reach is an ellipse
    on the screen, as wide as what its box holds: a ceiling seen aslant has long strides along its rows, and
    none from row to row. Things narrower than the strides have them along their length alone, as columns and
    shelves, or none where they stand aslant.
    Weights: (1 - d^2/h^2)^2 (n.n')^16 (1 - z^2/b^2)^2 dA; d and z are the distances from the point and
    from its tangent plane, dA the area that a receiver stands for, n the shading normals, or bumps would
    be averaged away. As the normals still differ by 14 degrees, the first pass fits irradiance as a linear
    function of the normal, `ispm.optics.gradient`, and the others average these functions.
    Where even h holds few photons, as on small round things, (n.n')^4 and twice the b,
    and never quite 0: noise hides what the normals would tell there, and a thin rim that no photon met is
    better lit as what is around it than black.
    """
    words, told = _words(receivers), (size, diagonal, smoothing, threads)
    raw = FilteredLight(estimate, None)
    turned = normals_differ(receivers, size)
    spread = _run(_spread, words, words, raw, *told, turned=turned)
    smooth = _run(_smooth, words, words, spread, *told, turned=turned)
    filtered = _run(_finish, words, words, smooth, *told, turned=turned)
    filtered.light[:, MET] = spread.light[:, MET]
    return filtered


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
    given, raw = (_words(points), np.ascontiguousarray(pixels, np.int64)), FilteredLight(estimate, None)
    told, turned = (size, diagonal, smoothing, threads), normals_differ(receivers, size)
    return _run(_spread_points, given, _words(receivers), raw, *told, turned=turned).light


def filter_some(
    rows: np.ndarray,
    receivers: np.ndarray,
    estimate: np.ndarray,
    size: tuple[int, int],
    diagonal: float,
    smoothing: float,
    threads: int,
) -> np.ndarray:
    """Return the filtered estimate at some receivers, `rows`, (n, 16) float32: by the first pass alone, which
    reaches all that the three do, and as means; other arguments as of `filter_estimate`."""
    words, raw = _words(receivers), FilteredLight(estimate, None)
    given = np.take(words, rows, axis=0), rows.astype(np.int64)
    return _run(_spread_points, given, words, raw, size, diagonal, smoothing, threads, turned=False).light


def _words(receivers: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(receivers).view(np.float32).reshape(-1, 16)


def _run(
    kernel: Any,
    points: Any,
    words: np.ndarray,
    given: FilteredLight,
    size: tuple[int, int],
    diagonal: float,
    smoothing: float,
    threads: int,
    *,
    turned: bool,
) -> FilteredLight:
    """Call `kernel` from all threads with a shared counter; return what it writes."""
    rows, *_ = points if isinstance(points, tuple) else (points,)
    light, gradient = aligned(CHANNELS * len(rows)), aligned(WORDS * len(rows) * turned)
    out = _Out(light.reshape(-1, CHANNELS), gradient.reshape(-1, WORDS))
    estimate = given.light
    if address(estimate) % 64:
        estimate = aligned(estimate.size).reshape(-1, CHANNELS)
        estimate[:] = given.light
    limits = Limits(f32(diagonal * REACH * smoothing), f32(smoothing))
    before = _NO_GRADIENT if given.gradient is None else given.gradient
    image = _Image(words, estimate, before, size, bool((words[:, _ALPHA] > 0.0).any()), turned)
    run_shared(lambda counter: kernel(counter, points, image, limits, out), threads)
    return FilteredLight(out.light, out.gradient if turned else None)


@jit
def _spread(counter, points, image, limits, out):
    """First pass: strided taps over the reach."""
    words, size = image.words, image.size
    for y in shared_rows(counter, 1, size[1]):
        for x in range(size[0]):
            p = y * size[0] + x
            if words[p, _SLANT] > f32(0):
                density = image.estimate[p, DENSITY]
                reach = reach_of(words[p, _FOOTPRINT], density, limits)
                few = density * f32(math.pi) * reach * reach < f32(_MIN_PHOTONS)
                _spread_one(Place(points, p, x, y), reach, few, image, out)


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
                reach = reach_of(foot, estimate[p, DENSITY], limits)
                at = Place(points, p, x, y)
                wide, high = widths(at, image.words, image.size)
                stride_x, stride_y = lattice_of(reach / foot * wide, reach / foot * high).strides
                step_x, taps_x = gap_of(stride_x, part, most)
                step_y, taps_y = gap_of(stride_y, part, most)
                across = f32((taps_x + 1) * step_x) * min(f32(1) / wide, f32(3))
                down = f32((taps_y + 1) * step_y) * min(f32(1) / high, f32(3))
                lattice = Lattice((step_x, step_y), (taps_x, taps_y))
                how = i64(_CARRY) if image.turned else i64(_MEAN)
                _mean_about(at, foot * max(across, down), lattice, how, False, image, out)
                if part > i64(1) and image.turned:
                    _evaluate(words, p, out)


@jit
def _spread_points(counter, points, image, limits, out):
    """The first pass, for points that are no receivers."""
    given, pixels = points
    width, _ = image.size
    for i in shared_rows(counter, 64, len(given)):
        p = pixels[i]
        reach = reach_of(given[i, _FOOTPRINT], image.estimate[p, DENSITY], limits)
        _spread_one(Place(given, i, p % width, p // width), reach, False, image, out)


@jit
def _spread_one(at, reach, few, image, out):
    """Write the mean over `reach` m about a place, and how many receivers it met over what is enough."""
    wide, high = widths(at, image.words, image.size)
    how = i64(_FIT) if image.turned and not few else i64(_MEAN)
    pixels = reach / at.points[at.p, _FOOTPRINT]
    wanted = lattice_of(pixels * wide, pixels * high)
    (stride_x, stride_y), (taps_x, taps_y) = wanted
    met = _mean_about(at, reach, wanted, how, few, image, out)
    if met < i64(_MIN_RECEIVERS) and max(stride_x, stride_y) > i64(1):
        dense_x, dense_y = min(i64(TAPS), stride_x * taps_x), min(i64(TAPS), stride_y * taps_y)
        taps = dense_x, taps_y
        met = _mean_about(at, reach, Lattice((i64(1), stride_y), taps), how, few, image, out)
        if met < i64(_MIN_RECEIVERS):
            taps = taps_x, dense_y
            met = _mean_about(at, reach, Lattice((stride_x, i64(1)), taps), how, few, image, out)
        if met < i64(_MIN_RECEIVERS):
            taps = dense_x, dense_y
            met = _mean_about(at, reach, Lattice((i64(1), i64(1)), taps), how, few, image, out)
        taps_x, taps_y = taps
    box = (i64(2) * taps_x + i64(1)) * (i64(2) * taps_y + i64(1))
    enough = min(i64(_MIN_RECEIVERS), box // i64(4))  # a short reach holds few, and light is even over it
    stf(np.uint64(out.light.ctypes.data), at.p * CHANNELS + MET, f32(met) / f32(enough))


@jit
def _mean_about(at, reach, lattice, how, few, image, out):
    """Write the weighted mean of the estimates within `reach` m of a place; return of how many, int64.

    how  _MEAN, _FIT, which has the irradiance at the place's own normal, or _CARRY, at none
    few  photons are few there, and the weights lenient
    """
    points, p, x, y = at
    words, estimate, gradient, size, gloss, _ = image
    (stride_x, stride_y), (taps_x, taps_y) = lattice
    base, slopes = np.uint64(estimate.ctypes.data), np.uint64(gradient.ctypes.data)
    px, py, pz = points[p, 0], points[p, 1], points[p, 2]
    nx, ny, nz = points[p, _NG], points[p, _NG + 1], points[p, _NG + 2]
    sx, sy, sz = points[p, _N], points[p, _N + 1], points[p, _N + 2]
    (ux, uy, uz), (vx, vy, vz) = orthonormal_basis((sx, sy, sz))
    alpha = points[p, _ALPHA]
    inv_reach2 = f32(1) / (reach * reach)
    inv_thick2 = inv_reach2 * f32(1.0 / (_FLATNESS * _FLATNESS))
    if few:
        inv_thick2 *= f32(0.25)
    plain, glossy = splat8(f32(0)), splat8(f32(0))
    along_u, along_v = splat8(f32(0)), splat8(f32(0))
    of_x, of_y, of_z = splat4(f32(0)), splat4(f32(0)), splat4(f32(0))
    weight, gloss_weight, squares = f32(0), f32(0), f32(0)
    facing, mean_u, mean_v, uu, uv, vv = f32(0), f32(0), f32(0), f32(0), f32(0), f32(0)
    met = i64(0)
    for row in range(y - taps_y * stride_y, y + taps_y * stride_y + 1, stride_y):
        if row < 0 or row >= size[1]:
            continue
        for column in range(x - taps_x * stride_x, x + taps_x * stride_x + 1, stride_x):
            if column < 0 or column >= size[0]:
                continue
            q = row * size[0] + column
            dx, dy, dz = words[q, 0] - px, words[q, 1] - py, words[q, 2] - pz
            other = words[q, _ALPHA]
            if (other == f32(TAKES_NONE)) != (alpha == f32(TAKES_NONE)):
                continue
            d2 = (dx * dx + dy * dy + dz * dz) * inv_reach2
            z = dx * nx + dy * ny + dz * nz
            z2 = z * z * inv_thick2
            mx, my, mz = words[q, _N], words[q, _N + 1], words[q, _N + 2]
            alike = sx * mx + sy * my + sz * mz
            if d2 >= f32(1) or (
                (z2 >= f32(1) or alike <= f32(OTHER_FACING)) and not (few and alike > f32(0))
            ):
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
            light = vload8(base, q * CHANNELS)
            plain = vfma(light, splat8(w), plain)
            if how == i64(_FIT):
                facing += w * (nx * words[q, _NG] + ny * words[q, _NG + 1] + nz * words[q, _NG + 2])
                u, v = mx * ux + my * uy + mz * uz, mx * vx + my * vy + mz * vz
                wu, wv = w * u, w * v
                mean_u, mean_v, squares = mean_u + wu, mean_v + wv, squares + w * w
                uu, uv, vv = uu + wu * u, uv + wu * v, vv + wv * v
                along_u, along_v = vfma(light, splat8(wu), along_u), vfma(light, splat8(wv), along_v)
            elif how == i64(_CARRY):
                of_x = vfma(vload4(slopes, q * WORDS), splat4(w), of_x)
                of_y = vfma(vload4(slopes, q * WORDS + 4), splat4(w), of_y)
                of_z = vfma(vload4(slopes, q * WORDS + 8), splat4(w), of_z)
            same_gloss = f32(1) - f32(4) * abs(other - alpha)
            alike_narrow = (other < NARROW_ALPHA) == (alpha < NARROW_ALPHA)
            if gloss and other > f32(0) and same_gloss > f32(0) and alike_narrow:
                w *= same_gloss
                gloss_weight += w
                glossy = vfma(vload8(base, q * CHANNELS + _GLOSS), splat8(w), glossy)
    place, slopes = np.uint64(out.light.ctypes.data), np.uint64(out.gradient.ctypes.data)
    inverse = _inverse(weight)
    vstore8(place, p * CHANNELS, vmul(plain, splat8(inverse)))
    vstore8(place, p * CHANNELS + _GLOSS, vmul(glossy, splat8(_inverse(gloss_weight))))
    if how == i64(_CARRY):
        vstore4(slopes, p * WORDS, vmul(of_x, splat4(inverse)))
        vstore4(slopes, p * WORDS + 4, vmul(of_y, splat4(inverse)))
        vstore4(slopes, p * WORDS + 8, vmul(of_z, splat4(inverse)))
    elif how == i64(_FIT) and weight > f32(0):
        fit = fit_of(Moments(weight, squares, mean_u, mean_v, uu, uv, vv, facing))
        for c in range(3):
            mean = inverse * vget(plain, c)
            gu, gv = slope(fit, mean, vget(along_u, c), vget(along_v, c))
            stf(place, p * CHANNELS + c, max(mean - fit.u * gu - fit.v * gv, f32(0)))
            stf(slopes, p * WORDS + c, gu * ux + gv * vx)
            stf(slopes, p * WORDS + 4 + c, gu * uy + gv * vy)
            stf(slopes, p * WORDS + 8 + c, gu * uz + gv * vz)
    return met


@jit
def _evaluate(words, p, out):
    """Turn a mean of functions of the normal, their values at 0, into the value at that of receiver `p`."""
    place, slopes = np.uint64(out.light.ctypes.data), np.uint64(out.gradient.ctypes.data)
    n = words[p, _N], words[p, _N + 1], words[p, _N + 2]
    for c in range(3):
        row = p * WORDS + c
        along = ldf(slopes, row) * n[0] + ldf(slopes, row + 4) * n[1] + ldf(slopes, row + 8) * n[2]
        stf(place, p * CHANNELS + c, max(ldf(place, p * CHANNELS + c) + along, f32(0)))


@jit
def _inverse(weight):
    """1 / a float32 weight, 0 of 0."""
    return f32(1) / weight if weight > f32(0) else f32(0)
