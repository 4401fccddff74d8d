"""What facets that reflect all light send back of light from all around: GGX with Smith's shadowing, once.

ALBEDO[j, i] is the integral of D V cos over the hemisphere, by quadrature in float64, for alpha j / 20 and
n.wo = i / 10; in the first column n.wo is .005. `tests/optics/test_facet_albedo.py` integrates anew.
"""

import numpy as np

from ispm.optics.jit import jit

f32, i64 = np.float32, np.int64

ALBEDO = np.array([
    [1.000, 1.000, 1.000, 1.000, 1.000, 1.000, 1.000, 1.000, 1.000, 1.000, 1.000],
    [0.979, 0.911, 0.963, 0.982, 0.989, 0.993, 0.995, 0.996, 0.996, 0.997, 0.997],
    [0.988, 0.883, 0.905, 0.936, 0.957, 0.969, 0.977, 0.981, 0.985, 0.987, 0.988],
    [0.990, 0.887, 0.874, 0.893, 0.916, 0.934, 0.947, 0.957, 0.963, 0.968, 0.972],
    [0.990, 0.891, 0.858, 0.862, 0.878, 0.895, 0.911, 0.924, 0.934, 0.942, 0.948],
    [0.990, 0.892, 0.848, 0.838, 0.844, 0.857, 0.872, 0.885, 0.897, 0.907, 0.916],
], np.float32)  # fmt: skip
_ROWS, _COLUMNS = 5, 10


@jit
def facet_albedo(alpha, cosine):
    """Return the share, float32, that facets of alpha, 0 to .25, reflect along wo; cosine: n.wo."""
    x, y = min(max(cosine, f32(0)), f32(1)) * f32(_COLUMNS), min(max(alpha * f32(20), f32(0)), f32(_ROWS))
    i, j = min(i64(x), i64(_COLUMNS - 1)), min(i64(y), i64(_ROWS - 1))
    u, v = x - f32(i), y - f32(j)
    low = ALBEDO[j, i] + u * (ALBEDO[j, i + 1] - ALBEDO[j, i])
    high = ALBEDO[j + 1, i] + u * (ALBEDO[j + 1, i + 1] - ALBEDO[j + 1, i])
    return low + v * (high - low)


@jit
def widening_gain(alpha, wide, cosine):
    """Return the factor, float32, with which facets of alpha reflect as much if they count as `wide`: wider
    ones lose more to others."""
    return facet_albedo(alpha, cosine) / facet_albedo(wide, cosine) if wide > alpha else f32(1)
