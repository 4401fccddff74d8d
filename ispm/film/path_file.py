"""Camera paths as TOML, docs/films.md. Faults are told with the number of the line that they stand in."""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ispm.errors import SettingsError
from ispm.film.path import CameraKey, CameraPath
from ispm.settings import nearest

_FIELDS = {"time": "time", "eye": "eye", "target": "target", "fov": "yfov"}  # of a key, in the file and here
_NEEDED = ("time", "eye", "target")


def read_path(path: str | Path) -> CameraPath:
    """Return the camera path in a TOML file: tables [[key]] of time (s), eye, target (m) and fov (degrees).

    A key without fov has that of the one before, the first 50 degrees.
    Raises SettingsError for a file that cannot be read or holds no path.
    """
    try:
        text = Path(path).read_text("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise SettingsError(f"{path}: cannot be read: {getattr(error, 'strerror', error)}") from None
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise SettingsError(_broken(str(path), str(error), text)) from None
    lines = _Lines(str(path), text.splitlines())
    for name in table:
        if name != "key":
            raise lines.fault(f"there is no '{name}' in a camera path{nearest(name, ['key'])}", name)
    tables = table.get("key", [])
    if not isinstance(tables, list) or not all(isinstance(each, dict) for each in tables):
        raise lines.fault("key is no table; begin each key frame with a line [[key]]", "key")
    keys: list[CameraKey] = []
    for number, each in enumerate(tables):
        keys.append(_key(lines, number, each, keys[-1] if keys else None))
    try:
        return CameraPath(keys)
    except SettingsError as error:
        raise lines.fault(str(error), *_stands(error, keys)) from None


def _stands(error: SettingsError, keys: list[CameraKey]) -> tuple[str, int]:
    """What is at fault in a path of sound keys: a time, or that they are too few."""
    late = [k for k in range(1, len(keys)) if not keys[k].time > keys[k - 1].time]
    return ("time", late[0]) if late else ("key", max(len(keys) - 1, 0))


def _key(lines: _Lines, number: int, table: Mapping[str, Any], before: CameraKey | None) -> CameraKey:
    """One key frame."""
    for name in table:
        if name not in _FIELDS:
            hint = nearest(name, _FIELDS) or f"; it has {', '.join(_FIELDS)}"
            raise lines.fault(f"a key has no '{name}'{hint}", name, number)
    for name in _NEEDED:
        if name not in table:
            raise lines.fault(f"key {number + 1} lacks its {name}", "key", number)
    fov = table.get("fov")
    if fov is not None and not (type(fov) in (int, float) and 0.0 < fov < 180.0):
        raise lines.fault(f"fov must be between 0 and 180 degrees, not {fov!r}", "fov", number)
    last = CameraKey.yfov if before is None else before.yfov
    values = {_FIELDS[name]: table[name] for name in _NEEDED}
    try:
        return CameraKey(**values, yfov=last if fov is None else math.radians(fov))
    except SettingsError as error:
        raise lines.fault(str(error), str(error).partition(" ")[0].rstrip(":"), number) from None


def _broken(path: str, error: str, text: str) -> str:
    """What is wrong with a file that is no TOML, with its line first."""
    place = re.search(r" \((?:at line (\d+), column \d+|at end of document)\)$", error)
    line = (place and place[1]) or len(text.splitlines()) or 1
    return f"{path}:{line}: is not TOML: {error[: place.start()] if place else error}"


@dataclass(frozen=True)
class _Lines:
    """Where what was read stands: TOML's reader does not tell.

    path  the file;  text  its lines
    """

    path: str
    text: list[str]

    def fault(self, told: str, name: str, number: int = 0) -> SettingsError:
        """Return the error about the name `name` of the key frame `number`, from 0."""
        return SettingsError(f"{self.path}:{self._of(name, number)}: {told}")

    def _of(self, name: str, number: int) -> int:
        """The number of the line, from 1; the last where there is none."""
        heads = [k for k, line in enumerate(self.text) if re.match(r"\s*\[\[\s*key\s*\]\]", line)]
        first = heads[number] if number < len(heads) else 0
        end = heads[number + 1] if number + 1 < len(heads) else len(self.text)
        if name == "key" and heads:
            return first + 1
        for k in range(0 if name not in _FIELDS else first, end):
            if re.match(rf"\s*[\"']?{re.escape(name)}\b", self.text[k]):
                return k + 1
        return first + 1
