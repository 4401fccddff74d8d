"""Triangle meshes."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ispm.errors import SceneError
from ispm.scene.extent import used_points
from ispm.scene.values import FARTHEST, Strict, array_of

_ROUNDING = 1.0 / 510.0  # half a step of the 8 bits that colors are kept in
_OTHERS = {  # width, least and most
    "normals": (3, -FARTHEST, FARTHEST),
    "tangents": (4, -FARTHEST, FARTHEST),
    "uv0": (2, -FARTHEST, FARTHEST),
    "uv1": (2, -FARTHEST, FARTHEST),
    "colors": (4, -_ROUNDING, 1.0 + _ROUNDING),
}


ARRAYS = ("positions", "triangles", *_OTHERS)
"""The fields of a Mesh that hold arrays."""


@dataclass(eq=False)
class Mesh(Strict):
    """Triangles in object space, metres. Compared by identity.

    Other arrays may be given at any time; call `touch` after editing one in place.

    positions  (V, 3) float32
    triangles  (T, 3) uint32, counter-clockwise seen from outside
    normals    (V, 3) float32, unit; None: flat, from the triangles (as glTF says)
    tangents   (V, 4) float32, w = handedness; None: derived from uv0 where a normal map needs them
    uv0, uv1   (V, 2) float32, v downwards as in glTF
    colors     (V, 4) float32, linear RGBA in [0, 1], multiplied into the base colour
    version    counts calls of `touch`
    Raises SceneError where shapes disagree, an index points outside or a value is not finite.
    """

    positions: np.ndarray
    triangles: np.ndarray
    normals: np.ndarray | None = None
    tangents: np.ndarray | None = None
    uv0: np.ndarray | None = None
    uv1: np.ndarray | None = None
    colors: np.ndarray | None = None
    name: str = ""
    version: int = field(default=0, repr=False)

    def __post_init__(self) -> None:
        self.check()

    def __repr__(self) -> str:
        held = [name for name in _OTHERS if getattr(self, name) is not None]
        counts = f"{len(self.positions):,} vertices, {len(self.triangles):,} triangles"
        return f"<Mesh '{self.name}': {', '.join([counts, *held])}>"

    @property
    def bounds(self) -> np.ndarray:
        """The (2, 3) least and greatest corner of its triangles, metres, object space.

        Raises SceneError for a mesh without triangles.
        """
        points = used_points(self.positions, self.triangles)
        if not len(points):
            raise SceneError(f"mesh '{self.name}': has no triangles, and so no bounds")
        return np.stack([points.min(axis=0), points.max(axis=0)])

    def check(self) -> None:
        """Make all arrays contiguous and of their types. Raises SceneError where one cannot be used."""
        where = f"mesh '{self.name}'"
        self.positions = _floats(f"{where}: positions", self.positions, 3)
        self.triangles = _indices(where, self.triangles, len(self.positions))
        for name, (width, low, high) in _OTHERS.items():
            values = getattr(self, name)
            if values is None:
                continue
            values = _floats(f"{where}: {name}", values, width, low, high)
            if len(values) != len(self.positions):
                raise SceneError(f"{where}: {name} has {len(values)} rows for {len(self.positions)} vertices")
            setattr(self, name, values)

    @classmethod
    def from_trimesh(cls, mesh: Any) -> Mesh:
        """Return a copy of one of trimesh's: faces, vertex normals if given, uv, colors (as sRGB).

        mesh  a trimesh.Trimesh; metres, axes as they are
        Raises SceneError where the arrays cannot be used.
        """
        from ispm.scene.from_trimesh import to_mesh

        return to_mesh(mesh)

    def touch(self) -> None:
        """Say that an array was edited in place, so that renderers read it again."""
        self.version += 1


def _floats(
    what: str, values: object, width: int, low: float = -FARTHEST, high: float = FARTHEST
) -> np.ndarray:
    return np.ascontiguousarray(array_of(what, values, (None, width), low, high), np.float32)


def _indices(where: str, values: object, vertex_count: int) -> np.ndarray:
    triangles = array_of(f"{where}: triangles", values, (None, 3))
    if triangles.dtype.kind == "f" and (triangles != np.floor(triangles)).any():
        raise SceneError(f"{where}: triangles must be whole numbers, of its vertices")
    low, high = (int(triangles.min()), int(triangles.max())) if triangles.size else (0, -1)
    if low < 0:
        raise SceneError(f"{where}: index {low} points before the first vertex")
    if high >= vertex_count:
        raise SceneError(f"{where}: index {high} points past the last of {vertex_count} vertices")
    return np.ascontiguousarray(triangles, np.uint32)
