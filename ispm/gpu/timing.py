"""Milliseconds per stage, by the adapter's own clock where it has one."""

from __future__ import annotations

from typing import Any

import numpy as np
import wgpu

from ispm.gpu.readback import Readback

_CAPACITY = 4096  # timestamps of one frame, two a pass; WebGPU's largest set


class Timer:
    """The device's timestamps; shared by all frames, as the queue runs them one after the other."""

    def __init__(self, device: wgpu.GPUDevice) -> None:
        self.queries = device.create_query_set(type="timestamp", count=_CAPACITY)
        self.period_ns = _timestamp_period(device)


class Stopwatch:
    """The times of one frame's stages."""

    def __init__(self, device: wgpu.GPUDevice, readback: Readback, timer: Timer | None) -> None:
        self._device, self._readback, self._timer = device, readback, timer
        self._stages: list[str] = []  # of each timed pass
        self._times: dict[str, float] = {}
        self._resolved: wgpu.GPUBuffer | None = None

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
        usage = wgpu.BufferUsage.QUERY_RESOLVE | wgpu.BufferUsage.COPY_SRC
        self._resolved = self._device.create_buffer(label="timestamps", size=8 * count, usage=usage)
        encoder.resolve_query_set(self._timer.queries, 0, count, self._resolved, 0)

    def milliseconds(self) -> dict[str, float]:
        """Return the sum of each stage's passes, ms."""
        if self._resolved is not None and self._timer is not None:
            (ticks,) = self._readback.read([(self._resolved, np.uint64, 2 * len(self._stages))])
            begin, end = ticks[0::2], ticks[1::2]
            spans = np.where(end > begin, end - begin, 0) * (self._timer.period_ns * 1e-6)
            for stage, span in zip(self._stages, spans, strict=True):
                self.add(stage, float(span))
            self._resolved.destroy()
            self._resolved = None
        return dict(self._times)


def _timestamp_period(device: wgpu.GPUDevice) -> float:
    """Nanoseconds of one tick; wgpu-py has no public way to ask."""
    try:
        from wgpu.backends.wgpu_native._ffi import lib

        return float(lib.wgpuQueueGetTimestampPeriod(device.queue._internal))
    except (ImportError, AttributeError):
        return 1.0
