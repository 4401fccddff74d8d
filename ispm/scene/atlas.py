"""Where the shadow maps of all lights lie in one texture, and how many texels each has.

A light's `LightMap` says which faces it looks through. Here each face that sees something gets a square tile,
the larger the more of the picture its light fills, and a window: all of the face, or, where a light has one
face alone, as much of it as holds what the eye sees.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ispm.optics import records
from ispm.scene.lightmap import LightMap, corners_of

GUARD = 2  # texels round a tile's window, for the filter of its outermost points
LEAST = 32  # texels of a tile's side, a multiple of STEP
STEP = 16

_BUDGET = 24  # tiles of the asked resolution that all lights share: four cubes
_FAINT = 1.0 / 256.0  # of what is usual: a light reaches as far as it is brighter than that
_MARGIN = 0.02  # of a window, for pixels between the receivers it is fitted to
_SAMPLES = 2048  # receivers that lights are judged by


@dataclass(frozen=True, eq=False)
class ShadowFace:
    """One view of a light, as its shadow map holds it.

    light     row of the lights;  index  of its map's faces
    origin    (3,) m, world space
    frame     (3, 3) unit rows right, down, forward
    window    (2, 2) low and high corner of what the tile shows, in tangents right and down of forward;
              orthographic: in m
    depth     m before and behind the origin that an orthographic view holds; 0: a perspective one
    range     m from the origin beyond which the light ends
    weight    1; 0 where the light shines on nothing there that the eye sees
    """

    light: int
    index: int
    origin: np.ndarray
    frame: np.ndarray
    window: np.ndarray
    depth: float
    range: float
    weight: float

    def holds(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return where (n, 3) world-space points lie in the window's units, (2, n), and (n,) whether that
        is in the window."""
        frame = self.frame.astype(np.float32)
        local = frame @ (points - self.origin.astype(np.float32)).T
        at = local[:2] if self.depth else local[:2] / np.maximum(local[2], np.float32(1e-30))
        low, high = self.window.astype(np.float32)[..., None]
        return at, ((at >= low) & (at <= high)).all(axis=0)

    def sees(self, boxes: np.ndarray) -> np.ndarray:
        """Return (n,) whether (n, 2, 3) world-space boxes may be in the window, within the light's range."""
        right, down, ahead = np.moveaxis((corners_of(boxes) - self.origin) @ self.frame.T, -1, 0)
        edge = np.ones_like(ahead) if self.depth else ahead
        (left, top), (far, bottom) = self.window
        sides = (edge, right - left * edge, far * edge - right, down - top * edge, bottom * edge - down)
        outside = np.any([(side < 0.0).all(axis=1) for side in sides], axis=0)
        nearest = np.clip(self.origin, boxes[:, 0], boxes[:, 1]) - self.origin
        return np.asarray(~outside & (np.linalg.norm(nearest, axis=1) <= self.range))


@dataclass(frozen=True, eq=False)
class ShadowTile:
    """Where a face lies in the atlas.

    seen    rows of the boxes that it may see
    corner  texels: its upper left;  side  texels
    """

    face: ShadowFace
    seen: np.ndarray
    corner: tuple[int, int]
    side: int


@dataclass(frozen=True, eq=False)
class ShadowAtlas:
    """The tiles of all faces that see something, largest first; size: width and height that hold them."""

    tiles: list[ShadowTile]
    size: tuple[int, int]


def plan_atlas(
    lights: np.ndarray,
    maps: Sequence[LightMap],
    boxes: np.ndarray,
    receivers: np.ndarray,
    eye: np.ndarray,
    resolution: int,
    limit: int,
) -> ShadowAtlas | None:
    """Return the atlas of a frame, None where even the least tiles do not fit.

    lights      (L,) LIGHT;  maps  one for each
    boxes       (n, 2, 3) bounds of what casts shadows, world space
    receivers   (m, 3) points that the eye sees, world space
    eye         (4,) where the eye is and 1, or the direction towards it and 0 (orthographic)
    resolution  texels of a tile's side at most;  limit  of the texture's
    """
    samples = receivers[:: max(len(receivers) // _SAMPLES, 1)]
    irradiance = brightness(lights, samples)
    weights = apparent_sizes(lights, irradiance, eye)
    views: list[tuple[ShadowFace, np.ndarray]] = [
        (face, rows)
        for map in maps
        if lights[map.light]["intensity"].any()
        for face in _faces(map, lights[map.light], receivers, samples[irradiance[map.light] > 0.0])
        if len(rows := np.flatnonzero(face.sees(boxes)))
    ]
    wanted = np.array([face.weight * weights[face.light] for face, _ in views])
    budget = _BUDGET * resolution**2
    while True:
        sides = tile_sides(wanted, resolution, budget)
        order = np.argsort(-sides, kind="stable")
        places, size = pack_shelves(sides[order], limit)
        if max(size) <= limit:
            tiles = [
                ShadowTile(views[i][0], views[i][1], (int(place[0]), int(place[1])), int(sides[i]))
                for i, place in zip(order, places, strict=True)
            ]
            return ShadowAtlas(tiles, size)
        if (sides == LEAST).all():
            return None
        budget = budget * 3 // 4


def brightness(lights: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return (L, n) lx of the brightest channel that lights bring to points that face them, shadows aside."""
    peak = lights["intensity"].max(axis=1).astype(np.float64)[:, None]
    way = points - lights["position"].astype(np.float64)[:, None]
    square = np.maximum(np.einsum("lnk,lnk->ln", way, way), 1e-30)
    cosine = np.einsum("lnk,lk->ln", way, lights["direction"].astype(np.float64)) / np.sqrt(square)
    edge = np.clip(cosine * lights["cone_scale"][:, None] + lights["cone_offset"][:, None], 0.0, 1.0)
    reach = np.where(lights["range"] > 0.0, lights["range"], np.inf).astype(np.float64)[:, None]
    near = edge * edge * np.clip(1.0 - (square / reach**2) ** 2, 0.0, 1.0) / square
    return np.asarray(peak * np.where((lights["kind"] == records.LIGHT_DIRECTIONAL)[:, None], 1.0, near))


def apparent_sizes(lights: np.ndarray, irradiance: np.ndarray, eye: np.ndarray) -> np.ndarray:
    """Return (L,) how much of the picture's width what each light reaches may fill, 0 to 1.

    irradiance  (L, n) of `brightness`, at what the eye sees

    A light reaches to its range, or to where it is faint beside what the points seen usually have from
    their brightest light. Then it is as large as reach / distance; 1 within reach.
    """
    usual = float(np.median(irradiance.max(axis=0))) if irradiance.size else 0.0
    peak = lights["intensity"].max(axis=1).astype(np.float64)
    reach = np.sqrt(peak / (_FAINT * usual)) if usual > 0.0 else np.full(len(lights), np.inf)
    reach = np.where(lights["range"] > 0.0, np.minimum(reach, lights["range"]), reach)
    distance = np.linalg.norm(lights["position"].astype(np.float64) - eye[:3], axis=1) * (eye[3] > 0.0)
    everywhere = (lights["kind"] == records.LIGHT_DIRECTIONAL) | (reach >= distance)
    return np.where(everywhere, 1.0, reach / np.maximum(distance, 1e-30))


def tile_sides(weights: np.ndarray, resolution: int, budget: float) -> np.ndarray:
    """Return the texels of the tiles' sides: the resolution times the weight, all less where the budget asks.

    Multiples of 16, at least 32, at most `resolution`; their squares sum to at most the budget, unless
    the least tiles alone take more.
    """

    def sides(share: float) -> np.ndarray:
        wanted = np.asarray(np.minimum(share * weights, 1.0) * resolution).astype(np.int64)
        return np.maximum(wanted // STEP * STEP, LEAST)

    if (sides(1.0) ** 2).sum() <= budget:
        return sides(1.0)
    low, high = 0.0, 1.0
    for _ in range(16):
        middle = (low + high) / 2.0
        low, high = (middle, high) if (sides(middle) ** 2).sum() <= budget else (low, middle)
    return sides(low)


def pack_shelves(sides: np.ndarray, limit: int) -> tuple[np.ndarray, tuple[int, int]]:
    """Return (n, 2) places of squares, largest first, in rows of a nearly square texture, and its size."""
    if not len(sides):
        return np.zeros((0, 2), np.int64), (STEP, STEP)
    area = float((sides.astype(np.float64) ** 2).sum())
    width = min(max(math.ceil(math.sqrt(area) / STEP) * STEP, int(sides[0])), limit)
    places = np.zeros((len(sides), 2), np.int64)
    x = y = height = 0
    for i, side in enumerate(sides):
        if x + side > width:
            x, y, height = 0, y + height, 0
        places[i] = x, y
        x, height = x + int(side), max(height, int(side))
    return places, (width, y + height)


def _faces(map: LightMap, light: np.void, receivers: np.ndarray, lit: np.ndarray) -> list[ShadowFace]:
    """The faces of a light's map that it shines through; `lit`: receivers that it may shine on."""
    cube = len(map.axes) == 6
    ways = lit - map.origin
    largest = np.abs(ways).argmax(axis=1)
    used = set((2 * largest + (np.take_along_axis(ways, largest[:, None], 1)[:, 0] < 0.0)).tolist())
    faces = []
    for index, rows in enumerate(map.axes):
        lengths = np.linalg.norm(rows, axis=1)
        half = 1.0 / lengths[:2]
        depth = 1.0 / float(lengths[2]) if map.orthographic else 0.0
        window, frame = np.stack([-half, half]), rows / lengths[:, None]
        weight = float(index in used) if cube else 1.0
        face = ShadowFace(map.light, index, map.origin, frame, window, depth, map.range, weight)
        if not (cube and _is_dark(light, frame[2])):
            faces.append(face if cube else _fitted(face, receivers))
    return faces


def _fitted(face: ShadowFace, receivers: np.ndarray) -> ShadowFace:
    """The face with its window narrowed to the receivers in it."""
    at, inside = face.holds(receivers)
    at = at[:, inside]
    if not at.size:
        return replace(face, weight=0.0)
    low, high = face.window
    corners = np.stack([at.min(axis=1), at.max(axis=1)])
    margin = np.maximum(_MARGIN * (corners[1] - corners[0]), 1e-3 * (high - low))
    return replace(face, window=np.clip(corners + np.stack([-margin, margin]), low, high))


def _is_dark(light: np.void, forward: np.ndarray) -> bool:
    """Whether a spot's cone leaves out a face of the cube, all within 54.7 degrees of `forward`."""
    if light["kind"] != records.LIGHT_SPOT:
        return False
    outer = math.acos(min(max(float(-light["cone_offset"] / light["cone_scale"]), -1.0), 1.0))
    away = math.acos(min(max(float(light["direction"].astype(np.float64) @ forward), -1.0), 1.0))
    return away > outer + math.acos(1.0 / math.sqrt(3.0))
