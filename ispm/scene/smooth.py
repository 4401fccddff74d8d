"""Smooth normals for meshes that have none.

Vertices at one point are one. The faces around it fall into fans: from each to the next leads an edge that
two faces share, wound alike, at an angle of the crease at most. A normal is the mean of its fan's, weighted
by their angles at the vertex, so that it is the same however a surface is cut into triangles.
Source: Thuermer and Wuethrich, "Computing vertex normals from polygonal facets", 1998.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ispm.scene.mesh import DELTAS, Mesh, Morph


def smoothed(mesh: Mesh, crease: float) -> Mesh:
    """Return `mesh` with normals; vertices are doubled where faces that share them are not smooth.

    crease  rad, the largest angle between faces that are smooth
    """
    points = np.unique(mesh.positions + np.float32(0.0), axis=0, return_inverse=True)[1].ravel()
    corners = mesh.positions[mesh.triangles].astype(np.float64)
    faces, angles = angles_of(corners)
    fans = _fans(points[mesh.triangles], faces, math.cos(crease))
    sums = np.zeros((fans.max() + 1 if fans.size else 0, 3))
    np.add.at(sums, fans, angles[:, :, None] * faces[:, None, :])
    pairs = np.stack([mesh.triangles.ravel(), fans.ravel()], axis=1)
    kept, numbers = np.unique(pairs, axis=0, return_inverse=True)
    rows = kept[:, 0]
    others: dict[str, Any] = {
        name: _taken(getattr(mesh, name), rows)
        for name in ("tangents", "uv0", "uv1", "colors", "joints", "joint_weights")
    }
    deltas = ({name: _taken(getattr(morph, name), rows) for name in DELTAS} for morph in mesh.morphs)
    morphs = [Morph(**each, name=morph.name) for each, morph in zip(deltas, mesh.morphs, strict=True)]
    triangles, normals = numbers.reshape(-1, 3), unit(sums[kept[:, 1]])
    return Mesh(mesh.positions[rows], triangles, normals, **others, morphs=morphs, name=mesh.name)


def _taken(values: np.ndarray | None, rows: np.ndarray) -> np.ndarray | None:
    return None if values is None else values[rows]


def vertex_normals(positions: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Return what `Mesh.smooth_normals` promises, (V, 3) float32.

    positions  (V, 3) float32;  triangles  (T, 3) rows of these
    """
    faces, angles = angles_of(positions[triangles].astype(np.float64))
    corners, count = triangles.ravel(), len(positions)
    sums = [np.bincount(corners, (angles * faces[:, k, None]).ravel(), count) for k in range(3)]
    normals = unit(np.stack(sums, axis=1))
    normals[~normals.any(axis=1)] = 0.0, 1.0, 0.0
    return normals.astype(np.float32)


def angles_of(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return normals and angles of (T, 3, 3) triangles: (T, 3), 0 of those without an area; (T, 3) rad."""
    ahead = unit(np.roll(corners, -1, axis=1) - corners)
    behind = -np.roll(ahead, 1, axis=1)
    angles = np.arccos(np.clip(np.einsum("tki,tki->tk", ahead, behind), -1.0, 1.0))
    return unit(np.cross(ahead[:, 0], -ahead[:, 2])), angles


def unit(vectors: np.ndarray) -> np.ndarray:
    """Return vectors (..., 3) of length 1, or 0 where they have none."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(vectors / np.where(length > 0.0, length, 1.0))


def _fans(triangles: np.ndarray, faces: np.ndarray, least: float) -> np.ndarray:
    """(T, 3) numbers of the fans that corners belong to: those at one point that smooth edges connect.

    triangles  (T, 3) numbers of points
    faces      (T, 3) unit normals
    least      cosine of the crease angle
    """
    count = len(triangles)
    face, corner = np.repeat(np.arange(count), 3), np.tile(np.arange(3), count)
    start, end = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    low, high = np.minimum(start, end), np.maximum(start, end)
    order = np.lexsort((high, low))
    new = np.ones(3 * count, bool)
    new[1:] = (np.diff(low[order]) != 0) | (np.diff(high[order]) != 0)
    first = np.flatnonzero(new)
    first = first[np.diff(np.append(first, 3 * count)) == 2]  # edges of two faces
    a, b = order[first], order[first + 1]
    n, m = faces[face[a]], faces[face[b]]
    flat = ~(n.any(axis=1) & m.any(axis=1))  # a face without an area has no side of its own
    smooth = (start[a] != start[b]) & (flat | (np.einsum("ei,ei->e", n, m) >= least - 1e-9))
    a, b = a[smooth], b[smooth]
    # an edge that one face goes along from corner k to k + 1, the other goes back
    ahead = 3 * face + (corner + 1) % 3
    links = np.concatenate([np.stack([a, ahead[b]], axis=1), np.stack([ahead[a], b], axis=1)])
    return connected(3 * count, links).reshape(count, 3)


def connected(count: int, links: np.ndarray) -> np.ndarray:
    """Return (count,) numbers from 0 of the sets into which (L, 2) links join `count` things.

    Each round hooks the larger of two roots to the smaller and shortens all paths to them (after Shiloach and
    Vishkin 1982).
    """
    root = np.arange(count)
    while len(links):
        ends = np.sort(root[links], axis=1)
        links = links[ends[:, 0] != ends[:, 1]]
        ends = ends[ends[:, 0] != ends[:, 1]]
        np.minimum.at(root, ends[:, 1], ends[:, 0])
        while (root[root] != root).any():
            root = root[root]
    return np.asarray(np.unique(root, return_inverse=True)[1]).ravel()
