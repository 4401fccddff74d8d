"""Directions of the environment that a surface draws, where openings are rare mostly through these."""

from __future__ import annotations

import numpy as np

from ispm.lights.area import PAIRS, candidate_pdf, resample_surround
from ispm.lights.openings import draw_opening, opening_cell, opening_pdf
from ispm.optics.environment import environment_light
from ispm.optics.jit import jit
from ispm.optics.vector import luminance, scale

f32 = np.float32

_GUIDED, _BESIDE_A_SUN = f32(0.8), f32(0.5)  # share of the draws that see openings, where these guide


@jit
def guided_surround(tables, x, wo, numbers, openings, brightest, by_lobes):
    """Return a direction of the environment for a SurfacePoint seen along wo, where openings are rare mostly
    one that sees these; the RGB radiance from there over the density of the draw, cd/m2, and the density of
    the environment's own draw, 1/sr.

    numbers  four of [0, 1), random;  brightest, by_lobes  as of `resample_surround`, the darker of whose
             directions it draws
    By the balance heuristic (Veach 1997, section 9.2.2), of candidates' densities in place of draws'.
    """
    cell, guided = opening_cell(openings.cells, x)
    u0, u1, u2, pick = numbers
    if not guided:
        drawn, _ = resample_surround(tables, x, wo, u1, u2, pick, PAIRS, brightest, by_lobes)
        return drawn.wi, drawn.radiance, drawn.pdf
    # what is drawn well without openings, a sun, has half of the draws
    sunny = brightest == f32(np.inf) and len(tables.environment.sunlight) > 0
    weight, share = f32(1), _BESIDE_A_SUN if sunny else _GUIDED
    if pick < share:
        wi = draw_opening(openings, cell, x.position, u0, u1, u2)
        radiance, pdf = environment_light(tables.environment, wi)
        own = candidate_pdf(tables, x, wo, wi, pdf, by_lobes)
        own = own if luminance(radiance) <= brightest else f32(0)  # suns have draws of their own
    else:
        pick = (pick - share) / (f32(1) - share)
        drawn, _ = resample_surround(tables, x, wo, u1, u2, pick, PAIRS, brightest, by_lobes)
        wi, radiance, pdf = drawn.wi, drawn.radiance, drawn.pdf
        own = candidate_pdf(tables, x, wo, wi, pdf, by_lobes)
        weight = own
    if own <= f32(0):
        return wi, (f32(0), f32(0), f32(0)), pdf
    weight /= (f32(1) - share) * own + share * opening_pdf(openings, cell, x.position, wi)
    return wi, scale(weight, radiance), pdf


@jit
def guided_suns(tables, x, wo, numbers, openings, by_lobes, turn):
    """Return likewise one of two draws of directions as bright as suns, whose sum counts: `turn` 0: of suns
    alone; 1, where openings are rare: one that sees these, for what is that bright and not small."""
    cell, guided = opening_cell(openings.cells, x)
    u0, u1, u2, pick = numbers
    limit = tables.environment.brightest
    if turn == 0:
        _, drawn = resample_surround(tables, x, wo, u1, u2, pick, PAIRS, limit, by_lobes)
        wi, radiance, pdf = drawn.wi, drawn.radiance, drawn.pdf
    else:
        wi = draw_opening(openings, cell, x.position, u0, u1, u2)
        radiance, pdf = environment_light(tables.environment, wi)
    if not guided or luminance(radiance) <= f32(0):
        return wi, radiance, pdf
    own = candidate_pdf(tables, x, wo, wi, pdf / tables.environment.sun_share, by_lobes)
    if own <= f32(0) or (turn == 1 and luminance(radiance) <= limit):
        return wi, (f32(0), f32(0), f32(0)), pdf
    weight = own if turn == 0 else f32(1)
    weight /= own + opening_pdf(openings, cell, x.position, wi)
    return wi, scale(weight, radiance), pdf
