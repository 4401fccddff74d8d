"""How eye paths continue from mirrors and glass: by one facet of the surface, and where one path serves for
both branches, by the stronger one."""

from __future__ import annotations

import math

import numpy as np

from ispm.lights.nee import greatest
from ispm.optics.bsdf import is_smooth, smooth_split, specular_split, transmits
from ispm.optics.jit import jit
from ispm.optics.microfacet import smith, visible_normal
from ispm.optics.rng import random4
from ispm.optics.sampling import LATTICE, to_local, to_world
from ispm.optics.vector import add, dot, luminance, scale, sub

f32, u32 = np.float32, np.uint32

ROUGH_SAMPLES = 8  # facets that are drawn where a pixel shows rough glass; a power of 2


@jit
def sample_specular_lobe(x, wo, u1, u2, may_part):
    """Return how a path that comes along -wo continues from a SurfacePoint: whether it does, wi, the factor
    (RGB) of its weight; whether a second path starts, that one's wi and factor.

    From within a solid it leaves wherever it can: reflected, it would circle under a ball's rim. If it may
    part where the face is smooth, the second is reflected; else one path serves for both.
    u1, u2  random in [0, 1)
    """
    b, entering = x.bsdf, x.entering
    if not is_smooth(b) and not transmits(b):
        return False, wo, wo, False, wo, wo
    reflectance, transmittance, above, beyond, through = facet_split(x, wo, u1, u2)
    both = add(reflectance, transmittance)
    if through and (not entering or luminance(transmittance) > luminance(reflectance)):
        if may_part and not entering and is_smooth(b) and greatest(reflectance) > f32(0):
            return True, beyond, transmittance, True, above, reflectance
        return True, beyond, both, False, wo, wo
    return greatest(both) > f32(0), above, both, False, wo, wo


@jit
def facet_split(x, wo, u1, u2):
    """Return what a mirror or glass at a SurfacePoint makes of light along wo, as `specular_split` has it.

    Where it is rough, by one of the facets visible along wo, drawn by u1 and u2 of [0, 1), times the share
    that others do not shadow.
    """
    b, n, ng = x.bsdf, x.n, x.ng
    if is_smooth(b):
        return smooth_split(b, n, ng, wo)
    alpha, nv = b.alpha, dot(n, wo)
    h = to_world(visible_normal(alpha, to_local(wo, n), u1, u2), n)
    reflectance, transmittance, above, beyond, through = specular_split(b, h, wo)
    if b.thin > f32(0):
        beyond = sub(above, scale(f32(2) * dot(n, above), n))
    shown = dot(above, ng) > f32(0) and dot(above, n) > f32(0)
    through = through and dot(beyond, ng) < f32(0) and dot(beyond, n) < f32(0)
    reflected = _unshadowed(alpha, nv, dot(n, above)) if shown else f32(0)
    passed = _unshadowed(alpha, nv, -dot(n, beyond)) if through else f32(0)
    return scale(reflected, reflectance), scale(passed, transmittance), above, beyond, through


@jit
def _unshadowed(alpha, nv, nl):
    """G2 / G1, 0 to 1, of facets of roughness alpha, for directions of these cosines to the normal."""
    a2 = alpha * alpha
    g1 = f32(2) * nv / (nv + math.sqrt(nv * nv * (f32(1) - a2) + a2))
    return smith(alpha, nv, nl) * f32(4) * nv * nl / g1


@jit
def facet_numbers(key, dimension, pass_index, seed):
    """Return three float32 random numbers of [0, 1) for an event of a path.

    A lattice (Roberts 2018) even over the samples, in another order and differently shifted for each event.
    dimension  uint32, 256 times the sample, and the event
    """
    rate_y, rate_z = LATTICE
    event, k = dimension & u32(255), dimension >> u32(8)
    k = k * (u32(2) * event + u32(1)) & u32(ROUGH_SAMPLES - 1)
    u1, u2, u3, _ = random4(key, event, pass_index, seed)
    u1 += f32(k) * f32(1.0 / ROUGH_SAMPLES)
    u2 += f32(k) * f32(rate_y)
    u3 += f32(k) * f32(rate_z)
    return u1 - f32(math.floor(u1)), u2 - f32(math.floor(u2)), u3 - f32(math.floor(u3))
