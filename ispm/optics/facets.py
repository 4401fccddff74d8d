"""The facets of a Bsdf: alike in all directions or, by KHR_materials_anisotropy, wider in one than across.

Directions leave the surface, unit, tuples of three float32; `b` is a Bsdf, n the shading normal, h the normal
of a facet. The formulas of those that are alike in all directions are in `optics.microfacet`.
Sources: KHR_materials_anisotropy; D and G of two widths: Heitz, JCGT 2014, sections 5.3 and 5.4; visible
normals: Dupuy and Benyoub, HPG 2023, which stretches as Heitz, JCGT 2018, does.
"""

import math
from typing import NamedTuple

import numpy as np

from ispm.optics.jit import jit
from ispm.optics.microfacet import ggx, smith, stretched_normal, visible_normal
from ispm.optics.sampling import orthonormal_basis, to_local, to_world
from ispm.optics.vector import Vector, add, cross, dot, scale, sub

f32 = np.float32

_INV_PI = f32(1 / math.pi)
_LEAST = f32(1e-12)  # square of the part of a tangent that lies in the surface, below which it tells nothing
_NONE = f32(0), f32(0), f32(0)


class Anisotropy(NamedTuple):
    """In which direction facets are widest.

    alpha    of their lobe in this direction, float32, at least that across it, which a Bsdf has; 0: they are
             alike in all directions
    tangent  the direction, unit, world space; what of it lies across n counts, and its sign does not
    """

    alpha: np.float32
    tangent: Vector


NO_ANISOTROPY = Anisotropy(f32(0), _NONE)


@jit
def is_anisotropic(b):
    """Return whether the facets of a Bsdf are wider in one direction, a bool."""
    return b.anisotropy.alpha > f32(0)


@jit
def mean_alpha(b):
    """Return the alpha, float32, of a lobe alike in all directions that fills the same solid angle."""
    return f32(math.sqrt(b.alpha * b.anisotropy.alpha)) if is_anisotropic(b) else b.alpha


@jit
def shadowing_alpha(b):
    """Return the alpha, float32, of a lobe alike in all directions that loses as much to shadows as this one
    does, within .03 of the light: of the mean square, as Smith's shadowing is of tangents."""
    if not is_anisotropic(b):
        return b.alpha
    return f32(math.sqrt(f32(0.5) * (b.alpha * b.alpha + b.anisotropy.alpha * b.anisotropy.alpha)))


@jit
def facet_lobe(b, n, wo, wi, h):
    """Return D V, 1/sr, of the lobe D V F; h: halfway between wo and wi, n.wo, n.wi > 0."""
    if not is_anisotropic(b):
        return ggx(b.alpha, n, h) * smith(b.alpha, dot(n, wo), dot(n, wi))
    t, across = _frame(b, n)
    o, i = _local(wo, t, across, n), _local(wi, t, across, n)
    return _distribution(b, _local(h, t, across, n)) * _smith(b, o, i)


@jit
def visible_pdf(b, n, wo, h):
    """Density of `visible_facet` over 4 wo.h, 1/sr: that of the reflected direction."""
    nv = dot(n, wo)
    if not is_anisotropic(b):
        a2 = b.alpha * b.alpha
        return ggx(b.alpha, n, h) / (f32(2) * (nv + math.sqrt(nv * nv * (f32(1) - a2) + a2)))
    t, across = _frame(b, n)
    seen = nv + _stretch(b, _local(wo, t, across, n))
    return _distribution(b, _local(h, t, across, n)) / (f32(2) * seen)


@jit
def visible_facet(b, n, wo, u1, u2):
    """Return the normal of a facet as seen from wo, unit; u1, u2: uniform in [0, 1)."""
    if not is_anisotropic(b):
        return to_world(visible_normal(b.alpha, to_local(wo, n), u1, u2), n)
    t, across = _frame(b, n)
    h = stretched_normal(b.anisotropy.alpha, b.alpha, _local(wo, t, across, n), u1, u2)
    return add(add(scale(h[0], t), scale(h[1], across)), scale(h[2], n))


@jit
def unshadowed(b, n, wo, wi):
    """Return G2 / G1, 0 to 1: the share of light along wi that facets seen from wo do not shadow; wi may be
    below what is alike in all directions."""
    nv, nl = dot(n, wo), abs(dot(n, wi))
    if not is_anisotropic(b):
        a2 = b.alpha * b.alpha
        g1 = f32(2) * nv / (nv + math.sqrt(nv * nv * (f32(1) - a2) + a2))
        return smith(b.alpha, nv, nl) * f32(4) * nv * nl / g1
    t, across = _frame(b, n)
    o, i = _local(wo, t, across, n), _local(wi, t, across, n)
    return f32(2) * nl * (nv + _stretch(b, o)) * _smith(b, o, i)


@jit
def _frame(b, n):
    """The direction of the widest facets and that across it, unit, at right angles to n."""
    along = b.anisotropy.tangent
    along = sub(along, scale(dot(along, n), n))
    square = dot(along, along)
    if square < _LEAST:
        return orthonormal_basis(n)
    along = scale(f32(1) / math.sqrt(square), along)
    return along, cross(n, along)


@jit
def _local(v, t, across, n):
    """A vector in the frame of these three."""
    return dot(v, t), dot(v, across), dot(v, n)


@jit
def _distribution(b, h):
    """GGX of two widths, 1/sr; h: local."""
    x, y = h[0] / b.anisotropy.alpha, h[1] / b.alpha
    k = x * x + y * y + h[2] * h[2]
    return _INV_PI / (b.anisotropy.alpha * b.alpha * k * k)


@jit
def _stretch(b, v):
    """n.v sqrt(1 + (alpha tan)^2), where alpha is the width towards v, a local direction."""
    x, y = b.anisotropy.alpha * v[0], b.alpha * v[1]
    return f32(math.sqrt(x * x + y * y + v[2] * v[2]))


@jit
def _smith(b, o, i):
    """Height-correlated G / (4 nv nl) of two local directions."""
    return f32(0.5) / (i[2] * _stretch(b, o) + o[2] * _stretch(b, i))
