"""The errors a user may meet. Each message says what is wrong, where, and how to mend it.

    IspmError
    ├── SceneError      a file or scene that cannot be used      (also a ValueError)
    ├── SettingsError   a setting that cannot be used            (also a ValueError)
    ├── OutputError     a picture or file that cannot be written (also an OSError)
    └── AdapterError    no graphics adapter, or one that cannot do the work

Where something is left to draw, the library warns instead, with `SceneWarning`.
"""

import inspect
import warnings


class IspmError(Exception):
    """Any error that `ispm` raises on purpose."""


class SceneError(IspmError, ValueError):
    """A scene file or a scene that cannot be used."""


class SettingsError(IspmError, ValueError):
    """A setting that is unknown, out of range, or at odds with another."""


class OutputError(IspmError, OSError):
    """A result that cannot be written or read back."""


class AdapterError(IspmError, RuntimeError):
    """No graphics adapter, or one that lacks what the work needs."""


class SceneWarning(UserWarning):
    """A fault or an unsupported feature in a scene that still leaves something to draw."""


def warn_caller(line: str) -> None:
    """Warn with a SceneWarning that points to the line outside this package that called it."""
    level, frame = 1, inspect.currentframe()
    while frame is not None and frame.f_globals.get("__name__", "").split(".")[0] == __package__:
        level, frame = level + 1, frame.f_back
    warnings.warn(line, SceneWarning, stacklevel=level)
