"""Compiled kernels by content: whoever has the same function, types, versions and CPU finds them.

Two folders: the one that a wheel carries, and the user's, which is written to. A file is a digest and what it
is of; one that is damaged or cannot be written costs a compilation, no more.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import shutil
import time
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

from ispm.cache import cache_folder

SHIPPED = Path(__file__).parent / "compiled"
ENDING = ".kernel"
_DIGEST = hashlib.sha256().digest_size
_KEPT_DAYS = 30.0
_DAY = 86400.0


def file_name(function: Any, signature: tuple[Any, ...], content: str, environment: str) -> str:
    """Return the name of a kernel's file, which tells its content.

    signature    numba's types of the arguments
    content      digest of what the function depends on
    environment  what the code depends on besides
    """
    types = "\n".join(map(repr, signature))
    digest = hashlib.sha256(f"{content}\n{environment}\n{types}".encode()).hexdigest()
    name = f"{function.__module__}.{function.__qualname__}".replace(
        "<locals>.", ""
    )  # no file name on Windows
    return f"{name}-{digest[:32]}{ENDING}"


def read(name: str) -> tuple[Any, ...] | None:
    """Return what was written under `name`; None where there is nothing, or nothing whole."""
    for folder in _folders():
        try:
            data = (folder / name).read_bytes()
        except OSError:
            continue
        if hashlib.sha256(data[_DIGEST:]).digest() != data[:_DIGEST]:
            continue
        try:
            parts: tuple[Any, ...] = pickle.loads(data[_DIGEST:])
        except Exception:  # of another version of a library, whatever it raises
            continue
        _touch(folder / name)
        return parts
    return None


def find(name: str) -> Path | None:
    """Return the file of that name; None where there is none."""
    files = [folder / name for folder in _folders()]
    return next((file for file in files if file.exists()), None)


def is_empty() -> bool:
    """Return whether there is no kernel at all, of any version."""
    return not any(any(folder.glob("*" + ENDING)) for folder in _folders())


def write(name: str, data: bytes) -> None:
    """Keep `data` under `name` in the user's folder, whole or not at all."""
    folder = written_folder()
    if folder is None:
        return
    beside = folder / f".{name}.{os.getpid()}"
    try:
        beside.write_bytes(hashlib.sha256(data).digest() + data)
        beside.replace(folder / name)
    except OSError:
        with suppress(OSError):
            beside.unlink()


@cache
def written_folder() -> Path | None:
    """Return the user's folder of kernels, made where it is missing; None where nothing can be written."""
    root = cache_folder()
    if root is None:
        return None
    folder = root / "kernels"
    try:
        folder.mkdir(exist_ok=True)
    except OSError:
        return None
    _forget_old(root, folder)
    return folder


def _folders() -> list[Path]:
    """Where to look, in this order."""
    written = written_folder()
    return [SHIPPED] if written is None else [SHIPPED, written]


def _touch(file: Path) -> None:
    """Say that a file is in use, once a day."""
    with suppress(OSError):
        if time.time() - file.stat().st_mtime > _DAY:
            os.utime(file)


def _forget_old(root: Path, folder: Path) -> None:
    """Remove kernels that nobody has used for long, and the folders in which earlier versions kept theirs."""
    for file in (*root.glob("kernels-*"), *folder.iterdir()):
        with suppress(OSError):
            if time.time() - file.stat().st_mtime > _KEPT_DAYS * _DAY:
                shutil.rmtree(file) if file.is_dir() else file.unlink()
