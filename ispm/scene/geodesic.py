"""The sphere cut into nearly equal triangles."""

from __future__ import annotations

import numpy as np


def geodesic(segments: int) -> tuple[np.ndarray, np.ndarray]:
    """Return an icosahedron with edges cut into `segments`, pushed out to the unit sphere.

    ->  (10 segments^2 + 2, 3) float64 unit vertices, (20 segments^2, 3) triangles, counter-clockwise from
        outside
    """
    golden = (1.0 + 5.0**0.5) / 2.0
    ring = np.array([(0.0, a, b * golden) for a in (-1.0, 1.0) for b in (-1.0, 1.0)])
    corners = np.concatenate([ring, np.roll(ring, 1, axis=1), np.roll(ring, 2, axis=1)])
    near = np.isclose(np.linalg.norm(corners[:, None] - corners[None], axis=2), 2.0)
    faces = [
        (a, b, c) if np.dot(np.cross(corners[a], corners[b]), corners[c]) > 0.0 else (a, c, b)
        for a in range(12)
        for b in range(a + 1, 12)
        for c in range(b + 1, 12)
        if near[a, b] and near[b, c] and near[a, c]
    ]
    weights, pattern = _cut_triangle(segments)
    points = np.concatenate([weights @ corners[list(face)] for face in faces])
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    triangles = np.concatenate([pattern + k * len(weights) for k in range(len(faces))])
    # neighbours meet in rounded equal points; a millionth is far below an edge's length
    _, first, welded = np.unique(np.round(points, 6), axis=0, return_index=True, return_inverse=True)
    return points[first], welded.reshape(-1)[triangles]


def _cut_triangle(segments: int) -> tuple[np.ndarray, np.ndarray]:
    """Barycentric points and triangles of a triangle with edges cut into `segments`."""
    index: dict[tuple[int, int], int] = {}
    for i in range(segments + 1):
        for j in range(segments + 1 - i):
            index[i, j] = len(index)
    weights = np.array([(segments - i - j, i, j) for i, j in index]) / segments
    triangles = []
    for i, j in index:
        if i + j < segments:
            triangles.append((index[i, j], index[i + 1, j], index[i, j + 1]))
        if i + j < segments - 1:
            triangles.append((index[i + 1, j], index[i + 1, j + 1], index[i, j + 1]))
    return weights, np.array(triangles)
