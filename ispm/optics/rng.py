"""Random numbers without state: a pure function of what they are for.

The twins agree to the bit. Source: Jarzynski and Olano, Hash Functions for GPU Rendering, JCGT 2020.
"""

import numpy as np

from ispm.optics.jit import jit

f32 = np.float32
u32 = np.uint32


@jit
def pcg4d(a, b, c, d):
    """Return four uint32 that are the hash of four uint32."""
    a = u32(a * u32(1664525) + u32(1013904223))
    b = u32(b * u32(1664525) + u32(1013904223))
    c = u32(c * u32(1664525) + u32(1013904223))
    d = u32(d * u32(1664525) + u32(1013904223))
    a, b, c, d = _mix(a, b, c, d)
    a = u32(a ^ (a >> u32(16)))
    b = u32(b ^ (b >> u32(16)))
    c = u32(c ^ (c >> u32(16)))
    d = u32(d ^ (d >> u32(16)))
    return _mix(a, b, c, d)


@jit
def _mix(a, b, c, d):
    """One round of `pcg4d`: four uint32 from four."""
    a = u32(a + b * d)
    b = u32(b + c * a)
    c = u32(c + a * b)
    d = u32(d + b * c)
    return a, b, c, d


@jit
def uniform_float(x):
    """Return the top 24 bits of `x` as a float32 in [0, 1)."""
    return f32(u32(x) >> u32(8)) * f32(2.0**-24)


@jit
def random4(key, dimension, pass_index, seed):
    """Return four float32 in [0, 1) for the path `key` and the use `dimension` of them; arguments uint32."""
    a, b, c, d = pcg4d(u32(key), u32(dimension), u32(pass_index), u32(seed))
    return uniform_float(a), uniform_float(b), uniform_float(c), uniform_float(d)
