"""Interrupts that let the pass in progress end."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

_HELD = signal.SIGINT, signal.SIGTERM


@contextmanager
def interrupts() -> Iterator[Callable[[], bool]]:
    """Hold the first interrupt back, and yield what tells whether there was one; the second is as always.

    A request to end, as from `timeout` or a batch queue, counts as one.
    """
    before: dict[signal.Signals, Any] = {each: signal.getsignal(each) for each in _HELD}
    asked = False

    def restore() -> None:
        for each, handler in before.items():
            signal.signal(each, handler)

    def note(*_: Any) -> None:
        nonlocal asked
        asked = True
        restore()

    for each in _HELD:
        signal.signal(each, note)
    try:
        yield lambda: asked
    finally:
        restore()
