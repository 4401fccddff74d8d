"""Irradiance as a linear function of the shading normal. Twin of gradient.wgsl.

Over a small range of normals E(m) = E(n) + g . (m - n): to first order m - n lies in the tangent plane of n,
where g has two components for each channel. They are fitted to the light of receivers around a point, whose
normals differ, by least squares with a ridge.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from ispm import wgsl
from ispm.optics.jit import jit
from ispm.optics.vector import dot

f32 = np.float32

WORDS = 12
"""Floats of a gradient: for each axis of the world the derivatives of three channels, and one to spare."""

# A ridge regression (Hoerl and Kennard 1970). Over the number of receivers: the variance of one's irradiance
# over that of slopes to be expected, both relative. A bumpy wall's error is least at .2 where receivers have
# 4 x 4 pixels, at .05 with one for each; at 1 two thirds of the lost contrast stay lost.
_VARIANCE = 0.1
# Share of the spread of geometric normals: where the surface itself turns, light changes with the place too,
# and slopes are less certain. Columns under photons alone have 5 % more error at 0, 1 % at 4.
_BENT = 4.0
_MOST_TURNED = wgsl.load("optics/gradient.wgsl").constants["MOST_TURNED"]


class Moments(NamedTuple):
    """Weighted sums over receivers, whose normals are (u, v) off in the tangent plane: of w, w^2, w u, w v,
    w u^2, w u v, w v^2, and of w times the cosine between geometric normals."""

    w: Any
    w2: Any
    u: Any
    v: Any
    uu: Any
    uv: Any
    vv: Any
    facing: Any


class Fit(NamedTuple):
    """What `slope` needs of Moments: the mean normal, and the inverse of the covariance with its ridge."""

    inverse_weight: Any
    u: Any
    v: Any
    a: Any
    b: Any
    c: Any


@jit
def fit_of(moments):
    """Return the Fit of Moments whose weight is not 0.

    The ridge is _VARIANCE over the effective number of receivers, (sum w)^2 / sum w^2, and the geometry's
    part: where normals agree or receivers are few it outweighs what they tell, and the slope is small.
    """
    inverse = f32(1) / moments.w
    u, v = inverse * moments.u, inverse * moments.v
    bent = max(f32(2) - f32(2) * inverse * moments.facing, f32(0))  # mean square of their differences
    ridge = f32(_VARIANCE) * moments.w2 * inverse * inverse + f32(_BENT) * bent
    uu = max(inverse * moments.uu - u * u, f32(0)) + ridge
    vv = max(inverse * moments.vv - v * v, f32(0)) + ridge
    uv = inverse * moments.uv - u * v
    scaled = f32(1) / max(uu * vv - uv * uv, ridge * ridge)
    return Fit(inverse, u, v, vv * scaled, -uv * scaled, uu * scaled)


@jit
def slope(fit, mean, along_u, along_v):
    """Return the derivatives of a channel E along u and v.

    mean  of E;  along_u, along_v  sums of w u E and w v E
    """
    u = along_u * fit.inverse_weight - fit.u * mean
    v = along_v * fit.inverse_weight - fit.v * mean
    return fit.a * u + fit.b * v, fit.b * u + fit.c * v


@jit
def turn(n, m):
    """Return by what the unit vector `m` is off `n` in the tangent plane of n, as far as fits are used."""
    along = dot(n, m)
    off = m[0] - along * n[0], m[1] - along * n[1], m[2] - along * n[2]
    square = dot(off, off)
    share = f32(_MOST_TURNED) / math.sqrt(square) if square > f32(_MOST_TURNED * _MOST_TURNED) else f32(1)
    return off[0] * share, off[1] * share, off[2] * share


@jit
def turned_light(light, gradient, c, off):
    """Return channel `c` of irradiance `light` where the normal is `off`; gradient: (WORDS,) float32."""
    change = gradient[c] * off[0] + gradient[4 + c] * off[1] + gradient[8 + c] * off[2]
    return max(light[c] + change, f32(0))
