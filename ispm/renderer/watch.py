"""Wall time of the frame's parts on the CPU, without compilation, and how much memory the process took."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

from ispm.kernels.jit import seconds_compiling


class Watch:
    """Milliseconds by name; the same name adds up."""

    def __init__(self) -> None:
        self.milliseconds: dict[str, float] = {}

    @contextmanager
    def __call__(self, name: str) -> Iterator[None]:
        start = rendering_seconds()
        yield
        self.add(name, (rendering_seconds() - start) * 1e3)

    def add(self, name: str, milliseconds: float) -> None:
        """Add a time measured elsewhere."""
        self.milliseconds[name] = self.milliseconds.get(name, 0.0) + milliseconds


def rendering_seconds() -> float:
    """Return a clock that stands still while kernels are compiled or loaded."""
    return time.perf_counter() - seconds_compiling()


def peak_memory() -> int:
    """Return the largest resident size of this process so far in bytes; 0 where it cannot be told."""
    try:
        import resource
    except ImportError:  # Windows
        return 0
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else peak * 1024
