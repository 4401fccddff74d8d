"""The passes of `ispm render`: how far they are, and what ends them."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from ispm.cli.console import Console
from ispm.cli.interrupts import interrupts
from ispm.errors import OutputError
from ispm.settings import Settings

if TYPE_CHECKING:
    from ispm.renderer import Frame, Renderer
    from ispm.renderer.statistics import Stats

_EVERY = 30.0  # s from one writing of the passes to the next
_Tell = Callable[["Stats"], None]


def render_passes(
    console: Console, renderer: Renderer, resume: str | None
) -> tuple[Frame, bool, OutputError | None]:
    """Render the settings' passes; an interrupt ends them after the one begun.

    resume  file whose passes are continued where it exists, and which then holds them all; it is written now
            and then, so that not all is lost where this process is killed
    ->  the mean, whether an interrupt came, and why the passes could not be kept
    """
    settings, frame, interrupted = renderer.settings, None, False
    if settings.most_passes == 1 and resume is None:
        return renderer.render(), False, None
    continued = resume if resume is not None and Path(resume).exists() else None
    moving = console.is_live and settings.most_passes > 1
    kept = None if resume is None else _Kept(console, renderer, resume)
    with interrupts() as interrupt, _bar(settings) if moving else _lines(console) as tell:
        for frame in renderer.converge(resume=continued):
            tell(frame.stats)
            interrupted = interrupt()
            if interrupted:
                break
            if kept:
                kept.now_and_then()
    assert frame is not None
    if continued is not None and 1 < settings.passes < frame.stats.passes:
        console.warn(
            f"{resume} holds {frame.stats.passes} passes already; --passes {settings.passes} adds none"
        )
    return frame, interrupted, kept.finish() if kept else None


class _Kept:
    """The file that passes are kept in, while they are made."""

    def __init__(self, console: Console, renderer: Renderer, path: str) -> None:
        self._console, self._renderer, self._path = console, renderer, path
        self._last, self._wait = time.monotonic(), _EVERY

    def now_and_then(self) -> None:
        """Write the file where that is some time ago; no more than a tenth of all time goes into it."""
        started = time.monotonic()
        if started - self._last < self._wait:
            return
        try:
            self._renderer.save_progress(self._path)
        except OutputError as error:
            self._console.warn(f"{error}; rendering goes on, and passes are not kept")
        self._last = time.monotonic()
        self._wait = max(_EVERY, 9.0 * (self._last - started))

    def finish(self) -> OutputError | None:
        """Write the file, say so, and return why it could not be: there still is a picture to write."""
        try:
            self._console.written(self._renderer.save_progress(self._path))
        except OutputError as error:
            return error
        return None


@contextmanager
def _lines(console: Console) -> Iterator[_Tell]:
    """Yield what says in a line how far passes are, ever more seldom."""

    def tell(stats: Stats) -> None:
        done = stats.passes
        if done & (done - 1) == 0 or done % 64 == 0:
            console.say(f"  {done} pass{'es' * (done > 1)}{_error(stats)}")

    yield tell


@contextmanager
def _bar(settings: Settings) -> Iterator[_Tell]:
    """Yield what moves a bar on stderr: passes done, the error that noise leaves, and the time to the end."""
    from rich.console import Console as Rich
    from rich.progress import BarColumn, Progress, TextColumn

    columns = TextColumn("  {task.description}"), BarColumn(), TextColumn("{task.fields[left]}")
    started, first = time.perf_counter(), 0  # passes there were before
    with Progress(*columns, console=Rich(stderr=True, highlight=False)) as shown:
        bar = shown.add_task("pass 1", total=None, left="")

        def tell(stats: Stats) -> None:
            nonlocal first
            first = first or stats.passes - 1
            spent = time.perf_counter() - started
            left = seconds_left(settings, stats.passes, spent / (stats.passes - first), spent)
            of = f" of {settings.most_passes}" if math.isfinite(settings.most_passes) else ""
            shown.update(
                bar,
                description=f"{stats.passes}{of} pass{'es' * (stats.passes > 1)}{_error(stats)}",
                completed=spent,
                total=spent + left if math.isfinite(left) else None,
                left=f"{left:.0f} s left" if math.isfinite(left) else f"{spent:.0f} s",
            )

        yield tell


def seconds_left(settings: Settings, done: int, each: float, spent: float) -> float:
    """Return the seconds until passes or time are at their end, whichever is first; inf: neither ends them.

    each   seconds a pass takes;  spent  seconds since the first of this run began
    """
    by_time = settings.time_limit - spent if settings.time_limit else math.inf
    return max(min((settings.most_passes - done) * each, by_time), 0.0)


def _error(stats: Stats) -> str:
    return f", error about {stats.error:.2%}" if stats.error > 0.0 else ""
