"""From what the user wrote to a scene and a camera."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import replace
from math import radians
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from ispm.cli.console import Console
from ispm.cli.options import vector
from ispm.errors import OutputError, SettingsError

if TYPE_CHECKING:
    from ispm.cli.viewpoint import Viewpoint
    from ispm.scene.camera import Camera
    from ispm.scene.scene import Scene


def open_scene(console: Console, name: str, options: Mapping[str, Any]) -> Scene:
    """Return the built-in scene or the file called `name`; warnings are printed.

    options  what `load` takes
    Raises SceneError where there is neither, or the file cannot be used.
    """
    from ispm.io.download import DOWNLOADS
    from ispm.io.named import open_named
    from ispm.library.builtin import BUILTINS

    if name in BUILTINS:
        return open_named(name, **options)
    with console.step(f"{'fetching' if name in DOWNLOADS else 'loading'} {name}"):
        scene = open_named(name, **options)
    for warning in scene.warnings:
        console.warn(warning)
    return scene


def surround(scene: Scene, look: Viewpoint) -> None:
    """Give a scene the environment that the options ask for.

    Raises SceneError where it cannot be used, SettingsError where it is no file but a kind of light.
    """
    if look.environment is None:
        return
    from ispm.scene.environment import Environment

    if look.environment in ("sky", "studio"):
        raise SettingsError(
            f"--environment: takes a file; --light {look.environment} lights a scene that has no light"
        )
    intensity = 1.0 if look.environment_intensity is None else look.environment_intensity
    scene.environment = Environment(look.environment, radians(look.environment_rotation or 0.0), intensity)


def choose_camera(
    scene: Scene, camera: str | None, look_from: str | None, look_at: str | None, fov: float | None
) -> Camera | str | None:
    """Return the camera the options ask for, or its name or index; None: the scene's own choice.

    fov  vertical angle of view, degrees
    Raises SettingsError, and SceneError where the scene has no such camera.
    """
    if fov is not None and not 0.0 < fov < 180.0:
        raise SettingsError(f"--fov: {fov:g} is not between 0 and 180 degrees")
    eye = None if look_from is None else vector("--look-from", look_from)
    target = None if look_at is None else vector("--look-at", look_at)
    if (eye is None) != (target is None):
        raise SettingsError("--look-from and --look-at go together; give both")
    if eye is None or target is None:
        return _named(scene, camera) if fov is None else _with_fov(scene, camera, fov)
    if camera is not None:
        raise SettingsError("--camera and --look-from exclude each other; give one")
    from ispm.scene.camera import Camera

    if fov is None:
        return Camera.look_at(eye, target)
    return Camera.look_at(eye, target, yfov=radians(fov))


def _named(scene: Scene, camera: str | None) -> str | None:
    """A camera's name or index, which the scene has; None: none is named."""
    if camera is not None:
        from ispm.framing.camera import find_camera

        find_camera(scene, camera)
    return camera


def _with_fov(scene: Scene, camera: str | None, fov: float) -> Camera:
    from ispm.framing.camera import find_camera

    found = find_camera(scene, camera)
    if found is None:
        raise SettingsError("--fov: the scene has no camera; give --look-from and --look-at too")
    own, pose = found
    return replace(own, yfov=radians(fov), ymag=None, pose=pose)


def require_not_input(output: Path, scene: str, environment: str | None = None) -> None:
    """Raise OutputError where `output` is the scene's file, one that it names, or the environment's."""
    source = Path(scene)
    if not os.path.exists(output):
        return
    if environment is not None and os.path.exists(environment) and output.samefile(environment):
        raise OutputError(f"{output}: is the environment; name another file with -o")
    if not os.path.isfile(source):
        return
    readers = [source, *source.parent.glob("*.mtl")]
    spellings = {output.name, quote(output.name), json.dumps(output.name)[1:-1]}
    named = any(
        spelling.encode() in file.read_bytes()
        for file in readers
        if file.suffix.lower() in (".gltf", ".glb", ".obj", ".mtl")
        for spelling in spellings
    )
    if output.samefile(source) or (named and source.parent.resolve() in output.resolve().parents):
        raise OutputError(f"{output}: belongs to the scene {scene}; name another file with -o")
