"""An elephant with its trunk raised: rounded solids that melt into one smooth closed surface."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from ispm.library.forms import averaged, refined
from ispm.library.shapes import face_normals
from ispm.scene.mesh import Mesh

Point = tuple[float, float, float]

TRIANGLES = 138_902


class _Bone(NamedTuple):
    """A cone with round ends, radii a and b at its ends, all in m; it melts into the others over `blend`."""

    start: Point
    end: Point
    a: float
    b: float
    blend: float = 0.06


class _Egg(NamedTuple):
    """An ellipsoid about a middle with half axes, turned about x, then about y (degrees); with
    `plate`, half its thickness in m, the ellipse of the first two half axes with a round rim."""

    middle: Point
    axes: Point
    tilt: float = 0.0
    turn: float = 0.0
    blend: float = 0.08
    plate: float = 0.0


def _limbs() -> list[_Bone]:
    """Legs, feet, trunk, tusks and tail. The elephant looks along +x and is 2 m high at the shoulder."""
    bones = []
    for x, z, step in ((0.62, 0.30, 0.10), (0.54, -0.30, -0.12), (-0.72, 0.30, -0.10), (-0.62, -0.30, 0.12)):
        knee, foot = (x + 0.4 * step, 0.55, z), (x + step, 0.12, z)
        bones += [_Bone((x, 1.10, 0.92 * z), knee, 0.27, 0.175, 0.10), _Bone(knee, foot, 0.17, 0.15)]
        bones.append(_Bone((foot[0] + 0.03, 0.07, z), (foot[0] + 0.05, 0.05, z), 0.185, 0.19, 0.05))
    trunk = [
        (1.42, 1.66, 0.0),
        (1.66, 1.42, 0.0),
        (1.87, 1.30, 0.02),
        (2.08, 1.38, 0.05),
        (2.20, 1.60, 0.07),
        (2.20, 1.86, 0.07),
        (2.10, 2.08, 0.05),
        (1.95, 2.20, 0.02),
    ]
    radii = [0.23, 0.19, 0.155, 0.13, 0.112, 0.095, 0.08, 0.068]
    bones += [_Bone(a, b, r, s, 0.05) for a, b, r, s in zip(trunk, trunk[1:], radii, radii[1:], strict=False)]
    for s in (-1.0, 1.0):
        tusk = [
            (1.44, 1.50, 0.18 * s),
            (1.62, 1.24, 0.32 * s),
            (1.86, 1.12, 0.40 * s),
            (2.06, 1.16, 0.43 * s),
        ]
        bones += [
            _Bone(a, b, r, t, 0.07)
            for a, b, r, t in zip(tusk, tusk[1:], (0.066, 0.060, 0.050), (0.060, 0.050, 0.034), strict=False)
        ]
    tail = [(-1.12, 1.42, 0.0), (-1.28, 1.20, 0.02), (-1.34, 0.92, 0.04), (-1.30, 0.72, 0.05)]
    bones += [
        _Bone(a, b, r, t, 0.04)
        for a, b, r, t in zip(tail, tail[1:], (0.075, 0.05, 0.042), (0.05, 0.042, 0.06), strict=False)
    ]
    return bones


_EGGS = [
    _Egg((-0.08, 1.36, 0.0), (1.06, 0.64, 0.56), blend=0.12),  # the barrel
    _Egg((0.62, 1.44, 0.0), (0.52, 0.60, 0.47), blend=0.14),  # the shoulders
    _Egg((-0.72, 1.36, 0.0), (0.50, 0.58, 0.48), blend=0.14),  # the hips
    _Egg((1.22, 1.82, 0.0), (0.37, 0.42, 0.33), blend=0.14),  # the head
    _Egg((1.26, 2.10, 0.13), (0.17, 0.14, 0.15), blend=0.12),  # its two domes
    _Egg((1.26, 2.10, -0.13), (0.17, 0.14, 0.15), blend=0.12),
    _Egg((1.34, 1.44, 0.0), (0.26, 0.20, 0.18), blend=0.12),  # the jaw
    _Egg((1.00, 1.72, 0.56), (0.36, 0.50, 0.0), -16.0, 28.0, 0.08, 0.055),  # the ears
    _Egg((1.00, 1.72, -0.56), (0.36, 0.50, 0.0), 16.0, -28.0, 0.08, 0.055),
]
_LOW, _HIGH = np.array([-1.46, -0.04, -0.92]), np.array([2.42, 2.40, 0.92])


@lru_cache(maxsize=2)
def _elephant(triangles: int) -> Mesh:
    """The mesh that `elephant` returns copies of: of a grid that gives no more triangles, refined."""
    # m; as it grows a little, thin places come to lie well in the grid
    cell = 0.0199 * (TRIANGLES / triangles) ** 0.5
    mesh = _surface(cell)
    while len(mesh.triangles) > triangles or not _is_sound(mesh):
        cell *= 1.0005
        mesh = _surface(cell)
    return averaged(refined(mesh, triangles))


def elephant(triangles: int = TRIANGLES) -> Mesh:
    """Return an elephant, standing on y = 0 and looking along +x; closed and smooth.

    triangles  how many it has; an even number
    """
    made = _elephant(triangles)
    return Mesh(made.positions, made.triangles, made.normals, name="elephant")


def _is_sound(mesh: Mesh) -> bool:
    """Whether each edge is that of two triangles, and each vertex's normal on the front of those round it."""
    edges = np.sort(np.concatenate([mesh.triangles[:, [k, (k + 1) % 3]] for k in range(3)]), axis=1)
    keys = edges[:, 0].astype(np.int64) * len(mesh.positions) + edges[:, 1]
    if (np.unique(keys, return_counts=True)[1] != 2).any():
        return False
    smooth = averaged(mesh)
    assert smooth.normals is not None  # averaged makes them
    facing = np.einsum("tcj,tj->tc", smooth.normals[mesh.triangles], face_normals(mesh))
    return bool((facing > 0.0).all())


def _surface(cell: float) -> Mesh:
    """The surface where the distance is 0: one vertex in each cell that it crosses, one quad at each edge;
    `cell` in m. Source: Gibson, "Constrained elastic surface nets", 1998."""
    shape = np.ceil((_HIGH - _LOW) / cell).astype(int) + 1
    field = _distance(shape, cell)
    inside = field < 0.0
    crossed = np.zeros(tuple(shape - 1), bool)
    total = np.zeros((*crossed.shape,), np.int8)
    for i in (0, 1):
        for j in (0, 1):
            for k in (0, 1):
                total += inside[i : i + shape[0] - 1, j : j + shape[1] - 1, k : k + shape[2] - 1]
    crossed = (total > 0) & (total < 8)
    cells = np.argwhere(crossed)
    number = np.full(crossed.shape, -1)
    number[crossed] = np.arange(len(cells))
    # the mean of where the surface cuts the edges of the cell
    sums, met = np.zeros((len(cells), 3)), np.zeros(len(cells))
    for axis in range(3):
        for i in (0, 1):
            for j in (0, 1):
                corner = np.insert([i, j], axis, 0)
                a = field[tuple((cells + corner).T)].astype(np.float64)
                b = field[tuple((cells + corner + np.eye(3, dtype=int)[axis]).T)].astype(np.float64)
                cut = (a < 0.0) != (b < 0.0)
                t = np.where(cut, a / np.where(cut, a - b, 1.0), 0.0)
                sums[cut] += corner
                sums[:, axis] += t
                met += cut
    positions = _LOW + cell * (cells + sums / met[:, None])
    quads = []
    for axis in range(3):
        b, c = (axis + 1) % 3, (axis + 2) % 3
        one = np.eye(3, dtype=int)
        first = np.swapaxes(inside, 0, axis)[:-1]
        other = np.swapaxes(inside, 0, axis)[1:]
        edges = np.argwhere(np.swapaxes(first != other, 0, axis))
        around = [edges - one[b] - one[c], edges - one[c], edges, edges - one[b]]
        corners = np.stack([number[tuple(p.T)] for p in around], axis=1)
        flip = ~inside[tuple(edges.T)]
        corners[flip] = corners[flip, ::-1]
        quads.append(corners)
    q = np.concatenate(quads)
    return _evened(Mesh(positions, np.concatenate([q[:, [0, 1, 2]], q[:, [0, 2, 3]]])))


def _evened(mesh: Mesh) -> Mesh:
    """The mesh with its vertices drawn towards the means of their neighbours and back a little: steps of the
    grid go, the size stays (Taubin, "A signal processing approach to fair surface design", 1995)."""
    count = len(mesh.positions)
    start = mesh.triangles.astype(np.int64)
    ends = np.roll(start, -1, axis=1)
    positions = mesh.positions.astype(np.float64)
    met = np.bincount(start.ravel(), minlength=count)[:, None]
    for share in (0.60, -0.62) * 4:
        sums = np.stack(
            [np.bincount(start.ravel(), positions[ends.ravel(), a], minlength=count) for a in range(3)],
            axis=1,
        )
        positions += share * (sums / met - positions)
    return Mesh(positions, mesh.triangles)


def _distance(shape: np.ndarray, cell: float) -> np.ndarray:
    """(X, Y, Z) float32 m from the surface, negative within; exact only near it."""
    field = np.full(tuple(shape), 1.0, np.float32)
    solids: list[_Egg | _Bone] = [*_EGGS, *_limbs()]
    for solid in solids:
        if isinstance(solid, _Egg):
            low = np.array(solid.middle) - max(solid.axes)
            high = np.array(solid.middle) + max(solid.axes)
        else:
            ends, reach = np.array([solid.start, solid.end]), max(solid.a, solid.b)
            low, high = ends.min(axis=0) - reach, ends.max(axis=0) + reach
        margin = 2.0 * solid.blend + 2.0 * cell
        first = np.clip(np.floor((low - margin - _LOW) / cell).astype(int), 0, shape)
        last = np.clip(np.ceil((high + margin - _LOW) / cell).astype(int), 0, shape)
        axes = [(_LOW[a] + cell * np.arange(first[a], last[a])).astype(np.float32) for a in range(3)]
        x, y, z = np.meshgrid(*axes, indexing="ij", sparse=True)
        own = field[first[0] : last[0], first[1] : last[1], first[2] : last[2]]
        d = _to_egg(solid, x, y, z) if isinstance(solid, _Egg) else _to_bone(solid, x, y, z)
        # a minimum that is rounded where the two are within `blend` of each other (Quilez)
        near = np.maximum(solid.blend - np.abs(own - d), 0.0)
        np.minimum(own, d, out=own)
        own -= near * near * np.float32(0.25 / solid.blend)
    below = (-_LOW[1] - cell * np.arange(shape[1])).astype(np.float32)  # of the ground, which cuts the feet
    return np.asarray(np.maximum(field, below[None, :, None]))


def _to_egg(egg: _Egg, x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Distance from an ellipsoid, to first order."""
    a, b = np.radians([egg.tilt, egg.turn])
    u, v, w = (p - np.float32(c) for p, c in zip((x, y, z), egg.middle, strict=True))
    u, w = np.cos(b) * u - np.sin(b) * w, np.sin(b) * u + np.cos(b) * w
    v, w = np.cos(a) * v + np.sin(a) * w, np.cos(a) * w - np.sin(a) * v
    if egg.plate:
        p, q, r = np.float32(1.0 / egg.axes[0]), np.float32(1.0 / egg.axes[1]), np.float32(0.0)
    else:
        p, q, r = (np.float32(1.0 / axis) for axis in egg.axes)
    length = np.sqrt((u * p) ** 2 + (v * q) ** 2 + (w * r) ** 2)
    slope = np.sqrt((u * p * p) ** 2 + (v * q * q) ** 2 + (w * r * r) ** 2)
    away = length * (length - 1.0) / np.maximum(slope, 1e-4)
    if egg.plate:
        away = np.hypot(np.maximum(away, 0.0), w) - egg.plate
    return np.asarray(away, np.float32)


def _to_bone(bone: _Bone, x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Distance from a cone with round ends, as from a ball that shrinks along it."""
    start, along = np.array(bone.start), np.array(bone.end) - np.array(bone.start)
    u, v, w = (p - np.float32(c) for p, c in zip((x, y, z), start, strict=True))
    ax, ay, az = (np.float32(c) for c in along)
    t = np.clip((u * ax + v * ay + w * az) / np.float32(along @ along), 0.0, 1.0)
    gap = np.sqrt((u - t * ax) ** 2 + (v - t * ay) ** 2 + (w - t * az) ** 2)
    return np.asarray(gap - (bone.a + (bone.b - bone.a) * t), np.float32)
