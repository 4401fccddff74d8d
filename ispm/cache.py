"""Where things worth keeping between runs lie: `ISPM_CACHE`, else the platform's cache folder.

Compiled code is among them, so a folder that others own or may write is not used.
"""

from __future__ import annotations

import os
import stat
import sys
from pathlib import Path


def cache_folder() -> Path | None:
    """Return the writable cache folder, made where it is missing; None where there is none."""
    folder = _wanted()
    try:
        if folder is None:
            return None
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError:
        return None
    return folder if os.access(folder, os.W_OK) and not fault_of(folder) else None


def cache_fault() -> str:
    """Return why the folder that would be used is not; an empty string where there is no fault."""
    folder = _wanted()
    return "" if folder is None else fault_of(folder)


def fault_of(folder: Path) -> str:
    """Return why code from a folder cannot be trusted, as others may write there; else an empty string."""
    if not hasattr(os, "geteuid"):
        return ""  # Windows' folders are by default their user's
    try:
        about = folder.stat()
    except OSError:
        return ""
    if about.st_uid != os.geteuid():
        fault, cure = "belongs to another user", "set ISPM_CACHE to a folder of your own"
    elif about.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        fault, cure = "may be written by others", f"chmod go-w '{folder}'"
    else:
        return ""
    return f"the cache folder {folder} {fault}, and is not used; {cure}"


def _wanted() -> Path | None:
    given = os.environ.get("ISPM_CACHE")
    if given:
        return Path(given).absolute()
    platform = _platform_folder()
    return None if platform is None else platform / "ispm"


def _platform_folder() -> Path | None:
    """The user's folder of caches; None where there is none, as without a home."""
    try:
        if sys.platform == "win32":
            local = os.environ.get("LOCALAPPDATA")
            return Path(local) if local else Path.home() / "AppData" / "Local"
        if sys.platform == "darwin":
            return _absolute(Path.home() / "Library" / "Caches")
        # XDG Base Directory Specification 0.8: paths that are not absolute are invalid, and to be ignored
        given = _absolute(Path(os.environ.get("XDG_CACHE_HOME", "")))
        return given or _absolute(Path.home() / ".cache")
    except RuntimeError:  # neither a home nor a user's name
        return None


def _absolute(path: Path) -> Path | None:
    return path if path.is_absolute() else None
