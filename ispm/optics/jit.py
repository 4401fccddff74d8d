"""Numba, as all kernels use it."""

from ispm.kernels.jit import jit

__all__ = ["jit"]
