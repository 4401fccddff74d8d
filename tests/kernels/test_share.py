"""Rows shared among threads: each is taken once, in order within a thread."""

import numpy as np
import pytest

from ispm.kernels.share import run_shared, shared_rows
from ispm.optics.jit import jit


@jit
def _count(counter, step, times):
    last = -1
    for row in shared_rows(counter, step, len(times)):
        times[row] += 1 if row > last else 100
        last = row


@pytest.mark.parametrize("count", [0, 1, 63, 64, 65, 10_000])
@pytest.mark.parametrize("threads", [1, 2, 5])
def test_every_row_is_taken_once(count, threads):
    for step in (1, 64):
        times = np.zeros(count, np.int64)
        run_shared(lambda counter, step=step, times=times: _count(counter, step, times), threads)
        assert (times == 1).all()


def test_errors_of_a_thread_are_raised():
    with pytest.raises(ZeroDivisionError):
        run_shared(lambda counter: 1 // 0, 2)
