"""Scenes that nothing was tuned for: kept apart to tell whether what holds for the others holds in general.

Their references are by our own paths from the eye, see `traced.py`.
"""

from __future__ import annotations

import math

import numpy as np

from ispm import shapes
from ispm.library.common import add_camera, lambert
from ispm.library.shapes import box, lathe, polygons
from ispm.scene.light import SphereLight
from ispm.scene.material import Material
from ispm.scene.mesh import Mesh
from ispm.scene.scene import Scene
from ispm.scene.sky import Sky

_WHITE, _CREAM, _SLATE, _OAK = (0.78, 0.78, 0.76), (0.7, 0.62, 0.5), (0.12, 0.13, 0.15), (0.5, 0.33, 0.2)
_TEAL, _RUST, _COPPER = (0.1, 0.4, 0.42), (0.6, 0.22, 0.12), (0.95, 0.64, 0.54)
_SUNK = 0.02  # m that a thing is below what it stands on


def strip_corridor() -> Scene:
    """A corridor with a polished floor, lit by two strips a thousand times as long as they are wide."""
    scene = Scene(name="strip-corridor")
    floor = Material(_SLATE, roughness=0.3, name="polished")
    for low, high, material in (
        ((-0.2, -0.2, -0.2), (2.6, 0.0, 14.2), floor),
        ((-0.2, 2.5, -0.2), (2.6, 2.7, 14.2), lambert(_WHITE)),
        ((-0.2, -0.1, -0.1), (0.0, 2.6, 14.1), lambert(_TEAL)),
        ((2.4, -0.1, -0.1), (2.6, 2.6, 14.1), lambert(_CREAM)),
        ((-0.1, -0.1, -0.2), (2.5, 2.6, 0.0), lambert(_WHITE)),
        ((-0.1, -0.1, 14.0), (2.5, 2.6, 14.2), lambert(_RUST)),
        ((1.7, -_SUNK, 4.0), (2.1, 1.1, 4.4), lambert(_WHITE)),
        ((0.0 - _SUNK, -_SUNK, 6.5), (0.25, 2.5 + _SUNK, 6.9), lambert(_CREAM)),
    ):
        scene.add(box(low, high), material=material)
    glow = Material((0.3,) * 3, specular=0.0, emission=(900.0, 1000.0, 1200.0), name="strip")
    strip = polygons([np.array([[0, 0, 0], [0.013, 0, 0], [0.013, 0, 13], [0, 0, 13]], float)], "strip")
    for x in (0.12, 2.267):
        scene.add(strip, material=glow, translation=(x, 2.46, 0.5))
    add_camera(scene, (1.0, 1.5, 0.4), (1.2, 1.0, 6.0), math.radians(50.0))
    return scene


def window_vase() -> Scene:
    """A glass vase and plates on a table before a window, which a sky without a sun lights."""
    scene = Scene(name="window-vase", environment=Sky(sun_elevation=0.5, sun_azimuth=2.4).dome())
    for low, high, color in (
        ((-0.2, -0.2, -0.2), (3.7, 0.0, 3.2), _OAK),
        ((-0.2, 2.4, -0.2), (3.7, 2.6, 3.2), _WHITE),
        ((-0.2, -0.1, -0.1), (0.0, 2.5, 3.1), _CREAM),
        ((3.5, -0.1, -0.1), (3.7, 2.5, 3.1), _TEAL),
        ((-0.1, -0.1, 3.0), (3.6, 2.5, 3.2), _WHITE),
        ((-0.1, -0.1, -0.2), (1.0, 2.5, 0.0), _WHITE),
        ((2.6, -0.1, -0.2), (3.6, 2.5, 0.0), _WHITE),
        ((0.9, -0.1, -0.2), (2.7, 0.8, 0.0), _WHITE),
        ((0.9, 2.0, -0.2), (2.7, 2.5, 0.0), _WHITE),
        ((1.1, 0.65, 0.3), (2.5, 0.7, 1.3), _OAK),
        ((1.15, -_SUNK, 0.35), (1.2, 0.65 + _SUNK, 0.4), _OAK),
        ((2.4, -_SUNK, 1.2), (2.45, 0.65 + _SUNK, 1.25), _OAK),
    ):
        scene.add(box(low, high), material=lambert(color))
    glass = Material(transmission=1.0, thickness=0.01, roughness=0.0, name="glass")
    scene.add(_vessel(0.11, 0.32, 0.015, 0.6), material=glass, translation=(1.75, 0.701, 0.7))
    for x, z in ((1.4, 0.95), (2.15, 0.6)):
        plate = shapes.cylinder(0.12, 0.02)
        scene.add(plate, material=lambert(_RUST), translation=(x, 0.705, z))
    add_camera(scene, (2.4, 1.35, 2.5), (1.7, 0.8, 0.6), math.radians(42.0))
    return scene


def copper_pots() -> Scene:
    """Open pots of copper, polished to dull, under three round lamps."""
    scene = Scene(name="copper-pots")
    for low, high, color in (
        ((-1.6, -0.2, -1.2), (1.6, 0.0, 1.2), _OAK),
        ((-1.7, -0.1, -1.3), (1.7, 1.8, -1.1), _WHITE),
    ):
        scene.add(box(low, high), material=lambert(color))
    for x, z, radius, height, roughness in (
        (-0.85, -0.4, 0.3, 0.4, 0.2),
        (-0.1, -0.55, 0.22, 0.55, 0.35),
        (0.65, -0.35, 0.32, 0.3, 0.5),
        (0.15, 0.35, 0.2, 0.18, 0.28),
        (-0.6, 0.4, 0.16, 0.2, 0.7),
    ):
        copper = Material(_COPPER, metallic=1.0, roughness=roughness, name="copper")
        scene.add(_vessel(radius, height, 0.02, 0.9), material=copper, translation=(x, 0.001, z))
    for x, color in ((-0.9, (220.0, 200.0, 170.0)), (0.0, (200.0,) * 3), (0.9, (170.0, 190.0, 220.0))):
        scene.add(SphereLight(color, radius=0.09), name="lamp", translation=(x, 1.5, 0.2))
    add_camera(scene, (0.3, 1.3, 2.4), (-0.05, 0.2, -0.1), math.radians(36.0))
    return scene


def _vessel(radius: float, height: float, wall: float, foot: float) -> Mesh:
    """An open pot about +Y that stands on the origin; its side bulges from `foot` of the radius to all."""
    t = np.linspace(0.0, 1.0, 9)
    across = radius * (foot + (1.0 - foot) * np.sin(0.5 * np.pi * t))
    outside = list(zip(across, height * t, strict=True))
    inside = [(r - wall, max(y, wall)) for r, y in reversed(outside)]
    return lathe([(0.0, 0.0), *outside, *inside[:-1], (inside[-1][0], wall), (0.0, wall)], 64, "vessel")


HELD_OUT = {"strip-corridor": strip_corridor, "window-vase": window_vase, "copper-pots": copper_pots}
"""Name to function."""
