"""The clear coat of KHR_materials_clearcoat: a second layer of facets, of index 1.5, over a surface.

A coated surface is two at one place, whose light adds: the coat, which reflects by facets alone, and what is
under it, of which the coat hides the share that it reflects of light along wo. The extension takes that share
from n.wo, so that a coat over a white surface hides what it reflects; f is not symmetric under a coat.
Source: KHR_materials_clearcoat, appendix; facets: `optics.bsdf`.
"""

from typing import NamedTuple

import numpy as np

from ispm.optics.bsdf import MIN_ALPHA, Bsdf
from ispm.optics.facets import NO_ANISOTROPY
from ispm.optics.jit import jit
from ispm.optics.microfacet import schlick
from ispm.optics.vector import Vector, scale

f32 = np.float32

_F0 = f32(0.04)  # reflectance of index 1.5 along the normal
_LEAST_SHOWN = f32(1e-6)  # of what is under a coat, also at grazing incidence, so that it divides
_NONE = f32(0), f32(0), f32(0)


class Coat(NamedTuple):
    """A clear coat at a point, as it is seen along wo; float32.

    weight  share of the surface that it covers, 0: none
    alpha   roughness^2; exactly 0: a mirror
    n       its normal, unit, on wo's side
    shown   share of what is under it that is seen, 1 - weight F(n.wo)
    """

    weight: np.float32
    alpha: np.float32
    n: Vector
    shown: np.float32


NO_COAT = Coat(f32(0), f32(0), _NONE, f32(1))


@jit
def make_coat(weight, roughness, n, cosine):
    """Return the Coat of these factors, float32, with the normal n; cosine: n.wo."""
    alpha = roughness * roughness
    hidden = weight * (_F0 + (f32(1) - _F0) * schlick(cosine))
    shown = max(f32(1) - hidden, _LEAST_SHOWN)
    return Coat(weight, f32(0) if alpha < MIN_ALPHA else alpha, n, shown)


@jit
def coat_bsdf(coat):
    """Return the Bsdf of a Coat alone; its normal is the coat's."""
    r = _F0 * coat.weight
    return Bsdf(
        _NONE,
        (r, r, r),
        coat.weight,
        coat.alpha,
        f32(0),
        f32(0),
        _NONE,
        f32(1),
        f32(1),
        f32(0),
        NO_ANISOTROPY,
    )


@jit
def with_diffuse(b, diffuse):
    """Return a Bsdf with another albedo of its Lambert lobe, RGB."""
    kept = b.dielectric_f0, b.dielectric_f90, b.tint, b.eta, b.thin, b.sheen, b.anisotropy
    return Bsdf(diffuse, b.f0, b.f90, b.alpha, *kept)


@jit
def covered(b, shown):
    """Return the Bsdf of an opaque surface of which a coat shows this share, float32."""
    kept = b.dielectric_f0, b.dielectric_f90, b.tint, b.eta, b.thin, b.sheen, b.anisotropy
    return Bsdf(scale(shown, b.diffuse), scale(shown, b.f0), shown * b.f90, b.alpha, *kept)
