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
from ispm.settings import Settings

if TYPE_CHECKING:
    from ispm.renderer import Frame, Renderer
    from ispm.renderer.statistics import Stats

_Tell = Callable[["Stats"], None]


def render_passes(console: Console, renderer: Renderer, resume: str | None) -> tuple[Frame, bool]:
    """Render the settings' passes; an interrupt ends them after the one begun. Return whether one came.

    resume  file whose passes are continued where it exists, and which then holds them all
    """
    settings, frame, interrupted = renderer.settings, None, False
    if settings.most_passes == 1 and resume is None:
        return renderer.render(), False
    continued = resume if resume is not None and Path(resume).exists() else None
    moving = console.is_live and settings.most_passes > 1
    with interrupts() as interrupt, _bar(settings) if moving else _lines(console) as tell:
        for frame in renderer.converge(resume=continued):
            tell(frame.stats)
            interrupted = interrupt()
            if interrupted:
                break
    assert frame is not None
    if resume is not None:
        console.written(renderer.save_progress(resume))
    return frame, interrupted


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
                bar, description=f"{stats.passes}{of} pass{'es' * (stats.passes > 1)}{_error(stats)}",
                completed=spent, total=spent + left if math.isfinite(left) else None,
                left=f"{left:.0f} s left" if math.isfinite(left) else f"{spent:.0f} s",
            )  # fmt: skip

        yield tell


def seconds_left(settings: Settings, done: int, each: float, spent: float) -> float:
    """Return the seconds until passes or time are at their end, whichever is first; inf: neither ends them.

    each   seconds a pass takes;  spent  seconds since the first of this run began
    """
    by_time = settings.time_limit - spent if settings.time_limit else math.inf
    return max(min((settings.most_passes - done) * each, by_time), 0.0)


def _error(stats: Stats) -> str:
    return f", error about {stats.error:.2%}" if stats.error > 0.0 else ""
