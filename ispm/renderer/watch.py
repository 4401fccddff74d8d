"""Wall time of the frame's parts on the CPU, without compilation, and how much memory the process took."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

from ispm.gpu import Gpu, Recording
from ispm.kernels.jit import seconds_compiling


class Watch:
    """Milliseconds by name; the same name adds up.

    timing  how the device is measured, see `Recording`
    """

    def __init__(self) -> None:
        self.milliseconds: dict[str, float] = {}
        self.timing = ""
        self._started = rendering_seconds()
        self._recordings: list[Recording] = []

    @contextmanager
    def __call__(self, name: str) -> Iterator[None]:
        start = rendering_seconds()
        yield
        self.add(name, (rendering_seconds() - start) * 1e3)

    @contextmanager
    def record(self, gpu: Gpu) -> Iterator[Recording]:
        """Record commands whose stages count too."""
        with gpu.frame() as recording:
            self._recordings.append(recording)
            yield recording

    def stop(self) -> float:
        """Add what the device tells of the recordings, which it waits for; return ms since the start."""
        Recording.read_times(self._recordings)
        for recording in self._recordings:
            self.timing = recording.timing
            for name, spent in recording.milliseconds().items():
                self.add(name, spent)
        return (rendering_seconds() - self._started) * 1e3

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
