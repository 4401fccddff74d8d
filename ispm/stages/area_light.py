"""Direct light of lamps with a surface and of the environment at the eye's pixels: draws, and a filter.

It runs on the CPU, where the trees are. The draws of any 4 x 4 pixels together are even, see `area_draws.py`;
the filter is the mean over such a square (the discontinuity buffer of Wald et al., Interactive Global
Illumination using Fast Ray Tracing, EGWR 2002). It takes in pixels of the same plane alone, and no farther
than a fraction of the penumbra's width, by the distance to what casts the shadow: at contacts its edge stays
sharp. Where penumbrae are much wider than the square, what it lets through is filtered again, from squares
that lie farther and farther apart (Dammertz et al., Edge-Avoiding A-Trous Wavelet Transform for fast Global
Illumination Filtering, HPG 2010). So is what lamps bring without shadows, which varies over a fraction of
their distance.
"""

from __future__ import annotations

import math
from functools import partial
from typing import NamedTuple

import numpy as np

from ispm.accel.surface import SurfaceTable, scene_tables
from ispm.accel.world import World
from ispm.kernels.share import run_shared, shared_rows
from ispm.lights.ratio import ratio_share
from ispm.optics.jit import jit
from ispm.optics.vector import add, scale, vec3
from ispm.scene.packed import Packed
from ispm.stages.area_draws import CHUNK, UNSHADED, draw_light
from ispm.stages.pixels import (
    Pixels,
    PixelView,
    is_alike,
    is_lit,
    is_turned_alike,
    plane_at,
    transmitted_shares,
)

f32, i64, u32 = np.float32, np.int64, np.uint32

_REACH = 2  # pixels to each side that the filter takes in
_LEAST_REACH = f32(2)  # in the first pass, for single rays are specks
_SAME = f32(math.cos(math.radians(2.0)))  # of normals, of pixels whose light without shadows is averaged
_STRIDES = 4, 12  # pixels between squares that lie side by side: each of 3 x 3 of those before


class _Means(NamedTuple):
    """Filtered `diffuse`, `drawn` and `lamps` of Samples, and the least `near` and `reach` of those that are
    in them. The ratio of the first two is the share of light that is not shaded."""

    diffuse: np.ndarray
    drawn: np.ndarray
    lamps: np.ndarray
    near: np.ndarray
    reach: np.ndarray


class _Lit(NamedTuple):
    """What pixels show, (n, 3) float32: `unshaded` light of the Lambert lobe over its albedo, cd/m2, the
    `albedo` of what is not seen through, and the light, (n, 4)."""

    unshaded: np.ndarray
    albedo: np.ndarray
    light: np.ndarray


def area_light(
    pixels: Pixels,
    view: PixelView,
    packed: Packed,
    world: World,
    surfaces: SurfaceTable,
    smoothing: float,
) -> np.ndarray:
    """Return the direct light of lamps with a surface and of the environment, (n, 4) float32 cd/m2 of
    the n pixels; of an opacity of 1.

    smoothing  factor on the filter's width
    """
    count = len(pixels.points)
    tables = scene_tables(packed, world, surfaces)
    samples = draw_light(tables, pixels, view, world.threads)
    means = _Means(*np.zeros((3, count, 3), np.float32), *np.zeros((2, count), np.float32))
    unshaded, albedo = np.zeros((2, count, 3), np.float32)
    lit = _Lit(unshaded, albedo, np.zeros((count, 4), np.float32))
    told = pixels, view, f32(smoothing)
    run_shared(lambda counter: _filter(tables, *told, samples, counter, means, lit), world.threads)
    # the samples' own values are used up
    wider = _Means(samples.diffuse, samples.drawn, samples.lamps, samples.near, samples.reach)
    for stride in _STRIDES:
        run_shared(partial(_widen, *told, i64(stride), means, wider, lit), world.threads)
        means, wider = wider, means
    return lit.light


@jit
def _filter(tables, pixels, view, smoothing, samples, counter, means, lit):
    """Write what as many of the Pixels as a thread gets show to a _Lit, and the _Means that it is made of.

    The share of light that is not shaded multiplies what is known of it without shadows, as far as
    `ratio_share` says: the first pass takes no other.
    """
    first = view.pass_index == u32(0)
    least, exact = _LEAST_REACH if first else f32(0), len(tables.emitters.triangles) == 0
    by_ratio = ratio_share(view.pass_index)
    columns, rows = view.columns, i64(len(pixels.points)) // view.columns
    for i in shared_rows(counter, CHUNK, len(pixels.points)):
        row, column = i // columns, i % columns
        lit.light[i, 3], means.near[i], means.reach[i] = f32(1), f32(np.inf), f32(np.inf)
        if not is_lit(tables, pixels, i):
            continue
        top, bottom = max(row - _REACH, 0), min(row + _REACH, rows - 1)
        left, right = max(column - _REACH, 0), min(column + _REACH, columns - 1)
        near, reach = f32(np.inf), f32(np.inf)
        for y in range(top, bottom + 1):
            for x in range(left, right + 1):
                near = min(near, samples.near[y * columns + x])
                reach = min(reach, samples.reach[y * columns + x])
        base = pixels.base[i]
        passed, through = transmitted_shares(tables, pixels.points[i, 3])
        opaque = (f32(1) - base[3]) * (f32(1) - passed) * (f32(1) - through)
        means.near[i], means.reach[i] = near, reach
        for c in range(3):
            lit.albedo[i, c] = opaque * base[c]
        if first and exact and reach == f32(np.inf):  # nothing shades, and all is known
            for c in range(3):
                means.diffuse[i, c], means.drawn[i, c] = samples.diffuse[i, c], samples.drawn[i, c]
                lit.unshaded[i, c] = samples.unshadowed[i, c]
                passed = samples.diffuse[i, c] / max(samples.drawn[i, c], f32(1e-30))
                lit.light[i, c] = passed * lit.unshaded[i, c] * lit.albedo[i, c] + samples.gloss[i, c]
            continue
        reach = min(max(reach, least), f32(_REACH)) * smoothing
        plane = plane_at(pixels, view, i)
        none, total = (f32(0), f32(0), f32(0)), f32(0)
        diffuse, gloss, drawn, unshadowed, lamps = none, none, none, none, none
        for y in range(top, bottom + 1):
            down = _near(y - row, reach)
            if down <= f32(0):
                continue
            for x in range(left, right + 1):
                k = y * columns + x
                weight = down * _near(x - column, reach)
                if weight > f32(0) and (k == i or is_alike(pixels, plane, i, k)):
                    total += weight
                    diffuse = add(diffuse, scale(weight, vec3(samples.diffuse[k])))
                    gloss = add(gloss, scale(weight, vec3(samples.gloss[k])))
                    drawn = add(drawn, scale(weight, vec3(samples.drawn[k])))
                    unshadowed = add(unshadowed, scale(weight, vec3(samples.unshadowed[k])))
                    lamps = add(lamps, scale(weight, vec3(samples.lamps[k])))
        for c in range(3):
            means.diffuse[i, c], means.drawn[i, c] = diffuse[c] / total, drawn[c] / total
            means.lamps[i, c] = lamps[c] / total
            lit.unshaded[i, c] = (drawn[c] + by_ratio * (unshadowed[c] - drawn[c])) / total
            passed = diffuse[c] / max(drawn[c], f32(1e-30))
            lit.light[i, c] = passed * lit.unshaded[i, c] * lit.albedo[i, c] + gloss[c] / total


@jit
def _widen(pixels, view, smoothing, stride, means, wider, lit, counter):
    """Filter the _Means of as many of the Pixels as a thread gets with those of the 8 that lie `stride`
    pixels aside, and change what they show accordingly, where penumbrae are wide enough for it; and what
    lamps bring without shadows, where these are far enough.

    wider  _Means to write, of which `diffuse` and `drawn` are not normalized
    """
    columns, rows = view.columns, i64(len(pixels.points)) // view.columns
    by_ratio = ratio_share(view.pass_index)
    for i in shared_rows(counter, CHUNK, len(pixels.points)):
        row, column = i // columns, i % columns
        top, bottom = max(row - stride, row % stride), min(row + stride, rows - 1)
        left, right = max(column - stride, column % stride), min(column + stride, columns - 1)
        near, reach = f32(np.inf), f32(np.inf)
        for y in range(top, bottom + 1, stride):
            for x in range(left, right + 1, stride):
                near = min(near, means.near[y * columns + x])
                reach = min(reach, means.reach[y * columns + x])
        wider.near[i], wider.reach[i] = near, reach
        aside = _aside(reach, smoothing, stride) if reach < UNSHADED else f32(0)
        evenly = _aside(near, smoothing, stride) if near < f32(np.inf) else f32(0)
        diffuse, drawn = vec3(means.diffuse[i]), vec3(means.drawn[i])
        lamps, total = vec3(means.lamps[i]), f32(1)
        if aside > f32(0) or evenly > f32(0):
            plane = plane_at(pixels, view, i)
            alike = _alike_aside(pixels, plane, i, columns, rows, stride)
            for k in range(9):
                if alike >> k & 1 == 0 or k == 4:
                    continue
                j = i + stride * (i64(k // 3 - 1) * columns + i64(k % 3 - 1))
                diffuse = add(diffuse, scale(aside, vec3(means.diffuse[j])))
                drawn = add(drawn, scale(aside, vec3(means.drawn[j])))
                # with the one opposite alone, or a slope of light would be a bias
                if alike >> (8 - k) & 1 == 1 and is_turned_alike(pixels, plane, j, _SAME):
                    total += evenly
                    lamps = add(lamps, scale(evenly, vec3(means.lamps[j])))
        for c in range(3):
            wider.diffuse[i, c], wider.drawn[i, c] = diffuse[c], drawn[c]
            wider.lamps[i, c] = lamps[c] / total
            unshaded = lit.unshaded[i, c]
            changed = max(unshaded + by_ratio * (wider.lamps[i, c] - means.lamps[i, c]), f32(0))
            before = means.diffuse[i, c] / max(means.drawn[i, c], f32(1e-30))
            after = diffuse[c] / max(drawn[c], f32(1e-30))
            lit.light[i, c] += (after * changed - before * unshaded) * lit.albedo[i, c]
            lit.unshaded[i, c] = changed


@jit
def _alike_aside(pixels, plane, i, columns, rows, stride):
    """Bits of which of 3 x 3 rows of Pixels, `stride` pixels apart about row i, are alike; int64."""
    row, column, alike = i // columns, i % columns, i64(0)
    for k in range(9):
        y, x = row + stride * i64(k // 3 - 1), column + stride * i64(k % 3 - 1)
        if y >= 0 and x >= 0 and y < rows and x < columns and is_alike(pixels, plane, i, y * columns + x):
            alike |= i64(1) << k
    return alike


@jit
def _aside(reach, smoothing, stride):
    """Weight of squares `stride` pixels aside in a filter that reaches so far: side by side they reach as far
    as one and a half of them."""
    return min(max(reach * smoothing / (f32(1.5) * f32(stride)) - f32(1), f32(0)), f32(1))


@jit
def _near(away, reach):
    """Weight of a pixel `away` rows or columns from the middle of a square that reaches so far."""
    return min(max(reach + f32(0.5) - abs(f32(away)), f32(0)), f32(1)) if away != 0 else f32(1)
