"""The time line of a scene's animations: play, pause, scrub, speed."""

from __future__ import annotations

from dataclasses import dataclass, replace

from ispm.scene.scene import Scene


@dataclass(frozen=True)
class TimeLine:
    """Where the animations are.

    time       s
    duration   s, of the longest in play, after which they begin again; 0: there is none
    speed      times as fast; below 0: backwards
    animation  the one that plays; None: all
    """

    time: float = 0.0
    duration: float = 0.0
    playing: bool = False
    speed: float = 1.0
    animation: str | None = None

    @classmethod
    def of(cls, scene: Scene, animation: str | None = None) -> TimeLine:
        """Return the time line of a scene, standing at its beginning."""
        played = [a.duration for a in scene.animations if animation in (None, a.name)]
        return cls(duration=max(played, default=0.0), animation=animation)

    def at(self, time: float) -> TimeLine:
        """Stand at a time, s, brought within the duration."""
        return replace(self, time=min(max(time, 0.0), self.duration))

    def after(self, seconds: float) -> TimeLine:
        """Let seconds of the clock go by."""
        if not self.playing or self.duration <= 0.0:
            return self
        return replace(self, time=(self.time + self.speed * seconds) % self.duration)
