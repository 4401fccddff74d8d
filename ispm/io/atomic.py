"""Files that are either whole or not there: written beside their place, then renamed into it."""

from __future__ import annotations

import os
import secrets
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ispm.errors import OutputError


def as_path(path: object) -> Path:
    """Return `path` as a Path. Raises OutputError where it is none."""
    if isinstance(path, (str, os.PathLike)):
        return Path(path)
    raise OutputError(f"a {type(path).__name__} is not the path of a file; give a str or a Path")


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """Yield a name beside `path` to write to; what is written there then takes the place of `path`.

    After any error or interrupt nothing is left, and what was at `path` is still there.
    The name ends as `path` does. Missing parent folders are made.
    Raises OutputError where the file cannot be written.
    """
    target = Path(os.path.realpath(path))
    beside = target.with_name(f".{secrets.token_hex(4)}-{target.name[-80:]}")
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        yield beside
        _flush(beside)
        os.replace(beside, target)
    except OSError as error:
        raise _cannot(path, error) from error
    finally:
        beside.unlink(missing_ok=True)


def require_writable(path: str | Path) -> None:
    """Raise OutputError where `path` could not be written; missing parent folders are made."""
    target = Path(os.path.realpath(path))
    if os.path.isdir(target):
        raise OutputError(f"{path}: is a folder; name a file in it")
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=target.parent):
            pass
    except OSError as error:
        raise _cannot(path, error) from error


def _cannot(path: str | Path, error: OSError) -> OutputError:
    return OutputError(f"{path}: cannot be written: {error.strerror or error}")


def _flush(path: Path) -> None:
    """Have the bytes on disk before the name is: a crash then cannot leave an empty file."""
    with open(path, "rb+") as file:
        os.fsync(file.fileno())
