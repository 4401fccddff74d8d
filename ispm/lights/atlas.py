"""Where the shadow maps of all lights lie in one texture, and how many texels each has.

A light's `LightMap` has faces. Here each face that sees something gets a window, the part of it that holds
what the light brings to the eye, and a tile, the finer the more of the picture it serves.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ispm.lights.lightmap import LightMap
from ispm.optics import records

GUARD = 2  # texels round a tile's window, for the filter of its outermost points
LEAST = 32  # texels of a tile's side, a multiple of STEP
STEP = 16

_BUDGET = 12  # squares of the asked resolution that all lights share: two cubes
_FINEST = 1.0  # texels across a pixel, in the mean over a window: beyond that rays resolve edges
_MARGIN = 0.02  # of a window, for pixels between the points it is fitted to
_GRID = 1.0 / 8.0  # windows of cubes end at multiples of it, and mostly stay while the eye moves
_NEAREST = np.float32(1e-6)  # m from a light that its brightness is judged at
_PAIRS = 1 << 17  # of a light and a receiver that are considered


@dataclass(frozen=True, eq=False)
class Seen:
    """What the eye sees, some points of it.

    points   (n, 3) m, world space;  normals  (n, 3) geometric, on the eye's side
    widths   (n,) m: a pixel's there, seen face on
    reaches  (n,) m: radius of the part of its surface that each stands for
    through  whether light from behind may reach the eye
    """

    points: np.ndarray
    normals: np.ndarray
    widths: np.ndarray
    reaches: np.ndarray
    through: bool = False

    def some(self, count: int) -> Seen:
        """Return every n-th point, about `count` of them; their reaches, m, grow with sqrt(n)."""
        step = max(-(-len(self.points) // max(count, 1)), 1)
        some = self.take(slice(None, None, step))
        return replace(some, reaches=some.reaches * np.float32(math.sqrt(step)))

    def take(self, rows: np.ndarray | slice) -> Seen:
        """Return the points of some rows, (m,) ints or a slice."""
        arrays = ("points", "normals", "widths", "reaches")
        return replace(self, **{name: getattr(self, name)[rows] for name in arrays})


@dataclass(frozen=True, eq=False)
class ShadowFace:
    """One view of a light, as its shadow map holds it.

    light     row of the lights;  index  of its map's faces
    origin    (3,) m, world space
    frame     (3, 3) unit rows right, down (a light map's has up), forward
    window    (2, 2) low and high corner of what the tile shows, in tangents right and down of forward;
              orthographic: in m
    depth     m before and behind the origin that an orthographic view holds; 0: a perspective one
    range     m from the origin beyond which nothing that the eye sees is lit
    wanted    texels per unit of the window, up to a factor that all faces share; 0: the eye sees none
    finest    texels per unit beyond which more would not be seen
    """

    light: int
    index: int
    origin: np.ndarray
    frame: np.ndarray
    window: np.ndarray
    depth: float
    range: float
    wanted: float = 0.0
    finest: float = 0.0

    @property
    def extent(self) -> np.ndarray:
        """(2,) width and height of the window."""
        low, high = self.window
        return np.asarray(high - low)

    def projected(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return (n, 3) world-space points in the window's units, (2, n), and how long one of those units is
        there, (n,) m; that is not positive where a point is not ahead."""
        local = self.frame.astype(np.float32) @ (points - self.origin.astype(np.float32)).T
        across, ahead = local[:2], local[-1]
        unit = np.ones_like(ahead) if self.depth else ahead
        return across / np.maximum(unit, np.float32(1e-30)), unit

    def holds(self, points: np.ndarray) -> np.ndarray:
        """Return (n,) whether (n, 3) world-space points lie in the window."""
        projected, unit = self.projected(points)
        low, high = self.window.astype(np.float32)[..., None]
        return np.asarray(((projected >= low) & (projected <= high)).all(axis=0) & (unit > 0.0))

    def sees(self, center: np.ndarray, half: np.ndarray) -> np.ndarray:
        """Return (n,) whether boxes may be in the window, within the range.

        center, half  (3, n) m: world-space boxes' middles and half their sizes
        """
        right, down, ahead = self.frame
        (left, top), (far, bottom) = self.window
        edge, shift = (0.0 * ahead, 1.0) if self.depth else (ahead, 0.0)
        normals = np.stack(
            [edge, right - left * edge, far * edge - right, down - top * edge, bottom * edge - down]
        )
        offsets = shift * np.array([1.0, -left, far, -top, bottom])
        local = center - self.origin[:, None]
        inside = normals @ local + np.abs(normals) @ half + offsets[:, None]
        nearest = np.maximum(np.abs(local) - half, 0.0)
        near = (nearest * nearest).sum(axis=0) <= self.range**2
        return np.asarray((inside >= 0.0).all(axis=0) & near)


@dataclass(frozen=True, eq=False)
class ShadowTile:
    """Where a face lies in the atlas.

    seen    rows of the boxes that it may see, ascending
    corner  texels: its upper left;  size  texels: width and height
    """

    face: ShadowFace
    seen: np.ndarray
    corner: tuple[int, int]
    size: tuple[int, int]


@dataclass(frozen=True, eq=False)
class ShadowAtlas:
    """The tiles of all faces that see something, highest first; size: width and height that hold them."""

    tiles: list[ShadowTile]
    size: tuple[int, int]


def plan_atlas(
    lights: np.ndarray, maps: Sequence[LightMap], boxes: np.ndarray, seen: Seen, resolution: int, limit: int
) -> ShadowAtlas | None:
    """Return the atlas of a frame, None where even the least tiles do not fit.

    lights      (L,) LIGHT;  maps  one for each
    boxes       (n, 2, 3) bounds of what casts shadows, world space
    resolution  texels of a tile's side at most;  limit  of the texture's
    """
    seen = seen.some(_PAIRS // max(len(lights), 1))
    light_shares = shares(lights, seen)
    center, half = (
        np.ascontiguousarray(part.T) for part in (boxes.mean(axis=1), np.ptp(boxes, axis=1) / 2.0)
    )
    views: list[tuple[ShadowFace, np.ndarray]] = [
        (face, rows)
        for map in maps
        if lights[map.light]["intensity"].any()
        for face in _faces(map, lights[map.light], seen, light_shares[map.light])
        if len(rows := np.flatnonzero(face.sees(center, half)))
    ]
    faces = [face for face, _ in views]
    budget = _BUDGET * resolution**2
    while True:
        sizes = tile_sizes(faces, resolution, budget)
        order = np.argsort(-sizes[:, 1], kind="stable")
        corners, size = pack_shelves(sizes[order], limit)
        if max(size) <= limit:
            tiles = [
                ShadowTile(views[i][0], views[i][1], _pair(corner), _pair(sizes[i]))
                for i, corner in zip(order, corners, strict=True)
            ]
            return ShadowAtlas(tiles, size)
        if (sizes == LEAST).all():
            return None
        budget = budget * 3 // 4


def shares(lights: np.ndarray, seen: Seen) -> np.ndarray:
    """Return each light's share of the light that arrives at each point, shadows aside, (L, n)."""
    segments = lights["position"].astype(np.float32)[:, None] - seen.points.astype(np.float32)
    square = np.maximum(np.einsum("lnk,lnk->ln", segments, segments), _NEAREST**2)
    distance = np.sqrt(square)
    ahead = -np.einsum("lnk,lk->ln", segments, lights["direction"]) / distance
    facing = np.einsum("lnk,nk->ln", segments, seen.normals.astype(np.float32)) / distance
    edge = np.clip(ahead * lights["cone_scale"][:, None] + lights["cone_offset"][:, None], 0.0, 1.0)
    reach = np.where(lights["range"] > 0.0, lights["range"], np.float32(np.inf))[:, None]
    kept = edge * edge * np.clip(1.0 - (distance / reach) ** 4, 0.0, 1.0) / square
    far = lights["kind"] == records.LIGHT_DIRECTIONAL
    kept[far], facing[far] = 1.0, -lights["direction"][far] @ seen.normals.T.astype(np.float32)
    cosine = np.abs(facing) if seen.through else np.maximum(facing, 0.0)
    arriving = lights["intensity"].max(axis=1)[:, None] * kept * cosine
    return np.asarray(arriving / np.maximum(arriving.sum(axis=0), np.float32(1e-30)))


def tile_sizes(faces: Sequence[ShadowFace], resolution: int, budget: float) -> np.ndarray:
    """Return the texels of the tiles' sides, (n, 2): in proportion to what the faces want, within the budget.

    Multiples of 16, at least 32, at most `resolution`; they cover at most the budget, unless the least
    tiles alone take more.
    """
    wanted, finest = (np.array([getattr(face, name) for face in faces]) for name in ("wanted", "finest"))
    extents = np.array([face.extent for face in faces]).reshape(-1, 2)
    inner = resolution - 2 * GUARD
    finest = np.minimum(finest[:, None], inner / np.maximum(extents, 1e-30))

    def sizes(scale: float) -> np.ndarray:
        texels = np.minimum(scale * wanted[:, None], finest) * extents + 2 * GUARD
        steps = np.ceil(texels / STEP).astype(np.int64)
        return np.asarray(np.clip(steps * STEP, LEAST, max(resolution // STEP * STEP, LEAST)))

    some = wanted > 0.0
    high = float(np.max(finest[some] / wanted[some, None], initial=0.0))
    if sizes(high).prod(axis=1).sum() <= budget:
        return sizes(high)
    low = 0.0
    for _ in range(32):
        middle = (low + high) / 2.0
        low, high = (middle, high) if sizes(middle).prod(axis=1).sum() <= budget else (low, middle)
    return sizes(low)


def pack_shelves(sizes: np.ndarray, limit: int) -> tuple[np.ndarray, tuple[int, int]]:
    """Return the corners, (n, 2), of rectangles, (n, 2) width and height, highest first, in rows of a nearly
    square texture, and its size."""
    if not len(sizes):
        return np.zeros((0, 2), np.int64), (STEP, STEP)
    area = float(sizes.astype(np.float64).prod(axis=1).sum())
    width = min(max(math.ceil(math.sqrt(area) / STEP) * STEP, int(sizes[:, 0].max())), limit)
    corners = np.zeros((len(sizes), 2), np.int64)
    x = y = height = 0
    for i, (across, down) in enumerate(sizes.tolist()):
        if x + across > width:
            x, y, height = 0, y + height, 0
        corners[i] = x, y
        x, height = x + across, max(height, down)
    return corners, (width, y + height)


def _pair(values: np.ndarray) -> tuple[int, int]:
    return int(values[0]), int(values[1])


def _faces(map: LightMap, light: np.void, seen: Seen, share: np.ndarray) -> list[ShadowFace]:
    """The faces of a light's map that it shines through; `share`: (n,) its part of the light at `seen`."""
    cube = len(map.axes) == 6
    lit = np.flatnonzero(share > 0.0)
    on = np.zeros(len(lit), np.int64)
    if cube:
        on = _cube_face(seen.points[lit] - map.origin.astype(np.float32))
    faces = []
    for index, rows in enumerate(map.axes):
        lengths = np.linalg.norm(rows, axis=1)
        half = 1.0 / lengths[:2]
        depth = 1.0 / float(lengths[2]) if map.orthographic else 0.0
        window, frame = np.stack([-half, half]), rows / lengths[:, None]
        face = ShadowFace(map.light, index, map.origin, frame, window, depth, map.range)
        _, _, forward = frame
        if not (cube and _is_dark(light, forward)):
            here = lit[on == index]
            faces.append(_fitted(face, seen.take(here), share[here], _GRID if cube else 0.0))
    return faces


def _cube_face(vectors: np.ndarray) -> np.ndarray:
    """(n,) index of the face of a cube that (n, 3) vectors leave through."""
    x, y, z = np.ascontiguousarray(np.abs(vectors.T))
    axis = np.where(x >= np.maximum(y, z), 0, np.where(y >= z, 1, 2))
    return np.asarray(2 * axis + (vectors[np.arange(len(vectors)), axis] < 0.0))


def _fitted(face: ShadowFace, seen: Seen, share: np.ndarray, grid: float) -> ShadowFace:
    """The face with its window narrowed to what is seen in it, and the texels that it wants for that.

    share  (n,) the light's part of the light there
    grid   what the window's corners are multiples of; 0: nothing

    A pixel at a shadow's edge is blurred by as many pixels as a texel is wide there, and the eye sees of it
    the light's share. Over all faces that sum is least, for a number of texels, where a face has
    cbrt(sum(share / width of a pixel) / area) in each direction.
    """
    held = face.holds(seen.points)
    if not held.any():
        return face
    seen, share = seen.take(held), share[held]
    projected, unit = face.projected(seen.points)
    low, high = face.window
    reach = seen.reaches / unit
    corners = np.stack([(projected - reach).min(axis=1), (projected + reach).max(axis=1)]).astype(np.float64)
    margin = np.maximum(_MARGIN * (corners[1] - corners[0]), 1e-3 * (high - low))
    corners += np.stack([-margin, margin])
    if grid:
        corners = np.stack([np.floor(corners[0] / grid), np.ceil(corners[1] / grid)]) * grid
    window = np.clip(corners, low, high)
    pixels = share * (unit / seen.widths)
    wanted = float(np.cbrt(pixels.sum() / (window[1] - window[0]).prod()))
    finest = _FINEST * float(pixels.sum() / share.sum())
    distance = np.linalg.norm(seen.points - face.origin.astype(np.float32), axis=1)
    far = math.inf if face.depth else float((distance + seen.reaches).max())
    return replace(face, window=window, range=min(face.range, far), wanted=wanted, finest=finest)


def _is_dark(light: np.void, forward: np.ndarray) -> bool:
    """Whether a spot's cone leaves out a face of the cube, all within 54.7 degrees of `forward`."""
    if light["kind"] != records.LIGHT_SPOT:
        return False
    outer = math.acos(min(max(float(-light["cone_offset"] / light["cone_scale"]), -1.0), 1.0))
    away = math.acos(min(max(float(light["direction"].astype(np.float64) @ forward), -1.0), 1.0))
    return away > outer + math.acos(1.0 / math.sqrt(3.0))
