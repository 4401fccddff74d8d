"""The triangles of a scene in world space, from the arrays that our tracer reads."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ispm.scene.packed import Packed


class Triangles(NamedTuple):
    """What one INSTANCE shows: n vertices with unit normals, m triangles that name them.

    positions, normals  (n, 3) float64
    uv                  (n, 2) float32, v downwards as in glTF
    corners             (m, 3) uint32
    """

    positions: np.ndarray
    normals: np.ndarray
    uv: np.ndarray
    corners: np.ndarray


def world_triangles(packed: Packed, instance: np.void) -> Triangles:
    """Return those of an INSTANCE. Raises ValueError where it is mirrored or has colors of its own.

    Vertices without a normal, as flat triangles have them, are written once for each of their triangles.
    """
    first, count = int(instance["first_index"]), 3 * int(instance["triangle_count"])
    indices = packed.geometry.indices[first : first + count]
    flat = not packed.geometry.vertices["normal"][indices].any(axis=1).all()
    used, corners = (indices, np.arange(count)) if flat else np.unique(indices, return_inverse=True)
    rows = packed.geometry.vertices[used]
    place = np.stack([instance[f"world{k}"] for k in range(3)]).astype(np.float64)
    turn = np.stack([instance[f"normal{k}"][:3] for k in range(3)]).astype(np.float64)
    if np.linalg.det(place[:, :3]) < 0.0:
        raise ValueError("a mesh is mirrored")
    if (rows["color"] != 0xFFFFFFFF).any():
        raise ValueError("a mesh has colors of its own")
    positions = rows["position"] @ place[:, :3].T + place[:, 3]
    normals = rows["normal"] @ turn.T
    if flat:
        a, b, c = positions.reshape(-1, 3, 3).swapaxes(0, 1)
        faces = np.repeat(np.cross(b - a, c - a), 3, axis=0)
        normals = np.where(rows["normal"].any(axis=1, keepdims=True), normals, faces)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return Triangles(positions, normals, rows["uv0"], corners.reshape(-1, 3).astype(np.uint32))
