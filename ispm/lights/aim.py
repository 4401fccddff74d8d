"""Where photons are aimed: narrow views, from a light, of what casts caustics and of what the eye sees, and
boxes about that."""

from __future__ import annotations

import math

import numpy as np

from ispm.lights.lightmap import LightMap, cropped, square_map, view_of

LIT = 0.5  # of a sun's photons that are not aimed at caustics, for where it shines in
SEEN = 0.5  # of the others, for what the eye sees
_WIDEST = math.tan(0.6)  # of half a view's angle: wider ones gain little
_LARGEST = 1.0 / 3.0  # of what the light's own map takes, likewise
_GAIN = 0.9  # of the size of a group, below which the sum of its two parts must be for a split
_SEEN_SHARES = 0.98, 0.75, 0.5  # of the points that the eye sees, along each of a map's axes
_AROUND = 0.25  # of what holds them, on each side: what lies there lights what the eye sees
_LIT_SHARE, _LIT_AROUND = 0.99, 0.1  # of the places where a sun shines, and around them
_ENOUGH = 8  # places where a sun shines, that tell where that is
_OUTLIERS, _BESIDE = 0.01, 0.5  # of what is seen, at either end; of those places, which may lie elsewhere
_LIT_LARGEST = 0.5  # of what a map of all that is seen takes, what one of these may
_WIDER = 3.0  # times as wide, from there outwards: what is farther away lights it less
_MARGIN = 0.02  # of a crop's half width, for sub-texel shifts


def aimed_maps(base: LightMap, light: np.void, hulls: np.ndarray, most: int) -> list[LightMap]:
    """Return at most `most` maps about the light of `base` that together see the hulls, near ones joined.

    base   the light's own map;  light  LIGHT
    hulls  (n, k, 3) points round each object, world space
    There is none of what has the light in its box, nor of what already fills much of its own map.
    """
    points = hulls - base.origin
    patches = _patches(base, points)
    kept = np.arange(len(points))
    if not base.orthographic:
        too_wide = (patches[:, 1] - patches[:, 0] > 2.0 * math.sin(0.6)).any(axis=1)
        inside = ((points.min(axis=1) < 0.0) & (points.max(axis=1) > 0.0)).all(axis=1)
        kept = np.flatnonzero(~too_wide & ~inside)
    maps = [_view(base, light, points[kept[group]]) for group in _groups(patches[kept], most)]
    return [map for map in maps if map and 0.0 < map.measure < _LARGEST * base.measure]


def seen_maps(base: LightMap, seen: np.ndarray) -> list[LightMap]:
    """Return maps of a directional light of what the eye sees, the widest first; other lights have none.

    seen  (n, 3) m, points in the picture, each for as much of it as another
    One holds nearly all points, narrower ones the middle of them: a picture that reaches the horizon is near
    the eye in most of its pixels. Wider ones let photons thin out with the distance, or the few from beyond
    would carry a hundred times the light of the others. Each is at most a third of the one before, the first
    of `base`.
    """
    if not aims_at_seen(base) or not len(seen):
        return []
    points = (seen - base.origin) @ base.axes[0, :2].T
    maps: list[LightMap] = []
    for low, high in _windows(points, np.array([[-1.0] * 2, [1.0] * 2])):
        if (low < high).all():
            map = cropped(base, low, high)
            if map.measure < _LARGEST * (maps[-1] if maps else base).measure:
                maps.append(map)
    return maps


def near_maps(base: LightMap, seen: np.ndarray, lit: np.ndarray | None) -> list[LightMap]:
    """Return `seen_maps` of what the eye sees; of `lit`, where the light shines on that or on what lights it,
    where most of these places lie beside: a room is lit by ground before its window."""
    if not aims_at_seen(base) or lit is None or len(lit) < _ENOUGH or not len(seen):
        return seen_maps(base, seen)
    across = base.axes[0, :2].T
    low, high = np.quantile((seen - base.origin) @ across, (_OUTLIERS, 1.0 - _OUTLIERS), axis=0)
    places = (lit - base.origin) @ across
    within = ((low <= places) & (places <= high)).all(axis=1)
    return seen_maps(base, seen if within.mean() > _BESIDE else lit)


def lit_map(base: LightMap, near: list[LightMap], lit: np.ndarray) -> LightMap | None:
    """Return a map of a directional light of where it shines; None where that is more than half of what the
    narrowest of `near` takes.

    near  its maps of what the eye sees;  lit  (n, 3) m, places of that, or that light it, where it shines
    It holds all of these but outliers, for what comes in beside it is carried by few photons.
    """
    if not aims_at_seen(base) or not len(lit):
        return None
    points = (lit - base.origin) @ base.axes[0, :2].T
    low, high = np.quantile(points, (0.5 - _LIT_SHARE / 2.0, 0.5 + _LIT_SHARE / 2.0), axis=0)
    room = _LIT_AROUND * (high - low)
    low, high = np.clip((low - room, high + room), -1.0, 1.0)
    if not (low < high).all():
        return None
    map = cropped(base, low, high)
    return map if map.measure < _LIT_LARGEST * min(each.measure for each in (base, *near)) else None


def seen_boxes(bounds: np.ndarray, seen: np.ndarray) -> list[np.ndarray]:
    """Return boxes, (2, 3) corners in m, about what the eye sees of a scene, chosen as `seen_maps` are: each
    shows at most a third of the area of the one before, the first of the scene's own.

    bounds  (2, 3) m, of the scene
    """
    boxes: list[np.ndarray] = []
    for box in _windows(seen, bounds) if len(seen) else ():
        if 0.0 < _size(*box) < _LARGEST * _size(*(boxes[-1] if boxes else bounds)):
            boxes.append(box)
    return boxes


def _windows(points: np.ndarray, bounds: np.ndarray) -> list[np.ndarray]:
    """Boxes, (2, k) corners, about most of (n, k) points, the widest first, within `bounds`, (2, k)."""
    boxes = []
    for share in _SEEN_SHARES:
        low, high = np.quantile(points, (0.5 - share / 2.0, 0.5 + share / 2.0), axis=0)
        room = np.maximum(_AROUND * (high - low), 1e-6 * (bounds[1] - bounds[0]))
        boxes.append(np.stack([low - room, high + room]))
    middle, half = boxes[0].mean(axis=0), np.ptp(boxes[0], axis=0) / 2.0
    while (half < (bounds[1] - bounds[0]) / _WIDER).any():
        half = _WIDER * half
        boxes.insert(0, np.stack([middle - half, middle + half]))
    return [np.clip(box, *bounds) for box in boxes]


def aims_at_seen(base: LightMap) -> bool:
    """Return whether a light, by its own map, may have maps of what the eye sees."""
    return base.orthographic


def _patches(base: LightMap, points: np.ndarray) -> np.ndarray:
    """(n, 2, 3) bounds of (n, k, 3) points: of their directions; of a parallel view in m across its rays."""
    if base.orthographic:
        (axes,) = base.axes
        frame = axes / np.linalg.norm(axes, axis=1, keepdims=True)
        seen = points @ frame.T * (1.0, 1.0, 0.0)
    else:
        seen = points / np.maximum(np.linalg.norm(points, axis=-1, keepdims=True), 1e-30)
    return np.stack([seen.min(axis=1), seen.max(axis=1)], axis=1)


def _groups(patches: np.ndarray, most: int) -> list[np.ndarray]:
    """Indices of patches that one map sees together: all of them, split where that gains most."""
    groups = [np.arange(len(patches))] if len(patches) else []
    splits = [_split(patches, group) for group in groups]
    while len(groups) < most:
        best = max(range(len(groups)), key=lambda k: splits[k][0], default=-1)
        if best < 0 or splits[best][0] <= 0.0:
            break
        _, halves = splits.pop(best)
        groups[best : best + 1] = halves
        splits[best:best] = [_split(patches, half) for half in halves]
    return groups


def _split(patches: np.ndarray, group: np.ndarray) -> tuple[float, tuple[np.ndarray, np.ndarray]]:
    """What is gained by splitting a group where that leaves the smallest parts, and the two parts."""
    most, halves = 0.0, (group, group)
    whole = float(_size(patches[group].min(axis=0)[0], patches[group].max(axis=0)[1]))
    for axis in range(3):
        order = group[np.argsort(patches[group, :, axis].sum(axis=1), kind="stable")]
        low, high = patches[order, 0], patches[order, 1]
        left = _size(np.minimum.accumulate(low), np.maximum.accumulate(high))[:-1]
        right = _size(np.minimum.accumulate(low[::-1]), np.maximum.accumulate(high[::-1]))[-2::-1]
        if not len(left):
            continue
        last = int((left + right).argmin())
        gain = _GAIN * whole - float(left[last] + right[last])
        if gain > most:
            most, halves = gain, (order[: last + 1], order[last + 1 :])
    return most, halves


def _size(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Half the surface of boxes: of directions, which lie on a sphere, about what they cover."""
    x, y, z = np.moveaxis(high - low, -1, 0)
    return np.asarray(x * y + y * z + z * x)


def _view(base: LightMap, light: np.void, points: np.ndarray) -> LightMap | None:
    """The map that sees (n, k, 3) points, relative to the base's origin; None where it were too wide."""
    if base.orthographic:
        seen = points.reshape(-1, 3) @ base.axes[0, :2].T
        low, high = seen.min(axis=0), seen.max(axis=0)
        room = np.maximum(_MARGIN * (high - low) / 2.0, 1e-6)
        return cropped(base, np.maximum(low - room, -1.0), np.minimum(high + room, 1.0))
    frame, spread = view_of(points.reshape(-1, 3))
    return square_map(base.light, light, frame, spread) if spread < _WIDEST else None
