"""A hall with as many triangles, things and lights as wanted, all of it moving but the hall."""

from __future__ import annotations

import math

import numpy as np

from ispm.library.common import add_camera, closed_path, lambert, turns_about
from ispm.library.forms import beveled_box
from ispm.library.shapes import box, icosphere, sheet, turned_inside_out
from ispm.scene.animation import Animation
from ispm.scene.light import PointLight
from ispm.scene.material import Material
from ispm.scene.mesh import Mesh
from ispm.scene.scene import Node, Part, Scene

_HALF, _HEIGHT = 8.0, 6.0  # m, the hall
_FLUX = 900.0  # cd, of all lights together
_KEYS = 2.0 * np.pi * np.arange(32) / 32
_PERIOD = 8.0  # s


def hall(triangles: int = 8_192, instances: int = 16, lights: int = 2) -> Scene:
    """Return a hall of 16 x 16 x 6 m whose floor has about so many triangles.

    instances  of a chest of 44 triangles, in a square on the floor, which slide to and fro together
    lights     points in a circle below the ceiling, which turns; together they are as bright as one
    """
    scene = Scene(name="hall")
    walls = turned_inside_out(box((-_HALF, -0.5, -_HALF), (_HALF, _HEIGHT, _HALF), "walls"))
    scene.add(walls, material=lambert((0.70, 0.64, 0.56), "plaster"))
    cells = max(round(math.sqrt(triangles / 2)), 1)
    scene.add(_floor(cells), material=lambert((0.46, 0.47, 0.50), "rough stone"))
    ball = icosphere(0.6, 12, "ball")
    scene.add(
        ball, material=Material((0.91, 0.74, 0.42), metallic=1.0, roughness=0.0), translation=(0.0, 4.0, 0.0)
    )
    chests = _chests(instances)
    scene.roots.append(chests)
    slide = np.stack([0.3 * np.sin(_KEYS), 0.0 * _KEYS, 0.2 * np.cos(_KEYS)], axis=1)
    ring = Node("lights", translation=(0.0, _HEIGHT - 0.6, 0.0))
    scene.roots.append(ring)
    for k in range(lights):
        angle = 2.0 * math.pi * k / lights
        place = (4.0 * math.cos(angle), 0.0, 4.0 * math.sin(angle))
        scene.add(PointLight((_FLUX / lights / 3.0,) * 3), name=f"light {k}", translation=place, parent=ring)
    turn = turns_about((0.0, 1.0, 0.0), _KEYS)
    channels = [
        closed_path(chests, "translation", slide, _PERIOD),
        closed_path(ring, "rotation", turn, _PERIOD),
    ]
    scene.animations.append(Animation(channels, "move"))
    add_camera(scene, (-6.5, 4.6, 6.5), (1.0, 0.6, -1.0), math.radians(62.0))
    return scene


def _floor(cells: int) -> Mesh:
    """A floor of cells x cells x 2 triangles in gentle waves."""
    along = np.linspace(-_HALF, _HALF, cells + 1)
    x, z = np.meshgrid(along, along)
    y = 0.08 * np.sin(2.1 * x + 0.6 * z) * np.cos(1.7 * z)
    return sheet(np.stack([x, y, z], axis=-1), "floor")


def _chests(count: int) -> Node:
    """A node with so many chests below it, in a square grid of 12 x 12 m."""
    side = math.isqrt(max(count - 1, 0)) + 1
    step = 12.0 / side
    half = 0.35 * step
    chest = beveled_box((-half, 0.1, -half), (half, 0.1 + 1.4 * half, half), 0.2 * half, "chest")
    parts = [Part(chest, lambert((0.55, 0.20, 0.12), "red paint"))]
    chests = Node("chests")
    for k in range(count):
        x, z = ((n + 0.5) * step - 6.0 for n in (k % side, k // side))
        chests.children.append(Node(f"chest {k}", translation=(x, 0.0, z), parts=parts))
    return chests
