"""A ray against triangles: four at once, and those too thin for float32.

Source: Woop, Benthin & Wald, "Watertight ray/triangle intersection", 2013.
"""

from __future__ import annotations

import numpy as np

from ispm.kernels.simd import ldf, vadd, vfma, vload4, vmin, vmul, vsign, vsub, vxor
from ispm.optics.jit import jit
from ispm.optics.vector import cross, dot, sub

f32, f64 = np.float32, np.float64


@jit(inline=True)
def meet_block(blocks, word, wx, wy, wz, kx, ky, kz, minus_x, minus_y, rate):
    """Meet 4 triangles, in the space where the ray starts at 0 and runs along z.

    wx ..  words of the coordinates that become x, y and z;  kx ..  the ray's origin in them
    ->     (b, c, size, inside, scaled): weights of the second and third corner and distance, all times
           size > 0; inside is not negative where all three weights are not
    A weight depends on the two corners of an edge alone, and is the exact negative in the triangle beyond
    it: no ray misses both, and one on the edge hits both.
    """
    pz = vsub(vload4(blocks, word + wz), kz)
    qz = vsub(vload4(blocks, word + 12 + wz), kz)
    sz = vsub(vload4(blocks, word + 24 + wz), kz)
    px = vfma(minus_x, pz, vsub(vload4(blocks, word + wx), kx))
    py = vfma(minus_y, pz, vsub(vload4(blocks, word + wy), ky))
    qx = vfma(minus_x, qz, vsub(vload4(blocks, word + 12 + wx), kx))
    qy = vfma(minus_y, qz, vsub(vload4(blocks, word + 12 + wy), ky))
    sx = vfma(minus_x, sz, vsub(vload4(blocks, word + 24 + wx), kx))
    sy = vfma(minus_y, sz, vsub(vload4(blocks, word + 24 + wy), ky))
    a = vsub(vmul(sx, qy), vmul(sy, qx))
    b = vsub(vmul(px, sy), vmul(py, sx))
    c = vsub(vmul(qx, py), vmul(qy, px))
    whole = vadd(a, vadd(b, c))
    sign = vsign(whole)
    a, b, c = vxor(a, sign), vxor(b, sign), vxor(c, sign)
    scaled = vmul(rate, vfma(a, pz, vfma(b, qz, vmul(c, sz))))
    return b, c, vxor(whole, sign), vmin(a, vmin(b, c)), scaled


@jit(inline=True)
def meet_needle(blocks, word, ox, oy, oz, dx, dy, dz):
    """Return (distance, u, v) of the triangle whose first word is `word`; NaN where it is seen from its edge.

    In float64. Products of coordinates are as large as the square of a needle's length, their sum is its
    area: in float32 one of 1:20 is off its plane by up to 20 roundings, more than rays start from it, and
    they meet it again. Weights below 0 are taken for 0: the hit is within the triangle.
    """
    o, d = (f64(ox), f64(oy), f64(oz)), (f64(dx), f64(dy), f64(dz))
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
    return f64(ldf(blocks, word)), f64(ldf(blocks, word + 4)), f64(ldf(blocks, word + 8))
