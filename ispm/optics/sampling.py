"""Points on spheres and hemispheres, and the frames they live in. Twin of sampling.wgsl."""

import math

import numpy as np

from ispm.optics.jit import jit
from ispm.optics.vector import normalize

f32 = np.float32

LATTICE = (0.7548776662466927, 0.5698402909980532)
"""Steps 1 / p and 1 / p^2, p^3 = p + 1, whose multiples modulo 1 lie evenly in a square (Roberts 2018)."""


@jit
def orthonormal_basis(n):
    """Return two unit vectors that complete the unit vector `n` to a right-handed frame.

    Source: Duff et al., Building an Orthonormal Basis, Revisited, JCGT 2017; but the sign changes aside of 0,
    where upright walls' normals are: rounding would turn their frames.
    """
    sign = f32(1) if n[2] >= f32(-0.125) else f32(-1)
    a = f32(-1) / (sign + n[2])
    b = n[0] * n[1] * a
    tangent = (f32(1) + sign * n[0] * n[0] * a, sign * b, -sign * n[0])
    bitangent = (b, sign + n[1] * n[1] * a, -n[1])
    return tangent, bitangent


@jit
def to_world(local, n):
    """Return the float32 direction that is `local` in the frame whose third axis is `n`, unit."""
    t, b = orthonormal_basis(n)
    return (
        local[0] * t[0] + local[1] * b[0] + local[2] * n[0],
        local[0] * t[1] + local[1] * b[1] + local[2] * n[1],
        local[0] * t[2] + local[1] * b[2] + local[2] * n[2],
    )


@jit
def to_local(direction, n):
    """Return `direction`, float32, in the frame whose third axis is `n`, unit."""
    t, b = orthonormal_basis(n)
    return (
        direction[0] * t[0] + direction[1] * t[1] + direction[2] * t[2],
        direction[0] * b[0] + direction[1] * b[1] + direction[2] * b[2],
        direction[0] * n[0] + direction[1] * n[1] + direction[2] * n[2],
    )


@jit
def cosine_hemisphere(u1, u2):
    """Return a unit direction about +z with pdf cos / pi; u1, u2: uniform in [0, 1)."""
    radius = math.sqrt(u1)
    phi = f32(2 * math.pi) * u2
    return radius * math.cos(phi), radius * math.sin(phi), math.sqrt(f32(1) - u1)


@jit
def in_cone(axis, cosine, u, v):
    """Return a direction, unit, drawn evenly by u, v of [0, 1) in a cone; cosine: of half its angle."""
    z = f32(1) - u * (f32(1) - cosine)
    radius, phi = f32(math.sqrt(max(f32(1) - z * z, f32(0)))), f32(2 * math.pi) * v
    return to_world((radius * f32(math.cos(phi)), radius * f32(math.sin(phi)), z), axis)


@jit
def octahedral_encode(n):
    """Return the unit vector `n` as a point of [-1, 1]^2.

    Source: Cigolle et al., A Survey of Efficient Representations for Independent Unit Vectors, JCGT 2014.
    """
    s = f32(1) / (abs(n[0]) + abs(n[1]) + abs(n[2]))
    x, y = n[0] * s, n[1] * s
    return _fold(x, y) if n[2] < f32(0) else (x, y)


@jit
def octahedral_decode(x, y):
    """Return the unit vector that `octahedral_encode` maps to (x, y)."""
    z = f32(1) - abs(x) - abs(y)
    if z < f32(0):
        x, y = _fold(x, y)
    return normalize((x, y, z))


@jit
def _fold(x, y):
    """Return the point (x, y), float32, turned over the nearest edge of the square's inner diamond."""
    return (
        (f32(1) - abs(y)) * (f32(1) if x >= f32(0) else f32(-1)),
        (f32(1) - abs(x)) * (f32(1) if y >= f32(0) else f32(-1)),
    )


@jit
def equal_area_octahedral(u, v):
    """Return the direction of (u, v) in [-1, 1]^2; equal areas are equal solid angles (Jacobian pi).

    Source: Clarberg, Fast Equal-Area Mapping of the (Hemi)Sphere using SIMD, JGT 2008.
    """
    d = f32(1) - abs(u) - abs(v)
    r = f32(1) - abs(d)
    phi = f32(math.pi / 4) * ((abs(v) - abs(u)) / r + f32(1)) if r > f32(0) else f32(0)
    f = r * math.sqrt(f32(2) - r * r)
    return (
        math.copysign(f * math.cos(phi), u),
        math.copysign(f * math.sin(phi), v),
        math.copysign(f32(1) - r * r, d),
    )
