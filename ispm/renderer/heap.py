"""Memory that arrays have left to the C library, back to the system."""

from __future__ import annotations

import ctypes
import sys


def give_back() -> None:
    """Give back the free pages of the heap, which glibc keeps between those in use; elsewhere do nothing."""
    if sys.platform == "linux":
        trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
        if trim is not None:
            trim(ctypes.c_size_t(0))
