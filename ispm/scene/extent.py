"""How large a scene is: its bounds along the axes, and its size however it is turned."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from ispm.errors import SceneError

if TYPE_CHECKING:
    from ispm.scene.mesh import Mesh

_CORNERS = np.array([[i & 1, i >> 1 & 1, i >> 2 & 1] for i in range(8)])
_FARTHEST = 4096  # points that may lie on the sphere
_STEPS = 64
_AT_ONCE = 1 << 22  # coordinates that are held while copies are bounded


def enclosing_diameter(points: np.ndarray) -> float:
    """Return the diameter of the smallest sphere about (n, 3) points, to a few hundredths; 0 without any.

    It turns with the points, where a box along the axes grows. From their mean, step by ever smaller step
    towards the farthest (Badoiu and Clarkson, Smaller Core-Sets for Balls, SODA 2003), of those that are far.
    """
    if not len(points):
        return 0.0
    center = points.mean(axis=0)
    points = np.ascontiguousarray(points.T)
    if len(points.T) > _FARTHEST:
        points = points[:, np.argpartition(_squares(points, center), -_FARTHEST)[-_FARTHEST:]]
    radius = np.inf
    for step in range(1, _STEPS + 1):
        away = _squares(points, center)
        farthest = int(away.argmax())
        radius = min(radius, float(away[farthest]))
        center = center + (points[:, farthest] - center) / (step + 1)
    return 2.0 * float(np.sqrt(radius))


def _squares(points: np.ndarray, center: np.ndarray) -> np.ndarray:
    """(n,) squared distances of (3, n) points from one, (3,)."""
    away = points - center[:, None]
    x, y, z = away * away
    return np.asarray(x + y + z)


def corners_of(boxes: np.ndarray) -> np.ndarray:
    """Return the (..., 8, 3) corners of (..., 2, 3) boxes."""
    return np.asarray(boxes[..., _CORNERS, [0, 1, 2]])


def placed_bounds(placed: Iterable[tuple[Mesh, np.ndarray]]) -> np.ndarray:
    """Return the (2, 3) float64 corners of meshes with the (n, 4, 4) matrices that place each in the world.

    Raises SceneError where there is no surface.
    """
    shown: dict[int, tuple[Mesh, list[np.ndarray]]] = {}
    for mesh, places in placed:
        shown.setdefault(id(mesh), (mesh, []))[1].append(places)
    if not shown:
        raise SceneError("there is no surface, and so there are no bounds")
    boxes = np.stack(
        [
            _bounds_of_copies(used_points(mesh.positions, mesh.triangles), np.concatenate(matrices))
            for mesh, matrices in shown.values()
        ]
    )
    return np.stack([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])


def used_points(positions: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Return the (n, 3) float64 positions that triangles use."""
    used = np.zeros(len(positions), bool)
    used[triangles.ravel()] = True
    return np.asarray(positions[used], np.float64)


def _bounds_of_copies(points: np.ndarray, matrices: np.ndarray) -> np.ndarray:
    """(2, 3) bounds of (n, 3) points at each of (k, 4, 4) matrices.

    Only copies whose box, turned with them, reaches beyond what others do are looked at point by point.
    """
    turns, moves = matrices[:, :3, :3], matrices[:, :3, 3]
    middle, half = (points.max(axis=0) + points.min(axis=0)) / 2.0, np.ptp(points, axis=0) / 2.0
    centers, reach = turns @ middle + moves, np.abs(turns) @ half
    loose = np.stack([centers - reach, centers + reach])
    first = np.concatenate([loose[0].argmin(axis=0), loose[1].argmax(axis=0)])
    bounds = _exact(points, turns[first], moves[first])
    beyond = np.flatnonzero(((loose[0] < bounds[0]) | (loose[1] > bounds[1])).any(axis=1))
    step = max(_AT_ONCE // (3 * len(points)), 1)
    for k in range(0, len(beyond), step):
        few = beyond[k : k + step]
        low, high = _exact(points, turns[few], moves[few])
        bounds = np.stack([np.minimum(bounds[0], low), np.maximum(bounds[1], high)])
    return bounds


def _exact(points: np.ndarray, turns: np.ndarray, moves: np.ndarray) -> np.ndarray:
    moved = turns @ points.T + moves[:, :, None]
    return np.stack([moved.min(axis=(0, 2)), moved.max(axis=(0, 2))])
