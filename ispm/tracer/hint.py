"""The radius of a photon's kernel from its path alone, as the talk of 2009 has it: for comparison.

McGuire and Luebke call it the a-priori path density. The form is that of the authors' later published code
(G3D's photon map sample): a hint, 1 at the light, is multiplied at each scatter by what the surface does to
the path's density, and the radius goes from wide to narrow with a power of it. A path's density is not the
density of photons where it ends, so the model knows caustic from diffuse light and little more.
"""

from __future__ import annotations

import numpy as np

f32 = np.float32

RADIUS_MIN, RADIUS_MAX = 0.001, 0.04  # of the diagonal: the authors' 1 cm and 40 cm in a scene of 10 m
_POWER = 0.4
_SPECULAR = 0.9  # the hint of a path of mirrors and glass: what they let on
_DIFFUSE = 0.5e-3 / np.pi  # of each diffuse scatter: a thousandth of f, at albedo 0.5
_COUNT = 20_356  # photons at which the two radii hold; the talk's row 5
_HEIGHT = 0.25  # of a kernel over its radius; the talk leaves it open


def hint_radii(photons: np.ndarray, diagonal: float, photon_count: int, smoothing: float = 1.0) -> None:
    """Write `radius` and `height` of each photon's kernel from its number of diffuse scatters.

    photons       (N,) PHOTON, changed in place
    diagonal      of the scene, m
    photon_count  emitted; radii shrink with its sixth root, without which more photons would not bring the
                  picture nearer to the truth
    smoothing     factor on every radius
    In a scene of 10 m: 2.6 cm after mirrors and glass alone, 38.8 cm after one diffuse scatter.
    """
    bounce = photons["bounce"].astype(np.float64)
    hint = np.where(bounce == 0.0, _SPECULAR, _DIFFUSE**bounce)
    share = RADIUS_MAX + (RADIUS_MIN - RADIUS_MAX) * hint**_POWER
    scale = diagonal * smoothing * (max(photon_count, 1) / _COUNT) ** (-1.0 / 6.0)
    photons["radius"] = (scale * share).astype(f32)
    photons["height"] = f32(_HEIGHT) * photons["radius"]
