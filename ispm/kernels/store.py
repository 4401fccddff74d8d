"""Compiled kernels by content: whoever has the same function, types, versions and CPU finds them.

Two folders: the one that a wheel carries, and the user's, which is written to. A file is a digest of its
name and content, and the content; one that is damaged or cannot be written costs a compilation, no more.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import shutil
import time
from collections.abc import Iterable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

from ispm.cache import cache_fault, cache_folder, fault_of
from ispm.errors import warn_caller

SHIPPED = Path(__file__).parent / "compiled"
ENDING = ".kernel"
_FORMAT = 2  # of the files
_DIGEST = hashlib.sha256().digest_size
_KEPT_DAYS = 30.0
_DAY = 86400.0


def file_name(function: Any, types: Iterable[str], content: str, environment: str) -> str:
    """Return the name of a kernel's file, which tells its content.

    types        of the arguments
    content      digest of what the function depends on
    environment  what the code depends on besides
    """
    text = "\n".join([str(_FORMAT), content, environment, *types])
    digest = hashlib.sha256(text.encode()).hexdigest()
    home = function.__qualname__.replace("<locals>.", "")  # Windows has no such file names
    return f"{function.__module__}.{home}-{digest[:32]}{ENDING}"


def read(name: str) -> tuple[Any, ...] | None:
    """Return what was written under `name`; None where there is nothing, or nothing whole."""
    for folder in _folders():
        data = _content(folder / name)
        if data is None:
            continue
        try:
            parts: tuple[Any, ...] = pickle.loads(data)
        except Exception:  # of another version of a library, whatever it raises
            continue
        _touch(folder / name)
        return parts
    return None


def find(name: str) -> Path | None:
    """Return the whole file of that name; None where there is none."""
    files = [folder / name for folder in _folders()]
    return next((file for file in files if _content(file) is not None), None)


def _content(file: Path) -> memoryview | None:
    """What a file holds; None where it is not what was written under its name: LLVM ends the process then."""
    try:
        data = memoryview(file.read_bytes())
    except OSError:
        return None
    content = data[_DIGEST:]
    return content if _digest(file.name, content) == data[:_DIGEST] else None


def _digest(name: str, content: bytes | memoryview) -> bytes:
    """What tells that a file holds this kernel and not another, each bit of it."""
    return hashlib.sha256(name.encode() + b"\0" + content).digest()


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
        beside.write_bytes(_digest(name, data) + data)
        beside.replace(folder / name)
    except OSError:
        with suppress(OSError):
            beside.unlink()


@cache
def written_folder() -> Path | None:
    """Return the user's folder of kernels, made where it is missing; None where nothing can be written."""
    root = cache_folder()
    if root is None:
        _say(cache_fault())
        return None
    folder = root / "kernels"
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
    except OSError:
        return None
    if fault := fault_of(folder):
        _say(fault)
        return None
    _forget_old(root, folder)
    return folder


def _say(fault: str) -> None:
    if fault:
        warn_caller(fault)


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
