"""Triangle meshes, and what deforms them."""

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
"""The fields of a Mesh that hold what is drawn of it as it stands."""

DELTAS = ("positions", "normals", "tangents")
"""Those of a Morph, and what a skin changes of a Mesh."""

_MOST_JOINTS = 65535  # the largest number of one


@dataclass(eq=False)
class Morph(Strict):
    """A morph target: what one weight of a node adds to each vertex of a mesh. Compared by identity.

    positions, normals, tangents  (V, 3) float32, differences, metres in object space; None: none
    Source: glTF 2.0, section 3.7.2.2.
    """

    positions: np.ndarray | None = None
    normals: np.ndarray | None = None
    tangents: np.ndarray | None = None
    name: str = ""

    def __repr__(self) -> str:
        held = [name for name in DELTAS if getattr(self, name) is not None]
        return f"<Morph '{self.name}': {', '.join(held) or 'nothing'}>"

    def check(self, where: str, vertex_count: int) -> None:
        """Make all arrays contiguous float32. Raises SceneError, which begins with `where`, for others."""
        for name in DELTAS:
            values = getattr(self, name)
            if values is not None:
                setattr(self, name, _floats(f"{where}: {name}", values, 3))
                _require_rows(f"{where}: {name}", values, vertex_count)


@dataclass(eq=False)
class Mesh(Strict):
    """Triangles in object space, metres. Compared by identity.

    Other arrays may be given at any time, as of a surface that deforms from frame to frame; call `touch`
    after editing one in place. While `triangles` stays the same array, renderers make the rest anew alone.

    positions  (V, 3) float32
    triangles  (T, 3) uint32, counter-clockwise seen from outside
    normals    (V, 3) float32, unit; None: flat, from the triangles (as glTF says)
    tangents   (V, 4) float32, w = handedness; None: derived from uv0, for normal maps and anisotropy
    uv0, uv1   (V, 2) float32, v downwards as in glTF
    colors     (V, 4) float32, linear RGBA in [0, 1], multiplied into the base colour
    version    counts calls of `touch`
    joints     (V, 4 n) uint16, of the joints of a node's `skin`, those that each vertex follows
    joint_weights  (V, 4 n) float32 from 0, how much it follows each; their sum counts as 1, and where all
               are 0 the vertex follows the first
    morphs     targets of the `weights` of nodes, one each
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
    joints: np.ndarray | None = None
    joint_weights: np.ndarray | None = None
    morphs: list[Morph] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.check()

    def __repr__(self) -> str:
        held = [name for name in (*_OTHERS, "joints") if getattr(self, name) is not None]
        held += [f"{len(self.morphs)} morph target{'s' * (len(self.morphs) > 1)}"] * bool(self.morphs)
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
            _require_rows(f"{where}: {name}", values, len(self.positions))
            setattr(self, name, values)
        self._check_joints(where)
        if not isinstance(self.morphs, list) or not all(isinstance(m, Morph) for m in self.morphs):
            raise SceneError(f"{where}: morphs must be a list of Morph")
        for number, morph in enumerate(self.morphs):
            morph.check(f"{where}: morph target {number}", len(self.positions))

    def _check_joints(self, where: str) -> None:
        if self.joints is None and self.joint_weights is None:
            return
        if self.joints is None or self.joint_weights is None:
            raise SceneError(f"{where}: joints and joint_weights go together; give both")
        joints = array_of(f"{where}: joints", self.joints, (None, None), 0, _MOST_JOINTS)
        weights = array_of(f"{where}: joint_weights", self.joint_weights, (None, None), 0.0, FARTHEST)
        if joints.shape != weights.shape or not joints.shape[1]:
            raise SceneError(f"{where}: joints of shape {joints.shape} have weights of shape {weights.shape}")
        _require_rows(f"{where}: joints", joints, len(self.positions))
        self.joints = np.ascontiguousarray(joints, np.uint16)
        self.joint_weights = np.ascontiguousarray(weights, np.float32)

    @classmethod
    def from_trimesh(cls, mesh: Any) -> Mesh:
        """Return a copy of one of trimesh's: faces, vertex normals if given, uv, colors (as sRGB).

        mesh  a trimesh.Trimesh; metres, axes as they are
        Raises SceneError where the arrays cannot be used.
        """
        from ispm.scene.from_trimesh import to_mesh

        return to_mesh(mesh)

    def smooth_normals(self) -> np.ndarray:
        """Return (V, 3) unit normals of the vertices where they are now, as for new `positions`.

        Of each, the mean of the triangles that share it, by their angles; +Y where there is none.
        Source: Thuermer and Wuethrich, "Computing vertex normals from polygonal facets", 1998.
        """
        from ispm.scene.smooth import vertex_normals

        return vertex_normals(self.positions, self.triangles)

    def touch(self) -> None:
        """Say that an array was edited in place, so that renderers read it again."""
        self.version += 1


def _require_rows(what: str, values: np.ndarray, count: int) -> None:
    if len(values) != count:
        raise SceneError(f"{what} has {len(values)} rows for {count} vertices")


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
