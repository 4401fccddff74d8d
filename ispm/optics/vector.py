"""Three-vectors for numba kernels: tuples of float32, which LLVM keeps in registers.

WGSL has these built in, so there is no twin.
"""

import math

import numpy as np

from ispm.optics.jit import jit

f32, u32 = np.float32, np.uint32

Vector = tuple[np.float32, np.float32, np.float32]

LUMINANCE = (0.2126, 0.7152, 0.0722)  # of linear sRGB (BT.709)


@jit
def vec3(a):
    """Return three numbers of an array, or of a record's field, as a Vector."""
    return a[0], a[1], a[2]


@jit
def dot(a, b):
    """Return a . b, float32."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@jit
def cross(a, b):
    """Return a x b, float32."""
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


@jit
def add(a, b):
    """Return a + b, float32."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@jit
def sub(a, b):
    """Return a - b, float32."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@jit
def scale(s, a):
    """Return s a, float32."""
    return s * a[0], s * a[1], s * a[2]


@jit
def normalize(a):
    """Return a / |a|, unit."""
    return scale(f32(1) / math.sqrt(dot(a, a)), a)


@jit
def luminance(c):
    """Return the Rec. 709 luminance of a linear RGB triple."""
    return f32(LUMINANCE[0]) * c[0] + f32(LUMINANCE[1]) * c[1] + f32(LUMINANCE[2]) * c[2]


@jit
def facing(normal):
    """Return which side of a cube a normal points to, uint32 0 to 5."""
    x, y, z = abs(normal[0]), abs(normal[1]), abs(normal[2])
    if x >= y and x >= z:
        return u32(normal[0] <= f32(0))
    if y >= z:
        return u32(2) + u32(normal[1] <= f32(0))
    return u32(4) + u32(normal[2] <= f32(0))
