"""How large pictures are while something moves, so that they come often enough."""

from __future__ import annotations

_STEPS = (0.25, 0.35, 0.5, 0.7, 1.0)  # of the picture's sides; few, for textures are made anew at each change
_SHARE = 0.8  # of the time between pictures that drawing may take: the rest brings them to who looks
_ROOM = 0.8  # of that, which a larger picture must be expected to leave
_GROW, _SHRINK = 4, 2  # pictures in a row that must say so
_GUESS = 1e6  # pixels a second, until pictures are timed: of a small processor


class Pace:
    """Chooses the part of the full size that moving pictures are drawn at: small at first, larger where time is.

    fps  pictures a second that are wanted
    """

    def __init__(self, fps: float) -> None:
        self._budget = _SHARE / fps
        self._step, self._told = -1, 0

    def spent(self, seconds: float) -> None:
        """Tell what the last moving picture took."""
        share = _STEPS[self._step]
        larger = _STEPS[min(self._step + 1, len(_STEPS) - 1)] / share
        if seconds > self._budget:
            self._told = min(self._told, 0) - 1
            if self._told <= -_SHRINK:
                self._move(-2 if seconds > 2.0 * self._budget else -1)
        elif seconds * larger * larger < _ROOM * self._budget:
            self._told = max(self._told, 0) + 1
            if self._told >= _GROW:
                self._move(1)
        else:
            self._told = 0

    def _move(self, by: int) -> None:
        self._step, self._told = min(max(self._step + by, 0), len(_STEPS) - 1), 0

    def size(self, full: tuple[int, int]) -> tuple[int, int]:
        """Return the size in pixels of a moving picture."""
        width, height = full
        if self._step < 0:
            fits = [share * share * width * height <= _GUESS * self._budget for share in _STEPS]
            self._step = max(sum(fits) - 1, 0)
        share = _STEPS[self._step]
        return max(round(width * share), 16), max(round(height * share), 16)
