"""Facets of rough surfaces: how their normals are distributed, shadow each other, reflect and refract.

Twin of microfacet.wgsl. Directions leave the surface, unit, tuples of three float32.
Sources: GGX: Walter et al. 2007; V: Heitz, JCGT 2014; visible normals: Dupuy and Benyoub, HPG 2023.
"""

import math

import numpy as np

from ispm.optics.jit import jit
from ispm.optics.vector import add, cross, dot, normalize, scale, sub

f32 = np.float32

_INV_PI = f32(1 / math.pi)
_TWO_PI = f32(2 * math.pi)


@jit
def ggx(alpha, n, h):
    """Return the GGX distribution of normals, 1/sr, at `h` about `n`, both unit.

    The sine comes from n x h: 1 - (n.h)^2 would lose it for small alpha.
    """
    nxh = cross(n, h)
    nh = dot(n, h)
    k = alpha / (alpha * alpha * nh * nh + dot(nxh, nxh))
    return k * k * _INV_PI


@jit
def smith(alpha, nv, nl):
    """Return height-correlated Smith shadowing as G / (4 nv nl), float32; nv = n.wo, nl = n.wi."""
    a2 = alpha * alpha
    one_a2 = f32(1) - a2
    return f32(0.5) / (nl * math.sqrt(nv * nv * one_a2 + a2) + nv * math.sqrt(nl * nl * one_a2 + a2))


@jit
def schlick(cosine):
    """Return (1 - cosine)^5, float32, safe against rounding."""
    m = min(max(f32(1) - cosine, f32(0)), f32(1))
    return m * m * m * m * m


@jit
def fresnel_dielectric(cosine, eta):
    """Return the share of unpolarized light that a boundary reflects; 1 at total internal reflection.

    cosine  with the normal, of the direction on this side, within [0, 1]
    eta     index of the other side over this one's
    """
    square = eta * eta - f32(1) + cosine * cosine  # (eta cos)^2 of the other side
    if square <= f32(0):
        return f32(1)
    other = math.sqrt(square)
    s = (cosine - other) / (cosine + other)
    p = (eta * eta * cosine - other) / (eta * eta * cosine + other)
    return f32(0.5) * (s * s + p * p)


@jit
def mirrored(wo, h):
    """Return `wo` reflected about the normal `h`, all unit."""
    return normalize(sub(scale(f32(2) * dot(wo, h), h), wo))


@jit
def refract(wo, h, eta):
    """Return (whether light passes, wi beyond the surface of normal `h`, on wo's side); Snell's law."""
    c = dot(wo, h)
    square = eta * eta - f32(1) + c * c
    if square <= f32(0):
        return False, wo
    return True, normalize(sub(scale(c - math.sqrt(square), h), wo))


@jit
def visible_normal(alpha, wo, u1, u2):
    """Return a GGX normal as seen from `wo`, both unit and local; u1, u2: uniform in [0, 1)."""
    return stretched_normal(alpha, alpha, wo, u1, u2)


@jit
def stretched_normal(alpha_x, alpha_y, wo, u1, u2):
    """Return likewise a normal of a GGX of two widths, along the x and the y axis.

    Source: Dupuy and Benyoub, Sampling Visible GGX Normals with Spherical Caps, HPG 2023.
    """
    stretched = normalize((alpha_x * wo[0], alpha_y * wo[1], wo[2]))
    _, _, height = stretched
    phi = _TWO_PI * u1
    z = (f32(1) - u2) * (f32(1) + height) - height
    r = math.sqrt(max(f32(1) - z * z, f32(0)))
    h = add((r * math.cos(phi), r * math.sin(phi), z), stretched)
    return normalize((alpha_x * h[0], alpha_y * h[1], h[2]))
