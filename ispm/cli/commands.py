"""Run the command that the arguments name; errors become one line on stderr and an exit code."""

from __future__ import annotations

import os
import sys
import traceback
import warnings
from typing import Any

from cyclopts import CycloptsError, UnusedCliTokensError

from ispm import __version__
from ispm.cli import animate, bench, compare, doctor, info, render, scenes, view
from ispm.cli.console import Console, drop, fault_of, one_line, tell
from ispm.cli.main import INTERRUPTED
from ispm.cli.options import app
from ispm.errors import AdapterError, IspmError, SceneWarning

COMMANDS = (render, view, animate, compare, scenes, info, doctor, bench)  # importing a command registers it

BAD_INPUT, NO_ADAPTER = 2, 3  # exit codes


def run(arguments: list[str]) -> int:
    """Run a command line and return its exit code, as `main` says."""
    if sys.stdout is None or sys.stderr is None:  # closed by the parent process
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
    except (BrokenPipeError, SystemExit):  # the reader of a pipe closed it; rich then raises SystemExit
        drop(sys.stdout)
        return 0
    except KeyboardInterrupt as stopped:
        return interrupted(debug, str(stopped))
    except AdapterError as error:
        return _failed(NO_ADAPTER, str(error), debug)
    except UnusedCliTokensError as error:
        extra = " ".join(error.unused_tokens or [])
        return _failed(BAD_INPUT, f"{extra}: is more than the command takes; see its --help", debug)
    except (IspmError, CycloptsError) as error:
        return _failed(BAD_INPUT, str(error), debug)
    except Exception as error:  # whatever it is, the user gets one line and an exit code
        unnamed = isinstance(error, OSError) and error.filename is None
        if unnamed and (fault := fault_of(sys.stdout)):
            drop(sys.stdout)
            return _failed(BAD_INPUT, f"stdout: cannot be written: {fault}", debug)
        what = f"unexpected {type(error).__name__}: {error}; run again with --debug to see where"
        return _failed(BAD_INPUT, what, debug)


def interrupted(debug: bool = False, told: str = "") -> int:
    """Print on stderr that the command was interrupted, and what is left of it; return the exit code."""
    return _failed(INTERRUPTED, f"interrupted{': ' * bool(told)}{told}", debug)


def _failed(code: int, message: str, debug: bool) -> int:
    """Print in one line on stderr what went wrong, after the traceback with `debug`; return `code`."""
    if debug:
        tell(traceback.format_exc().rstrip())
    tell("ispm: " + one_line(message))
    return code


def _show_warnings(console: Console, everything: bool) -> None:
    """Print warnings about scenes in a line each; those of libraries only with --debug."""

    def show(message: Any, category: type[Warning], *place: Any, **_: Any) -> None:
        console.warn(str(message))

    warnings.showwarning = show
    warnings.simplefilter("default" if everything else "ignore")
    warnings.simplefilter("always", SceneWarning)
