"""Generators of triangle meshes, in metres, from which scenes are built."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ispm.scene.geodesic import geodesic
from ispm.scene.mesh import Mesh

CREASE = np.radians(35.0)  # profiles that bend by more get a sharp edge
_BOX_CORNERS = np.array([[i & 1, i >> 1 & 1, i >> 2 & 1] for i in range(8)], bool)
_BOX_QUADS = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]]


def polygons(faces: Sequence[np.ndarray], name: str = "") -> Mesh:
    """Return flat convex polygons, each (N, 3) counter-clockwise from outside, as fans of triangles."""
    triangles = []
    first = 0
    for face in faces:
        triangles += [(first, first + k, first + k + 1) for k in range(1, len(face) - 1)]
        first += len(face)
    return Mesh(np.concatenate(faces), np.array(triangles), name=name)


def box(low: Sequence[float], high: Sequence[float], name: str = "") -> Mesh:
    """Return a closed box between two corners, (3,) in m: 12 flat triangles."""
    corners = np.where(_BOX_CORNERS, np.asarray(high, float), np.asarray(low, float))
    quads = np.array(_BOX_QUADS)
    return Mesh(corners, quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3), name=name)


def lathe(profile: Sequence[tuple[float, float]], segments: int, name: str = "") -> Mesh:
    """Turn a profile about the y axis; smooth, but sharp where the profile bends by more than CREASE.

    profile  (K, 2) radius and y, from bottom to top for an outside that faces away from the axis
    ->       2 triangles per segment and step, 1 at a step that begins or ends on the axis
    """
    points = np.asarray(profile, float)
    rows, normals, starts = _profile_rows(points)
    angle = 2.0 * np.pi * np.arange(segments) / segments
    turn = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    positions = np.empty((len(rows), segments, 3))
    directions = np.empty_like(positions)
    for values, out in ((rows, positions), (normals, directions)):
        out[:, :, 0] = values[:, :1] * turn[:, 0]
        out[:, :, 1] = values[:, 1:]
        out[:, :, 2] = values[:, :1] * turn[:, 1]
    here, there = np.arange(segments), np.roll(np.arange(segments), -1)
    triangles = []
    for k, row in enumerate(starts):
        low, high = row * segments, (row + 1) * segments
        if points[k + 1, 0] > 0.0:
            triangles.append(np.stack([low + here, high + here, high + there], axis=1))
        if points[k, 0] > 0.0:
            triangles.append(np.stack([low + here, high + there, low + there], axis=1))
    flat = positions.reshape(-1, 3)
    return Mesh(flat, np.concatenate(triangles), directions.reshape(-1, 3), name=name)


def _profile_rows(points: np.ndarray) -> tuple[np.ndarray, np.ndarray, list[int]]:
    """Rows of a turned profile, their normals, and the row at which each step starts."""
    step = np.diff(points, axis=0)
    normal = np.stack([step[:, 1], -step[:, 0]], axis=1)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    rows, normals, starts = [points[0]], [normal[0]], []
    for k in range(len(step)):
        if k and np.dot(normal[k - 1], normal[k]) >= np.cos(CREASE):
            normals[-1] = normal[k - 1] + normal[k]
            normals[-1] /= np.linalg.norm(normals[-1])
        elif k:
            rows.append(points[k])
            normals.append(normal[k])
        starts.append(len(rows) - 1)
        rows.append(points[k + 1])
        normals.append(normal[k])
    for end in (0, -1):
        if rows[end][0] == 0.0 and abs(normals[end][1]) > 0.5:
            normals[end] = np.array([0.0, np.sign(normals[end][1])])
    return np.array(rows), np.array(normals), starts


def ball(radius: float, segments: int, steps: int, name: str = "") -> Mesh:
    """Return a sphere about the origin cut by meridians and parallels: 2 segments (steps - 1) triangles.

    radius  m
    steps   from pole to pole
    """
    angle = np.linspace(-0.5 * np.pi, 0.5 * np.pi, steps + 1)
    across = radius * np.cos(angle)
    across[[0, -1]] = 0.0  # on the axis exactly
    profile = [(float(x), float(y)) for x, y in zip(across, radius * np.sin(angle), strict=True)]
    return lathe(profile, segments, name)


def tube(path: np.ndarray, radius: float, sides: int, name: str = "") -> Mesh:
    """Return a round tube along a closed curve: 2 triangles per point and side.

    path  (N, 3) points in order, the last one joined to the first
    """
    ahead = np.roll(path, -1, axis=0) - np.roll(path, 1, axis=0)
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    across = carried(ahead)
    # what the frame has turned by after one round is taken back evenly along it
    start, *_, last = across
    end = _across(last, ahead[0])
    lag = np.arctan2(np.cross(start, end) @ ahead[0], start @ end)
    turn = 2.0 * np.pi * np.arange(sides) / sides - lag * np.arange(len(path))[:, None] / len(path)
    other = np.cross(ahead, across)
    out = np.cos(turn)[..., None] * across[:, None] + np.sin(turn)[..., None] * other[:, None]
    k = np.arange(len(path) * sides).reshape(len(path), sides)
    a, b = k, np.roll(k, -1, axis=0)
    c, d = np.roll(b, -1, axis=1), np.roll(a, -1, axis=1)
    triangles = np.stack([a, c, b, a, d, c], axis=-1).reshape(-1, 3)
    return Mesh((path[:, None] + radius * out).reshape(-1, 3), triangles, out.reshape(-1, 3), name=name)


def carried(ahead: np.ndarray) -> np.ndarray:
    """(N, 3) unit vectors across a curve, each turned as little as can be from the one before."""
    across = [_across(np.eye(3)[np.argmin(np.abs(ahead[0]))], ahead[0])]
    for direction in ahead[1:]:
        across.append(_across(across[-1], direction))
    return np.array(across)


def _across(vector: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """The unit vector along the part of `vector` across `direction`."""
    part = vector - direction * (vector @ direction)
    return np.asarray(part / np.linalg.norm(part))


def icosphere(radius: float, segments: int, name: str = "") -> Mesh:
    """Return a sphere about the origin: an icosahedron with edges cut into `segments`, pushed outwards.

    ->  20 segments^2 triangles that share vertices; exact normals
    """
    directions, triangles = geodesic(segments)
    return Mesh(radius * directions, triangles, directions, name=name)


def sheet(points: np.ndarray, name: str = "") -> Mesh:
    """Span a smooth surface over points (R, C, 3); its front is along (next row) x (next column)."""
    rows, columns = points.shape[:2]
    k = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = k[:-1, :-1], k[1:, :-1], k[1:, 1:], k[:-1, 1:]
    triangles = np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)
    return smooth(Mesh(points.reshape(-1, 3), triangles, name=name))


def sweep(profile: Sequence[tuple[float, float]], half_x: float, half_z: float, name: str = "") -> Mesh:
    """Carry a closed profile round a rectangle in the xz plane, with mitred corners: a closed frame.

    profile  (K, 2) offset outwards from the rectangle and y, counter-clockwise
    ->       8 K flat triangles
    """
    offset, y = np.asarray(profile, float).T
    corners = [
        np.stack([sx * (half_x + offset), y, sz * (half_z + offset)], axis=1)
        for sx, sz in ((1, -1), (1, 1), (-1, 1), (-1, -1))
    ]
    k = np.arange(len(y))
    following = np.roll(k, -1)
    triangles = []
    for side in range(4):
        here, there = side * len(y), (side + 1) % 4 * len(y)
        triangles.append(np.stack([here + k, here + following, there + following], axis=1))
        triangles.append(np.stack([here + k, there + following, there + k], axis=1))
    return Mesh(np.concatenate(corners), np.concatenate(triangles), name=name)


def face_normals(mesh: Mesh) -> np.ndarray:
    """Return (T, 3) vectors along the geometric normals, as long as twice the triangles' areas."""
    p = mesh.positions.astype(np.float64)[mesh.triangles]
    return np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])


def smooth(mesh: Mesh) -> Mesh:
    """Return the mesh with vertex normals averaged over the triangles round each vertex, by area."""
    sums = np.zeros((len(mesh.positions), 3))
    for corner in range(3):
        np.add.at(sums, mesh.triangles[:, corner], face_normals(mesh))
    normals = sums / np.linalg.norm(sums, axis=1, keepdims=True)
    return Mesh(mesh.positions, mesh.triangles, normals, colors=mesh.colors, name=mesh.name)


def split(mesh: Mesh) -> Mesh:
    """Return the mesh with three vertices of its own for each triangle; flat unless it has normals."""
    corners = mesh.triangles.ravel()
    if mesh.normals is None:
        n = face_normals(mesh)
        normals = np.repeat(n / np.linalg.norm(n, axis=1, keepdims=True), 3, axis=0)
    else:
        normals = mesh.normals[corners]
    colors = None if mesh.colors is None else mesh.colors[corners]
    triangles = np.arange(len(corners)).reshape(-1, 3)
    return Mesh(mesh.positions[corners], triangles, normals, colors=colors, name=mesh.name)


def paint(mesh: Mesh, colors: np.ndarray) -> Mesh:
    """Return the mesh with a colour for each triangle, (T, 3) linear."""
    result = split(mesh)
    opaque = np.concatenate([colors, np.ones((len(colors), 1))], axis=1)
    result.colors = np.repeat(opaque.astype(np.float32), 3, axis=0)
    return result


def merge(meshes: Sequence[Mesh], name: str = "") -> Mesh:
    """Return the meshes as one; those without normals become flat, those without colours white."""
    parts = [split(mesh) if mesh.normals is None else mesh for mesh in meshes]
    counts = [len(part.positions) for part in parts]
    firsts = np.cumsum([0, *counts[:-1]]).astype(np.uint32)
    colors = None
    if any(part.colors is not None for part in parts):
        white = np.ones((max(counts), 4), np.float32)
        given = [white[: len(p.positions)] if p.colors is None else p.colors for p in parts]
        colors = np.concatenate(given)
    return Mesh(
        np.concatenate([part.positions for part in parts]),
        np.concatenate([part.triangles + first for part, first in zip(parts, firsts, strict=True)]),
        np.concatenate([part.normals for part in parts if part.normals is not None]),
        colors=colors,
        name=name,
    )


def moved(mesh: Mesh, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Mesh:
    """Return the mesh shifted by metres."""
    shifted = mesh.positions + np.array([x, y, z], np.float32)
    return Mesh(shifted, mesh.triangles, mesh.normals, colors=mesh.colors, name=mesh.name)


def turned_inside_out(mesh: Mesh) -> Mesh:
    """Return the mesh with its front sides where its back sides were."""
    normals = None if mesh.normals is None else -mesh.normals
    return Mesh(mesh.positions, mesh.triangles[:, ::-1], normals, colors=mesh.colors, name=mesh.name)
