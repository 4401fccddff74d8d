"""Scenes and rays for the tests of the tracer."""

import numpy as np

from ispm.scene.mesh import Mesh
from ispm.scene.scene import Scene


def grid(place, columns, rows):
    """(positions, triangles) of a surface place(u, v) over the unit square."""
    u, v = np.meshgrid(np.linspace(0, 1, columns + 1), np.linspace(0, 1, rows + 1), indexing="ij")
    positions = np.stack(np.broadcast_arrays(*place(u, v)), axis=-1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(columns), np.arange(rows), indexing="ij")
    a = (i * (rows + 1) + j).ravel()
    b = a + rows + 1
    return positions, np.concatenate([np.stack([a, b, b + 1], 1), np.stack([a, b + 1, a + 1], 1)])


def merged(parts):
    """One mesh of (positions, triangles) pairs."""
    starts = np.cumsum([0, *(len(p) for p, _ in parts)])
    return Mesh(
        np.concatenate([p for p, _ in parts]),
        np.concatenate([t + start for (_, t), start in zip(parts, starts, strict=False)]),
    )


def shell(size, columns, rows):
    """The six faces of a box from 0 to `size`."""
    parts = []
    for axis in range(3):
        for side in (0.0, 1.0):

            def face(u, v, axis=axis, side=side):
                point = [None] * 3
                point[axis], point[(axis + 1) % 3], point[(axis + 2) % 3] = side + 0 * u, u, v
                return [p * s for p, s in zip(point, size, strict=True)]

            parts.append(grid(face, columns, rows))
    return parts


def hall():
    """A closed hall of 76,400 triangles: columns, drapery, beams askew, scattered leaves."""
    rng = np.random.default_rng(1)
    size = np.array([30.0, 12.0, 14.0])
    parts = []
    for x in np.linspace(2, 28, 9):
        for z in (4.0, 10.0):
            parts.append(grid(lambda u, v, x=x, z=z: _column(u, v, x, z), 48, 20))
            parts.append(grid(lambda u, v, x=x, z=z: _drapery(u, v, x, z), 40, 20))
    for x, slope in zip(rng.uniform(3, 27, 30), rng.uniform(-0.1, 0.1, 30), strict=True):
        parts.append(
            grid(lambda u, v, x=x, s=slope: (
                x + s * (u - 0.5) * 14 + 0.07 * np.cos(6.28319 * v),
                10.5 + np.sin(3.14159 * u) + 0.07 * np.sin(6.28319 * v), 14 * u,
            ), 6, 6)
        )  # fmt: skip
    leaves = rng.uniform([1, 5, 3], [29, 8, 11], (8000, 1, 3)) + rng.normal(0, 0.06, (8000, 3, 3))
    parts.append((leaves.reshape(-1, 3), np.arange(24000).reshape(-1, 3)))
    parts = [(np.clip(p, 0.01, size - 0.01), t) for p, t in parts]
    return merged(shell(size, 20, 12) + parts)


def _column(u, v, x, z):
    r = 0.35 * (1 + 0.05 * np.cos(100.53096 * u)) * (1 + 0.3 * (v > 0.93) + 0.3 * (v < 0.06))
    return x + r * np.cos(6.28319 * u), 9 * v, z + r * np.sin(6.28319 * u)


def _drapery(u, v, x, z):
    return x + 0.5 + 2 * u, 8 - 4 * v, z + 0.2 * np.sin(18 * u + x) * (0.3 + v)


def blob(columns=32, rows=16):
    """A lumpy ball of radius about 1."""

    def place(u, v):
        a, b = 2 * np.pi * u, np.pi * v
        r = 1 + 0.2 * np.sin(3 * a + 1) * np.sin(4 * b) + 0.1 * np.sin(7 * a) * np.sin(5 * b)
        return r * np.sin(b) * np.cos(a), r * np.cos(b), r * np.sin(b) * np.sin(a)

    return merged([grid(place, columns, rows)])


def crowd(count=1000):
    """A closed box of 30 x 12 x 14 m with turned and unevenly scaled balls in it."""
    rng = np.random.default_rng(5)
    scene, ball = Scene(), blob()
    scene.add(merged(shell(np.array([30.0, 12.0, 14.0]), 8, 8)))
    for _ in range(count):
        scene.add(
            ball, translation=rng.uniform(1, [29, 11, 13]), rotation=rng.normal(size=4),
            scale=rng.uniform(0.1, 0.6, 3),
        )  # fmt: skip
    return scene


def rays_inside(count, low, high, seed):
    """Origins spread evenly in a box, directions over the sphere."""
    rng = np.random.default_rng(seed)
    directions = rng.normal(size=(count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return rng.uniform(low, high, (count, 3)).astype(np.float32), directions.astype(np.float32)


def corners_of(packed, hits):
    """(N, 3, 3) float64 corners in world space of the triangles hit."""
    rows = packed.instances[hits["instance"]]
    first = rows["first_index"].astype(np.int64) + 3 * hits["primitive"].astype(np.int64)
    vertices = packed.geometry.indices[first[:, None] + np.arange(3)]
    local = packed.geometry.vertices["position"][vertices].astype(np.float64)
    matrix = np.stack([rows["world0"], rows["world1"], rows["world2"]], axis=1).astype(np.float64)
    return np.einsum("nij,nkj->nki", matrix[:, :, :3], local) + matrix[:, None, :, 3]


def intersect64(origins, directions, corners):
    """Moeller-Trumbore in float64: t, the least barycentric coordinate, cosine at the surface."""
    o, d = origins.astype(np.float64), directions.astype(np.float64)
    e1, e2 = corners[..., 1, :] - corners[..., 0, :], corners[..., 2, :] - corners[..., 0, :]
    normal = np.cross(e1, e2)
    p = np.cross(d, e2)
    det = np.sum(e1 * p, axis=-1)
    s = o - corners[..., 0, :]
    q = np.cross(s, e1)
    with np.errstate(divide="ignore", invalid="ignore"):
        u, v = np.sum(s * p, axis=-1) / det, np.sum(d * q, axis=-1) / det
        t = np.sum(e2 * q, axis=-1) / det
        cosine = det / (np.linalg.norm(normal, axis=-1) * np.linalg.norm(d, axis=-1))
    return t, np.minimum(np.minimum(u, v), 1 - u - v), np.abs(cosine)
