"""Options made from the knobs of dataclasses, and the order in which their values are looked for."""

from __future__ import annotations

import inspect
import os
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import Field, asdict, fields, is_dataclass
from pathlib import Path
from typing import Annotated, Any, Unpack, get_type_hints

from cyclopts import App, Parameter, Token

from ispm.cli.console import Console
from ispm.errors import SettingsError
from ispm.film.settings import Film
from ispm.knobs import as_text
from ispm.settings import LOADING, Changes, Settings, convert, nearest, resolve

app = App(
    name="ispm",
    help="Dynamic global illumination by image space photon mapping.",
    help_format="plaintext",
    suppress_keyboard_interrupt=False,
    help_epilogue="Exit codes: 0 done; 1 a bound of compare exceeded, or slower by bench --compare; "
    "2 bad input or usage; 3 no usable graphics adapter; 130 interrupted.",
)

WHOLE = Parameter(converter=lambda _, tokens: _whole(tokens[0]))  # options that are no knobs; cyclopts rounds
_KNOWN = [f.name for owner in (Settings, Film, *LOADING) for f in fields(owner)]
_OTHER_VARIABLES = ("ISPM_ADAPTER", "ISPM_ASSETS", "ISPM_CACHE", "ISPM_DOWNLOADS", "ISPM_REFS")
_COMMON = {
    "quiet": "print nothing but results and errors",
    "json": "print one JSON object on stdout",
    "debug": "show a traceback where something goes wrong",
}


def command(*owners: type) -> Callable[[Callable[..., int | None]], Callable[..., int | None]]:
    """Make a function a command of `app`; the knobs of `owners` become options.

    The function takes a Console first, then its own parameters, then as `**given` the knobs the user
    gave, as text or bool. The fields of a parameter that is a dataclass are options too. Its return value is
    the exit code; None is 0.
    """

    def register(function: Callable[..., int | None]) -> Callable[..., int | None]:
        def run(
            *args: Any, quiet: bool = False, json: bool = False, debug: bool = False, **given: Any
        ) -> Any:
            known = {name: value for name, value in given.items() if value is not None}
            console = Console(quiet=quiet, as_json=json)
            _warn_of_unknown_variables(console)
            for name, kind in nouns.items():
                known[name] = kind(**{f.name: known.pop(f.name) for f in fields(kind) if f.name in known})
            return function(console, *args, **known)

        taken = list(inspect.signature(function, eval_str=True).parameters.values())[1:]
        taken = [p for p in taken if p.kind is not inspect.Parameter.VAR_KEYWORD]
        nouns: dict[str, Any] = {p.name: p.annotation for p in taken if is_dataclass(p.annotation)}
        own = [p for p in taken if p.name not in nouns]
        own += [p for kind in nouns.values() for p in _parameters(kind)]
        own += [_option(f) for owner in owners for f in fields(owner)]
        own += [
            _keyword(name, bool, help, default=False, negative="", show_default=False)
            for name, help in _COMMON.items()
        ]
        vars(run)["__signature__"] = inspect.Signature(own)  # cyclopts reads it
        run.__annotations__ = {p.name: p.annotation for p in own}
        run.__name__, run.__doc__ = function.__name__, function.__doc__
        app.command(run)
        return run

    return register


def settings_from(given: Mapping[str, Any], config: str | None, **otherwise: Unpack[Changes]) -> Settings:
    """Return the settings: flags, else ISPM_<NAME>, else the TOML file, else `otherwise`, preset, default.

    Raises SettingsError, saying where the value stands.
    """
    with named_as_flags(*given):
        return resolve(*_layers(Settings, given, config), otherwise)


@contextmanager
def named_as_flags(*names: str) -> Iterator[None]:
    """Have a SettingsError that begins with one of these names, and a colon, begin with its flag."""
    try:
        yield
    except SettingsError as error:
        name, colon, fault = str(error).partition(":")
        if name not in names:
            raise
        raise SettingsError(f"--{name.replace('_', '-')}{colon}{fault}") from None


def film_from(given: Mapping[str, Any], config: str | None) -> Film:
    """Return what a film is, found as the settings are."""
    return Film(**_merged(Film, given, config))


def loading_from(given: Mapping[str, Any], config: str | None) -> dict[str, Any]:
    """Return all that `load` takes, found as the settings are."""
    found: dict[str, Any] = {}
    for owner in LOADING:
        found |= asdict(owner(**_merged(owner, given, config)))
    return found


def vector(option: str, text: str) -> tuple[float, float, float]:
    """Return the three numbers of X,Y,Z. Raises SettingsError."""
    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError:
        raise SettingsError(f"{option}: '{text}' is not X,Y,Z") from None
    if not all(abs(value) < 1e12 for value in (x, y, z)):
        raise SettingsError(f"{option}: '{text}' is not a place; give metres")
    return x, y, z


def _whole(token: Token) -> int:
    """The whole number that an option is given. Raises SettingsError."""
    try:
        return int(token.value)
    except ValueError:
        raise SettingsError(f"{token.keyword}: '{token.value}' is not a whole number") from None


def _layers(owner: type, given: Mapping[str, Any], config: str | None) -> list[dict[str, Any]]:
    """The user's values for the knobs of `owner`, converted, the strongest source first."""
    return [
        _picked(owner, given, lambda name: "--" + name.replace("_", "-")),
        _picked(owner, _environment(owner), lambda name: "ISPM_" + name.upper()),
        _picked(owner, _file(config), lambda name: f"{config}: {name}"),
    ]


def _merged(owner: type, given: Mapping[str, Any], config: str | None) -> dict[str, Any]:
    """The user's values for the knobs of `owner`, each from the strongest source that has it."""
    merged: dict[str, Any] = {}
    for layer in reversed(_layers(owner, given, config)):
        merged |= layer
    return merged


def _picked(owner: type, values: Mapping[str, Any], called: Callable[[str], str]) -> dict[str, Any]:
    return {f.name: convert(f, values[f.name], called(f.name)) for f in fields(owner) if f.name in values}


def _environment(owner: type) -> dict[str, str]:
    found = {f.name: os.environ.get("ISPM_" + f.name.upper()) for f in fields(owner)}
    return {name: value for name, value in found.items() if value}


def _warn_of_unknown_variables(console: Console) -> None:
    known = [f"ISPM_{name.upper()}" for name in _KNOWN] + [*_OTHER_VARIABLES]
    for name in os.environ:
        if name.startswith("ISPM_") and name not in known:
            console.warn(f"the environment has {name}, which means nothing{nearest(name, known)}")


def _file(config: str | None) -> dict[str, Any]:
    if config is None:
        return {}
    import tomllib

    try:
        table = tomllib.loads(Path(config).read_text("utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise SettingsError(f"{config}: cannot be read: {getattr(error, 'strerror', error)}") from None
    except tomllib.TOMLDecodeError as error:
        raise SettingsError(f"{config}: is not TOML: {error}") from None
    values = {key.replace("-", "_"): value for key, value in table.items()}
    for key in values:
        if key not in _KNOWN:
            raise SettingsError(f"{config}: there is no setting '{key}'{nearest(key, _KNOWN)}")
    return values


def _parameters(kind: type) -> Iterator[inspect.Parameter]:
    """The options that the fields of a dataclass are, annotated as a command's own parameters."""
    hints = get_type_hints(kind, vars(sys.modules[kind.__module__]), {}, include_extras=True)
    for f in fields(kind):
        yield inspect.Parameter(
            f.name, inspect.Parameter.KEYWORD_ONLY, default=f.default, annotation=hints[f.name]
        )


def _option(f: Field[Any]) -> inspect.Parameter:
    """The option of one knob; values stay text, so that all sources are converted and refused alike."""
    if isinstance(f.default, bool):
        return _keyword(f.name, bool | None, f.metadata["help"], show_default=lambda _: as_text(f.default))
    choices = f" ({', '.join(f.metadata['choices'])})" if f.metadata["choices"] else ""
    return _keyword(
        f.name,
        str | None,
        f.metadata["help"] + choices,
        metavar=f.metadata["metavar"] or "NAME",
        allow_leading_hyphen=True,
        show_default=lambda _: as_text(f.default),
    )


def _keyword(name: str, kind: Any, help: str, *, default: Any = None, **about: Any) -> inspect.Parameter:
    annotation = Annotated[kind, Parameter(help=help, **about)]
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=annotation)
