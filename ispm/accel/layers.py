"""A surface of layers as several at one place: the clear coat, the sheen under it, what is under both, and
the other side of a translucent sheet.

Light of all adds. Each is a SurfacePoint, so that what is known of surfaces holds for either alone.
"""

from __future__ import annotations

import numpy as np

from ispm.accel.surface import SurfacePoint, opacity
from ispm.optics.bsdf import Bsdf, facet_reflectance, is_within
from ispm.optics.coat import NO_COAT, coat_bsdf, with_diffuse
from ispm.optics.facets import NO_ANISOTROPY, is_anisotropic
from ispm.optics.jit import jit
from ispm.optics.microfacet import schlick
from ispm.optics.sheen import MIN_ROUGHNESS, NO_SHEEN
from ispm.optics.vector import add, dot, luminance, scale, sub

f32 = np.float32

_NONE = f32(0), f32(0), f32(0)
_BELOW_ONE = f32(1 - 2**-24)
_LEAST_MET = f32(1 / 8)  # opacity by whose inverse what lights a surface counts: below it that were noise


@jit
def weight_met(tables, hit):
    """Return the inverse of the chance with which rays meet a Hit's surface, at most 8: what lights it counts
    by so much, for what it shows counts by its opacity."""
    return f32(1) / max(opacity(tables, hit), _LEAST_MET) if tables.porous else f32(1)


@jit
def without_diffuse(b):
    """Return a Bsdf without its Lambert lobe."""
    return with_diffuse(b, _NONE)


@jit
def without_facets(b):
    """Return a Bsdf that reflects nothing by facets, to which the Lambert lobe gives way all the same."""
    kept = b.dielectric_f0, b.dielectric_f90, b.tint, b.eta, b.thin, b.sheen, b.anisotropy
    return Bsdf(b.diffuse, _NONE, f32(0), b.alpha, *kept)


@jit
def end_bsdf(b, goes_on):
    """Return the Bsdf by which photons light the end of a path that may go on by the surface's lobe: without
    it where that is anisotropic, and the Lambert lobe alone within glass, whose facets are left to paths."""
    if is_within(b):
        matte = f32(0), f32(0), f32(0), f32(0), _NONE, f32(1), f32(1), f32(0), NO_ANISOTROPY
        return Bsdf(b.diffuse, _NONE, *matte)
    return without_facets(b) if goes_on and is_anisotropic(b) else b


@jit
def facet_point(x):
    """Return what the facets of an opaque SurfacePoint reflect as a surface of its own."""
    b = without_diffuse(x.bsdf)
    return SurfacePoint(x.hit, x.position, x.ng, x.n, b, x.flags, x.entering, NO_COAT, NO_SHEEN, _NONE)


@jit
def is_coated(x):
    """Return whether a SurfacePoint has a coat."""
    return x.coat.weight > f32(0)


@jit
def coat_point(x):
    """Return the coat of a SurfacePoint as a surface of its own: facets alone, smooth or rough."""
    return SurfacePoint(
        x.hit, x.position, x.ng, x.coat.n, coat_bsdf(x.coat), x.flags, x.entering, NO_COAT, NO_SHEEN, _NONE
    )


@jit
def has_sheen(x):
    """Return whether a SurfacePoint has sheen."""
    return x.sheen.albedo > f32(0)


@jit
def sheen_point(x):
    """Return the sheen of a SurfacePoint as a surface of its own: opaque, rough, one wide lobe."""
    roughness = max(x.sheen.roughness, MIN_ROUGHNESS)
    fibers = f32(0), f32(1), f32(0), f32(0), _NONE, f32(1), f32(1), roughness, NO_ANISOTROPY
    b = Bsdf(_NONE, x.sheen.color, *fibers)
    return SurfacePoint(x.hit, x.position, x.ng, x.n, b, x.flags, x.entering, NO_COAT, NO_SHEEN, _NONE)


@jit
def with_matte_sheen(x):
    """Return a SurfacePoint whose sheen counts as part of the Lambert lobe, by its albedo along wo, for light
    that is known as irradiance."""
    if not has_sheen(x):
        return x
    b = x.bsdf
    diffuse = add(b.diffuse, scale(x.sheen.albedo, x.sheen.color))
    b = with_diffuse(b, diffuse)
    return SurfacePoint(x.hit, x.position, x.ng, x.n, b, x.flags, x.entering, x.coat, x.sheen, x.translucence)


@jit
def is_translucent(x):
    """Return whether light from the other side of a SurfacePoint leaves it on this side."""
    return x.translucence[0] + x.translucence[1] + x.translucence[2] > f32(0)


@jit
def far_side(x, wo):
    """Return the other side of a translucent SurfacePoint as a surface of its own, a Lambert one, and the
    direction, unit, from which it shows what x shows of its light along wo: mirrored at the sheet, so that
    reflection takes as much of light that goes through as of light that comes back."""
    b = x.bsdf
    gives_way = b.dielectric_f0, b.dielectric_f90, _NONE, f32(1), f32(1), f32(0), NO_ANISOTROPY
    lambert = Bsdf(x.translucence, _NONE, f32(0), f32(0), *gives_way)
    ng, n = scale(f32(-1), x.ng), scale(f32(-1), x.n)
    y = SurfacePoint(x.hit, x.position, ng, n, lambert, x.flags, not x.entering, NO_COAT, NO_SHEEN, _NONE)
    return y, sub(wo, scale(f32(2) * dot(x.n, wo), x.n))


@jit
def drawn_side(x, wo, u):
    """Draw one side of a SurfacePoint, whose light it sends along wo, by what it sends of even light.

    u   random in [0, 1)
    ->  the side, a SurfacePoint; wo as it takes it, see `far_side`; u, uniform again; the chance, float32
    """
    if not is_translucent(x):
        return x, wo, u, f32(1)
    b = x.bsdf
    far = luminance(x.translucence) * (f32(1) - b.dielectric_f0)
    near = luminance(b.diffuse) * (f32(1) - b.dielectric_f0)
    near += luminance(facet_reflectance(b, schlick(dot(x.n, wo))))
    share = far / (far + near)
    if u < share:
        y, wo = far_side(x, wo)
        return y, wo, u / share, share
    return x, wo, min((u - share) / (f32(1) - share), _BELOW_ONE), f32(1) - share


@jit
def drawn_layer(x, wo, u):
    """Draw the coat of a SurfacePoint, its sheen or a side of what is under both, by what these reflect.

    u   random in [0, 1)
    ->  as of `drawn_side`
    """
    hidden = f32(1) - x.coat.shown
    if u < hidden:
        return coat_point(x), wo, u / hidden, hidden
    u, chance = min((u - hidden) / x.coat.shown, _BELOW_ONE), x.coat.shown
    if has_sheen(x):
        hidden = f32(1) - x.sheen.shown
        if u < hidden:
            return sheen_point(x), wo, u / hidden, chance * hidden
        u, chance = min((u - hidden) / x.sheen.shown, _BELOW_ONE), chance * x.sheen.shown
    side, wo, u, share = drawn_side(x, wo, u)
    return side, wo, u, chance * share


@jit
def with_rough_coat(x):
    """Return a SurfacePoint whose rough coat counts as part of the Lambert lobe, by its reflectance along wo,
    for light that is known as irradiance. What a smooth one reflects photons bring."""
    if not is_coated(x) or x.coat.alpha == f32(0):
        return x
    b, hidden = x.bsdf, f32(1) - x.coat.shown
    diffuse = add(b.diffuse, (hidden, hidden, hidden))
    b = with_diffuse(b, diffuse)
    return SurfacePoint(x.hit, x.position, x.ng, x.n, b, x.flags, x.entering, x.coat, x.sheen, x.translucence)
