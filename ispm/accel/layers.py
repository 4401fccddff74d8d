"""A coated surface as two at one place: the clear coat, and what is under it.

Light of both adds. Each is a SurfacePoint, so that what is known of surfaces holds for either alone.
"""

from __future__ import annotations

import numpy as np

from ispm.accel.surface import SurfacePoint
from ispm.optics.bsdf import Bsdf
from ispm.optics.coat import NO_COAT, coat_bsdf
from ispm.optics.jit import jit
from ispm.optics.vector import add

f32 = np.float32

_BELOW_ONE = f32(1 - 2**-24)


@jit
def is_coated(x):
    """Return whether a SurfacePoint has a coat."""
    return x.coat.weight > f32(0)


@jit
def coat_point(x):
    """Return the coat of a SurfacePoint as a surface of its own: facets alone, smooth or rough."""
    return SurfacePoint(x.hit, x.position, x.ng, x.coat.n, coat_bsdf(x.coat), x.flags, x.entering, NO_COAT)


@jit
def drawn_layer(x, u):
    """Draw the coat of a SurfacePoint or what is under it, by what the coat reflects.

    u   random in [0, 1)
    ->  the layer, a SurfacePoint; u, uniform again; the chance, float32, with which it was drawn
    """
    hidden = f32(1) - x.coat.shown
    if u < hidden:
        return coat_point(x), u / hidden, hidden
    return x, min((u - hidden) / x.coat.shown, _BELOW_ONE), x.coat.shown


@jit
def with_rough_coat(x):
    """Return a SurfacePoint whose rough coat counts as part of the Lambert lobe, by its reflectance along wo,
    for light that is known as irradiance. What a smooth one reflects photons bring."""
    if not is_coated(x) or x.coat.alpha == f32(0):
        return x
    b, hidden = x.bsdf, f32(1) - x.coat.shown
    diffuse = add(b.diffuse, (hidden, hidden, hidden))
    b = Bsdf(diffuse, b.f0, b.f90, b.alpha, b.dielectric_f0, b.dielectric_f90, b.tint, b.eta, b.thin)
    return SurfacePoint(x.hit, x.position, x.ng, x.n, b, x.flags, x.entering, x.coat)
