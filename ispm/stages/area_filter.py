"""The filter of direct light of lamps with a surface and of the environment: means over pixels of a surface.

It works on runs of pixels of a row, and on one quantity after the other, so that a compiler makes it work on
several pixels at a time. In kernels `i` and `k` are the first pixel of a run, or of a part of it, and the
first of those that lie aside of it alike; arrays of the `work` hold one number for each pixel of a run.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ispm.kernels.share import shared_rows
from ispm.lights.ratio import ratio_share
from ispm.optics.bsdf import NARROW_ALPHA
from ispm.optics.jit import jit
from ispm.stages.area_draws import UNSHADED
from ispm.stages.area_runs import (
    RUN,
    add,
    copy,
    divide,
    forget_unshown,
    part,
    part_aside,
    run_of,
    runs,
    take_between,
    take_least,
)
from ispm.stages.area_shapes import keep_alike

f32, i64, u32 = np.float32, np.int64, np.uint32

WORK = 35, RUN  # shape of the float32 array that a thread works in
_REACH = 2  # pixels to each side that the filter takes in
_LEAST = f32(1e-4)  # weight of a row or column within them
_FAR = f32(72)  # of a reach, which narrows no filter: the widest squares are whole from half of it on
_SAME = f32(math.cos(math.radians(2.0)))  # of normals, of pixels whose light without shadows is averaged
_ROUNDED = f32(1e-6)  # of squares of differences of normals
_UNLIKE = f32(4)  # over the difference of lobes' alpha, from which they are not averaged
_CHUNK = 64  # pixels a thread takes at a time


class Means(NamedTuple):
    """Filtered Samples, and the least `near`, `reach` and `shine` of those that are in them, float32.

    diffuse, drawn  (3, n), whose ratio is the share of light that is not shaded: both by the same factor
    gloss           (6, n) of the other lobes
    lamps           (3, n) of light without shadows what lamps bring, cd/m2; (3, 0) where it is known
    near            (n,) or (0,) pixels
    reach, shine    (n,) pixels
    """

    diffuse: np.ndarray
    drawn: np.ndarray
    gloss: np.ndarray
    lamps: np.ndarray
    near: np.ndarray
    reach: np.ndarray
    shine: np.ndarray


class Unshaded(NamedTuple):
    """Light of n pixels, (3, n) float32 but for what is said, cd/m2.

    diffuse         of the Lambert lobe over its albedo without shadows
    missed          of the Lambert lobe over its albedo with shadows, what its draws lack of what is known, 0
                    in the mean over passes; (3, 0) in the first
    by_ratio        (n,) which share of `diffuse` is what is known, and not what is drawn
    """

    diffuse: np.ndarray
    missed: np.ndarray
    by_ratio: np.ndarray


@jit
def filter_samples(shapes, view, smoothing, samples, lobes, bent, counter, work, means, unshaded):
    """Write the Means and what is Unshaded of as many runs as a thread gets, from the Samples about them;
    gloss from those of like Lobes.

    The share of light that is not shaded multiplies what is known of it without shadows, as far as
    `ratio_share` says: the first pass takes no other. Later passes do so less where they filter less, for a
    ratio of few draws is biased most. For the rest of it light without shadows is a control
    variate: what draws lack of it, times the share that passes. That share is of whole squares, which have
    all parts alike: of parts that go with what the pixel drew it were a bias.
    Source: Glasserman, Monte Carlo Methods in Financial Engineering, 2004, section 4.1.

    bent  over alpha^2, what the square of the difference of normals is weighed by for gloss
    """
    share_most, by_draws = ratio_share(view.pass_index), samples.lamps.shape[1] > 0
    corrects = unshaded.missed.shape[1] > 0
    columns, count = view.columns, i64(len(shapes.word))
    for run in shared_rows(counter, 1, count // columns * runs(columns)):
        i, first, size = run_of(run, columns, shapes.word)
        if size == i64(0):
            continue
        end = i + size
        reach, weight, total, sums = work[0, :size], work[1, :size], work[2, :size], work[5:20]
        alike, whole = work[20, :size], work[21:27]
        shine, shining = work[27, :size], work[28, :size]
        near, lamp_taps, lamp_total = work[31, :size], work[32, :size], work[33, :size]
        if by_draws:
            take_least(samples.near, i, first, columns, i64(1), _REACH, means.near[i:end])
            forget_unshown(shapes.word[i:end], means.near[i:end])
            for x in range(size):
                near[x] = min(means.near[i + x], f32(_REACH)) * smoothing
        mean = f32(1) / (f32(1) + f32(view.pass_index))
        take_between(samples.reach, mean, _FAR, i, first, columns, _REACH, weight, total, means.reach[i:end])
        take_least(samples.shine, i, first, columns, i64(1), _REACH, means.shine[i:end])
        forget_unshown(shapes.word[i:end], means.reach[i:end])
        forget_unshown(shapes.word[i:end], means.shine[i:end])
        by_ratio = unshaded.by_ratio[i:end]
        for x in range(size):
            reach[x] = min(means.reach[i + x], f32(_REACH))
            by_ratio[x] = share_most * max(reach[x] * f32(1 / _REACH), mean)
            reach[x] *= smoothing
        shines = _any_about(samples.gloss, i, first, columns, total)
        total[:] = f32(0)
        sums[:] = f32(0)
        whole[:] = f32(0)
        shining[:] = f32(0)
        lamp_total[:] = f32(0)
        for tap in range((2 * _REACH + 1) ** 2):
            down, right = tap // (2 * _REACH + 1) - _REACH, tap % (2 * _REACH + 1) - _REACH
            low, high, k = part(i, first, size, down, right, columns, count)
            if high <= low:
                continue
            taps, same, size_of, until = weight[low:high], alike[low:high], high - low, k + high - low
            same[:] = f32(1)
            room = work[3, :size_of], work[29, :size_of], work[30, :size_of]
            if tap != (2 * _REACH + 1) ** 2 // 2:
                keep_alike(shapes, i + low, k, room, work[4, :size_of], same)
            if by_draws:
                _weigh(near[low:high], down, right, lamp_taps[low:high])
                for x in range(size_of):
                    lamp_taps[low + x] *= same[x]
                    lamp_total[low + x] += lamp_taps[low + x]
                for c in range(3):
                    add(lamp_taps[low:high], samples.lamps[c, k:until], sums[6 + c, low:high])
            _weigh(reach[low:high], down, right, taps)
            for x in range(size_of):
                taps[x] *= same[x]
                total[low + x] += taps[x]
            if corrects:
                half = f32(1 if abs(down) < _REACH else 0.5) * f32(1 if abs(right) < _REACH else 0.5)
                for x in range(size_of):
                    same[x] *= half
                for c in range(3):
                    add(same, samples.diffuse[c, k:until], whole[c, low:high])
                    add(same, samples.drawn[c, k:until], whole[3 + c, low:high])
            if shines:
                _weigh_lobes(lobes.alpha[i + low : i + high], lobes.alpha[k:until], taps, shine[low:high])
                if tap != (2 * _REACH + 1) ** 2 // 2:
                    _weigh_turned(lobes.alpha[i + low : i + high], work[4, :size_of], bent, shine[low:high])
                for x in range(low, high):
                    shining[x] += shine[x]
            for c in range(3):
                add(taps, samples.diffuse[c, k:until], sums[c, low:high])
                add(taps, samples.drawn[c, k:until], sums[3 + c, low:high])
            for c in range(6 if shines else 0):
                add(shine[low:high], samples.gloss[c, k:until], sums[9 + c, low:high])
        for c in range(6):
            divide(sums[9 + c, :size], shining if shines else total, means.gloss[c, i:end])
        if not by_draws:  # else light without shadows is none, too, where no draw brings any
            for x in range(size):
                by_ratio[x] = by_ratio[x] if sums[3, x] + sums[4, x] + sums[5, x] > f32(0) else f32(1)
        for c in range(3):
            divide(sums[c, :size], total, means.diffuse[c, i:end])
            divide(sums[3 + c, :size], total, means.drawn[c, i:end])
            known, drawn = samples.known[c, i:end], means.drawn[c, i:end]
            shown, lamps = unshaded.diffuse[c, i:end], sums[6 + c, :size]
            if by_draws:
                divide(lamps, lamp_total, means.lamps[c, i:end])
                lamps = means.lamps[c, i:end]
            for x in range(size):
                shown[x] = drawn[x] + by_ratio[x] * (known[x] + lamps[x] - drawn[x])
            if corrects:
                missed, lit, sent = unshaded.missed[c, i:end], whole[c, :size], whole[3 + c, :size]
                for x in range(size):
                    share = _wide(means.reach[i + x] * smoothing, i64(2 * _REACH)) * (f32(1) - by_ratio[x])
                    share *= lit[x] / max(sent[x], f32(1e-30))
                    missed[x] = share * (known[x] + lamps[x] - drawn[x])


@jit
def widen(shapes, view, smoothing, stride, means, lobes, counter, work, wider, unshaded):
    """Filter the Means of as many runs as a thread gets with those of the 8 pixels that lie `stride` pixels
    aside, where penumbrae there and opposite are wide enough for it or no draw brings any light, gloss with
    those of like Lobes that are turned alike; and what lamps bring without shadows, where these are far
    enough, from which what is Unshaded changes.

    wider  Means to write, of which `diffuse` and `drawn` are not normalized
    """
    by_draws = means.lamps.shape[1] > 0
    columns, count = view.columns, i64(len(shapes.word))
    for run in shared_rows(counter, 1, count // columns * runs(columns)):
        i, first, size = run_of(run, columns, shapes.word)
        if size == i64(0):
            continue
        end = i + size
        evenly, taps, total, pairs = work[1, :size], work[2, :size], work[3, :size], work[31:35]
        most = _weigh_pairs(
            means.reach, i, first, columns, stride, smoothing, pairs, work[0, :size], wider.reach[i:end]
        )
        for x in range(size):
            if means.drawn[0, i + x] + means.drawn[1, i + x] + means.drawn[2, i + x] == f32(0):
                most = f32(1)  # what share of light passes is known from others alone
                for pair in range(4):
                    pairs[pair, x] = f32(1)
        forget_unshown(shapes.word[i:end], wider.reach[i:end])
        if by_draws:
            take_least(means.near, i, first, columns, stride, 1, wider.near[i:end])
            forget_unshown(shapes.word[i:end], wider.near[i:end])
            most = max(most, _weigh_aside(wider.near[i:end], smoothing, stride, evenly))
        shiny, shine, shining = work[26, :size], work[27, :size], work[28, :size]
        shines = _is_any(lobes.f90[i:end])
        if shines:
            take_least(means.shine, i, first, columns, stride, 1, wider.shine[i:end])
            forget_unshown(shapes.word[i:end], wider.shine[i:end])
            for x in range(size):
                shiny[x] = min(wider.reach[i + x], wider.shine[i + x])
            most = max(most, _weigh_aside(shiny, smoothing, stride, shiny))
        for c in range(6):
            copy(means.gloss[c, i:end], wider.gloss[c, i:end])
        for c in range(3):
            copy(means.diffuse[c, i:end], wider.diffuse[c, i:end])
            copy(means.drawn[c, i:end], wider.drawn[c, i:end])
            if by_draws:
                copy(means.lamps[c, i:end], wider.lamps[c, i:end])
        if most <= f32(0):
            continue
        alike, same = work[6:15], work[15:24]  # with the pixel aside; and turned alike, too
        alike[:] = f32(0)
        for tap in range(9):
            low, high, k = part_aside(i, first, size, stride, tap, columns, count)
            if high <= low or tap == 4:
                continue
            until, turn = k + high - low, work[4, low:high]
            room = work[5, low:high], work[24, low:high], work[25, low:high]
            alike[tap, low:high] = f32(1)
            keep_alike(shapes, i + low, k, room, turn, alike[tap, low:high])
            pair = pairs[min(tap, 8 - tap)]
            for x in range(low, high):
                taps[x] = pair[x] * alike[tap, x]
                same[tap, x] = alike[tap, x] if turn[x - low] > _SAME else f32(0)
            for c in range(3):
                add(taps[low:high], means.diffuse[c, k:until], wider.diffuse[c, i + low : i + high])
                add(taps[low:high], means.drawn[c, k:until], wider.drawn[c, i + low : i + high])
        if shines:
            shining[:] = f32(1)
            for tap in range(9):
                low, high, k = part_aside(i, first, size, stride, tap, columns, count)
                if high <= low or tap == 4:
                    continue
                until = k + high - low
                for x in range(low, high):
                    taps[x] = shiny[x] * same[tap, x]
                _weigh_lobes(
                    lobes.alpha[i + low : i + high], lobes.alpha[k:until], taps[low:high], shine[low:high]
                )
                for x in range(low, high):
                    shining[x] += shine[x]
                for c in range(6):
                    add(shine[low:high], means.gloss[c, k:until], wider.gloss[c, i + low : i + high])
            for c in range(6):
                divide(wider.gloss[c, i:end], shining, wider.gloss[c, i:end])
        if not by_draws:
            continue
        total[:] = f32(1)
        for tap in range(9):
            low, high, k = part_aside(i, first, size, stride, tap, columns, count)
            if high <= low or tap == 4:
                continue
            # with the one opposite alone, or a slope of light would be a bias
            for x in range(low, high):
                taps[x] = evenly[x] * same[tap, x] * alike[8 - tap, x]
                total[x] += taps[x]
            for c in range(3):
                add(taps[low:high], means.lamps[c, k : k + high - low], wider.lamps[c, i + low : i + high])
        for c in range(3):
            before, after = means.lamps[c, i:end], wider.lamps[c, i:end]
            divide(after, total, after)
            shown, by_ratio = unshaded.diffuse[c, i:end], unshaded.by_ratio[i:end]
            for x in range(size):
                shown[x] = max(shown[x] + by_ratio[x] * (after[x] - before[x]), f32(0))


@jit
def _any_about(values, i, first, columns, work):
    """Return whether any of the values, (6, n) and not below 0, is above it in the rows about a run."""
    count, size, found = i64(values.shape[1]), i64(len(work)), False
    work[:] = f32(0)
    for down in range(-_REACH, _REACH + 1):
        for right in (-_REACH, _REACH):
            low, high, k = part(i, first, size, i64(down), i64(right), columns, count)
            for c in range(len(values) if high > low else 0):
                row, sums = values[c, k : k + high - low], work[low:high]
                for x in range(high - low):
                    sums[x] += row[x]
    for x in range(size):
        found = found or work[x] > f32(0)
    return found


@jit
def _is_any(values):
    """Return whether any of the values is above 0."""
    most = f32(0)
    for x in range(len(values)):
        most = max(most, values[x])
    return most > f32(0)


@jit
def _weigh(reach, down, right, out):
    """Write the weights of pixels so many rows and columns aside in squares that reach so far."""
    for x in range(len(out)):
        out[x] = _near(down, reach[x]) * _near(right, reach[x])


@jit
def _weigh_lobes(alpha, others, weights, out):
    """Write the weights of pixels times how alike their lobes' alpha is: narrow lobes are left to eye paths
    in part."""
    for x in range(len(out)):
        alike = max(f32(1) - _UNLIKE * abs(alpha[x] - others[x]), f32(0))
        both = (alpha[x] < NARROW_ALPHA) == (others[x] < NARROW_ALPHA)
        out[x] = weights[x] * alike if both else f32(0)


@jit
def _weigh_turned(alpha, turn, bent, weights):
    """Multiply the weights of pixels by 1 - bent |n - n'|^2 / alpha^2, n and n' their normals.

    turn  cosines between these;  bent  as of `filter_samples`
    """
    for x in range(len(weights)):
        bend = max(f32(2) - f32(2) * turn[x] - _ROUNDED, f32(0)) / max(alpha[x] * alpha[x], _ROUNDED)
        weights[x] *= max(f32(1) - bent * bend, f32(0))


@jit
def _weigh_aside(reach, smoothing, stride, out):
    """Write the weights of squares `stride` pixels aside in filters that reach so far, and return the
    greatest: side by side they reach as far as one and a half of them; none where they reach without end."""
    most = f32(0)
    for x in range(len(out)):
        out[x] = _wide(reach[x] * smoothing, stride) if reach[x] < f32(np.inf) else f32(0)
        most = max(most, out[x])
    return most


@jit
def _weigh_pairs(reach, i, first, columns, stride, smoothing, weights, least, out):
    """Write the weights of squares `stride` pixels aside, four rows of them for the pairs that lie opposite
    each other, and to `out` the least reach of all that count; return the greatest weight.

    Both of a pair count by the lesser of their reaches, for one alone would be a bias: beside a contact
    those along it do, and none toward it. `least` is room for as many values."""
    size, most = i64(len(out)), f32(0)
    take_least(reach, i, first, columns, stride, 1, least)
    copy(reach[i : i + size], out)
    for pair in range(4):
        together = weights[pair, :size]
        copy(reach[i : i + size], together)
        for tap in (pair, 8 - pair):
            low, high, k = part_aside(i, first, size, stride, tap, columns, i64(len(reach)))
            if high > low:
                part, other = together[low:high], reach[k : k + high - low]
                for x in range(high - low):
                    part[x] = min(part[x], other[x])
        for x in range(size):
            weight = _wide(together[x] * smoothing, stride) if least[x] < UNSHADED else f32(0)
            out[x] = min(out[x], together[x] if weight > f32(0) else f32(np.inf))
            together[x] = weight
            most = max(most, weight)
    return most


@jit
def _wide(reach, stride):
    """How far squares `stride` pixels aside count where a filter reaches so far: from 0 to 1."""
    return min(max(reach / (f32(1.5) * f32(stride)) - f32(1), f32(0)), f32(1))


@jit
def _near(away, reach):
    """Weight of a pixel `away` rows or columns from the middle of a square that reaches so far; next to none
    beyond it, for what share of light passes is not known where no draw brings any."""
    return min(max(reach + f32(0.5) - abs(f32(away)), _LEAST), f32(1)) if away != 0 else f32(1)
