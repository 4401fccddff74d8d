"""Files that are either whole or not there: written under another name, then renamed."""

from __future__ import annotations

import os
import re
import secrets
import stat
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path

from ispm.errors import OutputError

_BESIDE = re.compile(r"\.ispm-[0-9a-f]{8}-")  # how names begin that are written to first
_TAIL = 64  # bytes that are left of a target's name in these; the longest name that file systems take is 255
_OLD = 3600.0  # s, after which one was left by a process that was killed: nothing takes as long to write
_KINDS = {
    stat.S_IFDIR: "a folder",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
    stat.S_IFIFO: "a FIFO",
    stat.S_IFSOCK: "a socket",
}


def as_path(path: object) -> Path:
    """Return `path` as a Path. Raises OutputError where it is none."""
    if isinstance(path, (str, os.PathLike)):
        return Path(path)
    raise OutputError(f"a {type(path).__name__} is not the path of a file; give a str or a Path")


def write_whole(path: str | Path, chunks: Iterable[bytes | memoryview]) -> None:
    """Write bytes to `path`, as `replacing` does."""
    with replacing(path) as beside, open(beside, "wb") as file:
        file.writelines(chunks)


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """Yield an empty file beside `path` to write to; what is written there then takes the place of `path`.

    Where `path` is a link to a file, that file is replaced and the link stays. A new file has the mode of the
    one that it replaces. After any error or interrupt nothing is left, and what was at `path` is still there.
    The name ends as `path` does. Missing parent folders are made.
    Raises OutputError where the file cannot be written, or something stands there that is no file.
    """
    try:
        target, mode = _place(path)
        _sweep(target.parent)
        beside = target.with_name(f".ispm-{secrets.token_hex(4)}-{_tail(target.name)}")
        try:
            _create(beside, mode)
            yield beside
            _flush(beside)
            if mode is not None:
                beside.chmod(mode)
            os.replace(beside, target)
        finally:
            with suppress(OSError):
                beside.unlink()
    except OutputError:
        raise
    except OSError as error:
        raise _cannot(path, error) from error


def require_writable(path: str | Path) -> None:
    """Raise OutputError where `path` could not be written; missing parent folders are made."""
    try:
        target, mode = _place(path)
        beside = target.with_name(f".ispm-{secrets.token_hex(4)}-")
        try:
            _create(beside, mode)
        finally:
            beside.unlink(missing_ok=True)
    except OutputError:
        raise
    except OSError as error:
        raise _cannot(path, error) from error


def remove_unfinished(folder: Path, names: Iterable[str]) -> None:
    """Remove what killed processes left of files of these names; none may be writing them now."""
    tails = {_tail(name) for name in names}
    with suppress(OSError):
        for each in folder.iterdir():
            match = _BESIDE.match(each.name)
            if match and each.name[match.end() :] in tails:
                each.unlink()


def _tail(name: str) -> str:
    """What names of files that are written first have of that which they take the place of."""
    return name.encode()[-_TAIL:].decode(errors="ignore")


def _place(path: str | Path) -> tuple[Path, int | None]:
    """The file that `path` stands for, its folder made, and the mode of what is there; None: nothing is."""
    try:
        str(path).encode()
    except UnicodeEncodeError:
        raise OutputError(f"{str(path)!r}: the name is no UTF-8; give another one") from None
    if "\0" in str(path):
        raise OutputError(f"{str(path)!r}: no name holds a NUL; give another one")
    target = Path(os.path.realpath(path))
    target.parent.mkdir(parents=True, exist_ok=True)
    try:
        found = target.stat().st_mode
    except FileNotFoundError:
        return target, None
    if not stat.S_ISREG(found):
        kind = _KINDS.get(stat.S_IFMT(found), "no file")
        cure = "name a file in it" if stat.S_ISDIR(found) else "name a file"
        raise OutputError(f"{path}: is {kind}; {cure}")
    return target, stat.S_IMODE(found)


def _create(path: Path, mode: int | None) -> None:
    """Make an empty file that no more people may read than the one it replaces; None: there is none."""
    allowed = 0o666 if mode is None else mode | stat.S_IWUSR
    os.close(os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY, allowed))


@cache
def _sweep(folder: Path) -> None:
    """Remove what killed processes of this user left in a folder; once in a process."""
    with suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            if _BESIDE.match(entry.name) and entry.is_file(follow_symlinks=False):
                about = entry.stat(follow_symlinks=False)
                mine = not hasattr(os, "geteuid") or about.st_uid == os.geteuid()
                if mine and time.time() - about.st_mtime > _OLD:
                    with suppress(OSError):
                        os.unlink(entry.path)


def _cannot(path: str | Path, error: OSError) -> OutputError:
    return OutputError(f"{path}: cannot be written: {error.strerror or error}")


def _flush(path: Path) -> None:
    """Have the bytes on disk before the name is: a crash then cannot leave an empty file."""
    with open(path, "rb+") as file:
        os.fsync(file.fileno())
