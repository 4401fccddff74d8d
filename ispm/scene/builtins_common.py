"""What the built-in scenes share: exact Lambert materials and cameras on nodes that can be moved."""

from __future__ import annotations

import math

import numpy as np

from ispm.scene.camera import Camera, look_at_pose
from ispm.scene.material import Material
from ispm.scene.scene import Node, Scene


def lambert(color: tuple[float, ...], name: str = "", double_sided: bool = False) -> Material:
    """Return a purely diffuse material: no specular reflection at all."""
    return Material(color, specular=0.0, double_sided=double_sided, name=name)


def add_camera(
    scene: Scene,
    eye: tuple[float, float, float],
    target: tuple[float, float, float],
    yfov: float = math.radians(50.0),
    name: str = "camera",
) -> Node:
    """Place a camera at `eye` (metres) that looks at `target`, by translation and rotation."""
    pose = look_at_pose(np.asarray(eye, float), np.asarray(target, float))
    return scene.add(Camera(yfov=yfov), name=name, translation=eye, rotation=quaternion(pose[:3, :3]))


def quaternion(rotation: np.ndarray) -> tuple[float, float, float, float]:
    """Return the unit quaternion x, y, z, w of a (3, 3) rotation matrix."""
    # the eigenvector of the largest eigenvalue (Bar-Itzhack 2000): sound for every rotation
    (a, b, c), (d, e, f), (g, h, i) = rotation
    k = np.array([
        [a - e - i, b + d, c + g, h - f],
        [b + d, e - a - i, f + h, c - g],
        [c + g, f + h, i - a - e, d - b],
        [h - f, c - g, d - b, a + e + i],
    ])  # fmt: skip
    x, y, z, w = np.linalg.eigh(k)[1][:, 3]
    sign = -1.0 if w < 0.0 else 1.0
    return float(sign * x), float(sign * y), float(sign * z), float(sign * w)
