"""Photons to receivers through a grid in world space: for any points, on screen or not."""

from __future__ import annotations

import numpy as np

from ispm.tracer.grid import PhotonGrid


class Grid:
    """The `grid` estimator, see `estimators.Estimator`."""
