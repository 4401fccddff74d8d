"""What the eye's pixels draw from lamps with a surface and from the environment: a shadow ray to each.

It runs on the CPU, where the trees are. A pixel draws from one of the 4 x 4 equal parts of what is to be
drawn from, and its neighbors from the others, so that any 4 x 4 pixels together draw evenly (Keller and
Heidrich, Interleaved Sampling, EGWR 2001). In the first pass pixels draw more often where a penumbra is
narrow, for there the filter of `area_light.py` takes in few of them. Where lamps are close it takes in few as
well, and what they bring without shadows is known, see `lights/known.py`. What the neighbors have found
decides, never a pixel's own draw: a mean is off if what is drawn says whether it counts.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ispm.accel.intersect import STACK_WORDS, any_distance
from ispm.accel.layers import without_diffuse
from ispm.accel.records import Ray, Scratch
from ispm.accel.surface import Tables
from ispm.accel.transmittance import BEFORE, shadow_transmittance
from ispm.kernels.share import run_shared, shared_rows
from ispm.kernels.simd import alloca
from ispm.lights.area import resample_surround, sample_lamps
from ispm.lights.known import are_known, unshaded_lamps
from ispm.lights.nee import (
    BY_FACETS,
    drawn_share,
    draws_by_lobes,
    greatest,
    side_of,
)
from ispm.optics.bsdf import eval_bsdf, is_lambert, is_narrow, transmits
from ispm.optics.coat import with_diffuse
from ispm.optics.environment import environment_irradiance, has_environment
from ispm.optics.jit import jit
from ispm.optics.light import FAR
from ispm.optics.rng import random4
from ispm.optics.vector import Vector, add, dot, scale, sub
from ispm.stages.pixels import Pixels, PixelView, is_lit, lift, shown_at

f32, i64, u32 = np.float32, np.int64, np.uint32

UNSHADED = f32(1e9)  # pixels, where nothing shades, but the filter is wanted
CHUNK = 64  # pixels a thread takes at a time
_DIMENSION = 5 << 20  # of the random numbers
_SIDE = 4  # pixels of a square that draws from each part once
_PAIRS = 1  # of directions that one of the environment is drawn from
_BLUR = f32(0.25)  # of a penumbra's width, that the filter blurs it over to each side at most
_NEAR = f32(0.18)  # of a lamp's distance, that its light without shadows is filtered over, likewise
_DRAWS = 4  # of a pixel in a narrow penumbra, in the first pass
_NARROW = f32(6)  # pixels that the filter reaches there, less than which its wider squares have no weight
# Pixels that lamps' light is averaged over: below the first the filter's widest squares count in part, below
# 12 those of its first stride. 2, 4, 8 and 16 draws make some 1,800 of what is averaged, from 9 pixels on.
_CLOSE = f32(36), f32(25), f32(20), f32(9)
_WHITE = f32(1), f32(1), f32(1)
_IS_NARROW, _IS_REACHED = 1, 2  # marks: of what casts a shadow, of light
_CLOSE_BIT = 2  # and from this bit on: of what lamps bring, which of _CLOSE it is below
_AROUND = 2  # pixels to each side that tell of penumbrae and of lamps


class Samples(NamedTuple):
    """What shadow rays found, float32, a row for each channel.

    diffuse, gloss  (3, n) light of the Lambert lobe over its albedo, and of the others, cd/m2
    drawn           (3, n) what `diffuse` would be without shadows and reflection above it
    known           (3, n) likewise, exact: the environment's, and that of lamps where `are_known`
    lamps           (3, n) likewise, of other lamps, in the mean; (3, 0) where there are none
    near            (n,) or (0,) pixels over which that may be averaged, infinite where they bring nothing
    reach           (n,) pixels to each side that the filter may take in: of the penumbra's width, infinite
                    where none shades a Lambert surface
    """

    diffuse: np.ndarray
    gloss: np.ndarray
    drawn: np.ndarray
    known: np.ndarray
    lamps: np.ndarray
    near: np.ndarray
    reach: np.ndarray


def draw_light(tables: Tables, pixels: Pixels, view: PixelView, threads: int) -> Samples:
    """Return the Samples of n pixels."""
    count = len(pixels.points)
    by_draws = 0 if are_known(tables.emitters) else count
    lamps, near = np.zeros((3, by_draws), np.float32), np.full(by_draws, np.inf, np.float32)
    diffuse, gloss, drawn, known = np.zeros((4, 3, count), np.float32)
    samples = Samples(diffuse, gloss, drawn, known, lamps, near, np.full(count, np.inf, np.float32))
    marks = np.zeros(count, np.uint8)
    run_shared(lambda counter: _draw_once(tables, pixels, view, marks, counter, samples), threads)
    if view.pass_index == 0 or by_draws:
        run_shared(lambda counter: _refine(tables, pixels, view, marks, counter, samples), threads)
    return samples


@jit
def _draw_once(tables, pixels, view, marks, counter, samples):
    """Trace a shadow ray for as many of the Pixels as a thread gets, and mark what it met."""
    scratch = Scratch(alloca(STACK_WORDS), alloca(2))
    step, by_draws = _first_part(view), len(samples.near) > 0
    for i in shared_rows(counter, CHUNK, len(pixels.points)):
        if not is_lit(tables, pixels, i):
            continue
        shown = shown_at(tables, pixels, view, i)
        if not is_lambert(shown.x.bsdf):
            # what reflection leaves to the Lambert lobe depends on the draw, whose ratio alone is biased; and
            # what is reflected is known by draws alone, of which each pixel of a square has another part
            samples.reach[i] = UNSHADED
        _draw(tables, shown, view, i, i64(0), step, scratch, samples)
        known = f32(0), f32(0), f32(0)
        if has_environment(tables.environment):
            known = environment_irradiance(tables.environment, shown.x.n)
        if not by_draws:
            known = add(known, unshaded_lamps(tables, shown.x, f32(0), f32(0), f32(0), i64(0)))
        is_reached = False
        for c in range(3):
            samples.known[c, i] = known[c] * f32(1 / math.pi)
            is_reached = is_reached or samples.diffuse[c, i] > f32(0) or samples.gloss[c, i] > f32(0)
        mark = _IS_NARROW * (samples.reach[i] < _NARROW) + _IS_REACHED * is_reached
        if by_draws:
            for level in range(len(_CLOSE)):
                mark += (1 << (_CLOSE_BIT + level)) * (samples.near[i] < _CLOSE[level])
        marks[i] = mark


@jit
def _refine(tables, pixels, view, marks, counter, samples):
    """Have pixels in narrow penumbrae draw again in the first pass, so that the Samples are their means, and
    those close to lamps know what these bring without shadows."""
    scratch = Scratch(alloca(STACK_WORDS), alloca(2))
    step, partly = _first_part(view), _IS_NARROW | _IS_REACHED
    for i in shared_rows(counter, CHUNK, len(pixels.points)):
        around = _marks_around(marks, i, view.columns)
        draws_again = view.pass_index == u32(0) and around & partly == partly
        close = around >> _CLOSE_BIT  # 0, 1, 3, 7 or 15: below one of _CLOSE is below those before
        if not (draws_again or close) or not is_lit(tables, pixels, i):
            continue
        shown = shown_at(tables, pixels, view, i)
        if draws_again:
            for k in range(1, _DRAWS):
                _draw(tables, shown, view, i, i64(k), step, scratch, samples)
            for sums in (samples.diffuse, samples.gloss, samples.drawn):
                for c in range(3):
                    sums[c, i] *= f32(1 / _DRAWS)
        if close:
            r0, r1, r2, _ = random4(u32(i), u32(_DIMENSION + 3), view.pass_index, view.seed)
            light = unshaded_lamps(tables, shown.x, r0, r1, r2, close + i64(1))
            for c in range(3):
                samples.lamps[c, i] = light[c] * f32(1 / math.pi)
        elif draws_again and len(samples.near) > 0:
            for c in range(3):
                samples.lamps[c, i] *= f32(1 / _DRAWS)


@jit
def _marks_around(marks, i, columns):
    """All that marks tell of the pixels about row i, but for i itself."""
    row, column, rows, every = i // columns, i % columns, i64(len(marks)) // columns, i64(0)
    for y in range(max(row - _AROUND, 0), min(row + _AROUND, rows - 1) + 1):
        for x in range(max(column - _AROUND, 0), min(column + _AROUND, columns - 1) + 1):
            if y != row or x != column:
                every |= i64(marks[y * columns + x])
    return every


@jit
def _first_part(view):
    """Which of the parts the first pixel draws from: in 16 passes each pixel draws from each part once."""
    turn, _, _, _ = random4(u32(0), u32(_DIMENSION + 1), u32(0), view.seed)
    # 5 has no part in common with 16
    return (i64(turn * f32(_SIDE * _SIDE)) + i64(5) * i64(view.pass_index)) % (_SIDE * _SIDE)


@jit
def _draw(tables, shown, view, i, k, step, scratch, samples):
    """Add to row i of the Samples its draw k: of the part that lies half of the parts aside along either
    axis, by the bits of k."""
    half, side = i64(_SIDE // 2), i64(_SIDE)
    column = (i % view.columns + step + half * (k % 2)) % side
    row = (i // view.columns + step // side + half * (k // 2)) % side
    r0, r1, r2, _ = random4(u32(i), u32(_DIMENSION) + u32(4 * k), view.pass_index, view.seed)
    # Shifted at random from square to square: a triangle is not to be drawn with the same parts of it.
    square = u32((i // view.columns // _SIDE) * view.columns + i % view.columns // _SIDE)
    shift, _, _, _ = random4(square, u32(_DIMENSION + 2), view.pass_index, view.seed)
    u0 = (f32((row * _SIDE + column) * 7 % (_SIDE * _SIDE)) + r0) * f32(1 / (_SIDE * _SIDE)) + shift
    u0 -= f32(math.floor(u0))
    u1, u2 = (f32(column) + r1) * f32(1 / _SIDE), (f32(row) + r2) * f32(1 / _SIDE)
    radiance, distance, wi, pdf, _, _ = sample_lamps(tables, shown.x, u0, u1, u2)
    if pdf > f32(0):
        arriving = _Arriving(scale(f32(1) / pdf, radiance), distance, wi, pdf)
        brought = _add_light(tables, shown, arriving, i, scratch, samples)
        if len(samples.near) > 0 and greatest(brought) > f32(0):
            for c in range(3):
                samples.lamps[c, i] += brought[c]
            slant = abs(dot(shown.x.ng, shown.wo))
            samples.near[i] = min(samples.near[i], _NEAR * slant * distance / shown.width)
    if has_environment(tables.environment):
        x, wo, pick = shown.x, shown.wo, u0
        brightest = tables.environment.brightest
        by_lobes = draws_by_lobes(x.bsdf) and not is_narrow(x.bsdf)  # eye paths take these
        both = resample_surround(tables, x, wo, u1, u2, pick, _PAIRS, brightest, by_lobes)
        for drawn in both:
            arriving = _Arriving(drawn.radiance, FAR, drawn.wi, drawn.pdf)
            _add_light(tables, shown, arriving, i, scratch, samples)


class _Arriving(NamedTuple):
    """Light of one point of a lamp, or from one direction: irradiance over the density of the draw, distance,
    m, wi, and the density of its direction among all lamps' points or the environment, 1/sr."""

    irradiance: Vector
    distance: np.float32
    wi: Vector
    pdf: np.float32


@jit
def _add_light(tables, shown, arriving, i, scratch, samples):
    """Add what row i makes of an _Arriving to the Samples, and return what of that is `drawn`."""
    x, wo, wi = shown.x, shown.wo, arriving.wi
    b, along = x.bsdf, abs(dot(x.n, wi))
    none = f32(0), f32(0), f32(0)
    if greatest(arriving.irradiance) <= f32(0):
        return none
    # over its albedo, of which channels may be 0: neighbors ask how much of the light passes in each
    f = eval_bsdf(with_diffuse(b, _WHITE), x.n, x.ng, wo, wi)
    gloss = none
    if not is_lambert(b):
        gloss = eval_bsdf(without_diffuse(b), x.n, x.ng, wo, wi)
        f = sub(f, gloss)
        if transmits(b):
            gloss = none  # eye paths find what these reflect and let through
        else:
            _, share = drawn_share(x, wo, wi, arriving.pdf, BY_FACETS)
            gloss = scale(share, gloss)
    if not (is_lambert(b) or greatest(b.diffuse) > f32(0) or greatest(gloss) > f32(0)):
        return none
    lights = greatest(f) > f32(0) or greatest(gloss) > f32(0)
    shades_itself = not lights and dot(x.ng, wi) <= f32(0)
    brought = none
    if dot(x.n, wi) > f32(0) and (lights or shades_itself):
        brought = scale(f32(1 / math.pi), scale(along, arriving.irradiance))
        for c in range(3):
            samples.drawn[c, i] += brought[c]
    if not lights:
        return brought
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
            return brought
        passed = shadow_transmittance(tables, start, toward, distance, scratch)
    for c in range(3):
        light = along * arriving.irradiance[c] * passed[c]
        samples.diffuse[c, i] += light * f[c]
        samples.gloss[c, i] += light * gloss[c]
    return brought
