"""The environment's light at points that a picture of one pass sees by few rays, without most of its noise.

What comes to a matte surface without shadows is known; few rays tell how much of it passes. Their ratio of
means errs by less than the rays' own mean, but not to nothing: later passes do without (Heitz, Hill and
McGuire, Combining Analytic Direct Illumination and Stochastic Shadows, I3D 2018, section 3).
"""

from __future__ import annotations

import numpy as np

from ispm.lights.area import area_numbers, resample_surround
from ispm.lights.nee import (
    BY_NOTHING,
    PAIRS,
    SILVER,
    Arriving,
    along,
    area_light,
    drawn_share,
    draws_by_lobes,
    next_numbers,
    shadowed,
    times,
    without_diffuse,
)
from ispm.optics.bsdf import eval_bsdf, transmits
from ispm.optics.environment import environment_irradiance, has_environment
from ispm.optics.jit import jit
from ispm.optics.light import FAR
from ispm.optics.vector import add, dot, scale, sub

f32, i64 = np.float32, np.int64


@jit
def first_area_light(tables, x, wo, u, scratch, goes_on, count):
    """Return what `area_light` does without a limit, for a picture's first pass."""
    by_ratio = has_environment(tables.environment) and not transmits(x.bsdf)
    total, traced = area_light(tables, x, wo, u, scratch, f32(np.inf), goes_on, count, not by_ratio)
    if by_ratio:
        light, rays = _surround(tables, x, wo, u, scratch, goes_on, count)
        total, traced = add(total, light), traced + rays
    return total, traced


@jit
def _surround(tables, x, wo, u, scratch, goes_on, count):
    """The environment's part of it at an opaque SurfacePoint, and the rays traced."""
    b, none, traced = x.bsdf, (f32(0), f32(0), f32(0)), i64(0)
    numbers, by_lobes = area_numbers(x.hit, u), goes_on == BY_NOTHING and draws_by_lobes(b)
    matte, gloss, drawn = none, none, none
    for k in range(count):
        _, u1, u2, pick = next_numbers(numbers, k)
        one, _ = resample_surround(tables, x, wo, u1, u2, pick, PAIRS, f32(np.inf), by_lobes)
        cosine = dot(x.n, one.wi)
        if cosine <= f32(0):
            continue
        light = scale(cosine, one.radiance)
        drawn = add(drawn, light)
        others = eval_bsdf(without_diffuse(b), x.n, x.ng, wo, one.wi)
        lambert = sub(eval_bsdf(b, x.n, x.ng, wo, one.wi), others)
        _, share = drawn_share(x, wo, one.wi, one.pdf, goes_on)
        passed, rays = shadowed(tables, x, Arriving(light, FAR, one.wi), along(u, k, SILVER), scratch)
        matte, gloss = add(matte, times(passed, lambert)), add(gloss, scale(share, times(passed, others)))
        traced += rays
    known, gloss = environment_irradiance(tables.environment, x.n), scale(f32(1) / f32(count), gloss)
    parts = _part(matte, known, drawn, 0), _part(matte, known, drawn, 1), _part(matte, known, drawn, 2)
    return add(gloss, parts), traced


@jit
def _part(passed, known, drawn, c):
    """Channel c of `known` times `passed` over `drawn`, 0 where nothing was drawn."""
    return known[c] * passed[c] / drawn[c] if drawn[c] > f32(0) else f32(0)
