"""Scene files and the files that they name, memory-mapped; the latter only from the scene file's folder."""

from __future__ import annotations

import mmap
import os
import re
from pathlib import Path, PureWindowsPath

from ispm.errors import SceneError
from ispm.io.budget import LOOK, Budget


def map_file(path: Path, budget: Budget) -> memoryview:
    """Return a file's bytes, memory-mapped. Raises SceneError where it is larger than allowed.

    The path is trusted: where a scene file names it, `read_inside` checks it first.
    """
    real = Path(os.path.realpath(path))
    if real not in budget.files:
        with path.open("rb") as file:
            size = os.fstat(file.fileno()).st_size
            budget.read(size, path.name)
            data = mmap.mmap(file.fileno(), size, access=mmap.ACCESS_READ) if size else b""
        budget.files[real] = memoryview(data)
    return budget.files[real]


def read_inside(name: str, folder: Path, budget: Budget) -> memoryview:
    """Return the bytes of the file `name` inside `folder`, links resolved.

    Raises SceneError for everything else: nothing is fetched, and nothing outside the folder is read.
    """
    shown = f"'{name[:200]}'"
    budget.take(f"the file {shown}", work=LOOK + len(name))
    foreign = re.match(r"[A-Za-z][A-Za-z0-9+.-]*:", name) or PureWindowsPath(name).anchor
    if foreign or "\0" in name:
        raise SceneError(f"{shown} is not read: only files in the scene's own folder are")
    try:
        root = os.path.realpath(folder)
        path = Path(os.path.realpath(os.path.join(root, name)))
        inside, there = path.is_relative_to(root), os.path.isfile(path)
    except (OSError, ValueError):  # the name is one that no file can have
        raise SceneError(f"the file {shown} is not there") from None
    if not inside:
        raise SceneError(f"{shown} is not read: it lies outside the scene's own folder")
    if not there:
        raise SceneError(f"the file {shown} is not there")
    return map_file(path, budget)
