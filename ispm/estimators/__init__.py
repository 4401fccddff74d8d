"""How photons become incident light at receivers: several ways to one sum.

In come receivers and photons with measured kernels; out goes the light at each receiver, channel by
channel. A test holds all of them to the same sums.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np

from ispm.estimators.grid import Grid
from ispm.estimators.tiled import Tiled
from ispm.estimators.tiled_cpu import TiledCpu
from ispm.estimators.volumes import Volumes
from ispm.gpu import Gpu
from ispm.settings import Settings


class Estimator(Protocol):
    """What every estimator does."""

    def __call__(
        self, receivers: np.ndarray, photons: np.ndarray, clip_from_world: np.ndarray, size: tuple[int, int]
    ) -> np.ndarray:
        """Return (h*w, 16) float32, INCIDENT: sums over all photons that count at each receiver.

        receivers        (h*w,) RECEIVER, row by row from the top left
        photons          (n,) PHOTON with radius and height set
        clip_from_world  (4, 4) float64, perspective or orthographic, columns on the right; a receiver is seen
                         within its pixel, or within one of it
        size             width and height of the receivers' screen
        channels         of `optics.incident`; `met` is 0, and so are fresnel and gloss where alpha is 0
        """


def estimator_name(settings: Settings) -> str:
    """Return the estimator that settings ask for; auto is screen tiles, or volumes for the talk's kernel."""
    if settings.estimator != "auto":
        return settings.estimator
    return "volumes" if settings.kernel == "hint" else "tiled"


def make_estimator(settings: Settings, gpu: Gpu, threads: int | None) -> Estimator:
    """Return the estimator that settings ask for. Raises AdapterError where the adapter cannot do it.

    threads  of the CPU; None: all
    """
    if settings.kernel == "hint":
        return Volumes(gpu, talk=True, errors=settings.talk_errors)
    return ESTIMATORS[estimator_name(settings)](gpu, threads)


def _tiled(gpu: Gpu, threads: int | None) -> Estimator:
    """On a software adapter numba does the same work in a third of the time."""
    return TiledCpu(threads) if gpu.is_software else Tiled(gpu)


# Made of a device and a number of threads (None: all).
ESTIMATORS: dict[str, Callable[[Gpu, int | None], Estimator]] = {
    "volumes": lambda gpu, threads: Volumes(gpu),
    "tiled": _tiled,
    "grid": lambda gpu, threads: Grid(threads),
}
