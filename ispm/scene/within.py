"""The solid of glass or water that the eye is in."""

from __future__ import annotations

import math

import numpy as np

from ispm.optics.records import MATERIAL_THIN, MATERIAL_TRANSMITS, NO_HIT
from ispm.scene.packed import Packed

_CLOSED = 0.75  # winding number: 1 within a closed surface, a half at most before an open sheet


def solid_about(packed: Packed, eye: np.ndarray) -> int:
    """Return the row of the instance whose solid the eye is in, of several the smallest; NO_HIT: it is in
    none, or looks along parallels from far away.

    eye  (4,) m, and 1;  0: a direction
    Source: Jacobson, Kavan and Sorkine-Hornung, Robust Inside-Outside Segmentation using Generalized Winding
    Numbers, SIGGRAPH 2013.
    """
    if eye[3] == 0.0:
        return NO_HIT
    eye = eye[:3]
    flags = packed.materials["flags"][packed.instances["material"]]
    is_solid = flags & (MATERIAL_TRANSMITS | MATERIAL_THIN) == MATERIAL_TRANSMITS
    low, high = packed.boxes[:, 0], packed.boxes[:, 1]
    near = np.flatnonzero(is_solid & (low < eye).all(axis=1) & (eye < high).all(axis=1))
    about = [row for row in near.tolist() if abs(_winding_number(packed, row, eye)) > _CLOSED]
    return min(about, key=lambda row: float((high[row] - low[row]).prod()), default=NO_HIT)


def _winding_number(packed: Packed, row: int, eye: np.ndarray) -> float:
    """How often an instance's triangles go about the eye (van Oosterom and Strackee 1983)."""
    instance = packed.instances[row]
    to_world = np.stack([instance[f"world{k}"] for k in range(3)]).astype(float)
    first, count = int(instance["first_index"]), 3 * int(instance["triangle_count"])
    points = packed.geometry.vertices["position"][packed.geometry.indices[first : first + count]]
    a, b, c = np.moveaxis((points @ to_world[:, :3].T + to_world[:, 3] - eye).reshape(-1, 3, 3), 1, 0)
    x, y, z = (np.linalg.norm(corner, axis=1) for corner in (a, b, c))
    volume = np.einsum("nk,nk->n", a, np.cross(b, c))
    ab, bc, ca = (np.einsum("nk,nk->n", p, q) for p, q in ((a, b), (b, c), (c, a)))
    return float(np.arctan2(volume, x * y * z + ab * z + bc * x + ca * y).sum() / (2.0 * math.pi))
