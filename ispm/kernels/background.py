"""Kernels that other processes compile while this one goes on.

The first kernel of the manifest that is asked for and not kept has all of them compiled, on all cores; this
process goes on to whatever needs none, and waits for each as it comes to it. Where that cannot be, it
compiles them itself, one by one. Either is said once.
"""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from ispm.kernels import store

enabled = True  # False: what is not kept is compiled by this process, without a word
bar = True  # drawn on terminals by who waits; False: lines there, too
_POLL = 0.05  # s
_EVERY = 30.0  # s from a line about what is left to the next, where no bar is drawn
_LONG = 50_000  # bytes of bytecode of a kernel that takes so long that one should know about it


@dataclass
class Progress:
    """How far compilation is.

    what      in words; empty until it is known that there is anything
    seconds   it will take, about
    left      kernels that are not compiled yet
    share     of the work that is done
    begun     when it began, s of time.perf_counter
    failures  a line for each kernel that could not be compiled
    """

    what: str = ""
    seconds: float = 0.0
    left: int = 0
    share: float = 0.0
    begun: float = 0.0
    failures: list[str] = field(default_factory=list)


progress = Progress()
_thread: threading.Thread | None = None
_lock = threading.Lock()
_warned = False


def _print(line: str) -> None:
    print(f"ispm: {line}", file=sys.stderr, flush=True)


say: Callable[[str], None] = _print
"""Tells the user a line; the command line puts its own here."""


def start() -> None:
    """Begin to compile all that is not kept, once in a process; return at once."""
    global _thread
    with _lock:
        if _thread is None and enabled and _can_start():
            _thread = threading.Thread(target=_compile, name="ispm kernels", daemon=True)
            _thread.start()


def finish() -> None:
    """Wait for the end of what was begun."""
    _wait(lambda: False)


def brings(name: str) -> bool:
    """Begin to compile all that is not kept, and wait for the kernel of this name; return whether it came."""
    start()
    _wait(lambda: store.find(name) is not None)
    return store.find(name) is not None


def tell(kernel: str, weight: int) -> None:
    """Say that this process compiles a kernel, where that takes long and nothing was said before."""
    global _warned
    if enabled and weight > _LONG and not _warned:
        _warned = True
        kept = (
            "once"
            if store.written_folder()
            else "which nothing keeps here: ISPM_CACHE names a folder that does"
        )
        say(f"compiling {kernel} and what else is needed, {kept}; that may take a minute")


def _compile() -> None:
    from ispm.kernels.workers import compile_missing

    started = time.perf_counter()
    try:
        with _telling():
            compile_missing(
                progress, _begin, lambda: say("waiting for another process that compiles kernels")
            )
    except OSError:  # no processes to be had: this one compiles
        return
    if progress.what and not _shows_bar():
        say(f"compiled in {time.perf_counter() - started:.0f} s")


@contextmanager
def _telling() -> Iterator[None]:
    """Say now and then how much is left, while it goes on."""
    ended = threading.Event()

    def tell_on() -> None:
        while not ended.wait(_EVERY):
            if progress.left and not _shows_bar():
                say(_so_far(time.perf_counter() - progress.begun))

    teller = threading.Thread(target=tell_on, name="ispm kernels told", daemon=True)
    teller.start()
    try:
        yield
    finally:
        ended.set()
        teller.join()


def _so_far(seconds: float) -> str:
    """What is left after `seconds` of work, at the pace so far."""
    left = f"compiling: {progress.left} kernel{'s' * (progress.left > 1)} left"
    if not progress.share:
        return left
    return f"{left}, about {seconds * (1.0 - progress.share) / progress.share:.0f} s more"


def _begin() -> None:
    global _warned
    _warned, progress.begun = True, time.perf_counter()
    if not _shows_bar():
        say(f"{progress.what}: about {progress.seconds:.0f} s")


def _wait(done: Callable[[], bool]) -> None:
    """Wait until it is done or nobody works at it any more; show how far it is on a terminal."""
    thread = _thread
    while thread is not None and thread.is_alive() and not done():
        if progress.what and _shows_bar():
            _draw(thread, done)
        thread.join(_POLL)


def _draw(thread: threading.Thread, done: Callable[[], bool]) -> None:
    from rich.console import Console
    from rich.progress import BarColumn, TaskProgressColumn, TextColumn
    from rich.progress import Progress as Bar

    columns = TextColumn("{task.description}"), BarColumn(), TaskProgressColumn()
    console = Console(stderr=True, highlight=False)
    with Bar(*columns, console=console, transient=True) as shown:
        task = shown.add_task(f"{progress.what}, about {progress.seconds:.0f} s", total=1.0)
        while thread.is_alive() and not done():
            shown.update(task, completed=progress.share)
            thread.join(_POLL)


def _shows_bar() -> bool:
    return bar and sys.stderr is not None and sys.stderr.isatty()


def _can_start() -> bool:
    """Whether there is an interpreter to start, and a folder to hand over its work."""
    python = os.path.basename(sys.executable or "").lower().startswith("python")
    return python and not getattr(sys, "frozen", False) and store.written_folder() is not None
