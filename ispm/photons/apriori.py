"""The radius of a photon's kernel from its path alone: for comparison.

McGuire and Luebke call what a path tells the a-priori path density. A path's density is not the density of
photons where it ends, so these models know caustic from diffuse light and little more.
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

_CAUSTIC_COUNT, _DIFFUSE_COUNT = 20.0, 100.0  # photons of its class in a kernel
_CLASS_MIN, _CLASS_MAX = 0.0005, 0.1  # of the diagonal


def hint_radii(photons: np.ndarray, diagonal: float, photon_count: int, smoothing: float = 1.0) -> None:
    """Write `radius` and `height` of each photon's kernel from its number of diffuse scatters: the talk's.

    The form is that of the authors' later published code (G3D's photon map sample): a hint, 1 at the light,
    is multiplied at each scatter by what the surface does to the path's density, and the radius goes from
    wide to narrow with a power of it.

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


def class_radii(
    photons: np.ndarray, beams: np.ndarray, area: float, diagonal: float, smoothing: float = 1.0
) -> None:
    """Write `radius` and `height` of each photon's kernel from how many scattered as often as it did.

    photons    (N,) PHOTON, changed in place
    beams      (B, 9) as in a Walk
    area       of the scene's surfaces, m2, over which diffuse photons of each class are taken to lie evenly
    diagonal   of the scene, m: no radius is below 0.0005 or above 0.1 of it
    smoothing  factor on every radius
    Kernels hold 100 photons of a class; of caustics 20, at the density that the beams tell.
    """
    bounce = photons["bounce"]
    each = _DIFFUSE_COUNT * area / np.maximum(np.bincount(bounce), 1)[bounce]
    spans = beams.astype(np.float64)
    each[bounce == 0] = _CAUSTIC_COUNT * np.linalg.norm(np.cross(spans[:, :3], spans[:, 3:6]), axis=1)
    radius = np.clip(np.sqrt(each / np.pi), _CLASS_MIN * diagonal, _CLASS_MAX * diagonal) * smoothing
    photons["radius"] = radius.astype(f32)
    photons["height"] = f32(_HEIGHT) * photons["radius"]
