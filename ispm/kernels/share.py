"""Work shared among threads that run the same kernel: each takes the next few rows until none are left."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ispm.kernels.jit import jit
from ispm.kernels.simd import address, atomic_add
from ispm.kernels.threads import run_threads

i64 = np.int64


def run_shared(kernel: Callable[[np.uint64], Any], threads: int) -> None:
    """Call `kernel`, which runs numba code, from so many threads, with the address of a counter for
    `shared_rows`; return when all are done."""
    counter = np.zeros(8, i64)  # a cache line of its own
    place = address(counter)
    run_threads(lambda _: kernel(place), threads)


@jit
def shared_rows(counter, step, count):
    """Yield the rows, int64 below `count`, that this thread takes: `step` at a time. The threads that share a
    counter, the address of an int64 that starts at 0, take every row once.
    """
    while True:
        first = atomic_add(counter, i64(step))
        if first >= count:
            return
        for row in range(first, min(first + i64(step), i64(count))):  # noqa: UP028, not in numba
            yield row
