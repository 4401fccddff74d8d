"""Polygons cut into triangles: convex ones as fans, others by clipping ears.

Source of the ear clipping: Meisters, "Polygons have ears", 1975. Cutting an ear off changes none but its
neighbours (Eberly, "Triangulation by ear clipping"), so it takes O(n^2); large ones are fans all the same.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ispm.io.budget import Budget

MOST_CORNERS = 128  # of a polygon whose ears are clipped
EAR = 60  # steps to look at a corner once for each corner: it is looked at three times, in Python


def triangulate(
    corners: np.ndarray, sizes: np.ndarray, points: np.ndarray, budget: Budget | None = None
) -> np.ndarray:
    """Return the (T, 3) triangles of polygons, each a run of `corners`, wound as they are.

    corners  (C,) numbers of rows of `points`, polygon after polygon
    sizes    (P,) corners of each polygon, 3 or more
    points   (V, 3) float
    budget   of work
    Raises SceneError where the polygons would take too long.
    """
    starts = np.cumsum(sizes) - sizes
    by_size = np.argsort(sizes, kind="stable")
    found, order = [], []
    for which in np.split(by_size, np.flatnonzero(np.diff(sizes[by_size])) + 1) if len(sizes) else []:
        size: int = sizes[which].item(0)
        polygons = corners[starts[which, None] + np.arange(size)]
        triangles = _fans(polygons) if size == 3 else _cut(polygons, points, budget)
        found.append(triangles)
        order.append(np.repeat(which, size - 2))
    if not found:
        return np.zeros((0, 3), corners.dtype)
    result: np.ndarray = np.concatenate(found)[np.argsort(np.concatenate(order), kind="stable")]
    return result


def _fans(polygons: np.ndarray) -> np.ndarray:
    """(P (n - 2), 3) triangles from the first corner of (P, n) polygons."""
    count, size = polygons.shape
    picks = np.stack([np.zeros(size - 2, int), np.arange(1, size - 1), np.arange(2, size)], axis=1)
    return polygons[:, picks].reshape(count * (size - 2), 3)


def _cut(polygons: np.ndarray, points: np.ndarray, budget: Budget | None) -> np.ndarray:
    """(P (n - 2), 3) triangles of (P, n) polygons, n > 3."""
    size = polygons.shape[1]
    with np.errstate(invalid="ignore", over="ignore"):  # of points that are not finite, which draw nothing
        flat = _flattened(points[polygons].astype(np.float64))
        turns = _turns(flat, np.roll(flat, -1, axis=1), np.roll(flat, -2, axis=1))
    bent = (turns < 0.0).any(axis=1) if size <= MOST_CORNERS else np.zeros(len(polygons), bool)
    triangles = _fans(polygons).reshape(len(polygons), size - 2, 3)
    if budget is not None:
        budget.take("polygons that are not convex", work=EAR * size**2 * int(bent.sum()))
    for i in np.flatnonzero(bent):
        triangles[i] = polygons[i][_ears(flat[i].tolist())]
    return triangles.reshape(-1, 3)


def _flattened(points: np.ndarray) -> np.ndarray:
    """(P, n, 2) outlines of (P, n, 3) polygons, seen along the axis nearest their normal, from its tip."""
    centered = points - points.mean(axis=1, keepdims=True)
    normals = np.cross(centered, np.roll(centered, -1, axis=1)).sum(axis=1)  # Newell's
    axis = np.abs(np.nan_to_num(normals)).argmax(axis=1)
    rows = np.arange(len(points))
    first, second = (axis + 1) % 3, (axis + 2) % 3
    mirrored = normals[rows, axis] < 0.0
    first, second = np.where(mirrored, second, first), np.where(mirrored, first, second)
    return np.stack([centered[rows, :, first], centered[rows, :, second]], axis=2)


def _turns(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """Twice the signed area of triangles (..., 2), positive to the left."""
    u, v = b - a, c - b
    area: np.ndarray = u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]
    return area


def _ears(outline: Sequence[Sequence[float]]) -> list[tuple[int, int, int]]:
    """Triangles of a simple polygon, counter-clockwise; a fan of the rest where no ear is left."""
    left = list(range(len(outline)))
    ears = [_is_ear(outline, left, k) for k in range(len(left))]
    triangles = []
    while len(left) > 3:
        ear = ears.index(True) if True in ears else 1
        triangles.append((left[ear - 1], left[ear], left[(ear + 1) % len(left)]))
        del left[ear], ears[ear]
        for k in (ear - 1, ear % len(left)):
            ears[k] = _is_ear(outline, left, k)
    return [*triangles, (left[0], left[1], left[2])]


def _is_ear(outline: Sequence[Sequence[float]], left: list[int], k: int) -> bool:
    """Whether corner k of those `left` turns left and no other lies in the triangle with its neighbours."""
    trio = outline[left[k - 1]], outline[left[k]], outline[left[(k + 1) % len(left)]]  # k may be -1
    (ax, ay), (bx, by), (cx, cy) = trio
    if (bx - ax) * (cy - by) - (by - ay) * (cx - bx) <= 0.0:
        return False
    for i in left:
        x, y = outline[i]
        if (
            outline[i] not in trio  # by place: outlines with holes pass some places twice
            and (bx - ax) * (y - ay) - (by - ay) * (x - ax) >= 0.0
            and (cx - bx) * (y - by) - (cy - by) * (x - bx) >= 0.0
            and (ax - cx) * (y - cy) - (ay - cy) * (x - cx) >= 0.0
        ):
            return False
    return True
