"""How one photon spreads over the surface it hit, and which points it may light. Twin of density.wgsl.

Source: biweight kernel, Silverman 1986, in an ellipsoid flattened along the photon's normal.
"""

import math

import numpy as np

from ispm.optics.jit import jit
from ispm.optics.vector import dot

f32 = np.float32

# Integral of (1 - t^2)^2 over the unit disc is pi / 3.
_NORMALISATION = f32(3 / math.pi)
# Photons on surfaces turned more than 60 degrees from the receiver's lie round a corner.
SAME_SURFACE = f32(0.5)
MAX_COSINE_RATIO = f32(10)


@jit
def density_kernel(offset, normal, radius, height):
    """Return kappa in 1/m2 at `offset` (m) from a photon; its integral over the disc across `normal` is 1.

    radius  reach in the photon's plane, m
    height  reach along its unit normal, m
    """
    z = dot(offset, normal)
    z2 = z * z
    planar2 = dot(offset, offset) - z2
    t2 = planar2 / (radius * radius) + z2 / (height * height)
    m = max(f32(1) - t2, f32(0))
    return _NORMALISATION / (radius * radius) * m * m


@jit
def ellipse_kernel(offset, u, v, n, height):
    """Return kappa in 1/m2 at `offset` (m) from a photon, of an ellipse with the semi-axes u and v, m, and
    the unit normal n; height as of `density_kernel`."""
    uu, vv = dot(u, u), dot(v, v)
    x, y, z = dot(offset, u) / uu, dot(offset, v) / vv, dot(offset, n) / height
    m = max(f32(1) - (x * x + y * y + z * z), f32(0))
    return ellipse_peak(uu, vv) * m * m


@jit
def ellipse_peak(uu, vv):
    """Return kappa in the middle of an ellipse, 1/m2; uu, vv: squares of its semi-axes, m2."""
    return _NORMALISATION / math.sqrt(uu * vv)


@jit
def photon_counts(wi_ng, normal_ng, inner, point_inner):
    """Return whether a photon lights a point, a bool: it came from the point's side, onto the same surface.

    wi_ng      cosine of the photon's direction of arrival and the point's geometric normal
    normal_ng  cosine of the two geometric normals
    inner, point_inner  whether INNER, see records.wgsl, is set of the photon and of the point
    """
    return (wi_ng > f32(0)) & (normal_ng > SAME_SURFACE) & (inner == point_inner)


@jit
def cosine_ratio(wi_n, wi_ng):
    """Return max(0, wi.n) / wi.ng, at most 10: what a shading normal makes of a photon. wi_ng > 0."""
    return min(max(wi_n, f32(0)) / wi_ng, MAX_COSINE_RATIO)
