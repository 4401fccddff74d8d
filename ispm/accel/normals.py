"""Normals as kernels need them: unit, and on the right side."""

import math

import numpy as np

from ispm.optics.jit import jit
from ispm.optics.vector import dot, scale, sub

f32 = np.float32


@jit
def unit(x):
    """Return x at unit length, without overflow; +Y where it has no length."""
    largest = max(abs(x[0]), max(abs(x[1]), abs(x[2])))
    if not largest > f32(0):
        return f32(0), f32(1), f32(0)
    x = scale(f32(1) / largest, x)
    return scale(f32(1) / math.sqrt(dot(x, x)), x)


@jit
def bend(n, toward):
    """Return the unit vector `n`, or the one next to it that is just on the side of `toward`, unit.

    For shading normals that a map or coarse triangles turned past the surface or away from where light
    goes: nothing would leave there. Twin of seen.wgsl's.
    """
    beyond = dot(n, toward)
    if beyond >= f32(0):
        return n
    return unit(sub(n, scale(beyond - f32(1e-3), toward)))
