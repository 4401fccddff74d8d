"""Light maps: the cubes, squares and parallel views from a light, in which its photons are rasterised.

A light shines from one point, or along one direction, so the first segment of every photon's path is a
picture (McGuire and Luebke 2009). Each such picture is a `LightMap`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from weakref import WeakKeyDictionary

import numpy as np

from ispm.optics import records
from ispm.scene.extent import corners_of
from ispm.scene.packed import Packed

_NARROW = 0.8  # tangent of half the angle below which the map of a light far outside holds the scene alone
_WIDE = 1.8  # tangent of half a spot's angle up to which one square serves it; wider ones take a cube
_NARROWEST = 1e-6  # likewise, of a scene that is a point
_MARGIN = 1.02  # for the maps' sub-texel shifts
_QUADRATURE = 128  # points a side, for the part of a spot's cone that a square covers

# Kind of a LIGHT that stands for a point of a lamp with a surface (Lambert): its intensity falls with the
# cosine from its direction. Emission alone makes such; `Packed.lights` never holds one.
LIGHT_LAMBERT = 3

# s (right), t (down) and axis of each face in the order of cube maps; WebGPU, section 23.2.
CUBE_AXES = np.array(
    [
        [(0, 0, -1), (0, -1, 0), (1, 0, 0)],
        [(0, 0, 1), (0, -1, 0), (-1, 0, 0)],
        [(1, 0, 0), (0, 0, 1), (0, 1, 0)],
        [(1, 0, 0), (0, 0, -1), (0, -1, 0)],
        [(1, 0, 0), (0, -1, 0), (0, 0, 1)],
        [(-1, 0, 0), (0, -1, 0), (0, 0, -1)],
    ],
    np.float64,
)


_maps: WeakKeyDictionary[Packed, list[LightMap]] = WeakKeyDictionary()


@dataclass(frozen=True, eq=False)
class LightMap:
    """Square views from a light that do not overlap: the six of a cube, five of one, or one.

    light         row of the lights
    origin        (3,) m, world space: the light; of a directional one the middle of what it lights
    axes          (F, 3, 3) rows s, t, axis of each face. A point at p from the origin lies at
                  (s.p, t.p) / axis.p of [-1, 1]^2, with s and t as long as 1 / tan(half the angle);
                  orthographic: at (s.p, t.p) itself, axis.p going from -1, near, to 1, far
    orthographic  the light is directional
    measure       what the map takes of the light: its flux is intensity times this; sr, weighted by a
                  spot's or a lamp's falloff; orthographic: m^2 across the rays
    range         m from the origin beyond which the light ends
    """

    light: int
    origin: np.ndarray
    axes: np.ndarray
    orthographic: bool
    measure: float
    range: float = math.inf

    @property
    def spread(self) -> float:
        """Tangent of half a face's angle, 1 for a cube; orthographic: half its width in m."""
        return float(1.0 / np.linalg.norm(self.axes[0, 0]))


def light_maps(packed: Packed) -> list[LightMap]:
    """Return for each LIGHT the map that holds all its light; found once for each packed scene."""
    if packed not in _maps:
        _maps[packed] = [light_map(i, row, packed.bounds) for i, row in enumerate(packed.lights)]
    return _maps[packed]


def mean_irradiance(packed: Packed) -> float:
    """Return the irradiance in lx that all lights make in the mean over a sphere about the scene."""
    sphere = math.pi * packed.diagonal**2
    measures = [sphere / 4.0 if map.orthographic else map.measure for map in light_maps(packed)]
    return float(packed.lights["intensity"].max(axis=1) @ np.array(measures) / sphere)


def light_map(index: int, light: np.void, bounds: np.ndarray) -> LightMap:
    """Return the map that holds all the light of row `index` that can reach the scene.

    light   LIGHT
    bounds  (2, 3) corners of the scene
    That of a light far outside holds the scene alone, which saves the photons that would miss it; that of a
    lamp's point a hemicube, the faces of a cube that see what is before its surface.
    """
    corners = corners_of(bounds)
    if light["kind"] == records.LIGHT_DIRECTIONAL:
        return parallel_map(index, light, corners)
    views = [view_of(corners - light["position"].astype(np.float64))]
    limits = [_NARROW]
    if light["kind"] == records.LIGHT_SPOT:
        views.append((_frame(_axis(light)), _cone_tangent(light)))
        limits.append(_WIDE)
    pairs = zip(views, limits, strict=True)
    fitting = [(frame, spread) for (frame, spread), limit in pairs if spread < limit]
    if fitting:
        return square_map(index, light, *min(fitting, key=lambda view: view[-1]))
    origin = light["position"].astype(np.float64)
    axes = CUBE_AXES[:5] @ _frame(_axis(light)) if light["kind"] == LIGHT_LAMBERT else CUBE_AXES
    return LightMap(index, origin, axes, False, cone_measure(light), _range(light))


def square_map(index: int, light: np.void, frame: np.ndarray, spread: float) -> LightMap:
    """Return a map of one square view.

    frame   (3, 3) rows right, up, forward, unit
    spread  tangent of half its angle
    """
    axes = np.stack([frame[0] / spread, -frame[1] / spread, frame[2]])[None]
    origin = light["position"].astype(np.float64)
    return LightMap(index, origin, axes, False, _square_measure(light, axes[0], spread), _range(light))


def parallel_map(index: int, light: np.void, points: np.ndarray) -> LightMap:
    """Return the orthographic map of a directional light that holds `points`, (n, 3) world space.

    Of the views that turn one of the world's axes upwards it is the smallest: one has an edge along each
    edge of a box, and the smallest rectangle round a polygon has an edge along one of the polygon's.
    """
    maps = [_parallel_view(index, light, points, up) for up in np.eye(3)]
    return min(maps, key=lambda map: map.measure)


def cropped(map: LightMap, low: np.ndarray, high: np.ndarray) -> LightMap:
    """Return the part of an orthographic map between two corners, (2,) each, of its [-1, 1]^2.

    It is as deep as the whole: what stands before the part, seen from the light, shades it.
    """
    half = (high - low) / 2.0
    across = map.axes[0, :2] / (map.axes[0, :2] ** 2).sum(axis=1, keepdims=True)
    origin, axes = map.origin + (low + high) / 2.0 @ across, map.axes / np.append(half, 1.0)[:, None]
    return replace(map, origin=origin, axes=axes, measure=map.measure * float(half.prod()))


def view_of(points: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the frame of a view from the origin to the middle of (n, 3) points, (3, 3) rows right, up,
    forward, and the tangent of half its angle, with a margin; infinite where a point is not ahead."""
    forward = (points.min(axis=0) + points.max(axis=0)) / 2.0
    tangent = math.inf
    for _ in range(2):  # the middle in space is not the middle of what is seen
        if not float(np.linalg.norm(forward)) > 0.0:
            return np.eye(3), math.inf
        frame = _frame(forward)
        seen = points @ frame.T
        if (seen[:, 2] <= 0.0).any():
            return frame, math.inf
        projected = seen[:, :2] / seen[:, 2:]
        tangent = float(np.abs(projected).max())
        forward = np.append((projected.min(axis=0) + projected.max(axis=0)) / 2.0, 1.0) @ frame
    return frame, max(_MARGIN * tangent, _NARROWEST)


def falloff(light: np.void, directions: np.ndarray) -> np.ndarray:
    """Return the share of its intensity that a light sends along (..., 3) unit directions."""
    cosines = directions @ _axis(light)
    if light["kind"] == LIGHT_LAMBERT:
        return np.asarray(np.maximum(cosines, 0.0))
    edge = np.clip(cosines * float(light["cone_scale"]) + float(light["cone_offset"]), 0.0, 1.0)
    return np.asarray(edge * edge)


def texel_measures(
    map: LightMap, light: np.void, width: int, shift: tuple[float, float] = (0.0, 0.0)
) -> np.ndarray:
    """Return the (F, width, width) float64 parts of the map's measure that its texels stand for.

    shift  texels, in [-0.5, 0.5], that the samples lie right of and below the texels' centres

    They follow falloff ds dt / l^3 at the shifted samples, scaled so that they sum to the map's measure.
    Over all shifts the unscaled measure is unbiased, as the exact angle of the texel is not: that belongs
    to its whole area, the light found to one point of it. The scale makes each single map carry the light's
    whole flux, and is 1 + O(width^-2), so that its own bias is of fourth order.
    """
    s, t = (2.0 * (np.arange(width) + 0.5 + k) / width - 1.0 for k in shift)
    parts = np.ones((width, width))
    if not map.orthographic:
        parts = (1.0 + map.spread**2 * (s**2 + t[:, None] ** 2)) ** -1.5
    parts = np.broadcast_to(parts, (len(map.axes), width, width))
    if _falls_off(light):
        parts = parts * [falloff(light, face_directions(axes, s, t[:, None])) for axes in map.axes]
    total = float(parts.sum())
    return parts * (map.measure / total) if total > 0.0 else parts


def face_directions(axes: np.ndarray, s: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Return the (..., 3) unit directions at points (s, t) of [-1, 1]^2 of a perspective face, (3, 3)."""
    square = axes[0] @ axes[0]
    ahead = axes[2] + (np.asarray(s)[..., None] * axes[0] + np.asarray(t)[..., None] * axes[1]) / square
    return np.asarray(ahead / np.linalg.norm(ahead, axis=-1, keepdims=True))


def texel_rays(
    map: LightMap, width: int, shift: tuple[float, float], texels: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return origins and directions, (n, 3) float64, of the rays that some texels stand for.

    width   of a face;  shift  as in `texel_measures`;  texels  (n,) numbers (face width + y) width + x
    Directions are as long as 1 along the axis; those of an orthographic map begin in its middle.
    """
    face, texel = np.divmod(texels, width * width)
    y, x = np.divmod(texel, width)
    s, t = (2.0 * (k + 0.5 + d) / width - 1.0 for k, d in zip((x, y), shift, strict=True))
    squares = (map.axes**2).sum(axis=-1, keepdims=True)
    right, down, axis = np.moveaxis((map.axes / squares)[face], 1, 0)
    across = s[:, None] * right + t[:, None] * down
    if map.orthographic:
        return map.origin + across, axis
    return np.broadcast_to(map.origin, across.shape), axis + across


def _frame(forward: np.ndarray) -> np.ndarray:
    """(3, 3) rows right, up, forward of a view along `forward`."""
    forward = forward / np.linalg.norm(forward)
    return _upright(forward, np.eye(3)[1 if abs(forward[1]) < 0.99 else 0])


def _upright(forward: np.ndarray, up: np.ndarray) -> np.ndarray:
    """Likewise, with `up` upwards; `forward` is unit and another direction."""
    right = np.cross(up, forward)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(forward, right), forward])


def _parallel_view(index: int, light: np.void, points: np.ndarray, up: np.ndarray) -> LightMap:
    forward = _axis(light)
    frame = _frame(forward) if abs(forward @ up) > 0.999 else _upright(forward, up)
    seen = points @ frame.T
    low, high = seen.min(axis=0), seen.max(axis=0)
    half = np.maximum(_MARGIN * (high - low) / 2.0, 1e-6 * max(float((high - low).max()), 1e-30))
    axes = (frame * np.array([1.0, -1.0, 1.0])[:, None] / half[:, None])[None]
    return LightMap(index, (low + high) / 2.0 @ frame, axes, True, float(4.0 * half[0] * half[1]))


def _falls_off(light: np.void) -> bool:
    """Whether a light's intensity differs with the direction."""
    return bool(light["kind"] in (records.LIGHT_SPOT, LIGHT_LAMBERT))


def _axis(light: np.void) -> np.ndarray:
    """Its direction, (3,), unit in float64."""
    direction = light["direction"].astype(np.float64)
    return np.asarray(direction / np.linalg.norm(direction))


def _cone_tangent(light: np.void) -> float:
    """Tangent of half the angle of a spot's whole cone."""
    cosine = float(-light["cone_offset"] / light["cone_scale"])
    if cosine < 1e-6:
        return math.inf
    return max(math.sqrt(max(1.0 - cosine * cosine, 0.0)) / cosine, _NARROWEST)


def _range(light: np.void) -> float:
    return float(light["range"]) if light["range"] > 0.0 else math.inf


def cone_measure(light: np.void) -> float:
    """Return the sr of all directions, weighted by the falloff: 4 pi but for spots and points of lamps.

    Of these it is 2 pi times the integral of the falloff over the cosine.
    """
    if not _falls_off(light):
        return 4.0 * math.pi
    if light["kind"] == LIGHT_LAMBERT:
        return math.pi
    scale, offset = float(light["cone_scale"]), float(light["cone_offset"])
    outer, inner = -offset / scale, (1.0 - offset) / scale
    full = max(1.0 - inner, 0.0)
    top = min(inner, 1.0) * scale + offset  # the falloff's root where the fade ends
    return 2.0 * math.pi * (full + top**3 / (3.0 * scale)) if outer < 1.0 else 0.0


def _square_measure(light: np.void, axes: np.ndarray, spread: float) -> float:
    """Solid angle, sr, of a square view of tangent `spread` to each side, weighted by the light's falloff."""
    square = spread * spread
    whole = 4.0 * math.atan2(square, math.sqrt(1.0 + 2.0 * square))
    if not _falls_off(light):
        return whole
    is_spot = light["kind"] == records.LIGHT_SPOT
    if is_spot and spread >= _cone_tangent(light) and float(axes[2] @ _axis(light)) > 1.0 - 1e-12:
        return cone_measure(light)
    s = 2.0 * (np.arange(_QUADRATURE) + 0.5) / _QUADRATURE - 1.0
    density = (1.0 + square * (s**2 + s[:, None] ** 2)) ** -1.5
    share = density * falloff(light, face_directions(axes, *np.meshgrid(s, s)))
    return float(whole * share.sum() / density.sum())
