"""A ray against triangles: four at once, and those too thin for float32.

Source: Woop, Benthin & Wald, "Watertight ray/triangle intersection", 2013.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ispm.kernels.simd import ldf, vadd, vfma, vload4, vmin, vmul, vsign, vsub, vxor
from ispm.optics.jit import jit
from ispm.optics.vector import cross, dot, sub

f32, f64 = np.float32, np.float64


class Shear(NamedTuple):
    """The transform to the space where a ray starts at 0 and runs along z; all but words in four lanes.

    wx, wy, wz        words, within a corner of a block, of the coordinates that become x, y and z
    kx, ky, kz        the ray's origin in these coordinates
    minus_x, minus_y  what is added to x and y for each unit of z
    rate              of the ray's parameter along z
    """

    wx: np.int64
    wy: np.int64
    wz: np.int64
    kx: Any
    ky: Any
    kz: Any
    minus_x: Any
    minus_y: Any
    rate: Any


@jit(inline=True)
def meet_block(blocks, word, shear):
    """Meet the 4 triangles from a word on, int64, of the address `blocks`, in the space of a Shear.
    Corners lie 12 words apart, the axes of one 4, triangle by triangle.

    ->     (b, c, size, inside, scaled), float32 in four lanes: weights b and c of the second and third corner
           and distance `scaled`, all times size > 0, twice the area that the ray sees; inside: the least
           of the three weights
    A weight depends on the two corners of an edge alone, and is the exact negative in the triangle beyond
    it: no ray misses both, and one on the edge hits both.
    """
    pz = vsub(vload4(blocks, word + shear.wz), shear.kz)
    qz = vsub(vload4(blocks, word + 12 + shear.wz), shear.kz)
    sz = vsub(vload4(blocks, word + 24 + shear.wz), shear.kz)
    px = vfma(shear.minus_x, pz, vsub(vload4(blocks, word + shear.wx), shear.kx))
    py = vfma(shear.minus_y, pz, vsub(vload4(blocks, word + shear.wy), shear.ky))
    qx = vfma(shear.minus_x, qz, vsub(vload4(blocks, word + 12 + shear.wx), shear.kx))
    qy = vfma(shear.minus_y, qz, vsub(vload4(blocks, word + 12 + shear.wy), shear.ky))
    sx = vfma(shear.minus_x, sz, vsub(vload4(blocks, word + 24 + shear.wx), shear.kx))
    sy = vfma(shear.minus_y, sz, vsub(vload4(blocks, word + 24 + shear.wy), shear.ky))
    a = vsub(vmul(sx, qy), vmul(sy, qx))
    b = vsub(vmul(px, sy), vmul(py, sx))
    c = vsub(vmul(qx, py), vmul(qy, px))
    whole = vadd(a, vadd(b, c))
    sign = vsign(whole)
    a, b, c = vxor(a, sign), vxor(b, sign), vxor(c, sign)
    scaled = vmul(shear.rate, vfma(a, pz, vfma(b, qz, vmul(c, sz))))
    return b, c, vxor(whole, sign), vmin(a, vmin(b, c)), scaled


@jit(inline=True)
def meet_needle(blocks, word, origin, direction):
    """Return (distance, u, v), float32, of the triangle whose first word in the blocks is `word`; NaN where
    it is seen from its edge. The distance counts in lengths of the ray's direction.

    In float64: products of coordinates are as large as the square of a needle's length, their sum is its
    area. In float32 one of 1:20 is off its plane by up to 20 roundings, more than rays start from it, and
    they meet it again. Weights below 0 are taken for 0: the hit is within the triangle.
    """
    o = (f64(origin[0]), f64(origin[1]), f64(origin[2]))
    d = (f64(direction[0]), f64(direction[1]), f64(direction[2]))
    p, q = sub(_corner(blocks, word), o), sub(_corner(blocks, word + 12), o)
    s = sub(_corner(blocks, word + 24), o)
    a, b, c = dot(d, cross(s, q)), dot(d, cross(p, s)), dot(d, cross(q, p))
    sign = f64(1) if a + b + c > f64(0) else f64(-1)
    a, b, c = max(sign * a, f64(0)), max(sign * b, f64(0)), max(sign * c, f64(0))
    inverse = f64(1) / (a + b + c)
    along = (a * dot(d, p) + b * dot(d, q) + c * dot(d, s)) * inverse
    return f32(along / dot(d, d)), f32(b * inverse), f32(c * inverse)


@jit(inline=True)
def _corner(blocks, word):
    """The corner of a triangle whose x is that word of the blocks, float64."""
    return f64(ldf(blocks, word)), f64(ldf(blocks, word + 4)), f64(ldf(blocks, word + 8))
