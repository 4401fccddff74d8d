"""Scene files of any kind that can be read."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from ispm.errors import SceneError
from ispm.io.gltf import read_gltf
from ispm.io.obj import read_obj
from ispm.io.ply import read_ply
from ispm.io.stl import read_stl
from ispm.scene.scene import Scene
from ispm.settings import LoadLimits, knob_of

READERS = {".glb": read_gltf, ".gltf": read_gltf, ".obj": read_obj, ".ply": read_ply, ".stl": read_stl}


def load(path: str | os.PathLike[str], **limits: Any) -> Scene:
    """Return the scene in the file `path`.

    limits  fields of LoadLimits: what the file may ask for at most, as in `max_texture=1024`
    Faults that leave something to draw are told in `scene.warnings`, a line each.
    Raises SceneError, one line that begins with the file's name, where the file cannot be used;
    SettingsError for a limit that is unknown or out of range.
    """
    for name in limits:
        knob_of(LoadLimits, name)
    checked = LoadLimits(**limits)
    require_path(path, f"is not the path of a file; give one that ends in {' '.join(READERS)}")
    path = find(path)
    try:
        scene = _read(path, checked)
    except SceneError as error:
        raise SceneError(_one_line(f"{path.name or path}: {error}")) from None
    except OSError as error:
        raise SceneError(_one_line(f"{path.name}: cannot be read: {error.strerror or error}")) from None
    except MemoryError:
        raise SceneError(_one_line(f"{path.name}: it needs more memory than there is")) from None
    scene.name = scene.name or path.stem
    scene.warnings = [_one_line(message) for message in scene.warnings]
    return scene


def require_path(path: object, fault: str) -> None:
    """Raise a SceneError of this fault where `path` cannot be the path of a file."""
    if not isinstance(path, (str, os.PathLike)) or not os.fspath(path):
        what = "''" if path == "" else f"a {type(path).__name__}"
        raise SceneError(f"{what} {fault}")


def find(path: str | os.PathLike[str]) -> Path:
    """Return where a scene file lies: in the folder ISPM_ASSETS if it has one of this name, else as said."""
    assets = os.environ.get("ISPM_ASSETS")
    named = Path(assets, path) if assets else Path(path)
    return named if os.path.isfile(named) else Path(path)


def _read(path: Path, limits: LoadLimits) -> Scene:
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
    return reader(path, limits)


def _one_line(text: str) -> str:
    """Return `text` with what would break a line or steer a terminal taken out: names come from files."""
    return "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in text)
