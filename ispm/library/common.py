"""What the built-in scenes share: exact Lambert materials, and cameras, spots and paths of nodes."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ispm.scene.animation import Channel
from ispm.scene.camera import Camera, look_at_pose
from ispm.scene.light import SpotLight
from ispm.scene.material import Material
from ispm.scene.rotation import quaternion
from ispm.scene.scene import Node, Part, Scene


def lambert(color: tuple[float, ...], name: str = "", double_sided: bool = False) -> Material:
    """Return a purely diffuse material: no specular reflection at all."""
    return Material(color, specular=0.0, double_sided=double_sided, name=name)


def add_camera(
    scene: Scene,
    eye: tuple[float, float, float],
    target: tuple[float, float, float],
    yfov: float = math.radians(50.0),
) -> Node:
    """Place a camera at `eye` (metres) that looks at `target`, by translation and rotation."""
    pose = look_at_pose(np.asarray(eye, float), np.asarray(target, float))
    return scene.add(Camera(yfov=yfov), name="camera", translation=eye, rotation=quaternion(pose[:3, :3]))


def add_spot(
    scene: Scene,
    light: SpotLight,
    name: str,
    eye: tuple[float, float, float],
    target: tuple[float, float, float],
    parent: Node | None = None,
) -> Node:
    """Place a spot at `eye` (metres) that shines at `target`."""
    pose = look_at_pose(np.asarray(eye, float), np.asarray(target, float))
    return scene.add(light, name=name, translation=eye, rotation=quaternion(pose[:3, :3]), parent=parent)


def closed_path(node: Node, path: str, values: np.ndarray, period: float) -> Channel:
    """Return the channel that takes `path` of a node through (K, n) values, evenly, in `period` s.

    path  as of a Channel
    The first value is where the node begins, and the path ends there.
    """
    keys = np.concatenate([values, values[:1]]).astype(np.float32)
    setattr(node, path, keys[0].astype(float))
    return Channel(node, path, np.linspace(0.0, period, len(keys), dtype=np.float32), keys)


def turns_about(axis: tuple[float, float, float], angles: np.ndarray) -> np.ndarray:
    """Return (K, 4) quaternions that turn by `angles` (radians) about a unit axis."""
    half = 0.5 * np.asarray(angles)[:, None]
    return np.concatenate([np.sin(half) * np.asarray(axis), np.cos(half)], axis=1)


def stand(scene: Scene, name: str, parts: list[Part], places: Sequence[np.ndarray]) -> None:
    """Hang a node with `parts` into the scene at each of (4, 4) `places`, which turn and move alone.

    The nodes share meshes and materials, and are numbered.
    """
    for number, place in enumerate(places):
        x, y, z = place[:3, 3].tolist()
        scene.roots.append(Node(f"{name} {number}", (x, y, z), quaternion(place[:3, :3]), parts=parts))
