"""Ways of the camera: key frames that it goes through, and a turn round the scene."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from ispm.errors import SettingsError
from ispm.scene.camera import Camera
from ispm.scene.values import FARTHEST, LEAST, Point, require

_WIDEST = math.nextafter(math.pi, 0.0)
_WITHIN = {
    "time": (-FARTHEST, FARTHEST, ()),
    "eye": (-FARTHEST, FARTHEST, (3,)),
    "target": (-FARTHEST, FARTHEST, (3,)),
    "yfov": (LEAST, _WIDEST, ()),
}


@dataclass(frozen=True, eq=False)
class CameraKey:
    """Where a camera is at a moment.

    time         seconds
    eye, target  (3,) where it stands and the point in the middle of its picture, m, world space
    yfov         vertical angle of view, radians
    Raises SettingsError where one of them makes no sense.
    """

    time: float
    eye: Point
    target: Point
    yfov: float = math.radians(50.0)

    def __post_init__(self) -> None:
        for f in fields(self):
            low, high, counts = _WITHIN[f.name]
            require(f.name, getattr(self, f.name), low, high, *counts, error=SettingsError)
        if np.array_equal(self.eye, self.target):
            raise SettingsError("target: is where the eye is; move one of them")


class CameraPath:
    """A camera that moves smoothly through key frames; before the first and after the last it stands still.

    keys  two or more, their times increasing
    Eye, target and angle each follow a cubic Hermite spline. Their velocity at a key is that of the parabola
    through it and its neighbours; it is 0 where one of these has the same value, so that what stands still
    does not sway, and at the ends, so that the camera starts and stops gently. Where the last key is the
    first again, the path is closed and goes through them as through the others.
    Raises SettingsError for fewer keys, and for times that do not increase.
    """

    def __init__(self, keys: Sequence[CameraKey]) -> None:
        self.keys = tuple(keys)
        for key in self.keys:
            if not isinstance(key, CameraKey):
                raise SettingsError(f"keys: a camera path is of CameraKey, not of {type(key).__name__}")
        if len(self.keys) < 2:
            raise SettingsError("keys: a camera path needs two or more")
        for k, (key, after) in enumerate(zip(self.keys, self.keys[1:], strict=False)):
            if not after.time > key.time:
                raise SettingsError(f"time: key {k + 2} is at {after.time:g} s, not after {key.time:g} s")

    def __repr__(self) -> str:
        return f"<CameraPath: {len(self.keys)} keys, {self.keys[0].time:g} to {self.keys[-1].time:g} s>"

    @classmethod
    def load(cls, path: str | Path) -> CameraPath:
        """Return the path in a TOML file (docs/films.md).

        path  of the file: tables [[key]] of time (s), eye, target (m) and fov (degrees)
        Raises SettingsError with the line of what is wrong.
        """
        from ispm.film.path_file import read_path

        return read_path(path)

    def at(self, time: float) -> Camera:
        """Return the camera at `time` in seconds, with its pose.

        Raises SettingsError where eye and target meet there.
        """
        eye, target, yfov = self._splines
        try:
            return Camera.look_at(eye.at(time), target.at(time), float(yfov.at(time)[0]))
        except SettingsError as error:
            raise SettingsError(f"camera path, at {time:.3g} s: {error}") from None

    @cached_property
    def _splines(self) -> tuple[_Spline, _Spline, _Spline]:
        times = np.array([key.time for key in self.keys], np.float64)
        eye = np.array([key.eye for key in self.keys], np.float64)
        target = np.array([key.target for key in self.keys], np.float64)
        yfov = np.array([[key.yfov] for key in self.keys], np.float64)
        closed = len(times) > 2 and all((each[0] == each[-1]).all() for each in (eye, target, yfov))
        return _Spline(times, eye, closed), _Spline(times, target, closed), _Spline(times, yfov, closed)


class _Spline:
    """A cubic Hermite spline through (K, n) values at (K,) times, as `CameraPath` says."""

    def __init__(self, times: np.ndarray, values: np.ndarray, closed: bool) -> None:
        self._times, self._values = times, values
        steps = np.diff(times)[:, None]
        slopes = np.diff(values, axis=0) / steps
        after = np.arange(len(times)) % len(steps)  # of each key, the way to the next; of the last, the first
        before = after - 1
        velocities = steps[after] * slopes[before] + steps[before] * slopes[after]
        velocities /= steps[before] + steps[after]
        velocities[~(slopes[before].any(axis=1) & slopes[after].any(axis=1))] = 0.0
        if not closed:
            velocities[[0, -1]] = 0.0
        self._velocities = velocities

    def at(self, time: float) -> np.ndarray:
        """Return the (n,) value at a time, held before the first key and after the last."""
        times = self._times
        k = int(np.clip(np.searchsorted(times, time, side="right") - 1, 0, len(times) - 2))
        step = times[k + 1] - times[k]
        s = min(max((time - times[k]) / step, 0.0), 1.0)
        value = (2 * s**3 - 3 * s**2 + 1) * self._values[k] + (3 * s**2 - 2 * s**3) * self._values[k + 1]
        value += step * (s**3 - 2 * s**2 + s) * self._velocities[k]
        return np.asarray(value + step * (s**3 - s**2) * self._velocities[k + 1])


@dataclass(frozen=True, eq=False)
class Turntable:
    """A camera that goes round the scene, counterclockwise as seen from above; below 0 degrees the other way.

    degrees  in all;  frames  of the film that take them: after 360 the next one would be the first again
    camera   that goes round: as of `Renderer`
    center   (3,) what it goes round, m; None: the middle of the scene's bounds as the film begins
    Raises SettingsError where one of them makes no sense.
    """

    degrees: float
    frames: int
    camera: Camera | str | int | None = None
    center: Point | None = None

    def __post_init__(self) -> None:
        require("turntable: degrees", self.degrees, error=SettingsError)
        if not isinstance(self.frames, int) or self.frames < 1:
            raise SettingsError(f"turntable: frames must be 1 or more, not {self.frames!r}")
        if self.center is not None:
            require("turntable: center", self.center, -FARTHEST, FARTHEST, 3, error=SettingsError)

    @classmethod
    def parse(cls, text: str) -> Turntable:
        """Return the one that `text`, DEGREES/FRAMES, names. Raises SettingsError."""
        degrees, _, frames = text.partition("/")
        try:
            return cls(float(degrees), int(frames))
        except ValueError as error:
            if isinstance(error, SettingsError):
                raise
        raise SettingsError(f"turntable: '{text}' is not DEGREES/FRAMES, as 360/120")

    def turned(self, camera: Camera, frame: float, center: np.ndarray) -> Camera:
        """Return a camera as it stands at a frame.

        camera  with a pose;  frame  which may lie between two
        center  (3,) what it goes round, m
        """
        angle = math.radians(self.degrees * frame / self.frames % 360.0)
        cosine, sine = math.cos(angle), math.sin(angle)
        turn = np.array([[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]])
        assert camera.pose is not None
        pose = camera.pose.copy()
        pose[:3, :3] = turn @ pose[:3, :3]
        pose[:3, 3] = center + turn @ (pose[:3, 3] - center)
        return replace(camera, pose=pose)
