"""Knobs: fields of dataclasses with range, unit and help, and how users' values for them are read."""

from __future__ import annotations

import difflib
import math
import numbers
import re
from collections.abc import Iterable, Mapping
from dataclasses import Field, field
from typing import Any

from ispm.errors import SettingsError


def knob(
    default: Any,
    help: str,
    *,
    within: tuple[float, float] = (-math.inf, math.inf),
    choices: tuple[str, ...] = (),
    words: Mapping[str, Any] | None = None,
    unit: str = "",
    metavar: str = "",
    whole: bool = False,
    name: bool = False,
) -> Any:
    """Return a dataclass field that carries its help, range, choices and unit.

    within  the least and the greatest number
    words   what may stand instead of a number, and the value that each stands for
    whole   numbers are whole, though the default is a word
    name    any text
    """
    about = dict(
        help=help, within=within, choices=choices, words=words or {}, unit=unit, whole=whole, name=name
    )
    return field(default=default, metadata={**about, "metavar": metavar})


def nearest(name: str, known: Iterable[str]) -> str:
    """Return '; did you mean ...?' for the known name closest to `name`, or an empty string."""
    for close in difflib.get_close_matches(str(name), sorted(known), 1):
        return f"; did you mean '{close}'?"
    return ""


def convert(f: Field[Any], value: Any, called: str = "") -> Any:
    """Return `value`, a Python value or text, as the knob `f` holds it.

    called  how the user wrote the knob's name: `--photons`, `ISPM_PHOTONS`
    Raises SettingsError where the value does not suit the knob.
    """
    try:
        if f.metadata["choices"]:
            return _choice(f, value)
        if f.metadata["name"]:
            return _text(value)
        if isinstance(f.default, bool):
            return _switch(value)
        return _numbers(f, value)
    except (SettingsError, OverflowError) as error:
        raise SettingsError(f"{called or f.name}: {error}") from None


def as_text(value: Any) -> str:
    """Return a knob's value as it is written on the command line."""
    if isinstance(value, tuple):
        whole = all(isinstance(v, int) for v in value)
        return ("x" if whole else ",").join(repr(v).removesuffix(".0") for v in value)
    return str(value).lower() if isinstance(value, bool) else str(value)


def _choice(f: Field[Any], value: Any) -> str:
    choices: tuple[str, ...] = f.metadata["choices"]
    if value in choices:
        return str(value)
    raise SettingsError(f"'{value}' is not one of {', '.join(choices)}{nearest(str(value), choices)}")


def _text(value: Any) -> str:
    if isinstance(value, str):
        return value
    raise SettingsError(f"{value!r} is no text")


def _switch(value: Any) -> bool:
    yes, no = ("1", "true", "yes", "on"), ("0", "false", "no", "off")
    words = dict.fromkeys(yes, True) | dict.fromkeys(no, False)
    if isinstance(value, bool):
        return value
    if isinstance(value, str) and value.lower() in words:
        return words[value.lower()]
    raise SettingsError(f"{value!r} is not true or false")


def _numbers(f: Field[Any], value: Any) -> Any:
    words: Mapping[str, Any] = f.metadata["words"]
    shape = f.default if isinstance(f.default, tuple) else (f.default,)
    if isinstance(value, str):
        if value in words:
            return words[value]
        hint = nearest(value, words) if value[:1].isalpha() else ""
        parts = re.split(r"\s*[xX,]\s*", value) if isinstance(f.default, tuple) else [value]
        if isinstance(f.default, tuple) and not all(parts):
            raise SettingsError(f"'{value}' is not {len(shape)} numbers")
        value = [_parse(part.strip(), words, hint) for part in parts]
    given = list(value) if isinstance(value, Iterable) else [value]
    if len(given) != len(shape):
        raise SettingsError(f"needs {len(shape)} number{'s' * (len(shape) > 1)}, not {len(given)}")
    result = tuple(_number(f, n, whole=isinstance(shape[0], int) or f.metadata["whole"]) for n in given)
    if isinstance(f.default, tuple):
        return result
    (number,) = result
    return number


def _parse(text: str, words: Iterable[str] = (), hint: str = "") -> float:
    """Return the number that `text` writes: 40000, 40_000, 40k, 1e6, 2M."""
    match = re.fullmatch(r"([-+]?(?:\d[\d_]*\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)([kKMG]?)", text)
    if not match:
        other = "".join(f" or {word}" for word in words)
        raise SettingsError(f"'{text}' is not a number{other}{hint}")
    digits, factor = match.groups()
    return float(digits.replace("_", "")) * {"": 1, "k": 1e3, "K": 1e3, "M": 1e6, "G": 1e9}[factor]


def _number(f: Field[Any], value: Any, *, whole: bool) -> float:
    (low, high), unit = f.metadata["within"], f.metadata["unit"]
    if isinstance(value, bool) or not isinstance(value, numbers.Real):
        raise SettingsError(f"{value!r} is not a number")
    number = float(value)
    if not low <= number <= high:
        raise SettingsError(f"{number:.10g} is outside {low} to {high}{' ' * bool(unit)}{unit}")
    if whole and number != int(number):
        raise SettingsError(f"{number} is not a whole number")
    return int(number) if whole else number
