"""Kernels as numba compiles them."""

from ispm.optics.jit import jit


@jit
def _double(x):
    return x + x


@jit
def _four_times(x):
    return _double(_double(x))


def test_a_callee_is_compiled_for_kernels_alone_until_python_calls_it():
    assert _four_times(3) == 12
    assert len(_four_times.signatures) == 1 and not _double.signatures
    assert _double(3) == 6
    assert len(_double.signatures) == 1
