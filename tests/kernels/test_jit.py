"""Kernels as numba compiles them."""

import math
from typing import NamedTuple

import numba
import numpy as np
import pytest

from ispm.kernels import store
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


class _Pair(NamedTuple):
    first: np.ndarray
    second: np.ndarray


@jit
def _sum(pair, i):
    return pair.first[i] + _second(pair, i)


@jit
def _second(pair, i):
    rest = pair.second[1:]
    return rest[i]


@jit
def _fresh(count):
    return np.zeros(count)


@jit(allocates=True)
def _made(count):
    return np.zeros(count)


def test_kernels_count_no_references_to_arrays_that_they_are_given(monkeypatch):
    monkeypatch.setattr(store, "read", lambda name: None)  # code that is kept cannot be looked at
    pair = _Pair(np.arange(4.0), np.arange(4.0))
    assert _sum(pair, 1) == 3.0
    (code,) = _sum.inspect_llvm().values()
    assert "NRT_incref" not in code and "NRT_decref" not in code


def test_kernels_that_make_arrays_say_so():
    assert len(_made(3)) == 3
    with pytest.raises(numba.core.errors.NumbaError, match="Only accept returning of array passed"):
        _fresh(3)


@jit
def _roots_and_quotients(x, roots, quotients):
    for i in range(x.size):
        roots[i] = np.float32(1) / math.sqrt(x[i])
        quotients[i] = np.float32(1) / x[i]


def test_roots_and_quotients_are_rounded_alike_on_every_processor():
    x = np.exp(np.random.default_rng(1).uniform(-40, 40, 10_000)).astype(np.float32)
    roots, quotients = np.empty_like(x), np.empty_like(x)
    _roots_and_quotients(x, roots, quotients)
    # IEEE 754 rounds each of both operations to the nearest float; an estimate would be off here and there
    np.testing.assert_array_equal(roots, np.float32(1) / np.sqrt(x))
    np.testing.assert_array_equal(quotients, np.float32(1) / x)
