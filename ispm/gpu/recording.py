"""Recording the commands of a frame, with small uniforms and the time of each stage."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from types import TracebackType
from typing import Any

import numpy as np
import wgpu

from ispm.errors import IspmError
from ispm.gpu import traffic
from ispm.gpu.raster import Canvas
from ispm.gpu.readback import Readback
from ispm.gpu.texture import Texture
from ispm.gpu.timing import Stopwatch, Timer, read_times

_CHUNK = 65536  # bytes; the largest uniform binding that every adapter has
_ALIGNMENT = 256  # bytes between uniforms; WebGPU's baseline


class UniformPool:
    """Memory for the uniforms of one recording at a time, in chunks that are kept."""

    def __init__(self, device: wgpu.GPUDevice) -> None:
        self._device = device
        self._chunks: list[tuple[wgpu.GPUBuffer, np.ndarray]] = []
        self._chunk, self._used = 0, 0
        self.in_use = False

    def add(self, array: np.ndarray) -> dict[str, Any]:
        """Return the binding of the bytes that hold `array` from the next `flush` on."""
        data = np.ascontiguousarray(array).reshape(-1).view(np.uint8)
        size = -(-data.nbytes // 16) * 16
        if self._used + size > _CHUNK:
            self._chunk, self._used = self._chunk + 1, 0
        if self._chunk == len(self._chunks):
            usage = wgpu.BufferUsage.UNIFORM | wgpu.BufferUsage.COPY_DST
            buffer = self._device.create_buffer(label="uniforms", size=_CHUNK, usage=usage)
            self._chunks.append((buffer, np.zeros(_CHUNK, np.uint8)))
        buffer, staged = self._chunks[self._chunk]
        staged[self._used : self._used + data.nbytes] = data
        binding = {"buffer": buffer, "offset": self._used, "size": size}
        self._used += -(-size // _ALIGNMENT) * _ALIGNMENT
        return binding

    def flush(self) -> None:
        """Send everything added and start over; the queue keeps the order with submitted work."""
        for index in range(min(self._chunk + 1, len(self._chunks))):
            buffer, staged = self._chunks[index]
            count = _CHUNK if index < self._chunk else min(self._used, _CHUNK)
            if count:
                traffic.count(sent=count)
                self._device.queue.write_buffer(buffer, 0, staged[:count])
        self._chunk, self._used = 0, 0


class Recording:
    """Commands that are sent together, a part of a frame; made by `Gpu.frame` and used as a context, which
    sends them as it is left.

    Only one may be open at a time. `timing` says how stages are measured: `timestamps` by the
    adapter's clock, `fenced` by waiting for each stage, or `off`.
    """

    def __init__(
        self,
        device: wgpu.GPUDevice,
        uniforms: UniformPool,
        readback: Readback,
        timer: Timer | None,
        timed: bool,
    ) -> None:
        self._device, self._uniforms, self._readback = device, uniforms, readback
        self._stopwatch = Stopwatch(device, readback, timer)
        self._fenced = timed and timer is None
        self.timing = "timestamps" if timer else "fenced" if timed else "off"
        self._stage, self._started = "", time.perf_counter()
        self.encoder = device.create_command_encoder()
        self._afterwards: list[Callable[[], None]] = []

    def __enter__(self) -> Recording:
        if self._uniforms.in_use:
            raise IspmError("this renderer is at work in another thread; give each thread one of its own")
        self._uniforms.in_use = True
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._uniforms.in_use = False
        if error is None:
            self.stage("")
            self._stopwatch.finish(self.encoder)
            self._submit()
            for do in self._afterwards:
                do()
        else:
            self._uniforms.flush()  # the pool starts over; nothing of this recording runs

    def stage(self, name: str) -> None:
        """Count the passes from here on as the stage `name`; the same name adds up."""
        if self._fenced:
            self._submit()
            self._reopen()
            self._readback.wait()
            now = time.perf_counter()
            if self._stage:
                self._stopwatch.add(self._stage, (now - self._started) * 1e3)
            self._started = now
        self._stage = name

    def afterwards(self, do: Callable[[], None]) -> None:
        """Have `do` called when all is sent; it is not where the recording is left by an error."""
        self._afterwards.append(do)

    def submit(self) -> None:
        """Send what is recorded so far to the device and go on recording."""
        self._submit()
        self._reopen()

    def milliseconds(self) -> dict[str, float]:
        """Return the time of each stage on the device in ms; waits for it. Call it after the context."""
        return self._stopwatch.milliseconds()

    @staticmethod
    def read_times(recordings: Sequence[Recording]) -> None:
        """Read at once what recordings of one device have to tell; `milliseconds` then does not wait."""
        read_times([recording._stopwatch for recording in recordings])

    def uniform(self, array: np.ndarray) -> dict[str, Any]:
        """Return a binding of a uniform that holds `array` for the commands until the next submission."""
        return self._uniforms.add(array)

    @contextmanager
    def compute_pass(self, label: str) -> Iterator[wgpu.GPUComputePassEncoder]:
        """Open a compute pass."""
        writes = self._stopwatch.mark(self._stage)
        commands = self.encoder.begin_compute_pass(label=label, timestamp_writes=writes)
        yield commands
        commands.end()

    @contextmanager
    def draw_into(
        self,
        *color: Texture,
        depth: Texture | None = None,
        clear: Sequence[float] | None = (0.0, 0.0, 0.0, 0.0),
        clear_depth: float | None = 0.0,
    ) -> Iterator[Canvas]:
        """Open a render pass.

        clear        value of all attachments; None keeps what is there
        clear_depth  0 is far; None keeps what is there
        """
        commands = self.encoder.begin_render_pass(
            label=self._stage,
            color_attachments=[_color(each, clear) for each in color],
            depth_stencil_attachment=None if depth is None else _depth(depth, clear_depth),
            timestamp_writes=self._stopwatch.mark(self._stage),
        )
        yield Canvas(commands)
        commands.end()

    def clear_buffer(self, buffer: Any) -> None:
        """Set all bytes of a `Buffer` to 0."""
        self.encoder.clear_buffer(buffer.handle, 0, buffer.nbytes)

    def _submit(self) -> None:
        self._uniforms.flush()
        self._device.queue.submit([self.encoder.finish()])

    def _reopen(self) -> None:
        self.encoder = self._device.create_command_encoder()


def _color(texture: Texture, clear: Sequence[float] | None) -> dict[str, Any]:
    if clear is None:
        return {"view": texture.view, "load_op": "load", "store_op": "store"}
    return {"view": texture.view, "load_op": "clear", "store_op": "store", "clear_value": tuple(clear)}


def _depth(texture: Texture, clear: float | None) -> dict[str, Any]:
    keep = {"view": texture.view, "depth_load_op": "load", "depth_store_op": "store"}
    return keep if clear is None else keep | {"depth_load_op": "clear", "depth_clear_value": clear}
