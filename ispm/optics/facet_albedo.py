"""What facets that reflect all light send back of light from all around: GGX with Smith's shadowing, once.

ALBEDO[j, i] is the integral of D V cos over the hemisphere, by quadrature in float64, for alpha (j / 10)^2
and n.wo = i / 10; in the first column n.wo is .005. `tests/optics/test_facet_albedo.py` integrates anew.
"""

import math

import numpy as np

from ispm.optics.jit import jit

f32, i64 = np.float32, np.int64

ALBEDO = np.array([
    [1.000, 1.000, 1.000, 1.000, 1.000, 1.000, 1.000, 1.000, 1.000, 1.000, 1.000],
    [0.919, 0.994, 0.999, 0.999, 1.000, 1.000, 1.000, 1.000, 1.000, 1.000, 1.000],
    [0.974, 0.929, 0.975, 0.988, 0.993, 0.995, 0.997, 0.997, 0.998, 0.998, 0.998],
    [0.987, 0.884, 0.914, 0.946, 0.965, 0.975, 0.981, 0.985, 0.988, 0.989, 0.991],
    [0.990, 0.888, 0.870, 0.886, 0.908, 0.926, 0.940, 0.951, 0.958, 0.964, 0.968],
    [0.990, 0.892, 0.848, 0.838, 0.844, 0.857, 0.872, 0.885, 0.897, 0.907, 0.916],
    [0.988, 0.882, 0.826, 0.796, 0.784, 0.782, 0.787, 0.795, 0.804, 0.815, 0.825],
    [0.986, 0.862, 0.793, 0.749, 0.721, 0.704, 0.695, 0.691, 0.691, 0.693, 0.698],
    [0.982, 0.833, 0.749, 0.692, 0.651, 0.621, 0.599, 0.582, 0.570, 0.561, 0.555],
    [0.978, 0.798, 0.697, 0.628, 0.576, 0.535, 0.503, 0.476, 0.454, 0.436, 0.420],
    [0.974, 0.760, 0.642, 0.560, 0.499, 0.451, 0.412, 0.379, 0.351, 0.328, 0.307],
], np.float32)  # fmt: skip
_STEPS = 10


@jit
def facet_albedo(alpha, cosine):
    """Return the share, float32, that facets of alpha, 0 to 1, reflect along wo; cosine: n.wo."""
    x, y = _place(cosine), _place(f32(math.sqrt(max(alpha, f32(0)))))
    i, j = min(i64(x), i64(_STEPS - 1)), min(i64(y), i64(_STEPS - 1))
    u, v = x - f32(i), y - f32(j)
    low = ALBEDO[j, i] + u * (ALBEDO[j, i + 1] - ALBEDO[j, i])
    high = ALBEDO[j + 1, i] + u * (ALBEDO[j + 1, i + 1] - ALBEDO[j + 1, i])
    return low + v * (high - low)


@jit
def _place(value):
    """Where a value, 0 to 1, lies in the table."""
    return min(max(value, f32(0)), f32(1)) * f32(_STEPS)


@jit
def albedo_gain(alpha, other, cosine):
    """Return the factor, float32, with which facets of alpha reflect as much if they count as of another
    alpha: wider ones lose more to others."""
    return facet_albedo(alpha, cosine) / facet_albedo(other, cosine) if other != alpha else f32(1)
