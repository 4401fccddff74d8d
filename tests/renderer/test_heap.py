"""What arrays left to the C library goes back to the system."""

import sys
from pathlib import Path

import numpy as np
import pytest

from ispm.renderer.heap import give_back

_EACH, _COUNT = 64 << 10, 2000  # bytes, fewer than are mapped by themselves; 125 MiB


def resident() -> int:
    """Bytes of this process that are in memory."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096


@pytest.mark.skipif(sys.platform != "linux", reason="the C library is another one")
def test_free_pages_between_used_ones_go_back() -> None:
    """Every other array of 64 KiB stays; of the rest, 62 MiB, three quarters at least."""
    arrays = [np.ones(_EACH, np.uint8) for _ in range(_COUNT)]
    kept = arrays[::2]
    del arrays
    before = resident()
    give_back()
    assert before - resident() > 0.75 * _EACH * _COUNT / 2
    assert all(each.all() for each in kept)
