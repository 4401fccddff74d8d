"""`ispm`: hand the arguments to a command, and turn errors into one line and an exit code."""

from __future__ import annotations

import os
import sys
import traceback
import warnings
from collections.abc import Sequence
from typing import Any

from cyclopts import CycloptsError

from ispm import __version__
from ispm.cli import bench, compare, doctor, info, render, scenes
from ispm.cli.console import Console, one_line
from ispm.cli.options import app
from ispm.errors import AdapterError, IspmError, SceneWarning

COMMANDS = (render, compare, scenes, info, doctor, bench)  # importing a command registers it

BAD_INPUT, NO_ADAPTER, INTERRUPTED = 2, 3, 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command line and return its exit code. `arguments` default to those of the process.

    0 done; 1 a bound of compare exceeded; 2 bad input or usage, and errors nobody foresaw;
    3 no usable graphics adapter; 130 interrupted.
    """
    arguments = sys.argv[1:] if arguments is None else list(arguments)
    if sys.stdout is None or sys.stderr is None:  # closed by who started us; there is nobody to tell
        sys.stdout, sys.stderr = (
            s or os.fdopen(os.open(os.devnull, os.O_WRONLY), "w") for s in (sys.stdout, sys.stderr)
        )
    debug = "--debug" in arguments
    app.version = __version__
    try:
        with warnings.catch_warnings():
            _show_warnings(Console(quiet="--quiet" in arguments), everything=debug)
            code = app(arguments, exit_on_error=False, print_error=False, result_action="return_value")
        sys.stdout.flush()
        return int(code or 0)
    except BrokenPipeError:  # who read the output has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except KeyboardInterrupt:
        return _failed(INTERRUPTED, "interrupted", debug)
    except AdapterError as error:
        return _failed(NO_ADAPTER, str(error), debug)
    except (IspmError, CycloptsError) as error:
        return _failed(BAD_INPUT, str(error), debug)
    except Exception as error:  # whatever it is, the user gets one line and an exit code
        what = f"unexpected {type(error).__name__}: {error}; run again with --debug to see where"
        return _failed(BAD_INPUT, what, debug)


def _failed(code: int, message: str, debug: bool) -> int:
    """Say in one line what went wrong; with the traceback where it is wanted."""
    if debug:
        traceback.print_exc()
    print("ispm: " + one_line(message), file=sys.stderr)
    return code


def _show_warnings(console: Console, everything: bool) -> None:
    """Print warnings about scenes in a line each; those of libraries only with --debug."""

    def show(message: Any, category: type[Warning], *place: Any, **_: Any) -> None:
        console.warn(str(message))

    warnings.showwarning = show
    warnings.simplefilter("default" if everything else "ignore")
    warnings.simplefilter("always", SceneWarning)
