"""Rows that a shader appended to buffers, as many as it counted."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ispm.gpu.buffer import Buffer

if TYPE_CHECKING:
    from ispm.gpu.device import Gpu


class Counted:
    """Reads such rows and their count, mostly at once: as many as last time and some are read on trust.

    gpu  the device
    """

    def __init__(self, gpu: Gpu) -> None:
        self._gpu, self._guess = gpu, 0

    def read(self, count: Buffer, most: int, *rows: tuple[Buffer, np.dtype]) -> tuple[int, list[np.ndarray]]:
        """Return what the shader counted, and of each buffer so many rows, but at most `most`."""
        guess = min(self._guess, most)
        (counted, *found) = self._gpu.read_many([(count, np.uint32, 1), *((*each, guess) for each in rows)])
        total = int(counted[0])
        held = min(total, most)
        if held > guess:
            found = self._gpu.read_many([(*each, held) for each in rows])
        self._guess = held * 5 // 4
        return total, [each[:held] for each in found]
