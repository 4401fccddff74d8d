"""Triangles that emit light, and a tree by which they are drawn for a point."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

EMITTER = np.dtype([("instance", "<u4"), ("primitive", "<u4")])


class Emitters(NamedTuple):
    """The emissive triangles of a scene as kernels read them; of one without any all arrays are empty."""

    triangles: np.ndarray


NO_EMITTERS = Emitters(np.zeros(0, EMITTER))
