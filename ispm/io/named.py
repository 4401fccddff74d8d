"""Scenes by name: those built in, those downloaded at their first use, and files."""

from __future__ import annotations

import inspect
import os
from dataclasses import fields
from pathlib import Path
from typing import Any

from ispm.errors import SceneError, SettingsError
from ispm.io.download import DOWNLOADS, fetch
from ispm.io.load import find, load, loading, require_path
from ispm.library import builtin as scenes
from ispm.scene.scene import Scene
from ispm.settings import LOADING, LoadOptions, nearest


def builtin(name: str, **parameters: Any) -> Scene:
    """Return a new scene. Its cameras and lights stand on nodes of their own.

    name        one of those that `ispm scenes` lists; the first use of some downloads them
    parameters  those of the scene's function; of a downloaded one, what `load` takes
    Raises SceneError where no scene has that name, or it cannot be downloaded; SettingsError for an
    unknown parameter.
    """
    known = [*scenes.BUILTINS, *DOWNLOADS]
    if name not in known:
        raise SceneError(
            f"no built-in scene is called '{name}'{nearest(name, known)}; there are {', '.join(known)}"
        )
    if name in scenes.BUILTINS:
        return scenes.builtin(name, **parameters)
    takes = [f.name for owner in LOADING for f in fields(owner)]
    for parameter in parameters:
        if parameter not in takes:
            raise SettingsError(f"scene '{name}' has no parameter '{parameter}'{nearest(parameter, takes)}")
    scene = load(fetch(name).absolute(), **parameters)
    scene.name = name
    return scene


def open_named(name: str | Path, **options: Any) -> Scene:
    """Return the built-in scene or the file called `name`.

    options  of a file, what `load` takes
    Raises SceneError where there is neither, or the file cannot be used; SettingsError for LoadOptions that
    a built-in scene has no use for.
    """
    require_path(name, "is no scene; give a Scene, a file, or the name of a built-in one")
    text = str(name)
    if text in scenes.BUILTINS:
        if loading(options)[0] != LoadOptions():
            names = ", ".join(f.name for f in fields(LoadOptions))
            raise SettingsError(f"scene '{text}' is built in; {names} are for files")
        return scenes.builtin(text)
    if text in DOWNLOADS:
        return builtin(text, **options)
    if not Path(name).suffix and not os.path.exists(find(name)):
        hint = nearest(text, [*scenes.BUILTINS, *DOWNLOADS]) or "; `ispm scenes` lists the built-in ones"
        raise SceneError(f"there is no file and no built-in scene '{name}'{hint}")
    return load(name, **options)


def abouts() -> dict[str, str]:
    """Return a line about each scene that has a name."""
    made = {name: inspect.getdoc(make) or "" for name, make in scenes.BUILTINS.items()}
    lines = {name: text.partition("\n")[0] for name, text in made.items()}
    return lines | {name: download.about for name, download in DOWNLOADS.items()}
