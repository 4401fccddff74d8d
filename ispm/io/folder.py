"""Files that a scene file names: mapped into memory, and never from outside its own folder."""

from __future__ import annotations

import mmap
import re
from pathlib import Path, PureWindowsPath

from ispm.errors import SceneError
from ispm.settings import LoadLimits


def map_file(path: Path, limits: LoadLimits) -> memoryview:
    """Return a file's bytes without reading them yet. Raises SceneError where it is larger than allowed."""
    size = path.stat().st_size
    if size > limits.max_file_bytes:
        raise SceneError(
            f"{path.name} has {size} bytes; max_file_bytes={limits.max_file_bytes} is the most that is read"
        )
    if size == 0:
        return memoryview(b"")
    with path.open("rb") as file:
        return memoryview(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ))


def read_inside(name: str, folder: Path, limits: LoadLimits) -> memoryview:
    """Return the bytes of the file `name` inside `folder`, links resolved.

    Raises SceneError for everything else: nothing is fetched, and nothing outside the folder is read.
    """
    foreign = re.match(r"[A-Za-z][A-Za-z0-9+.-]*:", name) or PureWindowsPath(name).anchor
    if foreign or "\0" in name:
        raise SceneError(f"'{name[:200]}' is not read: only files in the scene's own folder are")
    folder = folder.resolve()
    path = (folder / name).resolve()
    if not path.is_relative_to(folder):
        raise SceneError(f"'{name[:200]}' is not read: it lies outside the scene's own folder")
    if not path.is_file():
        raise SceneError(f"the file '{name[:200]}' is not there")
    return map_file(path, limits)
