"""First bounces so bright that photons carry their light, and gather rays leave it out."""

from __future__ import annotations

import math

import numpy as np

from ispm.accel.layers import far_side, is_translucent, sheen_point, with_matte_sheen
from ispm.accel.records import Hit
from ispm.accel.surface import hit_position, surface
from ispm.lights.emitted import first_irradiance
from ispm.optics.bsdf import eval_bsdf, is_narrow
from ispm.optics.jit import jit
from ispm.optics.records import NO_HIT
from ispm.optics.vector import add, dot, normalize, scale, sub

f32, i64, u32 = np.float32, np.int64, np.uint32

# photons that a bright first bounce sends out for each that arrives, a quarter of its flux each
SPLIT_COUNT = 4
_TURNED = 0.25  # radians that shading normals lie off facets at most: of a cylinder of 12 at its edges


@jit
def is_bright(b, ng, wo, irradiance, wi, limit):
    """Return whether a light's first bounce at a point is bright, seen along wo.

    b, ng           the Bsdf and the geometric normal there
    irradiance, wi  as `light_arriving` has them
    limit           of pi times the radiance that the light would make there without shadows
    The same for the eye and for photons: it takes the geometric normal, as the shading normal is bent
    towards the viewer, and is symmetric in wo and wi. A narrow lobe's highlight lies elsewhere on facets
    that look smooth: of the normals near by it takes the one that reflects most. Of a coated surface what is
    under the coat decides: callers scale the limit by the share of it that the coat shows, which is not
    symmetric.
    """
    if limit == f32(np.inf):
        return False
    n = ng
    if is_narrow(b) and dot(ng, wo) > f32(0) and dot(ng, wi) > f32(0):
        n = _turned_towards(ng, normalize(add(wo, wi)))
    f = eval_bsdf(b, n, n, wo, wi)
    most = max(f[0] * irradiance[0], max(f[1] * irradiance[1], f[2] * irradiance[2]))
    return f32(math.pi) * abs(dot(ng, wi)) * most > limit


@jit
def _turned_towards(n, h):
    """The unit vector that is within _TURNED of n and nearest to h."""
    cosine = min(dot(n, h), f32(1))
    aside = sub(h, scale(cosine, n))
    sine = f32(math.sqrt(dot(aside, aside)))
    if cosine >= f32(math.cos(_TURNED)) or sine <= f32(0):
        return h
    return add(scale(f32(math.cos(_TURNED)), n), scale(f32(math.sin(_TURNED)) / sine, aside))


@jit
def is_bright_first_bounce(tables, photon, x, wo, limit, by_sheen):
    """Return whether the first bounce of an EMITTED photon, at a SurfacePoint, is bright, seen along wo;
    limit: lx, see `is_bright`; by_sheen: whether it is the sheen that reflects it."""
    irradiance, wi = first_irradiance(tables, photon, x.position)
    b = sheen_point(x).bsdf if by_sheen else x.bsdf
    if not by_sheen and is_translucent(x) and dot(x.ng, wo) < f32(0):  # for those, this is the far side
        far, wo = far_side(x, wo)
        b = far.bsdf
    shown = f32(1) if by_sheen else x.coat.shown  # the sheen's color has it already
    return is_bright(b, x.ng, wo, irradiance, wi, limit * shown)


@jit
def split_count(tables, photon, limit):
    """Return how many photons, int64, an EMITTED one is split into at its first hit: more if that is bright.

    limit  lx, see `is_bright`
    Its light reaches the picture by photons alone, and they would be most of the picture's noise.
    """
    if limit == f32(np.inf) or photon.instance == u32(NO_HIT):
        return i64(1)
    hit = Hit(photon.instance, photon.primitive, photon.u, photon.v)
    irradiance, wi = first_irradiance(tables, photon, hit_position(tables.surfaces, hit))
    if max(irradiance[0], max(irradiance[1], irradiance[2])) <= limit:
        return i64(1)
    x = with_matte_sheen(surface(tables, hit, scale(f32(-1), wi)))
    return i64(SPLIT_COUNT) if is_bright(x.bsdf, x.ng, x.ng, irradiance, wi, limit * x.coat.shown) else i64(1)
