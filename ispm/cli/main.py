"""`ispm`: what begins before anything else is imported, so that an interrupt finds somebody to meet it."""

from __future__ import annotations

import os
import signal
import sys

TYPE_CHECKING = False  # what takes long to import has an interrupt meet nobody
if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any

INTERRUPTED = 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command line and return its exit code. `arguments` default to those of the process.

    0 done; 1 a bound of compare exceeded; 2 bad input or usage, and errors nobody foresaw;
    3 no usable graphics adapter; 130 interrupted.
    """
    watched = _watch()  # while modules are read, Python would tell where it was
    from ispm.cli import commands

    try:
        if watched:
            signal.signal(signal.SIGINT, signal.default_int_handler)
        return commands.run(sys.argv[1:] if arguments is None else list(arguments))
    except KeyboardInterrupt:  # before the command began, or as it ended
        return commands.interrupted()


def _watch() -> bool:
    """Have interrupts end this process at once, where Python would raise them."""
    try:
        if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
            signal.signal(signal.SIGINT, _leave)
            return True
    except ValueError:  # not the main thread
        pass
    return False


def _leave(*_: Any) -> None:
    """End at once: there is nothing to tidy up yet."""
    os.write(2, b"ispm: interrupted\n")
    os._exit(INTERRUPTED)
