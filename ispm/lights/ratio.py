"""The environment's light by few rays, without most of its noise.

What comes to a matte surface without shadows is known; few rays tell how much of it passes. Their ratio of
means errs by less than the rays' own mean, but is biased where much is shaded. So the first pass takes it
whole, and later ones less and less.
Source: Heitz, Hill and McGuire, Combining Analytic Direct Illumination and Stochastic Shadows, I3D 2018,
section 3.
"""

from __future__ import annotations

import numpy as np

from ispm.accel.layers import without_diffuse
from ispm.lights.area import area_numbers
from ispm.lights.guided import guided_suns, guided_surround
from ispm.lights.nee import (
    BY_NOTHING,
    Arriving,
    area_light,
    drawn_share,
    draws_by_lobes,
    next_numbers,
    seen_surround,
    times,
)
from ispm.lights.openings import opening_cell
from ispm.optics.bsdf import eval_bsdf, transmits
from ispm.optics.environment import environment_irradiance, has_environment
from ispm.optics.jit import jit
from ispm.optics.light import FAR
from ispm.optics.vector import add, dot, scale, sub

f32, i64 = np.float32, np.int64

_HALVED = f32(8)  # passes after which one takes half of it


@jit
def ratio_share(pass_index):
    """Return the share, float32, with which a pass takes the ratio of means; it takes the mean for the rest.

    A pass's noise grows as its bias falls: with the mean from the second pass on, a few passes would be
    noisier than one where little is shaded.
    """
    return _HALVED / (_HALVED + f32(pass_index))


@jit
def area_light_by_ratio(tables, x, wo, u, scratch, goes_on, count, pass_index, openings):
    """Return what `area_light` does without a limit, the environment's light by the ratio of means where a
    pass wants that, and none but Openings let it in. One draw has no ratio: it tells whether there is
    shadow, not how much light that takes."""
    by_ratio = has_environment(tables.environment) and not transmits(x.bsdf)
    total, traced = area_light(tables, x, wo, u, scratch, f32(np.inf), goes_on, count, not by_ratio)
    if by_ratio:
        share = ratio_share(pass_index) if count > 1 else f32(0)
        light, rays = _surround(tables, x, wo, u, scratch, goes_on, count, share, openings)
        total, traced = add(total, light), traced + rays
    return total, traced


@jit
def _surround(tables, x, wo, u, scratch, goes_on, count, by_ratio, openings):
    """The environment's part at an opaque SurfacePoint, and the rays traced; by_ratio: `ratio_share`.

    A sun is drawn by itself: in its shadow a mean of both tells the sky's light by how often that was drawn.
    """
    sunlight, others = environment_irradiance(tables.environment, x.n)
    told = tables, x, wo, u, scratch, goes_on, count, by_ratio
    total, traced = _part(*told, others, openings, False)
    if len(tables.environment.sunlight) > 0:
        light, rays = _part(*told, sunlight, openings, True)
        total, traced = add(total, light), traced + rays
    return total, traced


@jit
def _part(tables, x, wo, u, scratch, goes_on, count, by_ratio, known, openings, of_suns):
    """Likewise of directions as bright as suns or of the others; known: their irradiance without shadows.

    Draws that openings guide are too uneven without shadows for a ratio of a few, and tell it well without.
    """
    b, none, traced = x.bsdf, (f32(0), f32(0), f32(0)), i64(0)
    numbers, by_lobes = area_numbers(x.hit, u), goes_on == BY_NOTHING and draws_by_lobes(b)
    sunny = len(tables.environment.sunlight) > 0
    limit = tables.environment.brightest if sunny else f32(np.inf)
    matte, gloss, drawn = none, none, none
    _, guided = opening_cell(openings.cells, x)
    by_ratio = f32(0) if guided else by_ratio
    turns = 2 if of_suns and guided else 1
    for k in range(count * turns):
        chosen = next_numbers(numbers, k // turns)
        if of_suns:
            wi, radiance, pdf = guided_suns(tables, x, wo, chosen, openings, by_lobes, k % turns)
        else:
            wi, radiance, pdf = guided_surround(tables, x, wo, chosen, openings, limit, by_lobes)
        cosine = dot(x.n, wi)
        if cosine <= f32(0) or radiance[0] + radiance[1] + radiance[2] <= f32(0):
            continue
        light = scale(cosine, radiance)
        drawn = add(drawn, light)
        others = eval_bsdf(without_diffuse(b), x.n, x.ng, wo, wi)
        lambert = sub(eval_bsdf(b, x.n, x.ng, wo, wi), others)
        _, share = drawn_share(x, wo, wi, pdf, goes_on)
        passed, is_refracted = seen_surround(tables, x, Arriving(light, FAR, wi, none), scratch)
        passed = times(passed, light)
        if is_refracted and goes_on != BY_NOTHING:
            share = f32(0)  # paths by the lobe count in full there
        matte, gloss = add(matte, times(passed, lambert)), add(gloss, scale(share, times(passed, others)))
        traced += i64(1)
    each = f32(1) / f32(count)
    red, green = _factor(known[0], drawn[0], each, by_ratio), _factor(known[1], drawn[1], each, by_ratio)
    factors = red, green, _factor(known[2], drawn[2], each, by_ratio)
    return add(scale(each, gloss), times(factors, matte)), traced


@jit
def _factor(known, drawn, each, by_ratio):
    """What a channel's sum of light that passes is multiplied by; known, drawn: lx of all, and the sum of
    what was drawn of it;  each  1 over the number of draws."""
    return each + by_ratio * (known / drawn - each) if drawn > f32(0) else each
