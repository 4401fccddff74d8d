"""Light that arrives at a point, as estimators sum it: which of its 16 channels is what."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ispm.kernels.simd import aligned

# Phi: a photon's flux; kappa: its density kernel; c: `cosine_ratio`; Fc, D, V: see bsdf.wgsl
INCIDENT = np.dtype(
    [
        ("irradiance", np.float32, 3),  # Phi kappa c, lx
        ("density", np.float32),  # kappa, photons per m2
        ("fresnel", np.float32, 3),  # Phi kappa c Fc
        ("met", np.float32),  # of light that was filtered: of how many receivers, over what is enough
        ("gloss", np.float32, 3),  # Phi kappa c D V (1 - Fc)
        ("reach", np.float32),  # of light that was filtered: the filter's radius, m; 0: it was not
        ("grazing", np.float32, 3),  # Phi kappa c D V Fc
        ("spare1", np.float32),
    ]
)
CHANNELS = INCIDENT.itemsize // 4


class FilteredLight(NamedTuple):
    """Light at points, (n, 16), and how its irradiance changes with the shading normal, (n, WORDS of
    `optics.gradient`) lx, world space; None: neighbours' normals agree."""

    light: np.ndarray
    gradient: np.ndarray | None


def no_light(count: int) -> np.ndarray:
    """Return (count, 16) float32 of darkness, aligned as kernels that take vectors want it."""
    return aligned(count * CHANNELS).reshape(-1, CHANNELS)


def channels(light: np.ndarray) -> np.ndarray:
    """Return (n, 16) float32 light as (n,) INCIDENT, the same memory under names."""
    return np.asarray(light.view(INCIDENT)[:, 0])
