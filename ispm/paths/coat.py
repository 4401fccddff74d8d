"""How eye paths meet clear coats: the light of one, and how a path goes on from a coated surface.

What a coat reflects is left to eye paths, however rough it is: photons light what is under it.
"""

from __future__ import annotations

import numpy as np

from ispm.accel.layers import coat_point, facet_point
from ispm.lights.nee import BY_COAT, area_light, greatest, punctual_light
from ispm.optics.bsdf import is_smooth, smooth_split
from ispm.optics.jit import jit
from ispm.paths.facet import facet_numbers, mean_reflectance, sample_lobe, widened

f32, i64, u32 = np.float32, np.int64, np.uint32

_OF_PIXEL = 255  # of the random numbers of the light of what a pixel shows
_NONE = f32(0), f32(0), f32(0)
_BELOW_ONE = f32(1 - 2**-24)


@jit
def facet_light(tables, y, wo, u, scratch, widest, count):
    """Return the radiance along wo, cd/m2 RGB, of a SurfacePoint of opaque facets alone, a `coat_point` or
    `facet_point` from which a path goes on, see `nee.direct_light`: that of points, that of other lights by
    `count` draws; and the rays traced.

    widest  alpha, as which narrower lobes count for the former
    """
    if is_smooth(y.bsdf):
        return _NONE, _NONE, i64(0)
    points, rays = punctual_light(tables, widened(y, wo, widest), wo, scratch, f32(np.inf))
    areas, others = area_light(tables, y, wo, u, scratch, f32(np.inf), BY_COAT, count)
    return points, areas, rays + others


@jit
def own_light(tables, x, wo, key, view, scratch, count):
    """Return `facet_light` of the coat of a SurfacePoint that a pixel shows, or of its facets where paths do
    not start from the coat; key, view: of the pixel's ray."""
    _, _, u = facet_numbers(key, u32(_OF_PIXEL), view.pass_index, view.seed)
    facets = coat_point(x) if view.of_coats else facet_point(x)
    return facet_light(tables, facets, wo, u, scratch, f32(0), count)


@jit
def draw_coat(x, wo, u, leads_on):
    """Draw by which layer of a coated SurfacePoint a path goes on: by the coat alone unless what is under it
    leads on, too.

    u   random in [0, 1)
    ->  whether by the coat; u, uniform again; the chance, float32, of what was drawn
    """
    if not leads_on:
        return True, u, f32(1)
    hidden = f32(1) - x.coat.shown
    chance = hidden / (hidden + greatest(mean_reflectance(x, wo)))
    if u < chance:
        return True, u / chance, chance
    return False, min((u - chance) / (f32(1) - chance), _BELOW_ONE), f32(1) - chance


@jit
def sample_coat(x, wo, u1, u2):
    """Return how a path continues from the coat of a SurfacePoint, as `sample_lobe` does; the density is 0 of
    a smooth one."""
    y = coat_point(x)
    if is_smooth(y.bsdf):
        reflectance, _, above, _, _ = smooth_split(y.bsdf, y.n, y.ng, wo)
        return True, above, reflectance, f32(0)
    return sample_lobe(y, wo, u1, u2)
