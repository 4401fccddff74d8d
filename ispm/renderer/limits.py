"""What can be drawn, and what a graphics adapter can draw at once."""

from __future__ import annotations

import math

from ispm.errors import SceneError, SettingsError
from ispm.gpu import Gpu
from ispm.optics.records import RECEIVER
from ispm.scene.scene import Scene
from ispm.settings import Settings


def require_drawable(settings: Settings, gpu: Gpu) -> None:
    """Raise SettingsError for a picture that is too large for the adapter."""
    width, height = settings.size
    if max(settings.size) > gpu.max_texture:
        raise SettingsError(
            f"size: {width}x{height} is larger than {gpu.name} can draw, {gpu.max_texture} pixels a side"
        )
    receivers = math.prod(-(-side // settings.subsampling) for side in settings.size)
    if receivers * RECEIVER.itemsize > gpu.max_binding:
        raise SettingsError(
            f"size: {width}x{height} at subsampling {settings.subsampling} needs more memory at once than "
            f"{gpu.name} can bind; use a larger subsampling or a smaller size"
        )


def require_scene(scene: object) -> Scene:
    """Return `scene`. Raises SceneError where it is none."""
    if isinstance(scene, Scene):
        return scene
    raise SceneError(f"a Renderer takes a Scene, not a {type(scene).__name__}; see ispm.load")
