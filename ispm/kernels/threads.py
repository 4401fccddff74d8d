"""Work shared out over kept threads; the kernels release the GIL, so Python threads are enough."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import Any

from ispm.errors import SettingsError

_MAX_THREADS = 1024  # threads; more of them than cores gain nothing


def thread_count(threads: int | None) -> int:
    """Return `threads`, or the number of cores this process may use where it is None or 0.

    Raises SettingsError for a number of threads that makes no sense.
    """
    if threads:
        if not isinstance(threads, int) or not 0 < threads <= _MAX_THREADS:
            raise SettingsError(f"threads: {threads!r} is not a whole number of 1 to {_MAX_THREADS}")
        return threads
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def run_threads(worker: Callable[[int], Any], threads: int) -> list[Any]:
    """Call worker(k) for k in range(threads), at the same time, and return what they return.

    An exception of a worker propagates after all have ended. One thread: runs in the caller.
    """
    if threads == 1:
        return [worker(0)]
    futures = [_pool(threads - 1, os.getpid()).submit(worker, k) for k in range(1, threads)]
    try:
        first = worker(0)
    finally:
        errors = [future.exception() for future in futures]
    for error in errors:
        if error is not None:
            raise error
    return [first, *(future.result() for future in futures)]


@cache
def _pool(threads: int, process: int) -> ThreadPoolExecutor:
    """The kept pool of this process: after a fork the parent's threads are gone."""
    return ThreadPoolExecutor(threads, thread_name_prefix="ispm")
