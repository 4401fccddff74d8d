"""From the device to numpy, with one wait for any number of textures and buffers."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import wgpu

from ispm.gpu import traffic
from ispm.gpu.buffer import Buffer
from ispm.gpu.texture import Texture

_ROW = 256  # bytes; rows of a texture copy start at multiples of this
_STAGING_MOST = 96 << 20  # bytes read at a time, if more than one array is


@dataclass
class _Copy:
    """Where one array comes from, and where it lies in the staging buffer.

    offset  bytes
    stored  the shape there, with padded rows
    used    elements of each axis that are not padding
    shape   of the array that the caller gets
    """

    source: Texture | Buffer | wgpu.GPUBuffer
    offset: int
    dtype: np.dtype
    stored: tuple[int, ...]
    used: tuple[int, ...]
    shape: tuple[int, ...]

    @property
    def nbytes(self) -> int:
        return math.prod(self.stored) * self.dtype.itemsize

    def array(self, memory: memoryview, room: _Room) -> np.ndarray:
        rows = np.frombuffer(memory, self.dtype, math.prod(self.stored), self.offset).reshape(self.stored)
        out = room.take(math.prod(self.used) * self.dtype.itemsize).view(self.dtype)
        np.copyto(out.reshape(self.used), rows[tuple(slice(n) for n in self.used)])
        return out.reshape(self.shape)


class _Room:
    """A pool of memory for what is read; a piece is used again when no array refers to it any more.

    The system clears fresh memory before it hands it out, which takes longer than filling it: 0.1 s for
    a frame of 1280 x 720.
    """

    _SMALL = 1 << 20  # bytes, below which pieces are not pooled
    _KEPT = 24  # pieces at most, and
    _MOST = 96 << 20  # bytes, which a frame of 1280 x 720 takes: idle, those of larger ones would be missed
    _LOOSE = 2  # times what is asked for, that a piece holds at most: lists change their length each frame

    def __init__(self) -> None:
        self._pieces: list[np.ndarray] = []

    def take(self, nbytes: int) -> np.ndarray:
        """Return (nbytes,) uint8 that no other array shares."""
        if nbytes < self._SMALL:
            return np.empty(nbytes, np.uint8)
        for index in range(len(self._pieces)):
            # 2 references, the list's and getrefcount's own: arrays that view a piece refer to it, too
            fits = nbytes <= self._pieces[index].nbytes <= self._LOOSE * nbytes
            if fits and sys.getrefcount(self._pieces[index]) <= 2:
                return self._pieces[index][:nbytes]
        new = np.empty(nbytes, np.uint8)
        if nbytes + sum(piece.nbytes for piece in self._pieces) <= self._MOST:
            self._pieces = [*self._pieces[-self._KEPT + 1 :], new]
        return new[:]


class Readback:
    """Reads through one mapped staging buffer, which is kept and grows: 1.3 ms instead of 6.8 ms for
    a 1280 x 720 rgba32float texture by `queue.read_texture` (llvmpipe)."""

    def __init__(self, device: wgpu.GPUDevice) -> None:
        self._device = device
        self._most = device.limits["max-buffer-size"]
        self._staging = self._create(65536)
        self._room = _Room()

    def read(self, wanted: Sequence[tuple[Any, ...]]) -> list[np.ndarray]:
        """Return an array for each item: (texture, dtype, channels) as `Gpu.read_texture` does,
        (buffer, dtype, count) as (count,)."""
        planned: list[_Copy] = []
        end = 4  # bytes that are cleared below
        for source, *about in wanted:
            plan = _plan_texture if isinstance(source, Texture) else _plan_buffer
            planned.append(plan(-(-end // _ROW) * _ROW, source, *about))
            end = planned[-1].offset + -(-planned[-1].nbytes // 4) * 4
        if end > min(self._most, _STAGING_MOST) and len(wanted) > 1:
            half = len(wanted) // 2
            return self.read(wanted[:half]) + self.read(wanted[half:])
        if end > self._staging.size:
            self._staging.destroy()
            self._staging = self._create(end)
        traffic.count(read=sum(copy.nbytes for copy in planned))
        encoder = self._device.create_command_encoder()
        encoder.clear_buffer(self._staging, 0, 4)  # so that mapping waits even where nothing is copied
        for copy in planned:
            self._copy(encoder, copy)
        self._device.queue.submit([encoder.finish()])
        self._staging.map_sync(wgpu.MapMode.READ, 0, end)
        try:
            memory = self._staging.read_mapped(0, end, copy=False)
            return [copy.array(memory, self._room) for copy in planned]
        finally:
            self._staging.unmap()

    def wait(self) -> None:
        """Return when all submitted work is done."""
        self.read([])

    def _copy(self, encoder: wgpu.GPUCommandEncoder, copy: _Copy) -> None:
        source = copy.source
        if isinstance(source, Texture):
            height, row = copy.stored
            encoder.copy_texture_to_buffer(
                {"texture": source.handle},
                {
                    "buffer": self._staging,
                    "offset": copy.offset,
                    "bytes_per_row": row * copy.dtype.itemsize,
                    "rows_per_image": height,
                },
                (*source.size, 1),
            )
        elif copy.nbytes:
            handle = source.handle if isinstance(source, Buffer) else source
            size = -(-copy.nbytes // 4) * 4
            encoder.copy_buffer_to_buffer(handle, 0, self._staging, copy.offset, size)

    def _create(self, size: int) -> wgpu.GPUBuffer:
        usage = wgpu.BufferUsage.MAP_READ | wgpu.BufferUsage.COPY_DST
        return self._device.create_buffer(label="readback", size=size, usage=usage)


def _plan_texture(offset: int, texture: Texture, dtype: Any, channels: int = 1) -> _Copy:
    width, height = texture.size
    dtype = np.dtype(dtype)
    row = -(-width * channels * dtype.itemsize // _ROW) * _ROW // dtype.itemsize
    shape = (height, width, channels) if channels > 1 else (height, width)
    return _Copy(texture, offset, dtype, (height, row), (height, width * channels), shape)


def _plan_buffer(offset: int, buffer: Buffer | wgpu.GPUBuffer, dtype: Any, count: int) -> _Copy:
    return _Copy(buffer, offset, np.dtype(dtype), (count,), (count,), (count,))
