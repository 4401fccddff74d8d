"""How large a scene is, however it is turned."""

from __future__ import annotations

import numpy as np

_FARTHEST = 4096  # points that may lie on the sphere
_STEPS = 64


def enclosing_diameter(points: np.ndarray) -> float:
    """Return the diameter of the smallest sphere about (n, 3) points, to a few hundredths; 0 without any.

    It turns with the points, where a box along the axes grows. From their mean, step by ever smaller step
    towards the farthest (Badoiu and Clarkson, Smaller Core-Sets for Balls, SODA 2003), of those that are far.
    """
    if not len(points):
        return 0.0
    center = points.mean(axis=0)
    if len(points) > _FARTHEST:
        away = np.square(points - center).sum(axis=1)
        points = points[np.argpartition(away, -_FARTHEST)[-_FARTHEST:]]
    radius = np.inf
    for step in range(1, _STEPS + 1):
        away = np.square(points - center).sum(axis=1)
        farthest = int(away.argmax())
        radius = min(radius, float(away[farthest]))
        center = center + (points[farthest] - center) / (step + 1)
    return 2.0 * float(np.sqrt(radius))
