"""Milliseconds per stage, by the adapter's own clock where it has one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import wgpu

from ispm.gpu.readback import Readback

_CAPACITY = 4096  # timestamps of one recording, two a pass; WebGPU's largest set
_HELD = 4 * _CAPACITY  # of the recordings that are not read yet: a frame's are a few dozen
_STEP = 32  # timestamps that a recording's begin at multiples of


class Timer:
    """The device's timestamps; shared by all recordings, as the queue runs them one after the other."""

    def __init__(self, device: wgpu.GPUDevice) -> None:
        self.queries = device.create_query_set(type="timestamp", count=_CAPACITY)
        self.period_ns = _timestamp_period(device)
        usage = wgpu.BufferUsage.QUERY_RESOLVE | wgpu.BufferUsage.COPY_SRC
        self.resolved = device.create_buffer(label="timestamps", size=8 * _HELD, usage=usage)
        self._next = 0

    def room(self, count: int) -> int:
        """Return the row of `resolved` from which on there is room for so many timestamps."""
        first = self._next if self._next + count <= _HELD else 0
        self._next = first + -(-count // _STEP) * _STEP
        return first


class Stopwatch:
    """The times of one frame's stages."""

    def __init__(self, device: wgpu.GPUDevice, readback: Readback, timer: Timer | None) -> None:
        self._device, self._readback, self._timer = device, readback, timer
        self._stages: list[str] = []  # of each timed pass
        self._times: dict[str, float] = {}
        self._first: int | None = None  # row of the timer's, of timestamps that are not read

    def add(self, stage: str, milliseconds: float) -> None:
        """Add a time measured elsewhere."""
        self._times[stage] = self._times.get(stage, 0.0) + milliseconds

    def mark(self, stage: str) -> dict[str, Any] | None:
        """Return what a pass of `stage` has to write; None where nothing can be measured."""
        begin = 2 * len(self._stages)
        if self._timer is None or not stage or begin + 2 > _CAPACITY:
            return None
        self._stages.append(stage)
        return {
            "query_set": self._timer.queries,
            "beginning_of_pass_write_index": begin,
            "end_of_pass_write_index": begin + 1,
        }

    def finish(self, encoder: wgpu.GPUCommandEncoder) -> None:
        """Record the copy of the timestamps to a buffer."""
        if self._timer is None or not self._stages:
            return
        count = 2 * len(self._stages)
        self._first = self._timer.room(count)
        encoder.resolve_query_set(self._timer.queries, 0, count, self._timer.resolved, 8 * self._first)

    def milliseconds(self) -> dict[str, float]:
        """Return the sum of each stage's passes, ms."""
        read_times([self])
        return dict(self._times)

    def take(self, ticks: np.ndarray) -> None:
        """Count what (n,) uint64 timestamps tell, of which this recording's are from its first row on."""
        if self._first is not None and self._timer is not None:
            own = ticks[self._first : self._first + 2 * len(self._stages)]
            begin, end = own[0::2], own[1::2]
            spans = np.where(end > begin, end - begin, 0) * (self._timer.period_ns * 1e-6)
            for stage, span in zip(self._stages, spans, strict=True):
                self.add(stage, float(span))
        self._first = None

    @property
    def end(self) -> int:
        """The row of the timer's after its last; 0 where it has none that are not read."""
        return 0 if self._first is None else self._first + 2 * len(self._stages)


def read_times(stopwatches: Sequence[Stopwatch]) -> None:
    """Read the timestamps of recordings of one device, with one wait for all."""
    waiting = [each for each in stopwatches if each.end]
    if not waiting:
        return
    first, timer = waiting[0], waiting[0]._timer
    assert timer is not None
    (ticks,) = first._readback.read([(timer.resolved, np.uint64, max(each.end for each in waiting))])
    for each in waiting:
        each.take(ticks)


def _timestamp_period(device: wgpu.GPUDevice) -> float:
    """Nanoseconds of one tick; wgpu-py has no public way to ask."""
    try:
        from wgpu.backends.wgpu_native._ffi import lib

        return float(lib.wgpuQueueGetTimestampPeriod(device.queue._internal))
    except (ImportError, AttributeError):
        return 1.0
