"""What a place in the picture shows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ispm.renderer.picture import Frame


@dataclass(frozen=True, eq=False)
class Picked:
    """A point of a surface.

    node      place in `scene.nodes`;  part: in its parts, or behind them its lamp;  copy: of its instances
    name, mesh, material   their names
    position  (3,) m, world space
    distance  m, from the eye along the view
    """

    node: int
    part: int
    copy: int
    name: str
    mesh: str
    material: str
    position: np.ndarray
    distance: float


def pick(frame: Frame, x: float, y: float) -> Picked | None:
    """Return what a frame shows at parts `x`, `y` of its width and height; None: nothing."""
    height, width = frame.instance.shape
    column, row = min(int(x * width), width - 1), min(int(y * height), height - 1)
    number = int(frame.instance[row, column])
    if not 0 <= number < len(frame.names):
        return None
    seen, depth = frame.names[number], float(frame.depth[row, column])
    position = unprojected(frame, (column + 0.5) / width, (row + 0.5) / height, depth)
    material = frame.names.materials[seen.material]
    return Picked(seen.node, seen.part, seen.copy, seen.name, seen.mesh, material, position, depth)


def unprojected(frame: Frame, x: float, y: float, depth: float) -> np.ndarray:
    """Return the point, (3,) m, that is seen at a part of the picture, so far along the view axis."""
    world_from_clip = np.linalg.inv(frame.camera["clip_from_world"])
    ends = np.array([[2.0 * x - 1.0, 1.0 - 2.0 * y, z, 1.0] for z in (0.9, 0.1)]) @ world_from_clip.T
    first, second = ends[:, :3] / ends[:, 3:]
    pose = frame.camera["pose"]
    along = (first - pose[:3, 3]) @ -pose[:3, 2], (second - pose[:3, 3]) @ -pose[:3, 2]
    share = (depth - along[0]) / (along[1] - along[0])
    return np.asarray(first + share * (second - first))
