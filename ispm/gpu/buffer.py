"""Buffers that grow with what is written to them."""

from __future__ import annotations

from typing import Any

import numpy as np
import wgpu

from ispm.gpu import memory, traffic

_USAGE = {
    "storage": wgpu.BufferUsage.STORAGE,
    "vertex": wgpu.BufferUsage.VERTEX | wgpu.BufferUsage.STORAGE,
    "index": wgpu.BufferUsage.INDEX | wgpu.BufferUsage.STORAGE,
}
_COPIES = wgpu.BufferUsage.COPY_SRC | wgpu.BufferUsage.COPY_DST
_SLICE = 1 << 26  # bytes that are written at once
_SMALLEST = 256  # bytes; also what an empty buffer holds, since nothing of size 0 can be bound


class Buffer:
    """Bytes on the device, of a capacity that only grows; contents are lost when it does.

    handle  the device's buffer; a new one after growth
    nbytes  bytes in use, what a binding covers
    """

    def __init__(self, device: wgpu.GPUDevice, name: str, usage: str) -> None:
        self._device, self.name, self._usage = device, name, _USAGE[usage] | _COPIES
        self.handle: wgpu.GPUBuffer = self._create(_SMALLEST)
        self.nbytes = _SMALLEST

    def sized(self, nbytes: int) -> Buffer:
        """Return this buffer with room for `nbytes`, rounded up to 16."""
        self.nbytes = max(-(-nbytes // 16) * 16, 16)
        if self.nbytes > self.handle.size:
            capacity = self.nbytes if self.handle.size == _SMALLEST else self.nbytes * 5 // 4 // 16 * 16
            self.handle = self._create(capacity)  # the old one lives while recorded commands use it
        return self

    def write(self, array: np.ndarray) -> Buffer:
        """Replace the contents by the bytes of `array`; at least one element's room is kept."""
        self.sized(max(array.nbytes, array.itemsize))
        traffic.count(sent=array.nbytes)
        if array.nbytes:
            data = np.ascontiguousarray(array).reshape(-1).view(np.uint8)
            whole = array.nbytes & ~3  # the queue copies in words
            for begin in range(0, whole, _SLICE):
                if begin:
                    self._device.queue.submit([])  # the driver can give back its copy of the slice before
                end = min(begin + _SLICE, whole)
                self._device.queue.write_buffer(self.handle, begin, data[begin:end])
            if whole < array.nbytes:
                tail = np.zeros(4, np.uint8)
                tail[: array.nbytes - whole] = data[whole:]
                self._device.queue.write_buffer(self.handle, whole, tail)
        return self

    def patch(self, array: np.ndarray, offset: int) -> Buffer:
        """Replace bytes in use, from `offset` on, by those of `array`; both are multiples of 4."""
        data = np.ascontiguousarray(array).reshape(-1).view(np.uint8)
        traffic.count(sent=data.nbytes)
        self._device.queue.write_buffer(self.handle, offset, data)
        return self

    def rows(self, first: int, end: int, itemsize: int) -> dict[str, Any]:
        """Return the binding of rows of `itemsize` bytes, at least one, from a multiple of 256 bytes on."""
        size = max(end - first, 1) * itemsize
        return {"buffer": self.handle, "offset": first * itemsize, "size": size}

    def _create(self, size: int) -> wgpu.GPUBuffer:
        memory.changed()
        return self._device.create_buffer(label=self.name, size=size, usage=self._usage)
