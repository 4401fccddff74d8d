"""Photons to receivers through a grid in world space: for any points, on screen or not."""

from __future__ import annotations

import numpy as np

from ispm.kernels.threads import thread_count
from ispm.photons.grid import PhotonGrid


class Grid:
    """The `grid` estimator, see `estimators.Estimator`. Needs no screen: the projection is not used."""

    def __init__(self, threads: int | None) -> None:
        self._threads = thread_count(threads)

    def __call__(
        self, receivers: np.ndarray, photons: np.ndarray, clip_from_world: np.ndarray, size: tuple[int, int]
    ) -> np.ndarray:
        return PhotonGrid(photons).estimate(receivers, self._threads)
