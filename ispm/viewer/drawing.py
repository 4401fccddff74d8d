"""Pictures for a session: one renderer, in the thread that draws."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

import numpy as np

from ispm.renderer.light_paths import LightPaths
from ispm.renderer.picture import Frame
from ispm.renderer.renderer import Renderer
from ispm.scene.camera import Camera
from ispm.scene.scene import Scene
from ispm.settings import RENDERER_VIEWS, Preset, Settings

PRESET: Preset = "live"
"""What a viewer begins with where its user asks for no preset."""
STILL_PASSES = 32
"""Passes that a picture gets where nothing moves; the live frame that it began with counts no more then."""


class Draws(Protocol):
    """What draws for a session."""

    def open(self, scene: Scene, settings: Settings, camera: Camera | str | int | None) -> Camera:
        """Take another scene; return the camera, with its pose, that it is first seen by."""

    def draw(self, scene: Scene, settings: Settings, camera: Camera) -> Frame:
        """Return a picture of what moved since the last one."""

    def settle(self) -> Frame | None:
        """Return a better picture of what stands still; None: there is none."""

    def view(self, frame: Frame, name: str) -> np.ndarray:
        """Return a view of the last picture, (h, w, 3 or 4) uint8 sRGB. Raises SettingsError."""

    def light_paths(self, frame: Frame, x: float, y: float) -> LightPaths | None:
        """Return the photons that light a place in the last picture, by parts of its sides; None: nothing is
        there."""

    def exposed(self) -> None:
        """Have the next picture find the exposure that is held anew."""

    def close(self) -> None:
        """Free what it holds."""


class Drawing:
    """Draws with a `Renderer`. Belongs to one thread.

    adapter, threads  as of Renderer
    """

    def __init__(self, adapter: str | None = None, threads: int | None = None) -> None:
        self._adapter, self._threads = adapter, threads
        self._renderer: Renderer | None = None
        self._passes: Iterator[Frame] | None = None
        self._left = 0

    def open(self, scene: Scene, settings: Settings, camera: Camera | str | int | None) -> Camera:
        """Take another scene; return the camera, with its pose, that it is first seen by.

        Raises AdapterError where no adapter serves, SceneError for a scene that cannot be drawn.
        """
        self.close()
        self._renderer = Renderer(scene, settings, camera, adapter=self._adapter, threads=self._threads)
        return self._renderer.camera

    def draw(self, scene: Scene, settings: Settings, camera: Camera) -> Frame:
        """Return a picture of what moved since the last one. Errors as of `Renderer.render`."""
        renderer = self._renderer
        assert renderer is not None
        renderer.scene, renderer.camera = scene, camera
        if renderer.settings != settings:
            renderer.settings = settings
        self._passes, self._left = None, STILL_PASSES
        return renderer.render() if settings.live else renderer.render_pass(0)

    def settle(self) -> Frame | None:
        """Return the mean of one pass more of what stands still; None: there were enough."""
        assert self._renderer is not None
        if self._left <= 0:
            return None
        if self._renderer.settings.live:  # which converges by itself
            self._left -= 1
            return self._renderer.render()
        if self._passes is None:
            self._passes = self._renderer.converge(STILL_PASSES)
            next(self._passes)  # the picture that is shown
            self._left -= 1
        self._left -= 1
        return next(self._passes, None)

    def view(self, frame: Frame, name: str) -> np.ndarray:
        """Return a view of the last picture, (h, w, 3 or 4) uint8 sRGB. Raises SettingsError."""
        assert self._renderer is not None
        return self._renderer.view(name) if name in RENDERER_VIEWS else frame.view(name)

    def light_paths(self, frame: Frame, x: float, y: float) -> LightPaths | None:
        """Return the photons that light a place in the last picture, by parts of its sides; None: nothing is
        there."""
        assert self._renderer is not None
        height, width = frame.depth.shape
        return self._renderer.light_paths(min(x * width, width - 1), min(y * height, height - 1))

    def exposed(self) -> None:
        """Have the next picture find the exposure that is held anew."""
        assert self._renderer is not None
        self._renderer.chosen.exposure = None

    def close(self) -> None:
        """Free the renderer's memory."""
        self._passes = None
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None
