"""The built-in scenes, by name."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

from ispm.errors import SceneError, SettingsError
from ispm.library.atrium import atrium
from ispm.library.cargo_map import cargo_bay, cargo_level, cargo_map
from ispm.library.gallery import glass_figure, million
from ispm.library.ironworks_car import ironworks_car
from ispm.library.ironworks_water import ironworks_water
from ispm.library.rooms import cornell_box, integrating_sphere
from ispm.library.studio import caustic_ring, glass_sphere, objects_in_box
from ispm.scene.scene import Scene
from ispm.settings import nearest

BUILTINS: dict[str, Callable[..., Scene]] = {
    "atrium": atrium,
    "cargo-bay": cargo_bay,
    "cargo-level": cargo_level,
    "cargo-map": cargo_map,
    "caustic-ring": caustic_ring,
    "cornell-box": cornell_box,
    "glass-figure": glass_figure,
    "glass-sphere": glass_sphere,
    "integrating-sphere": integrating_sphere,
    "ironworks-car": ironworks_car,
    "ironworks-water": ironworks_water,
    "million": million,
    "objects-in-box": objects_in_box,
}
"""Name to function; the first line of the function's docstring describes the scene."""


def builtin(name: str, **parameters: Any) -> Scene:
    """Return a new scene. Its cameras and lights stand on nodes of their own.

    parameters  those of the scene's function
    Raises SceneError where no built-in has that name, SettingsError for an unknown parameter.
    """
    if name not in BUILTINS:
        known = ", ".join(BUILTINS)
        raise SceneError(f"no built-in scene is called '{name}'{nearest(name, BUILTINS)}; there are {known}")
    make = BUILTINS[name]
    known_parameters = inspect.signature(make).parameters
    for parameter in parameters:
        if parameter not in known_parameters:
            takes = ", ".join(known_parameters) or "none"
            hint = nearest(parameter, known_parameters) or f"; it takes {takes}"
            raise SettingsError(f"scene '{name}' has no parameter '{parameter}'{hint}")
    return make(**parameters)
