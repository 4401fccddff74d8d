"""The normalised world-space filter: noise out of the estimate without darkening its edges.

Each receiver takes the weighted mean of the estimates around it on its own surface. Because the
weights are divided by their sum, light is not lost past an edge, as it is by a wide photon kernel:
small kernels and this filter halve the error of wide kernels at less cost.
"""

from __future__ import annotations

import math

import numpy as np

from ispm.optics.jit import jit
from ispm.tracer.simd import (
    address, alloca, atomic_add, ldf, ldu, splat8, stf, vfma, vload8, vmul, vstore8,
)  # fmt: skip
from ispm.tracer.threads import run_threads

f32, i64, u32 = np.float32, np.int64, np.uint32

REACH = 0.075  # of the scene's diagonal: the filter's radius where photons are few
REACH_IN_KERNELS = 8.0  # elsewhere: 64 kernels' photons in the mean leave 3 % noise
_TAPS = 8  # on each side; wider reaches are strided
_MAX_PIXELS = 24.0  # reach on the screen, low-resolution pixels
_FLATNESS = 0.26  # half thickness of the filter over its radius
_KERNEL_COUNT = 25.0  # photons in a kernel, see tracer.density

# words of a RECEIVER
_ALPHA, _NG, _VALID, _FOOTPRINT, _SLANT = 3, 4, 7, 11, 15


def filter_estimate(
    receivers: np.ndarray,
    estimate: np.ndarray,
    size: tuple[int, int],
    diagonal: float,
    smoothing: float,
    threads: int,
    points: np.ndarray | None = None,
    point_pixels: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the filtered estimate at each receiver, and at `points` beside them.

    receivers   (h w,) RECEIVER, row by row
    estimate    (h w, 16) float32 channels of an estimator
    size        (w, h)
    points, point_pixels   (P,) RECEIVER, (P, 2) int32 low-resolution pixel each lies in
    ->          (h w, 16) and (P, 16) float32; a point with no receiver near keeps zeros and
                reports a weight of zero in channel 7
    Source: weights w = (1 - d^2/h^2)^2 (n.n')^16 (1 - z^2/b^2)^2 dA, d and z the distance and the
    distance from the tangent plane, dA the area a receiver stands for.
    """
    width, height = size
    out = np.zeros_like(estimate)
    words = np.ascontiguousarray(receivers).view(np.float32).reshape(-1, 16)
    shape = np.array([width, height], np.int64)
    scale = np.array([diagonal * REACH * smoothing, REACH_IN_KERNELS * smoothing], np.float32)
    counter = np.zeros(8, np.int64)
    gloss = bool((words[:, _ALPHA] > 0.0).any())

    def rows(_: int) -> None:
        _filter_rows(words, estimate, shape, scale, gloss, address(counter), out)

    run_threads(rows, threads)
    extra = np.zeros((0 if points is None else len(points), 16), np.float32)
    if points is not None and len(points):
        point_words = np.ascontiguousarray(points).view(np.float32).reshape(-1, 16)
        counter[:] = 0

        def chunks(_: int) -> None:
            _filter_points(
                point_words, point_pixels, words, estimate, shape, scale, gloss,
                address(counter), extra,
            )  # fmt: skip

        run_threads(chunks, threads)
    return out, extra


@jit
def _filter_rows(words, estimate, shape, scale, gloss, counter, out):
    width, height = shape[0], shape[1]
    scratch = alloca(32)
    while True:
        y = atomic_add(counter, i64(1))
        if y >= height:
            return
        for x in range(width):
            p = y * width + x
            if ldu(np.uint64(words.ctypes.data), p * 16 + _VALID) == u32(0):
                continue
            kernel = _kernel_radius(estimate[p, 3])
            _filter_one(
                words, p, x, y, kernel, words, estimate, width, height, scale, gloss, scratch
            )
            for c in range(16):
                out[p, c] = ldf(scratch, c)


@jit
def _filter_points(
    points, pixels, words, estimate, shape, scale, gloss, counter, out
):
    width, height = shape[0], shape[1]
    scratch = alloca(32)
    chunk = i64(64)
    while True:
        first = atomic_add(counter, chunk)
        if first >= len(points):
            return
        for i in range(first, min(first + chunk, len(points))):
            x, y = i64(pixels[i, 0]), i64(pixels[i, 1])
            p = y * width + x
            _filter_one(
                points, i, x, y, _kernel_radius(estimate[p, 3]), words, estimate, width, height,
                scale, gloss, scratch,
            )  # fmt: skip
            for c in range(16):
                out[i, c] = ldf(scratch, c)


@jit
def _kernel_radius(density):
    """Radius of a kernel where photons lie at `density` (1/m^2)."""
    return f32(math.sqrt(f32(_KERNEL_COUNT / math.pi) / max(density, f32(1e-12))))


@jit
def _filter_one(
    points, p, x, y, kernel, words, estimate, width, height, scale, gloss, scratch
):
    """Write the filtered channels of point `p` to `scratch`; channel 7: the sum of the weights."""
    base = np.uint64(estimate.ctypes.data)
    valid = np.uint64(words.ctypes.data)
    px, py, pz = points[p, 0], points[p, 1], points[p, 2]
    alpha = points[p, _ALPHA]
    nx, ny, nz = points[p, _NG], points[p, _NG + 1], points[p, _NG + 2]
    foot = points[p, _FOOTPRINT]
    reach = min(min(scale[0], scale[1] * kernel), f32(_MAX_PIXELS) * foot)
    reach_px = reach / foot
    stride = max(i64(1), i64(math.ceil(reach_px / f32(_TAPS))))
    taps = max(i64(1), i64(reach_px / f32(stride)))
    reach = max(reach, f32(1.5) * foot * f32(stride))
    inv_reach2 = f32(1) / (reach * reach)
    inv_thick2 = inv_reach2 * f32(1.0 / (_FLATNESS * _FLATNESS))
    plain = splat8(f32(0))
    glossy = splat8(f32(0))
    weight = f32(0)
    gloss_weight = f32(0)
    for j in range(-taps, taps + 1):
        row = y + j * stride
        if row < 0 or row >= height:
            continue
        for i in range(-taps, taps + 1):
            column = x + i * stride
            if column < 0 or column >= width:
                continue
            q = row * width + column
            if ldu(valid, q * 16 + _VALID) == u32(0):
                continue
            dx, dy, dz = words[q, 0] - px, words[q, 1] - py, words[q, 2] - pz
            d2 = (dx * dx + dy * dy + dz * dz) * inv_reach2
            if d2 >= f32(1):
                continue
            z = dx * nx + dy * ny + dz * nz
            z2 = z * z * inv_thick2
            facing = nx * words[q, _NG] + ny * words[q, _NG + 1] + nz * words[q, _NG + 2]
            if z2 >= f32(1) or facing <= f32(0.5):
                continue
            facing *= facing
            facing *= facing
            facing *= facing
            facing *= facing
            near = (f32(1) - d2) * (f32(1) - z2)
            w = near * near * facing * words[q, _FOOTPRINT] * words[q, _FOOTPRINT] * words[q, _SLANT]
            weight += w
            plain = vfma(vload8(base, q * 16), splat8(w), plain)
            if gloss:
                likeness = f32(1) - f32(4) * abs(words[q, _ALPHA] - alpha)
                if words[q, _ALPHA] > f32(0) and likeness > f32(0):
                    w *= likeness
                    gloss_weight += w
                    glossy = vfma(vload8(base, q * 16 + 8), splat8(w), glossy)
    scale_plain = f32(1) / weight if weight > f32(0) else f32(0)
    scale_gloss = f32(1) / gloss_weight if gloss_weight > f32(0) else f32(0)
    vstore8(scratch, i64(0), vmul(plain, splat8(scale_plain)))
    stf(scratch, i64(7), weight)
    vstore8(scratch, i64(8), vmul(glossy, splat8(scale_gloss)))
