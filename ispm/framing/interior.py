"""Whether a scene is a room, to be shown from inside, or an object, to be shown from outside."""

from __future__ import annotations

import math

import numpy as np

from ispm.accel.world import World
from ispm.optics.records import NO_HIT
from ispm.scene.directions import even_directions
from ispm.scene.packed import Packed

_GRID = 5  # points along each side of the bounds
_PROBES = 128  # rays from each
# Between rooms and objects; behind each, what rooms of the test assets have at least and objects at most.
_SEEN = 0.24  # share of the bounds' volume seen from one point: 0.29; 0.20 of objects that pass _REACH
_REACH = 0.5  # mean share of the distance to the bounds that rays go: 0.58; 0.38 of objects that pass _SEEN
_ENCLOSED = 0.4  # share of enclosed points: 0.57 of most rooms; 0.19
_LEVEL = 500.0  # m3 seen from one point of a level without a roof: 960; 32 of objects that show backs outside
_R3 = np.array([0.8191725, 0.6710436, 0.5497005])  # Roberts 2018: evenly spread points


def interior_viewpoint(packed: Packed, world: World) -> np.ndarray | None:
    """Return a point (3,) near the middle of a room, in m; None for an object, to be seen from outside.

    A point is enclosed where most rays from it meet front faces. In a room most points are, or one of them
    sees much of the bounds; inside a shoe neither holds. A level under an open sky is recognised by its size
    and by its walls, which show their backs to the outside.
    """
    low, high = packed.bounds
    steps = (np.arange(_GRID) + 0.5) / _GRID
    points = np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), axis=-1).reshape(-1, 3)
    points = low + points * (high - low)
    enclosed, volume, reach = _surroundings(packed, world, points)
    if not enclosed.any():
        return None
    most = float(volume[enclosed].max())
    wide = most >= _SEEN * np.prod(high - low) and float(reach[enclosed].max()) >= _REACH
    level = most >= _LEVEL and _shows_backs(packed, world)
    if not (wide or level or enclosed.mean() >= _ENCLOSED):
        return None
    fit = points[enclosed & (volume >= 0.8 * most)]
    away = np.linalg.norm((fit - (low + high) / 2.0) / np.maximum(high - low, 1e-9), axis=1)
    return np.asarray(fit[away.argmin()])


def _surroundings(
    packed: Packed, world: World, points: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return of each of (n, 3) points, (n,) each: whether it is enclosed, the volume in m3 seen from it, and
    the mean share of the distance to the bounds that its rays go; rays that meet nothing count as 0."""
    origins = np.repeat(points, _PROBES, axis=0)
    directions = np.tile(even_directions(_PROBES), (len(points), 1))
    front, back, t = _facing(packed, world, origins, directions)
    met = front | back
    t = np.where(met, t, 0.0).astype(np.float64)
    low, high = packed.bounds
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = np.fmin.reduce(np.where(directions > 0.0, high - origins, low - origins) / directions, axis=1)
    reach = np.clip(t / np.maximum(ends, 1e-30), 0.0, 1.0)
    shape = len(points), _PROBES
    hits = met.reshape(shape).sum(axis=1)
    enclosed = (hits > 0.8 * _PROBES) & (front.reshape(shape).sum(axis=1) > 0.6 * hits)
    volume = 4.0 / 3.0 * math.pi * (t.reshape(shape) ** 3).mean(axis=1)
    return enclosed, volume, reach.reshape(shape).mean(axis=1)


def _shows_backs(packed: Packed, world: World) -> bool:
    """Whether rays from all around into the scene meet many backs of faces."""
    low, high = packed.bounds
    outside = even_directions(512).astype(np.float64)
    k = np.arange(len(outside))[:, None]
    targets = low + (0.5 + k * _R3) % 1.0 * (high - low)
    origins = (low + high) / 2.0 + outside * packed.diagonal
    directions = targets - origins
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    front, back, _ = _facing(packed, world, origins, directions)
    return bool(back.sum() > 0.4 * (front | back).sum())


def _facing(
    packed: Packed, world: World, origins: np.ndarray, directions: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return of each of (n, 3) rays whether it meets a front face, whether a back face, and where, in m."""
    hits = world.trace(origins.astype(np.float32), directions.astype(np.float32))
    hit = hits["instance"] != NO_HIT
    rows = packed.instances[hits["instance"][hit]]
    first = rows["first_index"].astype(np.int64) + 3 * hits["primitive"][hit]
    corners = [packed.geometry.vertices["position"][packed.geometry.indices[first + k]] for k in range(3)]
    flat = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    matrix = np.stack([rows[f"normal{k}"][:, :3] for k in range(3)], axis=1)
    normals = np.einsum("nij,nj->ni", matrix, flat)
    front = np.zeros(len(hits), bool)
    front[hit] = np.einsum("ni,ni->n", normals, directions[hit]) < 0.0
    return front, hit & ~front, hits["t"]
