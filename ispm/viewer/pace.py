"""How large pictures are while something moves, so that they come often enough."""

from __future__ import annotations

_STEPS = (0.25, 0.35, 0.5, 0.7, 1.0)  # of the picture's sides; few, for textures are made anew at each change
_SHARE = 0.8  # of the time between pictures that drawing may take: the rest brings them to who looks
_ROOM = 0.8  # of that, which a larger picture must be expected to leave
_GROW, _SHRINK = 4, 2  # pictures in a row that must say so
_STALL = 0.2  # s that a picture of what stands still may take while it may be moved again at any moment
_GUESS = 1e6  # pixels a second, until pictures are timed: of a small processor


class Pace:
    """Chooses the part of the full size that moving pictures are drawn at: small first, larger where time is.

    fps  pictures a second that are wanted
    """

    def __init__(self, fps: float) -> None:
        self._budget = _SHARE / fps
        self._step, self._told = -1, 0
        self._seconds = 0.0

    def spent(self, seconds: float) -> None:
        """Tell what the last moving picture took."""
        self._seconds = seconds
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
        return _part(full, _STEPS[self._step])

    def resting(self, full: tuple[int, int]) -> tuple[int, int]:
        """Return the size in pixels of a picture soon after the last moving one: the next waits for it."""
        each = self._seconds / _STEPS[self._step] ** 2
        fits = [share for share in _STEPS if share * share * each <= _STALL]
        return _part(full, max([_STEPS[self._step], *fits]))


def _part(full: tuple[int, int], share: float) -> tuple[int, int]:
    return max(round(full[0] * share), 16), max(round(full[1] * share), 16)
