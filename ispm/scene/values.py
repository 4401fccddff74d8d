"""Values that users give: refused by name where they are of another kind or out of range."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Iterable, Mapping
from dataclasses import Field, fields
from enum import Enum
from fnmatch import fnmatchcase
from typing import Any, ClassVar, ParamSpec, Self, TypeVar

import numpy as np

from ispm.errors import IspmError, SceneError
from ispm.knobs import nearest

FARTHEST = 1e18  # m; squares of larger coordinates do not fit a float32
BRIGHTEST = 1e12  # cd/m2, cd and lx: beyond the sun's 2e9, and squares still fit a float32
LEAST = 1e-37  # of what is divided by: the inverse still fits a float32
_LONGEST = 60  # characters of a value that messages show

Point = tuple[float, float, float] | np.ndarray

_Member = TypeVar("_Member", bound=Enum)
_Takes = ParamSpec("_Takes")
_Gives = TypeVar("_Gives")
_OTHERWISE = {
    "position": "translation",
    "location": "translation",
    "orientation": "rotation",
    "color": "base_color",
    "albedo": "base_color",
    "emissive": "emission",
    "fov": "yfov",
    "power": "intensity",
}  # what others call ours, where no name is spelt as much like it


class Strict:
    """A base of dataclasses that refuse names which are not theirs: a misspelt one would change nothing.

    ELSEWHERE  names that people try, and what to write instead
    """

    ELSEWHERE: ClassVar[Mapping[str, str]] = {}

    def __new__(cls, *_: Any, **named: Any) -> Self:
        own = cls.__dataclass_fields__  # type: ignore[attr-defined]  # a base of dataclasses alone
        for name in named:
            if name not in own:
                raise TypeError(cls._lacks(name))
        return super().__new__(cls)

    def __setattr__(self, name: str, value: Any) -> None:
        own = self.__dataclass_fields__  # type: ignore[attr-defined]
        if name not in own and not hasattr(type(self), name):
            raise AttributeError(self._lacks(name))
        object.__setattr__(self, name, value)

    @classmethod
    def _lacks(cls, name: str) -> str:
        """What to say of a name that is none of the fields'."""
        own = cls.__dataclass_fields__  # type: ignore[attr-defined]
        hint = f"; {cls.ELSEWHERE[name]}" if name in cls.ELSEWHERE else _meant(name, own)
        return f"a {cls.__name__} has no '{name}'{hint}"


def strict_call(function: Callable[_Takes, _Gives]) -> Callable[_Takes, _Gives]:
    """Have a function refuse arguments that it does not take by naming the nearest that it does."""
    known = inspect.signature(function).parameters

    @functools.wraps(function)
    def call(*placed: _Takes.args, **named: _Takes.kwargs) -> _Gives:
        for name in named:
            if name not in known:
                raise TypeError(f"{function.__name__} takes no '{name}'{_meant(name, known)}")
        return function(*placed, **named)

    return call


def _meant(name: str, known: Iterable[str]) -> str:
    """'; did you mean ...?' with what stands for this name here, or is spelt like it."""
    other = _OTHERWISE.get(name)
    return f"; did you mean '{other}'?" if other in list(known) else nearest(name, known)


def require(
    what: str,
    value: object,
    low: float = -FARTHEST,
    high: float = FARTHEST,
    *counts: int,
    error: type[IspmError] = SceneError,
) -> None:
    """Raise `error` where `value` is no number of low..high; with `counts`, not one of so many of them."""
    if not counts:
        if not _within(value, low, high):
            raise error(f"{what} must be a number {_of(low, high)}, not {shown(value)}")
        return
    given = value.tolist() if isinstance(value, np.ndarray) else value
    if (
        not isinstance(given, (tuple, list))
        or len(given) not in counts
        or not all(_within(v, low, high) for v in given)
    ):
        many = " or ".join(map(str, counts))
        raise error(f"{what} must be {many} numbers {_of(low, high)}, not {shown(value)}")


def array_of(
    what: str,
    values: object,
    shape: tuple[int | None, ...],
    low: float = -FARTHEST,
    high: float = FARTHEST,
    *,
    error: type[IspmError] = SceneError,
) -> np.ndarray:
    """Return `values` as an array of numbers: itself where it is one.

    shape  what it must have; None: any length
    Raises `error` for another shape, and for values that are not finite or not of low..high.
    """
    wanted = f"({', '.join('n' if n is None else str(n) for n in shape)})"
    try:
        array = np.asarray(values)
    except (TypeError, ValueError):
        array = np.empty(0, object)  # as of rows that differ in length
    if array.dtype.kind not in "iuf":
        raise error(f"{what} must be numbers of shape {wanted}, not {shown(values)}")
    if array.ndim != len(shape) or any(n not in (None, m) for n, m in zip(shape, array.shape, strict=True)):
        raise error(f"{what} must have shape {wanted}, not {array.shape}")
    if array.size and not (array.min() >= low and array.max() <= high):  # NaN is neither
        place = np.argwhere(~((array >= low) & (array <= high)))[0].tolist()
        raise error(f"{what} must be numbers {_of(low, high)}, but {place} is {array[tuple(place)]:g}")
    return array


def frozen(item: object) -> tuple[object, ...]:
    """Return the values of an object's fields, to be compared with what they have become."""
    return tuple(map(kept_value, vars(item).values()))


def kept_value(value: object) -> object:
    """Return a value that is equal while this one is, and stays so if what this one holds is edited."""
    if isinstance(value, np.ndarray):
        return value.dtype.str, value.shape, value.tobytes()
    return tuple(map(kept_value, value)) if isinstance(value, list | tuple) else value


def matches(name: str, pattern: str) -> bool:
    """Return whether a name is `pattern`, or matches it as files' names do: "ball *", "ball ?", "[ab]*".

    Raises SceneError for a pattern that is no text.
    """
    if not isinstance(pattern, str):
        raise SceneError(f"names are found by a text such as 'ball *', not by {shown(pattern)}")
    return name == pattern or fnmatchcase(name, pattern)


def as_code(item: object) -> str:
    """Return a dataclass as the code that makes it, without fields at their defaults."""
    values = {f.name: (f, getattr(item, f.name)) for f in fields(item)}  # type: ignore[arg-type]
    given = [
        f"{name}=<array {value.shape}>" if isinstance(value, np.ndarray) else f"{name}={value!r}"
        for name, (f, value) in values.items()
        if not _is_default(f, value)
    ]
    return f"{type(item).__name__}({', '.join(given)})"


def _is_default(f: Field[Any], value: object) -> bool:
    return value is f.default or (not isinstance(value, np.ndarray) and bool(value == f.default))


def member_of(what: str, value: object, kind: type[_Member]) -> _Member:
    """Return `value`, a member of an enumeration or its number, as the member. Raises SceneError."""
    if isinstance(value, kind):
        return value
    try:
        return kind(value)
    except ValueError:
        names = ", ".join(f"{kind.__name__}.{member.name}" for member in kind)
        raise SceneError(f"{what} must be one of {names}, not {shown(value)}") from None


def _of(low: float, high: float) -> str:
    """The range in words."""
    if (low, high) == (-FARTHEST, FARTHEST):
        return f"of finite size, {high:g} at most"
    return f"of {low:g} to {high:g}"


def _within(value: object, low: float, high: float) -> bool:
    return isinstance(value, (int, float, np.integer, np.floating, np.bool_)) and bool(low <= value <= high)


def shown(value: object) -> str:
    """Return a value as messages show it: its repr, or its type where that is long."""
    if isinstance(value, (tuple, list)) and value and all(isinstance(v, float) for v in value):
        value = (list if isinstance(value, list) else tuple)(float(f"{v:.6g}") for v in value)
    text = " ".join(repr(value).split())
    return text if len(text) <= _LONGEST else f"a {type(value).__name__}"
