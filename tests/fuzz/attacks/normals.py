"""Meshes whose smooth normals are hard to find."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from fuzz.attacks.files import Attack, Target, text


def smooth() -> Iterator[Attack]:
    def fan(folder: Path) -> Target:
        """One vertex that 300,000 triangles share."""
        turn = np.linspace(0.0, 6.28, 300_001)
        rim = np.stack([np.cos(turn), np.sin(turn), turn * 0.0], axis=1)
        triangles = np.stack([rim * 0.0, rim, np.roll(rim, -1, axis=0)], axis=1).astype("<f4")
        record = np.zeros(len(triangles), np.dtype([("n", "<f4", 3), ("c", "<f4", (3, 3)), ("a", "<u2")]))
        record["c"] = triangles
        path = text("a.stl", bytes(80) + struct.pack("<I", len(record)) + record.tobytes())(folder)
        return path, {"smooth_normals": True, "crease_degrees": 180}

    def leaves(folder: Path) -> Target:
        """One edge that 100,000 triangles share."""
        path = text("a.obj", "".join(f"v {k} 1 0\n" for k in range(100_000)) + "v 0 0 0\nv 0 0 1\n"
                    + "".join(f"f {k + 1} 100001 100002\n" for k in range(100_000)))(folder)  # fmt: skip
        return path, {"smooth_normals": True}

    yield "a fan of 300,000 triangles made smooth", fan
    yield "a book of 100,000 leaves made smooth", leaves
