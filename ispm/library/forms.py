"""Shapes that steelwork, pipes and hulls are made of: prisms, pipes, lofts; copies of them; exact counts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from ispm.library.shapes import carried, face_normals, merge, polygons
from ispm.scene.mesh import Mesh

_ARC = 5  # points of a pipe's bend


def pose(
    x: float = 0.0, y: float = 0.0, z: float = 0.0, yaw: float = 0.0, pitch: float = 0.0, roll: float = 0.0
) -> np.ndarray:
    """Return the (4, 4) matrix that turns about z by `roll`, then x by `pitch`, then y by `yaw`, and moves.

    x, y, z  m;  yaw, pitch, roll  degrees
    """
    result = np.eye(4)
    for angle, (a, b) in ((roll, (0, 1)), (pitch, (1, 2)), (yaw, (2, 0))):
        c, s = math.cos(math.radians(angle)), math.sin(math.radians(angle))
        turn = np.eye(4)
        turn[a, a], turn[a, b], turn[b, a], turn[b, b] = c, -s, s, c
        result = turn @ result
    result[:3, 3] = x, y, z
    return result


def placed(mesh: Mesh, *places: np.ndarray, name: str = "") -> Mesh:
    """Return copies of a mesh as one, at (4, 4) `places` that turn, move and stretch, and do not mirror."""
    stack = np.array(places)
    turns, count = stack[:, :3, :3], len(mesh.positions)
    positions = mesh.positions @ turns.swapaxes(1, 2) + stack[:, None, :3, 3]
    normals = None
    if mesh.normals is not None:
        # normals turn by the inverse transpose
        normals = mesh.normals @ np.linalg.inv(turns)
        normals = (normals / np.linalg.norm(normals, axis=2, keepdims=True)).reshape(-1, 3)
    triangles = mesh.triangles[None].astype(np.int64) + count * np.arange(len(stack))[:, None, None]
    colors = None if mesh.colors is None else np.tile(mesh.colors, (len(stack), 1))
    return Mesh(
        positions.reshape(-1, 3), triangles.reshape(-1, 3), normals, colors=colors, name=name or mesh.name
    )


def prism(outline: Sequence[tuple[float, float]], low: float, high: float, name: str = "") -> Mesh:
    """Return a closed solid of one cross section along z, flat: 4 K - 4 triangles.

    outline    (K, 2) x and y in m, a simple polygon, counter-clockwise seen from +z
    low, high  z of its ends, m
    """
    flat = np.asarray(outline, float)
    count = len(flat)
    ends = [np.column_stack([flat, np.full(count, z)]) for z in (low, high)]
    here = np.arange(count)
    there = np.roll(here, -1)
    sides = [np.stack([here, there, there + count], axis=1), np.stack([here, there + count, here + count], 1)]
    cap = _ears(flat)
    return Mesh(np.concatenate(ends), np.concatenate([*sides, cap[:, ::-1], cap + count]), name=name)


def _ears(flat: np.ndarray) -> np.ndarray:
    """(K - 2, 3) triangles of a simple polygon (K, 2), counter-clockwise, by cutting off ears."""
    left, triangles = list(range(len(flat))), []

    def area(a: int, b: int, c: int) -> float:
        (ax, ay), (bx, by), (cx, cy) = flat[a], flat[b], flat[c]
        return float((bx - ax) * (cy - ay) - (by - ay) * (cx - ax))

    while len(left) > 3:
        for k in range(len(left)):
            a, b, c = left[k - 1], left[k], left[(k + 1) % len(left)]
            others = (p for p in left if p not in (a, b, c))
            if area(a, b, c) > 1e-9 and not any(
                min(area(a, b, p), area(b, c, p), area(c, a, p)) > -1e-9 for p in others
            ):
                triangles.append((a, b, c))
                del left[k]
                break
        else:
            raise ValueError("an outline crosses itself, or is clockwise")
    return np.array([*triangles, tuple(left)])


def beveled_box(low: Sequence[float], high: Sequence[float], bevel: float, name: str = "") -> Mesh:
    """Return a closed box with cut edges, flat: 44 triangles.

    low, high  (3,) its corners, m
    bevel      m, by which edges are cut
    """
    upper, inside, triangles = _bevels()
    corners = np.where(upper, np.asarray(high, float), np.asarray(low, float))
    return Mesh(corners + bevel * np.where(inside, 1.0 - 2.0 * upper, 0.0), triangles, name=name)


@lru_cache(maxsize=1)
def _bevels() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Which of the two corners a beveled box's (24, 3) vertices have, where they are moved inwards, and its
    (44, 3) triangles. Vertex 3 k + axis is that of corner k on the face across `axis`."""
    upper = np.repeat([[k & 1, k >> 1 & 1, k >> 2 & 1] for k in range(8)], 3, axis=0).astype(bool)
    inside = np.tile(~np.eye(3, dtype=bool), (8, 1))
    quads, triangles = [], [[3 * k, 3 * k + 1, 3 * k + 2] for k in range(8)]
    for axis in range(3):
        a, b = 1 << (axis + 1) % 3, 1 << (axis + 2) % 3
        for side in (0, 1):
            quads.append([3 * (k + (side << axis)) + axis for k in (0, a, a + b, b)])
            for other in (0, 1):  # the edge along `axis`, at these sides of the other two
                k = side * a + other * b
                ends = (3 * k, 3 * (k + (1 << axis)))
                one, two = (axis + 1) % 3, (axis + 2) % 3
                quads.append([ends[0] + one, ends[1] + one, ends[1] + two, ends[0] + two])
    triangles += [[q[i] for i in fan] for q in quads for fan in ((0, 1, 2), (0, 2, 3))]
    points = upper + 0.25 * np.where(inside, 1.0 - 2.0 * upper, 0.0) - 0.5
    result = np.array(triangles)
    p = points[result]
    inwards = np.einsum("ij,ij->i", np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), p.mean(axis=1)) < 0.0
    result[inwards] = result[inwards, ::-1]
    return upper, inside, result


def rounded(points: Sequence[Sequence[float]] | np.ndarray, bend: float) -> np.ndarray:
    """Return a polyline (N, 3) with its corners rounded, from `bend` metres before to as far behind them."""
    path = np.asarray(points, float)
    result = [path[:1]]
    t = np.linspace(0.0, 1.0, _ARC)[:, None]
    for before, corner, after in zip(path, path[1:], path[2:], strict=False):
        a = corner + bend * (before - corner) / np.linalg.norm(before - corner)
        b = corner + bend * (after - corner) / np.linalg.norm(after - corner)
        result.append((1.0 - t) ** 2 * a + 2.0 * t * (1.0 - t) * corner + t**2 * b)
    return np.concatenate([*result, path[-1:]])


def pipe(
    points: Sequence[Sequence[float]] | np.ndarray,
    radius: float,
    sides: int,
    bend: float = 0.0,
    name: str = "",
) -> Mesh:
    """Return a round bar along a polyline, smooth, with flat ends: 2 S (P - 1) + 2 (S - 2) triangles.

    points  (N, 3) m; with `bend`, corners are rounded so far before and behind, and P > N points result
    """
    path = rounded(points, bend) if bend else np.asarray(points, float)
    step = np.diff(path, axis=0)
    step /= np.linalg.norm(step, axis=1, keepdims=True)
    ahead = np.concatenate([step[:1], step[:-1] + step[1:], step[-1:]])
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    across = carried(ahead)
    turn = 2.0 * np.pi * np.arange(sides) / sides
    other = np.cross(ahead, across)
    out = np.cos(turn)[:, None] * across[:, None] + np.sin(turn)[:, None] * other[:, None]
    return loft(path[:, None] + radius * out, name)


def loft(rings: np.ndarray, name: str = "") -> Mesh:
    """Return the solid that leads through rings, smooth along its sides, with flat convex ends.

    rings  (R, S, 3) m, each counter-clockwise seen from where the next ones lie
    ->     2 S (R - 1) + 2 (S - 2) triangles
    """
    count, sides = rings.shape[:2]
    k = np.arange(count * sides).reshape(count, sides)
    a, b = k[:-1], k[1:]
    c, d = np.roll(b, -1, axis=1), np.roll(a, -1, axis=1)
    triangles = np.stack([a, c, b, a, d, c], axis=-1).reshape(-1, 3)
    side = averaged(Mesh(rings.reshape(-1, 3), triangles))
    return merge([side, polygons([rings[0][::-1], rings[-1]])], name)


def averaged(mesh: Mesh) -> Mesh:
    """Return the mesh with vertex normals averaged over the triangles round each vertex, by area."""
    flat, count = face_normals(mesh), len(mesh.positions)
    sums = np.stack(
        [
            np.bincount(mesh.triangles.ravel(), np.repeat(flat[:, axis], 3), minlength=count)
            for axis in range(3)
        ],
        axis=1,
    )
    normals = sums / np.linalg.norm(sums, axis=1, keepdims=True)
    return Mesh(mesh.positions, mesh.triangles, normals, colors=mesh.colors, name=mesh.name)


def refined(mesh: Mesh, count: int) -> Mesh:
    """Return the mesh cut into `count` triangles: its longest edges are halved, its surface stays.

    An edge between two triangles adds two, one at a border adds one. Vertices are shared as they were.
    Raises ValueError where it has more, or an odd number is wanted of a mesh without a border.
    """
    positions, triangles = mesh.positions, mesh.triangles.astype(np.int64)
    normals = mesh.normals
    while len(triangles) < count:
        wanted = count - len(triangles)
        edges = np.concatenate([triangles[:, [k, (k + 1) % 3]] for k in range(3)])
        pairs, owner, shared = np.unique(
            np.sort(edges, axis=1), axis=0, return_inverse=True, return_counts=True
        )
        order = np.argsort(owner.ravel(), kind="stable")  # those of one edge side by side
        first = np.cumsum(shared) - shared
        faces = order % len(triangles)
        length = np.linalg.norm(np.diff(positions[pairs].astype(np.float64), axis=1)[:, 0], axis=1)
        if wanted % 2:
            length[shared != 1] = 0.0  # a border edge makes the rest even
        else:
            length[shared != 2] = 0.0
        if not length.any():
            raise ValueError(f"mesh '{mesh.name}' cannot have {count} triangles")
        taken = np.zeros(len(triangles), bool)
        cut: list[tuple[int, np.ndarray]] = []
        budget = 1 if wanted % 2 else wanted // 2
        for edge in np.argsort(-length, kind="stable"):
            own = faces[first[edge] : first[edge] + shared[edge]]
            if len(cut) == budget or length[edge] < 0.5 * length.max():
                break
            if not taken[own].any():
                taken[own] = True
                cut.append((int(edge), own))
        middles = pairs[[edge for edge, _ in cut]]
        new = len(positions) + np.arange(len(cut))
        added = []
        for vertex, ((a, b), (_, own)) in zip(new, zip(middles, cut, strict=True), strict=True):
            for face in own:
                corners = triangles[face].copy()
                other = corners.copy()
                corners[corners == b], other[other == a] = vertex, vertex
                triangles[face] = corners
                added.append(other)
        triangles = np.concatenate([triangles, np.array(added)])
        positions = np.concatenate([positions, positions[middles].mean(axis=1)])
        if normals is not None:
            between = normals[middles].sum(axis=1)
            between /= np.linalg.norm(between, axis=1, keepdims=True)
            normals = np.concatenate([normals, between])
    if len(triangles) != count:
        raise ValueError(f"mesh '{mesh.name}' has more than {count} triangles")
    return Mesh(positions, triangles, normals, name=mesh.name)


def unwrapped(mesh: Mesh, metres: float) -> Mesh:
    """Return the mesh with uv0 along the two axes that each triangle lies closest to; v points down walls.

    metres  that the picture spans before it repeats
    """
    side = np.abs(face_normals(mesh)).argmax(axis=1)
    corners = mesh.triangles.astype(np.int64)
    kept, numbers = np.unique(3 * corners + side[:, None], return_inverse=True)
    vertex, axis = kept // 3, kept % 3
    x, y, z = mesh.positions[vertex].T
    uv = np.stack([np.where(axis == 0, z, x), np.where(axis == 1, z, -y)], axis=1) / metres
    normals = None if mesh.normals is None else mesh.normals[vertex]
    colors = None if mesh.colors is None else mesh.colors[vertex]
    return Mesh(
        mesh.positions[vertex], numbers.reshape(-1, 3), normals, uv0=uv, colors=colors, name=mesh.name
    )
