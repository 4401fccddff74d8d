"""Direct light of lamps with a surface and of the environment at the eye's pixels: a shadow ray to each, and
a filter.

It runs on the CPU, where the trees are. A pixel draws from one of the 4 x 4 equal parts of what is to be
drawn from, and its neighbors from the others, so that any 4 x 4 pixels together draw evenly; the filter is
the mean over such a square (Keller and Heidrich, Interleaved Sampling, EGWR 2001; the discontinuity buffer of
Wald et al., Interactive Global Illumination using Fast Ray Tracing, EGWR 2002). It takes in pixels of the
same plane alone, and no farther than a fraction of the penumbra's width, by the distance to what casts the
shadow: at contacts its edge stays sharp. Where penumbrae are much wider than the square, what it lets through
is filtered again, from squares that lie farther and farther apart (Dammertz et al., Edge-Avoiding A-Trous
Wavelet Transform for fast Global Illumination Filtering, HPG 2010). So is what lamps bring without shadows,
which varies over a fraction of their distance.
"""

from __future__ import annotations

import math
from functools import partial
from typing import NamedTuple

import numpy as np

from ispm.accel.intersect import STACK_WORDS, any_distance
from ispm.accel.layers import without_diffuse
from ispm.accel.records import Ray, Scratch
from ispm.accel.surface import SurfaceTable, scene_tables
from ispm.accel.transmittance import BEFORE, shadow_transmittance
from ispm.accel.world import World
from ispm.kernels.share import run_shared, shared_rows
from ispm.kernels.simd import alloca
from ispm.lights.area import resample_surround, sample_lamps
from ispm.lights.nee import (
    BY_FACETS,
    drawn_share,
    draws_by_lobes,
    greatest,
    side_of,
)
from ispm.lights.ratio import ratio_share
from ispm.optics.bsdf import eval_bsdf, is_lambert, is_narrow, transmits
from ispm.optics.environment import environment_irradiance, has_environment
from ispm.optics.jit import jit
from ispm.optics.light import FAR
from ispm.optics.rng import random4
from ispm.optics.vector import Vector, add, dot, scale, sub, vec3
from ispm.scene.packed import Packed
from ispm.stages.pixels import (
    Pixels,
    PixelView,
    is_alike,
    is_lit,
    is_turned_alike,
    lift,
    plane_at,
    shown_at,
    transmitted_shares,
)

f32, i64, u32 = np.float32, np.int64, np.uint32

_DIMENSION = 5 << 20  # of the random numbers
_SIDE = 4  # pixels of a square that draws from each part once
_PAIRS = 1  # of directions that one of the environment is drawn from
_REACH = 2  # pixels to each side that the filter takes in
_LEAST_REACH = f32(2)  # in the first pass, for single rays are specks
_UNSHADED = f32(1e9)  # pixels, where nothing shades, but the filter is wanted
_CHUNK = 64  # pixels a thread takes at a time
_BLUR = f32(0.25)  # of a penumbra's width, that the filter blurs it over to each side at most
_NEAR = f32(0.18)  # of a lamp's distance, that its light without shadows is filtered over, likewise
_SAME = f32(math.cos(math.radians(2.0)))  # of normals, of pixels whose light without shadows is averaged
_STRIDES = 4, 12  # pixels between squares that lie side by side: each of 3 x 3 of those before


class _Samples(NamedTuple):
    """What shadow rays found, float32.

    diffuse, gloss  (n, 3) light of the Lambert lobe over its albedo, and of the others, cd/m2
    drawn           (n, 3) what `diffuse` would be without shadows and reflection above it
    unshadowed      (n, 3) likewise, exact where that is known
    lamps           (n, 3) of `drawn` what lamps bring
    near            (n,) pixels over which that may be averaged, infinite where they bring nothing
    reach           (n,) pixels to each side that the filter may take in: of the penumbra's width, infinite
                    where none shades a Lambert surface
    """

    diffuse: np.ndarray
    gloss: np.ndarray
    drawn: np.ndarray
    unshadowed: np.ndarray
    lamps: np.ndarray
    near: np.ndarray
    reach: np.ndarray


class _Means(NamedTuple):
    """Filtered `diffuse`, `drawn` and `lamps` of _Samples, and the least `near` and `reach` of those that are
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
    diffuse, gloss, drawn, unshadowed, lamps = np.zeros((5, count, 3), np.float32)
    samples = _Samples(diffuse, gloss, drawn, unshadowed, lamps, *np.full((2, count), np.inf, np.float32))
    run_shared(lambda counter: _sample_pixels(tables, pixels, view, counter, samples), world.threads)
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
def _sample_pixels(tables, pixels, view, counter, samples):
    """Trace a shadow ray for as many of the Pixels as a thread gets."""
    scratch = Scratch(alloca(STACK_WORDS), alloca(2))
    # In 16 passes each pixel draws from each part once; 5 has no part in common with 16.
    turn, _, _, _ = random4(u32(0), u32(_DIMENSION + 1), u32(0), view.seed)
    step = (i64(turn * f32(_SIDE * _SIDE)) + i64(5) * i64(view.pass_index)) % (_SIDE * _SIDE)
    for i in shared_rows(counter, _CHUNK, len(pixels.points)):
        samples.reach[i] = f32(np.inf)
        if not is_lit(tables, pixels, i):
            continue
        shown = shown_at(tables, pixels, view, i)
        if not is_lambert(shown.x.bsdf):
            # what reflection leaves to the Lambert lobe depends on the draw, whose ratio alone is biased; and
            # what is reflected is known by draws alone, of which each pixel of a square has another part
            samples.reach[i] = _UNSHADED
        column = (i % view.columns + step) % _SIDE
        row = (i // view.columns + step // _SIDE) % _SIDE
        r0, r1, r2, _ = random4(u32(i), u32(_DIMENSION), view.pass_index, view.seed)
        # Shifted at random from square to square: a triangle is not to be drawn with the same parts of it.
        square = u32((i // view.columns // _SIDE) * view.columns + i % view.columns // _SIDE)
        shift, _, _, _ = random4(square, u32(_DIMENSION + 2), view.pass_index, view.seed)
        u0 = (f32((row * _SIDE + column) * 7 % (_SIDE * _SIDE)) + r0) * f32(1 / (_SIDE * _SIDE)) + shift
        u0 -= f32(math.floor(u0))
        u1, u2 = (f32(column) + r1) * f32(1 / _SIDE), (f32(row) + r2) * f32(1 / _SIDE)
        radiance, distance, wi, pdf, _, _ = sample_lamps(tables, shown.x, u0, u1, u2)
        if pdf > f32(0):
            arriving = _Arriving(scale(f32(1) / pdf, radiance), distance, wi, pdf)
            _add_light(tables, shown, arriving, i, scratch, samples)
            for c in range(3):
                samples.unshadowed[i, c] = samples.lamps[i, c] = samples.drawn[i, c]
            if greatest(vec3(samples.lamps[i])) > f32(0):
                slant = abs(dot(shown.x.ng, shown.wo))
                samples.near[i] = _NEAR * slant * distance / shown.width
        if has_environment(tables.environment):
            x, wo, pick = shown.x, shown.wo, u0
            brightest = tables.environment.brightest
            by_lobes = draws_by_lobes(x.bsdf) and not is_narrow(x.bsdf)  # eye paths take these
            both = resample_surround(tables, x, wo, u1, u2, pick, _PAIRS, brightest, by_lobes)
            for drawn in both:
                arriving = _Arriving(drawn.radiance, FAR, drawn.wi, drawn.pdf)
                _add_light(tables, shown, arriving, i, scratch, samples)
            irradiance = environment_irradiance(tables.environment, x.n)
            for c in range(3):
                samples.unshadowed[i, c] += irradiance[c] * f32(1 / math.pi)


class _Arriving(NamedTuple):
    """Light of one point of a lamp, or from one direction: irradiance over the density of the draw, distance,
    m, wi, and the density of its direction among all lamps' points or the environment, 1/sr."""

    irradiance: Vector
    distance: np.float32
    wi: Vector
    pdf: np.float32


@jit
def _add_light(tables, shown, arriving, i, scratch, samples):
    """Add what row i makes of an _Arriving to the _Samples."""
    x, wo, wi = shown.x, shown.wo, arriving.wi
    b, along = x.bsdf, abs(dot(x.n, wi))
    none = f32(0), f32(0), f32(0)
    if greatest(arriving.irradiance) <= f32(0):
        return
    f = eval_bsdf(b, x.n, x.ng, wo, wi)
    gloss = none
    if not is_lambert(b):
        gloss = eval_bsdf(without_diffuse(b), x.n, x.ng, wo, wi)
        f = sub(f, gloss)
        if transmits(b):
            gloss = none  # eye paths find what these reflect and let through
        else:
            _, share = drawn_share(x, wo, wi, arriving.pdf, BY_FACETS)
            gloss = scale(share, gloss)
    if greatest(f) <= f32(0) and greatest(gloss) <= f32(0):
        return
    if dot(x.n, wi) > f32(0):
        for c in range(3):
            samples.drawn[i, c] += along * arriving.irradiance[c] * f32(1 / math.pi)
    start = add(x.position, scale(lift(shown), side_of(x.ng, wi)))
    toward, distance = wi, arriving.distance
    if distance < FAR:  # anew, for `start` may lie nearer to a lamp by more than rays end before it
        segment = sub(add(x.position, scale(distance, wi)), start)
        distance = f32(math.sqrt(dot(segment, segment)))
        toward = scale(f32(1) / max(distance, f32(1e-30)), segment)
    limit = distance * (f32(1) - BEFORE)
    met = any_distance(tables.trees, Ray(start, toward, limit), scratch.stack)
    passed = f32(1), f32(1), f32(1)
    if met < limit:
        # of the lamp's image through a pinhole at what is between
        angle = f32(1) / f32(math.sqrt(max(arriving.pdf, f32(1e-30))))
        width = angle * met / max(f32(1) - met / distance, f32(1e-6))
        samples.reach[i] = min(samples.reach[i], _BLUR * width / shown.width)
        if not tables.porous:
            return
        passed = shadow_transmittance(tables, start, toward, distance, scratch)
    for c in range(3):
        light = along * arriving.irradiance[c] * passed[c]
        if b.diffuse[c] > f32(0):
            samples.diffuse[i, c] += light * f[c] / b.diffuse[c]
        samples.gloss[i, c] += light * gloss[c]


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
    for i in shared_rows(counter, _CHUNK, len(pixels.points)):
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
    for i in shared_rows(counter, _CHUNK, len(pixels.points)):
        row, column = i // columns, i % columns
        top, bottom = max(row - stride, row % stride), min(row + stride, rows - 1)
        left, right = max(column - stride, column % stride), min(column + stride, columns - 1)
        near, reach = f32(np.inf), f32(np.inf)
        for y in range(top, bottom + 1, stride):
            for x in range(left, right + 1, stride):
                near = min(near, means.near[y * columns + x])
                reach = min(reach, means.reach[y * columns + x])
        wider.near[i], wider.reach[i] = near, reach
        aside = _aside(reach, smoothing, stride) if reach < _UNSHADED else f32(0)
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
