"""Boxes that open lines pass: as few and as tight as tell where openings are.

Rays beside an open line meet what is about an opening. Where lines cross the plane of a wall that has
windows, they cross it in these alone: boxes about their crossings are as tight as can be, parted where there
are wide gaps. The planes that most have beside them are tried, and where none serves, as among leaves, what
lies beside each line tells a point of it. Which of all these boxes say best where lines lead is told by how
likely they make them (a mixture's weights by expectation maximization; Dempster, Laird and Rubin 1977).
"""

from __future__ import annotations

import math

import numpy as np

from ispm.lights.boxes import NO_BOXES, Boxes, box_pdf, joined_boxes
from ispm.optics.jit import jit
from ispm.optics.vector import vec3

f32 = np.float32

_MOST = 8  # boxes of either kind
_FEWEST = 8  # points that have a box
_PLANES = 6  # that lines are crossed with
_SOME = 128  # planes that the others are compared with, and points
_PARALLEL = 0.9995  # cosine of planes that are one
_WITHIN = 2e-3  # of the size of where lines start, likewise, that they lie apart
_ENOUGH = 500  # lines, about, that boxes are made for
_CLOSE = 6  # of some points that which tells how close others are
_FAR = 9.0  # times the square of that in the mean: far off; less than one over that: much closer
_FARTHER = 2.0  # times as far as the farthest thing beside a line, at most, that it crosses planes
_GRAZING = 0.05  # cosine, below which a line hardly crosses a plane
# Gaps that part a box, of its length: even points leave gaps of some log(n) n-th parts by chance, and hardly
# any draws are lost on narrow ones.
_GAP, _GAP_OF_FEW = 0.05, 20.0
_TURNS = math.radians(8.0), math.radians(1.0)  # of a box about its shortest axis
_STEPS = 6  # of these to each side
_THIN = 0.02  # of its longest half axis, that the others have at least
# Of n even points the outermost lie some n-th part of their box from its border; few draws find what a box
# lacks, so it is six times as far out: e^-6 of that stays uncovered.
_ROOM = 12.0
_MORE = 1.03  # times as long at least
_ALIKE = 0.15  # of its size, that a box differs by from one that is much like it
_NEAR = 1.25  # times its size, that lines pass close to a box
_LINING = 0.05  # of its size, that a box is larger than the points of what lines an opening
_ROUNDS = 20  # of expectation maximization
_LEAST = 0.005  # of all lines, that a box explains
_SPARE = 0.1  # of a cell's draws, that go to boxes as all lines together have them


def fit_boxes(
    starts: np.ndarray,
    directions: np.ndarray,
    along: np.ndarray,
    farthest: np.ndarray,
    planes: np.ndarray,
) -> tuple[Boxes, np.ndarray]:
    """Return the Boxes of open lines and the shares, (m, k), that each has in explaining a line.

    starts, directions  (m, 3) m and (m, 3) unit, of lines
    along, farthest     (m,) m along them to the nearest and to the farthest thing that rays beside them meet
    planes              (m, n, 4) of these: unit normal, and its product with points; NaN: none
    """
    few = slice(None, None, max(len(starts) // _ENOUGH, 1))
    crossings = _crossings(starts[few], directions[few], farthest[few], planes[few])
    boxes = _unlike(joined_boxes([NO_BOXES, *(_parted(core) for each in crossings for core in _cores(each))]))
    boxes = _grown(_likeliest(boxes, starts[few], directions[few]), starts, directions)
    rest = np.flatnonzero(~_are_passed(boxes, starts, directions))
    if len(rest):
        points = starts[rest] + along[rest, None] * directions[rest]
        boxes = joined_boxes([boxes, _boxes_about(points, starts[rest], directions[rest])])
    densities = _densities(boxes, starts, directions)
    return boxes, _explained(densities, _weights(densities))


def _boxes_about(points: np.ndarray, starts: np.ndarray, directions: np.ndarray) -> Boxes:
    """Boxes about points of lines, (n, 3) m, each of which passes one."""
    boxes = _likeliest(_parted(points), starts, directions)
    missed = ~_are_passed(boxes, starts, directions)
    return joined_boxes([boxes, _box_about(points[missed])]) if missed.any() else boxes


def _are_passed(boxes: Boxes, starts: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """(m,) bool, which lines pass any of the boxes."""
    return np.asarray((_densities(boxes, starts, directions) > 0.0).any(axis=1))


def _likeliest(boxes: Boxes, starts: np.ndarray, directions: np.ndarray) -> Boxes:
    """A few of the boxes, those to which lines lead most often."""
    weights = _weights(_densities(boxes, starts, directions))
    kept = np.flatnonzero(weights >= _LEAST)
    kept = kept[np.argsort(-weights[kept])][:_MOST]
    return Boxes(*(each[kept] for each in boxes))


def cell_weights(shares: np.ndarray, nearest: np.ndarray) -> np.ndarray:
    """Return with which chance draws in a cell take each box, (cells, k) float32.

    shares  as of `fit_boxes`;  nearest  (cells, n) rows of lines that end near a cell
    """
    own = np.stack([share[nearest].mean(axis=1) for share in shares.T.astype(f32)], axis=1)
    weights = (1.0 - _SPARE) * own + _SPARE * shares.mean(axis=0)
    return np.asarray(weights / weights.sum(axis=1, keepdims=True), f32)


def even_shares(boxes: Boxes, shares: np.ndarray) -> np.ndarray:
    """Return (k,) shares of boxes, as they are, but of boxes about one opening by their areas: light comes in
    through all of it, also where no place that is seen sees out. A box that has none gets none."""
    area = boxes.lengths[:, 1] * boxes.lengths[:, 2]
    away = np.abs(np.einsum("jkc,jac->jka", boxes.middles[None] - boxes.middles[:, None], boxes.axes))
    reach = boxes.lengths[:, None] + boxes.lengths[None] * (1.0, 0.0, 0.0)
    parallel = np.abs(boxes.axes[:, 0] @ boxes.axes[:, 0].T) > _PARALLEL
    near = parallel & (away <= reach).all(axis=2) & np.outer(shares, shares).astype(bool)
    near |= near.T
    for k in range(len(near)):  # what is near to one is near to all that are near to it
        near[near[k]] |= near[k]
    return np.where(near.sum(axis=1) > 1, near @ shares * area / np.maximum(near @ area, 1e-30), shares)


def lined_boxes(boxes: Boxes, points: np.ndarray) -> Boxes:
    """Return Boxes that hold what lines openings, too, sills and jambs, which scatter light in: as far along
    the first axes, outward, as openings are wide.

    points  (n, 3) m, some of what is beside lines; NaN: nothing
    """
    points = points[np.isfinite(points[:, 0])]
    middles, lengths = boxes.middles.copy(), boxes.lengths.copy()
    for k, (middle, axes, half) in enumerate(zip(*boxes, strict=True)):
        local = (points - middle) @ axes.T
        is_lining = (np.abs(local[:, 1:]) < _NEAR * half[1:]).all(axis=1)
        is_lining &= (local[:, 0] > 0.0) & (local[:, 0] < 2.0 * half[1:].min())
        more = np.maximum(np.abs(local[is_lining]).max(axis=0, initial=0.0) - half, 0.0)
        middles[k] += 0.5 * more[0] * axes[0]
        lengths[k] += (0.5 * more[0], *more[1:])
        lengths[k] += _LINING * math.sqrt(half[1] * half[2])
    return Boxes(middles, boxes.axes, lengths)


def _crossings(
    starts: np.ndarray, directions: np.ndarray, farthest: np.ndarray, planes: np.ndarray
) -> list[np.ndarray]:
    """Where lines cross each of the planes that most have beside them, (n, 3) m, if about as far off."""
    flat = planes[np.isfinite(planes[..., 0])]
    some = flat[:: max(len(flat) // _SOME, 1)]
    within = _WITHIN * float(np.ptp(starts, axis=0).max())
    beside = np.asarray(_are_one(planes, some, within).any(axis=1))
    crossings = []
    for _ in range(_PLANES if len(some) else 0):
        most = int(np.argmax(beside.sum(axis=0)))
        if beside[:, most].sum() < _FEWEST:
            break
        beside[:, _are_one(some[most], some, within)] = False
        facing = directions @ some[most, :3]
        rows = np.flatnonzero(np.abs(facing) > _GRAZING)
        away = (some[most, 3] - starts[rows] @ some[most, :3]) / facing[rows]
        near = (away > 0.0) & (away < _FARTHER * farthest[rows])
        rows, away = rows[near], away[near]
        crossings.append(starts[rows] + away[:, None] * directions[rows])
    return crossings


def _are_one(planes: np.ndarray, some: np.ndarray, within: float) -> np.ndarray:
    """Which of planes, (..., 4), are one with `some`, (n, 4), on either side: (..., n); NaN is with none."""
    cosine = planes[..., :3] @ some[:, :3].T
    apart = np.abs(planes[..., 3:] - np.sign(cosine) * some[:, 3])
    return np.asarray((np.abs(cosine) > _PARALLEL) & (apart < within))


def _cores(points: np.ndarray) -> list[np.ndarray]:
    """Points, (n, 3): all of them, and those that lie much closer to others than in the mean, or not much
    farther off: crossings in a hole among those in what is around, or without these."""
    if len(points) < _FEWEST:
        return []
    some = points[:: max(len(points) // _SOME, 1)]
    apart = np.square(points[:, None] - some).sum(axis=2)
    rank = min(_CLOSE, len(some) - 1)
    apart = np.partition(apart, rank, axis=1)[:, rank]
    middle = np.median(apart)
    cores = (points[apart < times * middle] for times in (1.0 / _FAR, _FAR))
    return [points, *(core for core in cores if len(core) < len(points))]


def _parted(points: np.ndarray) -> Boxes:
    """Boxes about points, (n, 3), parted where these leave wide gaps; none about a few."""
    boxes, parts = [], [points]
    while parts:
        points = parts.pop()
        if len(points) < _FEWEST:
            continue
        box = _box_about(points)
        local = (points - box.middles[0]) @ box.axes[0].T
        gap, cut, axis = max((*_widest_gap(local[:, axis]), axis) for axis in (1, 2))
        if gap > max(_GAP, _GAP_OF_FEW / len(points)):
            parts += [points[local[:, axis] < cut], points[local[:, axis] >= cut]]
        else:
            boxes.append(box)
    return joined_boxes([NO_BOXES, *boxes])


def _widest_gap(values: np.ndarray) -> tuple[float, float]:
    """The widest gap between values, (n,), as a share of all, and its middle."""
    ordered = np.sort(values)
    gaps = np.diff(ordered)
    k = int(np.argmax(gaps))
    return float(gaps[k] / max(ordered[-1] - ordered[0], 1e-30)), float(0.5 * (ordered[k] + ordered[k + 1]))


def _unlike(boxes: Boxes) -> Boxes:
    """Boxes without those that are much like one before."""
    size = boxes.lengths.max(axis=1)
    apart = np.linalg.norm(boxes.middles[:, None] - boxes.middles, axis=2)
    other = np.abs(boxes.lengths[:, None] - boxes.lengths).max(axis=2)
    like = np.maximum(apart, other) < _ALIKE * size
    return Boxes(*(each[~np.tril(like, -1).any(axis=1)] for each in boxes))


def _grown(boxes: Boxes, starts: np.ndarray, directions: np.ndarray) -> Boxes:
    """Boxes that reach as far as lines cross them, and close to them."""
    middles, axes, lengths = boxes.middles.copy(), boxes.axes, boxes.lengths.copy()
    for k, (middle, (across, right, up), (_, wide, high)) in enumerate(zip(*boxes, strict=True)):
        facing = directions @ across
        rows = np.flatnonzero(np.abs(facing) > _GRAZING)
        away = ((middle - starts[rows]) @ across) / facing[rows]
        off = starts[rows] + away[:, None] * directions[rows] - middle
        places = np.stack([off @ right, off @ up], axis=1)
        near = (away > 0.0) & (np.abs(places) < _NEAR * np.array([wide, high])).all(axis=1)
        if near.sum() >= _FEWEST:
            low, top = places[near].min(axis=0), places[near].max(axis=0)
            middles[k] += 0.5 * (low + top) @ np.stack([right, up])
            lengths[k, 1:] = np.maximum(0.5 * (top - low) * (_MORE + _ROOM / near.sum()), lengths[k, 0])
    return Boxes(middles, axes, lengths)


def _box_about(points: np.ndarray) -> Boxes:
    """A box about points, (n, 3), a little larger, its shortest axis first."""
    middle = points.mean(axis=0, dtype=np.float64)
    off = points - middle
    axes = np.linalg.eigh(off.T @ off)[1].T  # the first has the least spread
    for step in _TURNS:
        angles = step * np.arange(-_STEPS, _STEPS + 1)
        right = np.cos(angles)[:, None] * axes[1] + np.sin(angles)[:, None] * axes[2]
        up = np.cross(axes[0], right)
        turn = int(np.argmin(np.ptp(off @ right.T, axis=0) * np.ptp(off @ up.T, axis=0)))
        axes = np.stack([axes[0], right[turn], up[turn]])
    local = off @ axes.T
    low, top = local.min(axis=0), local.max(axis=0)
    half = 0.5 * (top - low) * (_MORE + _ROOM / len(points))
    half = np.maximum(half, _THIN * half.max() + 1e-6 * np.abs(points).max() + 1e-30)
    middle = middle + 0.5 * (low + top) @ axes
    return Boxes(*(each[None].astype(f32) for each in (middle, axes, half)))


def _weights(densities: np.ndarray) -> np.ndarray:
    """(k,) how often lines lead to each of k boxes, most likely, whose densities are (m, k)."""
    weights = np.full(densities.shape[1], 1.0 / max(densities.shape[1], 1))
    for _ in range(_ROUNDS):
        weights = _explained(densities, weights).mean(axis=0)
    return weights


def _explained(densities: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """The shares of k boxes in the densities, (m, k), of lines."""
    each = densities * weights + 1e-30 * weights
    return np.asarray(each / np.maximum(each.sum(axis=1, keepdims=True), 1e-300))


def _densities(boxes: Boxes, starts: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """(m, k) 1/sr, with which directions to random points of each box are drawn: `box_pdf` of each."""
    out = np.zeros((len(starts), len(boxes.middles)), np.float32)
    _fill_densities(boxes, np.ascontiguousarray(starts, f32), np.ascontiguousarray(directions, f32), out)
    return out.astype(np.float64)


@jit
def _fill_densities(boxes, starts, directions, out):
    """Write what `_densities` returns to (m, k) float32."""
    for i in range(len(out)):
        for k in range(out.shape[1]):
            out[i, k] = box_pdf(boxes, k, vec3(starts[i]), vec3(directions[i]))
