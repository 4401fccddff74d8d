"""The mean over the receivers around each, of a value that differs from pixel to pixel by noise."""

from __future__ import annotations

import numpy as np

from ispm.kernels.share import run_shared, shared_rows
from ispm.optics.jit import jit

f32 = np.float32

_AROUND = 2  # low-resolution pixels on each side, over which the mean goes
_SAME_WAY = 0.9  # cosine of normals, above which receivers belong together
_LEAST_SHARE = f32(1e-6)
_CHUNK = 1024  # receivers a thread takes at a time
_LEAST_MEAN = 1e-12  # that is returned, as others divide by it


def mean_around(receivers: np.ndarray, values: np.ndarray, size: tuple[int, int], threads: int) -> np.ndarray:
    """Return means over the receivers around each that face as it does, (n,) float32 above 0.

    receivers  (n,) RECEIVER, row by row of a picture of `size`;  values  (n,) float32
    """
    out = np.full(len(receivers), _LEAST_MEAN, np.float32)
    run_shared(lambda counter: _mean_around(receivers, values, size, counter, out), threads)
    return out


def ratio_around(
    receivers: np.ndarray, values: np.ndarray, shares: np.ndarray, size: tuple[int, int], threads: int
) -> np.ndarray:
    """Return `mean_around` of values over that of the shares, (n,) of 0 to 1, that have any."""
    share = np.maximum(mean_around(receivers, shares, size, threads), _LEAST_SHARE)
    return np.asarray(mean_around(receivers, values, size, threads) / share)


@jit
def _mean_around(receivers, values, size, counter, out):
    for i in shared_rows(counter, _CHUNK, len(receivers)):
        if receivers[i].valid == np.uint32(0):
            continue
        ng, total, count = receivers[i].ng, f32(0), f32(0)
        x, y = i % size[0], i // size[0]
        for row in range(max(y - _AROUND, 0), min(y + _AROUND + 1, size[1])):
            for column in range(max(x - _AROUND, 0), min(x + _AROUND + 1, size[0])):
                k = row * size[0] + column
                facing = f32(0)
                for axis in range(3):
                    facing += ng[axis] * receivers[k].ng[axis]
                if facing > _SAME_WAY:
                    total += values[k]
                    count += f32(1)
        out[i] = max(total / max(count, f32(1)), f32(_LEAST_MEAN))
