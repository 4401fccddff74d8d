"""The sheen of KHR_materials_sheen: fibers that stand on a surface, as velvet and peach skin have them.

The lobe is color D V: D the distribution of normals "Charlie", V Smith's term fitted to it. Of what is under
it a surface shows 1 - max(color) E(n.wo), E the lobe's albedo, of which `optics.sheen_albedo` has a table.
Fibers of a roughness below 0.3, seen from nearly along the surface, would reflect more light than comes:
there the lobe is divided by the larger of its albedos along wo and wi, so that it is reciprocal and gains no
energy.
Sources: Estevez and Kulla, Production Friendly Microfacet Sheen BRDF, SIGGRAPH 2017; KHR_materials_sheen.
"""

import math
from typing import NamedTuple

import numpy as np

from ispm.optics.jit import jit
from ispm.optics.sheen_albedo import ALBEDO
from ispm.optics.vector import Vector, cross, dot, scale

f32, i64 = np.float32, np.int64

MIN_ROUGHNESS = f32(0.07)  # fibers more upright than that are seen within 3 degrees of grazing alone
_ROWS, _COLUMNS = f32(ALBEDO.shape[0] - 1), f32(ALBEDO.shape[1] - 1)
_LEAST_SHOWN = f32(1e-6)  # of what is under it, so that it divides
_LEAST_COSINE = f32(1e-6)
_NONE = f32(0), f32(0), f32(0)


class Sheen(NamedTuple):
    """Sheen at a point, as it is seen along wo; float32.

    color      RGB, times what shows of it under a coat; black: none
    roughness  of the extension, 0 to 1; alpha is its square
    albedo     of the lobe along wo, without its color
    shown      share of what is under it that is seen, 1 - max(color) albedo
    """

    color: Vector
    roughness: np.float32
    albedo: np.float32
    shown: np.float32


NO_SHEEN = Sheen(_NONE, f32(1), f32(0), f32(1))


@jit
def make_sheen(color, roughness, cosine, uncovered):
    """Return the Sheen of these factors, RGB and float32.

    cosine  n.wo;  uncovered  share of it that a coat shows
    """
    albedo = sheen_albedo(roughness, cosine)
    hidden = max(color[0], max(color[1], color[2])) * albedo
    return Sheen(scale(uncovered, color), roughness, albedo, max(f32(1) - hidden, _LEAST_SHOWN))


@jit
def sheen_albedo(roughness, cosine):
    """Return E, float32, at most 1: what sheen of the color 1 reflects along wo of light from all around."""
    return min(_table(roughness, cosine), f32(1))


@jit
def _table(roughness, cosine):
    """E before it is held to 1, float32, bilinear."""
    x = f32(math.sqrt(min(max(cosine, f32(0)), f32(1)))) * _COLUMNS
    y = min(max(roughness, MIN_ROUGHNESS), f32(1)) * _ROWS
    i, j = min(i64(x), i64(_COLUMNS) - i64(1)), min(i64(y), i64(_ROWS) - i64(1))
    u, v = x - f32(i), y - f32(j)
    low = ALBEDO[j, i] + u * (ALBEDO[j, i + 1] - ALBEDO[j, i])
    high = ALBEDO[j + 1, i] + u * (ALBEDO[j + 1, i + 1] - ALBEDO[j + 1, i])
    return low + v * (high - low)


@jit
def eval_sheen(roughness, n, wo, wi, h):
    """Return D V, 1/sr float32, of a sheen; n.wo, n.wi > 0, h: unit, halfway between wo and wi."""
    kept = max(roughness, MIN_ROUGHNESS)
    alpha, nv, nl = kept * kept, dot(n, wo), dot(n, wi)
    gain = max(max(_table(roughness, nv), _table(roughness, nl)), f32(1))
    return _charlie(alpha, n, h) * _visibility(alpha, nv, nl) / gain


@jit
def _charlie(alpha, n, h):
    """The distribution of normals, 1/sr; the sine comes from n x h."""
    nxh = cross(n, h)
    rate = f32(1) / alpha
    sine = min(dot(nxh, nxh), f32(1)) ** (f32(0.5) * rate)
    return (f32(2) + rate) * f32(sine) * f32(0.5 / math.pi)


@jit
def _visibility(alpha, nv, nl):
    """G / (4 nv nl), of Estevez and Kulla."""
    nv, nl = max(nv, _LEAST_COSINE), max(nl, _LEAST_COSINE)
    return f32(1) / ((f32(1) + _lambda(alpha, nv) + _lambda(alpha, nl)) * f32(4) * nv * nl)


@jit
def _lambda(alpha, cosine):
    """Their fit of Smith's lambda, symmetric about half in its exponent."""
    if cosine < f32(0.5):
        return f32(math.exp(_curve(alpha, cosine)))
    return f32(math.exp(f32(2) * _curve(alpha, f32(0.5)) - _curve(alpha, f32(1) - cosine)))


@jit
def _curve(alpha, x):
    """The exponent below half; its five numbers are mixed by (1 - alpha)^2, table 1."""
    t = (f32(1) - alpha) * (f32(1) - alpha)
    a = f32(21.5473) + t * f32(25.3245 - 21.5473)
    b = f32(3.82987) + t * f32(3.32435 - 3.82987)
    c = f32(0.19823) + t * f32(0.16801 - 0.19823)
    d = f32(-1.97760) + t * f32(-1.27393 + 1.97760)
    e = f32(-4.32054) + t * f32(-4.85967 + 4.32054)
    return a / (f32(1) + b * f32(max(x, f32(0)) ** c)) + d * x + e
