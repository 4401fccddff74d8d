"""How large pictures are while something moves, so that they come often enough."""

from __future__ import annotations

_STEPS = (
    1.0,
    0.75,
    0.5,
    0.35,
    0.25,
)  # of the picture's sides; few, for textures are made anew at each change
_ROOM = 0.8  # of the time that there is, below which a larger picture is tried
_KEEP = 4  # pictures in a row that must say so


class Pace:
    """Chooses the part of the full size that moving pictures are drawn at.

    fps  pictures a second that are wanted
    """

    def __init__(self, fps: float) -> None:
        self._budget = 1.0 / fps
        self._step, self._told = 0, 0

    @property
    def share(self) -> float:
        """Of the full picture's sides."""
        return _STEPS[self._step]

    def spent(self, seconds: float) -> None:
        """Tell what the last moving picture took, at this share."""
        larger = _STEPS[max(self._step - 1, 0)] / self.share
        if seconds > self._budget and self._step < len(_STEPS) - 1:
            self._wish(1)
        elif seconds * larger * larger < _ROOM * self._budget and self._step > 0:
            self._wish(-1)
        else:
            self._told = 0

    def _wish(self, step: int) -> None:
        """Move on once several pictures in a row agree."""
        self._told = self._told + step if self._told * step >= 0 else step
        if abs(self._told) >= _KEEP:
            self._step, self._told = self._step + step, 0

    def size(self, full: tuple[int, int]) -> tuple[int, int]:
        """Return the size in pixels of a moving picture."""
        width, height = full
        return max(round(width * self.share), 16), max(round(height * self.share), 16)
