"""Work on kept threads."""

import threading

import pytest

from ispm.kernels.threads import run_threads, thread_count


def test_results_come_in_order():
    assert run_threads(lambda k: k * k, 5) == [0, 1, 4, 9, 16]


def test_one_thread_runs_in_the_caller():
    assert run_threads(lambda _: threading.current_thread(), 1) == [threading.current_thread()]


def test_workers_run_at_the_same_time():
    gate = threading.Barrier(3, timeout=10)
    run_threads(lambda _: gate.wait(), 3)


@pytest.mark.parametrize("failing", [0, 2])
def test_an_exception_propagates(failing):
    def work(k):
        if k == failing:
            raise ValueError("no")

    with pytest.raises(ValueError, match="no"):
        run_threads(work, 3)


def test_no_count_means_all_usable_cores():
    assert thread_count(None) == thread_count(0) >= 1
    assert thread_count(3) == 3
