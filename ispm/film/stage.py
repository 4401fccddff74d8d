"""What stands where at a moment of a film."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ispm.errors import SettingsError
from ispm.film.path import CameraPath, Turntable
from ispm.film.settings import Film
from ispm.framing.camera import given_camera
from ispm.renderer.renderer import Renderer
from ispm.scene.camera import Camera
from ispm.scene.scene import Scene

Change = Callable[[Renderer, float], object]


@dataclass(frozen=True, eq=False)
class Motion:
    """What moves in a film, and when.

    scene      its animations move it
    film       its pictures a second
    camera     as of `Renderer`, or one that moves
    animation  the name of the one that plays; None: all
    start      the scene's time at the first frame, s
    change     called with the renderer and the scene's time; sets by it what it changes
    """

    scene: Scene
    film: Film
    camera: Camera | CameraPath | Turntable | str | int | None = None
    animation: str | None = None
    start: float = 0.0
    change: Change | None = None

    @property
    def first_camera(self) -> Camera | str | int | None:
        """What a renderer of the film begins with."""
        if isinstance(self.camera, Turntable):
            return self.camera.camera
        return self.camera.at(self.start) if isinstance(self.camera, CameraPath) else self.camera

    @property
    def count(self) -> int:
        """How many frames there are. Raises SettingsError where nothing moves and no duration is given."""
        if self.film.duration > 0.0:
            return max(round(self.film.duration * self.film.fps), 1)
        if isinstance(self.camera, Turntable):
            return self.camera.frames
        if isinstance(self.camera, CameraPath):
            end = self.camera.keys[-1].time
        else:
            played = [a.duration for a in self.scene.animations if self.animation in (None, a.name)]
            end = max(played, default=0.0)
        if not end > self.start:
            what = (
                f"all that moves ends at {end:g} s, before the film begins" if end > 0.0 else "nothing moves"
            )
            raise SettingsError(f"duration: {what}; give one, or have the camera go round or along a path")
        return max(round((end - self.start) * self.film.fps), 1)

    def time(self, frame: float) -> float:
        """Return the scene's time at a frame, s."""
        return self.start + frame / self.film.fps


class Stage:
    """A renderer whose scene and camera can be put at any moment of a film.

    It is the same scene with the same nodes all the time, so that frames can go on from the ones before. A
    camera and a light that the scene does not bring are those of the film's first frame.
    """

    def __init__(self, motion: Motion, renderer: Renderer) -> None:
        self._motion, self._renderer, self._scene = motion, renderer, renderer.scene
        self._center = np.zeros(3)
        camera = motion.camera
        if isinstance(camera, Turntable):
            bounds = renderer.scene.bounds
            self._center = np.asarray(bounds.mean(axis=0) if camera.center is None else camera.center, float)
        self._default = renderer.camera
        self.put(0)
        renderer.made_of()  # so that it chooses by this frame

    def put(self, frame: float) -> None:
        """Have the next picture show a frame, which may lie between two."""
        motion, renderer = self._motion, self._renderer
        time, scene = motion.time(frame), self._scene
        renderer.scene = scene
        if motion.scene.animations:
            moment = motion.scene.at(time, motion.animation)
            for node, other in zip(scene.nodes, moment.nodes, strict=True):
                node.stand_as(other)
        if isinstance(motion.camera, CameraPath):
            renderer.camera = motion.camera.at(time)
        elif isinstance(motion.camera, Turntable):
            found = given_camera(scene, motion.camera.camera)
            camera = self._default if found is None else replace(found[0], pose=found[1])
            renderer.camera = motion.camera.turned(camera, frame, self._center)
        if motion.change is not None:
            motion.change(renderer, time)
