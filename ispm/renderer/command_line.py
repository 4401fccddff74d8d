"""The command line that makes a picture again."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping
from dataclasses import asdict, fields
from typing import Any

from ispm.knobs import as_text
from ispm.settings import LOADING, Settings, resolve

_DEFAULTS = {"time": None, "environment_intensity": None, "show": "full", "bits": 8}


def command_line(
    scene: str, options: Mapping[str, Any], settings: Settings, loading: Mapping[str, Any], *, output: str
) -> str:
    """Return `ispm render SCENE ... -o OUTPUT` with what differs from the defaults, quoted for a shell.

    options  those of the command itself, by the names of its parameters
    loading  what `load` takes
    """
    words = ["ispm", "render", scene]
    for name, value in options.items():
        if value is not None and value != _DEFAULTS.get(name, False):
            words += _option(name, value)
    if settings.preset != Settings.preset:
        words += _option("preset", settings.preset)
    words += _changed(asdict(settings), resolve({"preset": settings.preset}))
    for owner in LOADING:
        words += _changed(loading, owner())
    return shlex.join([*words, "-o", output])


def _changed(values: Mapping[str, Any], defaults: Any) -> Iterator[str]:
    for f in fields(defaults):
        value = values[f.name]
        if value != getattr(defaults, f.name):
            yield from _option(f.name, value)


def _option(name: str, value: Any) -> list[str]:
    dashed = name.replace("_", "-")
    if isinstance(value, bool):
        return [f"--{dashed}" if value else f"--no-{dashed}"]
    text = as_text(value)
    return [f"--{dashed}={text}"] if text.startswith("-") else [f"--{dashed}", text]
