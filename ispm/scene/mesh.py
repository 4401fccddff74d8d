"""Triangle meshes."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ispm.errors import SceneError


@dataclass(eq=False)
class Mesh:
    """Triangles in object space, metres. Compared by identity; call `touch` after editing an array.

    positions  (V, 3) float32
    triangles  (T, 3) uint32, counter-clockwise seen from outside
    normals    (V, 3) float32, unit; None: flat, from the triangles (as glTF says)
    tangents   (V, 4) float32, w = handedness; None: derived from uv0 where a normal map needs them
    uv0, uv1   (V, 2) float32, v downwards as in glTF
    colors     (V, 4) float32, linear RGBA in [0, 1], multiplied into the base colour
    Raises SceneError where shapes disagree or an index points outside.
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
        self.positions = _array(self.positions, np.float32, 3, "positions", self.name)
        self.triangles = _array(self.triangles, np.uint32, 3, "triangles", self.name)
        vertex_count = len(self.positions)
        if not np.isfinite(self.positions).all():
            raise SceneError(f"mesh '{self.name}': a position is not finite")
        for name, width in (("normals", 3), ("tangents", 4), ("uv0", 2), ("uv1", 2), ("colors", 4)):
            values = getattr(self, name)
            if values is not None:
                values = _array(values, np.float32, width, name, self.name)
                if len(values) != vertex_count:
                    raise SceneError(
                        f"mesh '{self.name}': {name} has {len(values)} rows for {vertex_count} vertices"
                    )
                setattr(self, name, values)
        if len(self.triangles) and int(self.triangles.max()) >= vertex_count:
            raise SceneError(
                f"mesh '{self.name}': index {int(self.triangles.max())} points past the last of "
                f"{vertex_count} vertices"
            )

    @classmethod
    def from_trimesh(cls, mesh: Any) -> Mesh:
        """Return a copy of a trimesh.Trimesh: faces, vertex normals if given, uv, colors (as sRGB).

        Raises SceneError where the arrays cannot be used.
        """
        from ispm.scene.from_trimesh import to_mesh

        return to_mesh(mesh)

    def touch(self) -> None:
        """Say that an array was edited in place, so that renderers read it again."""
        self.version += 1


def _array(values: object, dtype: type, width: int, what: str, name: str) -> np.ndarray:
    array: np.ndarray = np.ascontiguousarray(values, dtype)
    if array.ndim != 2 or array.shape[1] != width:
        raise SceneError(f"mesh '{name}': {what} must have shape (n, {width}), not {array.shape}")
    return array
