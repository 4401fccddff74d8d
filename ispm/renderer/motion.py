"""What moved from one frame to the next."""

from __future__ import annotations

import numpy as np

_SAME = ("node", "mesh", "material")  # what makes an instance the one it was
_PLACE = ("world0", "world1", "world2")


def moved(now: np.ndarray, before: np.ndarray | None) -> np.ndarray:
    """Return which instances stand elsewhere than in the frame before, (I,) bool.

    now, before  (I,) INSTANCE; None: there was no frame
    None moved where instances came or went: there is nothing to tell one from another by.
    """
    if before is None or len(now) != len(before) or any((now[k] != before[k]).any() for k in _SAME):
        return np.zeros(len(now), bool)
    return np.asarray(np.any([(now[k] != before[k]).any(axis=1) for k in _PLACE], axis=0))
