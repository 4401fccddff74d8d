"""Scene files of any kind that can be read."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from ispm.errors import SceneError, SettingsError
from ispm.io.gltf import read_gltf
from ispm.io.obj import read_obj
from ispm.io.ply import read_ply
from ispm.io.stl import read_stl
from ispm.scene.mesh import Mesh
from ispm.scene.scene import Scene
from ispm.scene.smooth import smoothed
from ispm.settings import LOADING, LoadLimits, LoadOptions, nearest

READERS = {".glb": read_gltf, ".gltf": read_gltf, ".obj": read_obj, ".ply": read_ply, ".stl": read_stl}


def load(path: str | os.PathLike[str], **options: Any) -> Scene:
    """Return the scene in the file `path`.

    options  fields of LoadOptions, how the file is taken, as in `up="z"` or `smooth_normals=True`, and of
             LoadLimits, what it may ask for at most, as in `max_texture=1024`
    Faults that leave something to draw are told in `scene.warnings`, a line each.
    Raises SceneError, one line that begins with the file's name, where the file cannot be used;
    SettingsError for an option that is unknown or out of range.
    """
    how, limits = loading(options)
    require_path(path, f"is not the path of a file; give one that ends in {' '.join(READERS)}")
    path = find(path)
    try:
        scene = _read(path, limits, how)
    except SceneError as error:
        raise SceneError(_one_line(f"{path.name or path}: {error}")) from None
    except OSError as error:
        name = path.name[:200]  # one that is too long is told in part
        raise SceneError(_one_line(f"{name}: cannot be read: {error.strerror or error}")) from None
    except MemoryError:
        raise SceneError(_one_line(f"{path.name}: it needs more memory than there is")) from None
    scene.name = scene.name or _one_line(path.stem)
    scene.warnings = [_one_line(message) for message in scene.warnings]
    return scene


def loading(options: Mapping[str, Any]) -> tuple[LoadOptions, LoadLimits]:
    """Return how a file is taken, and its limits. Raises SettingsError for what is neither."""
    owners = {f.name: owner for owner in LOADING for f in fields(owner)}
    for name in options:
        if name not in owners:
            raise SettingsError(f"there is no setting '{name}'{nearest(name, owners)}")
    chosen = {
        owner: {name: value for name, value in options.items() if owners[name] is owner} for owner in LOADING
    }
    return LoadOptions(**chosen[LoadOptions]), LoadLimits(**chosen[LoadLimits])


def require_path(path: object, fault: str) -> None:
    """Raise a SceneError of this fault where `path` cannot be the path of a file."""
    if (
        not isinstance(path, (str, os.PathLike))
        or not isinstance(os.fspath(path), str)
        or not os.fspath(path)
    ):
        what = "''" if path == "" else f"a {type(path).__name__}"
        raise SceneError(f"{what} {fault}")


def find(path: str | os.PathLike[str]) -> Path:
    """Return where a scene file lies: in the folder ISPM_ASSETS if it has one of this name, else as said."""
    assets = os.environ.get("ISPM_ASSETS")
    named = Path(assets, path) if assets else Path(path)
    return named if os.path.isfile(named) else Path(path)


def _read(path: Path, limits: LoadLimits, how: LoadOptions) -> Scene:
    if path.is_dir():
        raise SceneError("this is a folder, not a file")
    if not path.exists():
        raise SceneError(f"there is no such file in {path.parent.absolute()}")
    if not path.is_file():
        raise SceneError("this is not a regular file")
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        ending = f"files ending in {path.suffix}" if path.suffix else "files without an ending"
        raise SceneError(
            f"{ending} are not read, but {' '.join(READERS)} are; for others, Scene.from_trimesh takes what "
            "trimesh loads"
        )
    if how.up != "y" and reader is read_gltf:
        raise SceneError(f"up={how.up} is for OBJ, PLY and STL; glTF has y up, always")
    scene = reader(path, limits)
    if how.up == "z":
        turn_up(scene)
    if how.variant:
        scene.variant = how.variant
    if how.smooth_normals:
        smooth(scene, math.radians(how.crease_degrees))
    return scene


def turn_up(scene: Scene) -> None:
    """Turn meshes that stand on a plane of x and y to stand on one of x and z."""
    for mesh in {id(part.mesh): part.mesh for node in scene.nodes for part in node.parts}.values():
        for name in ("positions", "normals"):
            values = getattr(mesh, name)
            if values is not None:
                setattr(mesh, name, values[:, [0, 2, 1]] * np.array((1.0, 1.0, -1.0), values.dtype))


def smooth(scene: Scene, crease: float) -> None:
    """Give normals to the meshes that have none; those that parts share stay shared.

    crease  rad
    """
    made: dict[int, Mesh] = {}
    parts = [part for node in scene.nodes for part in node.parts if part.mesh.normals is None]
    for part in parts:
        key = id(part.mesh)
        made[key] = made.get(key) or smoothed(part.mesh, crease)
    for part in parts:
        part.mesh = made[id(part.mesh)]


def _one_line(text: str) -> str:
    """Return `text` with what would break a line or steer a terminal taken out: names come from files."""
    return "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in text)
