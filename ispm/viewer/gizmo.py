"""How the world is seen on a canvas, and the handles over the picture that drag what is selected.

Places on the canvas are (x, y) from the top left in its own units, points in the world (3,) m. The page has
the same in page/overlay.js.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

LENGTH = 70.0  # of an axis on the canvas, where it does not point at the eye
_NEAR = 9.0  # of a handle, within which it is meant
_FROM, _TO = 0.12, 1.06  # of an axis, within which it is meant
_BEFORE = 1e-9  # of clip space's w, that a point before the eye has at least
_CUT = 1e-3  # of the larger w of a line's ends, where what lies behind the eye is cut off

Part = Literal[0, 1, 2, "free"]
Place = tuple[float, float]


@dataclass(frozen=True, eq=False)
class Glass:
    """How the world is seen on a canvas.

    clip  (4, 4) clip-from-world matrix of the picture, for column vectors
    x, y, width, height  the picture's place on the canvas
    """

    clip: np.ndarray
    x: float
    y: float
    width: float
    height: float

    def project(self, point: np.ndarray) -> Place | None:
        """Return where a point is seen; None: it is behind the eye."""
        u, v, _, w = self.clip @ np.append(point, 1.0)
        if w <= _BEFORE:
            return None
        return self.x + (0.5 + 0.5 * u / w) * self.width, self.y + (0.5 - 0.5 * v / w) * self.height

    def segment(self, a: np.ndarray, b: np.ndarray) -> tuple[Place, Place] | None:
        """Return where the ends of a line are seen, as much of it as lies before the eye; None: nothing."""
        u, v = (float(self.clip[3] @ np.append(end, 1.0)) for end in (a, b))
        least = _CUT * max(abs(u), abs(v), 1e-6)
        if u < least and v < least:
            return None
        start = self.project(a if u >= least else a + (b - a) * (least - u) / (v - u))
        end = self.project(b if v >= least else b + (a - b) * (least - v) / (u - v))
        return None if start is None or end is None else (start, end)

    def length(self, point: np.ndarray) -> float:
        """Return m at a point before the eye that are LENGTH long on the canvas."""
        w = float(self.clip[3] @ np.append(point, 1.0))
        size = np.array([self.width, self.height]) / (2.0 * w)
        return LENGTH / max(float(np.linalg.norm(self.clip[:2, :3] * size[:, None], axis=0).max()), 1e-9)

    def tips(self, point: np.ndarray) -> list[Place | None]:
        """Return where the ends of the three axes at a point are seen."""
        return [self.project(point + self.length(point) * axis) for axis in np.eye(3)]

    def part_at(self, point: np.ndarray, place: Place) -> Part | None:
        """Return which handle of a point a place on the canvas means, if any."""
        base = self.project(point)
        if base is None:
            return None
        if np.hypot(place[0] - base[0], place[1] - base[1]) < _NEAR:
            return "free"
        parts: tuple[Part, ...] = (0, 1, 2)
        for part, tip in zip(parts, self.tips(point), strict=True):
            if tip is not None and _distance(place, base, tip) < 0.7 * _NEAR:
                return part
        return None

    def moved(self, point: np.ndarray, part: Part, right: float, down: float) -> np.ndarray:
        """Return where a handle takes a point that is dragged so far on the canvas.

        An axis moves it along itself, "free" in the plane of the picture; a drag that leads nowhere does not.
        """
        clip, w = self.clip, float(self.clip[3] @ np.append(point, 1.0))
        step = np.array([2.0 * right / self.width, -2.0 * down / self.height])  # of clip space
        if part == "free":  # x and y of clip space change, w does not, or z where w is 1 for parallel rays
            kept = 3 if clip[3, :3].any() else 2
            try:
                solved = np.linalg.solve(clip[[0, 1, kept], :3], np.append(step * w, 0.0))
            except np.linalg.LinAlgError:
                return point
            return np.asarray(point + solved)
        # along the axis clip space is (at + t along) / (w + t ahead); t is where it meets the drag, projected
        # on the direction that the axis has on the canvas
        at, along, ahead = clip[:2] @ np.append(point, 1.0), clip[:2, part], float(clip[3, part])
        seen = (along - at / w * ahead) * (self.width, self.height)
        if np.linalg.norm(seen) < 1e-9:
            return point
        way = seen / np.linalg.norm(seen) * (self.width, self.height)
        goal = float((at / w + step) @ way)
        below = float(along @ way) - goal * ahead
        if below == 0.0:
            return point
        t = (goal * w - float(at @ way)) / below
        return np.asarray(point + t * np.eye(3)[part]) if w + t * ahead > 1e-6 * w else point


def _distance(place: Place, start: Place, end: Place) -> float:
    """From a place to the part of a line by which it is dragged."""
    p, a, b = np.array(place), np.array(start), np.array(end)
    along = float((p - a) @ (b - a)) / (float((b - a) @ (b - a)) or 1.0)
    return float(np.linalg.norm(p - a - min(max(along, _FROM), _TO) * (b - a)))
