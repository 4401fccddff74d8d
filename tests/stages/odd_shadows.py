"""Scenes whose shadows are narrow, and other than the built-in ones."""

from __future__ import annotations

import math

import numpy as np
from exact import quad
from scipy.spatial.transform import Rotation

from ispm.library.shapes import box
from ispm.scene.camera import look_at_pose
from ispm.scene.light import DirectionalLight, PointLight
from ispm.scene.material import Material
from ispm.scene.scene import Node, Scene
from ispm.stages.camera import CameraView

_PLAIN = Material(specular=0.0, roughness=1.0, double_sided=True)
SIZE = (320, 180)


def _sun(scene: Scene, towards: tuple[float, float, float]) -> Node:
    node = scene.add(DirectionalLight((3.0, 3.0, 3.0)))
    node.rotation = tuple(
        Rotation.from_matrix(look_at_pose(np.array(towards), np.zeros(3))[:3, :3]).as_quat()
    )
    return node


def _add(scene: Scene, *boxes: tuple[tuple[float, float, float], tuple[float, float, float]]) -> None:
    for low, high in boxes:
        scene.add(box(low, high), material=_PLAIN)


def _view(eye: tuple[float, float, float], target: tuple[float, float, float]) -> CameraView:
    return CameraView(SIZE, look_at_pose(np.array(eye), np.array(target)), near=0.01)


def fence() -> tuple[Scene, CameraView]:
    """Pickets of 6 cm in a sun 12 degrees high, on a lawn of 40 m."""
    scene = Scene()
    _add(scene, ((-20.0, -0.5, -20.0), (20.0, 0.0, 20.0)))
    _add(scene, *(((x - 0.03, 0.0, -0.02), (x + 0.03, 1.2, 0.02)) for x in np.arange(-8.0, 8.0, 0.15)))
    _add(scene, ((-8.0, 0.9, 0.02), (8.0, 1.0, 0.05)), ((-8.0, 0.2, 0.02), (8.0, 0.3, 0.05)))
    _sun(scene, (0.4, math.tan(0.21), -1.0))
    return scene, _view((2.5, 1.7, 6.0), (0.0, 0.4, 0.0))


def blind() -> tuple[Scene, CameraView]:
    """A room lit by a sun through the slats of a blind, 3 mm thick and 5 cm apart."""
    scene = Scene()
    _add(
        scene, ((-2.0, -0.1, -2.0), (2.0, 0.0, 2.0)), ((-2.0, 2.5, -2.0), (2.0, 2.6, 2.0)),
        ((-2.0, 0.0, -2.1), (2.0, 2.5, -2.0)), ((-2.1, 0.0, -2.0), (-2.0, 2.5, 2.0)),
        ((2.0, 0.0, -2.0), (2.1, 0.8, 2.0)), ((2.0, 2.0, -2.0), (2.1, 2.5, 2.0)),
        ((2.0, 0.8, -2.0), (2.1, 2.0, -0.8)), ((2.0, 0.8, 0.8), (2.1, 2.0, 2.0)),
    )  # fmt: skip
    _add(scene, *(((2.02, y, -0.8), (2.06, y + 0.003, 0.8)) for y in np.arange(0.8, 2.0, 0.05)))
    _sun(scene, (1.0, 0.45, 0.3))
    return scene, _view((1.2, 1.6, 1.8), (-1.0, 0.5, -0.6))


def table() -> tuple[Scene, CameraView]:
    """A table with legs of 2 cm and a shelf of boards of 1 cm under one lamp."""
    scene = Scene()
    _add(scene, ((-3.0, -0.1, -3.0), (3.0, 0.0, 3.0)), ((-3.0, 0.0, -2.1), (3.0, 2.5, -2.0)))
    _add(scene, ((-0.8, 0.72, -0.5), (0.8, 0.75, 0.5)))
    _add(scene, *(((x, 0.0, z), (x + 0.02, 0.72, z + 0.02)) for x in (-0.78, 0.76) for z in (-0.48, 0.46)))
    _add(scene, *(((1.2, y, -2.0), (2.4, y + 0.01, -1.7)) for y in np.arange(0.2, 2.2, 0.25)))
    scene.add(PointLight((30.0, 30.0, 30.0)), translation=(0.3, 2.3, 0.4))
    return scene, _view((-1.5, 1.6, 2.6), (0.3, 0.6, -0.5))


def corridor() -> tuple[Scene, CameraView]:
    """A corridor of 20 m with beams under a ceiling that the lamps light at grazing angles."""
    scene = Scene()
    _add(
        scene, ((-1.0, -0.1, -20.0), (1.0, 0.0, 1.0)), ((-1.0, 2.5, -20.0), (1.0, 2.6, 1.0)),
        ((-1.1, 0.0, -20.0), (-1.0, 2.5, 1.0)), ((1.0, 0.0, -20.0), (1.1, 2.5, 1.0)),
    )  # fmt: skip
    _add(scene, *(((-1.0, 2.44, z), (1.0, 2.5, z + 0.04)) for z in np.arange(-19.5, 0.0, 1.5)))
    for z in (-2.0, -9.0, -16.0):
        scene.add(PointLight((20.0, 20.0, 20.0)), translation=(0.0, 2.3, z))
    return scene, _view((0.3, 1.6, 0.5), (0.0, 1.6, -10.0))


def partition() -> tuple[Scene, CameraView]:
    """A lamp beside a wall without thickness that meets floor and ceiling askew; the other side is dark."""
    scene = Scene()
    _add(scene, ((-3.0, -0.1, -3.0), (3.0, 0.0, 3.0)), ((-3.0, 2.5, -3.0), (3.0, 2.6, 3.0)))
    turn = Rotation.from_euler("y", 0.37) * Rotation.from_euler("z", math.pi / 2.0)
    scene.add(quad(5.0), material=_PLAIN, rotation=tuple(turn.as_quat()))
    scene.add(PointLight((30.0, 30.0, 30.0)), translation=(-0.6, 1.9, 0.1))
    return scene, _view((1.9, 1.3, 2.4), (0.2, 1.5, -0.6))


def wires() -> tuple[Scene, CameraView]:
    """Wires of 1 cm, askew, whose shadows are narrower than a pixel or a texel."""
    scene = Scene()
    _add(scene, ((-4.0, -0.5, -4.0), (4.0, 0.0, 4.0)))
    for k in range(12):
        turn = Rotation.from_euler("y", 0.1 * k + 0.03).as_quat()
        wire = box((-3.0, -0.005, -0.005), (3.0, 0.005, 0.005))
        scene.add(wire, material=_PLAIN, translation=(0.0, 0.8, 0.5 * k - 3.0), rotation=tuple(turn))
    _sun(scene, (0.4, 1.0, 0.2))
    return scene, _view((0.5, 2.2, 6.0), (0.0, 0.0, 0.0))


ODD = {
    "fence": fence,
    "blind": blind,
    "table": table,
    "corridor": corridor,
    "partition": partition,
    "wires": wires,
}
