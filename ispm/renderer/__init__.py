"""The frame, and the pictures it gives.

In come a scene, a camera and settings; a frame runs the stages and kernels in order, joins what they give,
and goes out as layers, statistics and files. All rooms below are joined here and nowhere else.
"""

from __future__ import annotations

from pathlib import Path
from typing import Unpack

from ispm.errors import SettingsError, warn_caller
from ispm.io.named import open_named
from ispm.renderer.picture import Frame
from ispm.renderer.renderer import Renderer
from ispm.renderer.statistics import Stats
from ispm.scene.camera import Camera
from ispm.scene.scene import Scene
from ispm.settings import Changes, Settings

__all__ = ["Frame", "Renderer", "Stats", "render"]


def render(
    scene: Scene | str | Path,
    settings: Settings | None = None,
    *,
    camera: Camera | str | int | None = None,
    time: float | None = None,
    **changes: Unpack[Changes],
) -> Frame:
    """Render one picture.

    scene    a Scene, a file, or the name of a built-in scene
    camera   a Camera with a pose, or the name or index of one of the scene's
    time     seconds of the scene's animations; None: as the scene stands
    changes  settings by name, over `settings`
    Raises SceneError, SettingsError or AdapterError; warns of faults that the file has.
    """
    if not isinstance(scene, Scene):
        scene = open_named(scene)
        for line in scene.warnings:
            warn_caller(line)
    if time is not None:
        scene = scene.at(time)
    if settings is not None and not isinstance(settings, Settings):
        raise SettingsError(f"settings must be ispm.Settings, not a {type(settings).__name__}")
    chosen = (settings or Settings()).replace(**changes)
    with Renderer(scene, chosen, camera=camera) as renderer:
        return renderer.render()
