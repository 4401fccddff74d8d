"""What moved from one frame to the next."""

from __future__ import annotations

import numpy as np

from ispm.scene.packed_instance import Placed

_SAME = ("node", "mesh", "material")  # what makes an instance the one it was
_PLACE = ("world0", "world1", "world2")


def moved(packed: Placed, last: Placed | None) -> np.ndarray:
    """Return which instances stand elsewhere, or have another shape, than in the frame before, (I,) bool.

    packed, last  those of the frames; None: there was none before
    None moved where instances came or went: there is nothing to tell one from another by.
    """
    now, before = packed.instances, None if last is None else last.instances
    if (
        last is None
        or before is None
        or len(now) != len(before)
        or any((now[k] != before[k]).any() for k in _SAME)
    ):
        return np.zeros(len(now), bool)
    pairs = zip(packed.geometry.ranges, last.geometry.ranges, strict=False)
    deformed = np.array(
        [
            piece.mesh.triangles is other.mesh.triangles and piece.mesh.positions is not other.mesh.positions
            for piece, other in pairs
        ],
        bool,
    )
    placed = np.any([(now[k] != before[k]).any(axis=1) for k in _PLACE], axis=0)
    return np.asarray(placed | deformed[now["mesh"]])
