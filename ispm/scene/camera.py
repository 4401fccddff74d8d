"""Cameras: where the picture is taken from."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from ispm.errors import SettingsError


@dataclass
class Camera:
    """A camera looks along -Z of its node, +Y up, +X to the right (glTF).

    yfov   vertical angle of view in radians; used where `ymag` is None (perspective)
    ymag   half the height of the view in metres (orthographic), else None
    pose   (4, 4) camera-to-world matrix; None: the pose of the node that holds the camera
    """

    yfov: float = math.radians(50.0)
    ymag: float | None = None
    pose: np.ndarray | None = None
    name: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        if not 0.0 < self.yfov < math.pi:
            raise SettingsError(f"camera: yfov {self.yfov} is outside 0 to pi radians")
        if self.ymag is not None and not 0.0 < self.ymag < math.inf:
            raise SettingsError(f"camera: ymag {self.ymag} is not a height; give metres")
        if self.pose is not None:
            self.pose = np.asarray(self.pose, np.float64)
            if self.pose.shape != (4, 4) or not np.isfinite(self.pose).all():
                raise SettingsError("camera: the pose must be a (4, 4) matrix of finite numbers")

    @property
    def orthographic(self) -> bool:
        """Whether rays are parallel."""
        return self.ymag is not None

    @classmethod
    def look_at(
        cls,
        eye: tuple[float, float, float],
        target: tuple[float, float, float],
        yfov: float = math.radians(50.0),
    ) -> Camera:
        """Return a perspective camera at `eye` (metres) looking at `target`, +Y up.

        Raises SettingsError where the two points are the same.
        """
        return cls(yfov=yfov, pose=look_at_pose(np.asarray(eye, float), np.asarray(target, float)))


def look_at_pose(eye: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Return the (4, 4) camera-to-world matrix of a camera at `eye` looking at `target`, +Y up."""
    back = eye - target
    length = float(np.linalg.norm(back))
    if not length > 0.0:
        raise SettingsError("the camera's position and the point it looks at are the same")
    back /= length
    up = np.array([0.0, 1.0, 0.0]) if abs(back[1]) < 0.9999 else np.array([0.0, 0.0, -1.0])
    right = np.cross(up, back)
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3, 0], pose[:3, 1], pose[:3, 2], pose[:3, 3] = right, np.cross(back, right), back, eye
    return pose
