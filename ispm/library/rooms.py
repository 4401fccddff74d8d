"""Closed rooms whose light is known: the Cornell box and the integrating sphere."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ispm.errors import SettingsError
from ispm.library.common import add_camera, lambert
from ispm.library.shapes import icosphere, polygons, turned_inside_out
from ispm.scene.light import PointLight
from ispm.scene.scene import Scene

# The measured box of Cornell University's Program of Computer Graphics, in centimetres; corners of quads,
# counter-clockwise from the side that the room's air is on.
_ROOM = [
    [[552.8, 0, 0], [0, 0, 0], [0, 0, 559.2], [549.6, 0, 559.2]],
    [[556, 548.8, 0], [556, 548.8, 559.2], [0, 548.8, 559.2], [0, 548.8, 0]],
    [[549.6, 0, 559.2], [0, 0, 559.2], [0, 548.8, 559.2], [556, 548.8, 559.2]],
]
_GREEN_WALL = [[[0, 0, 559.2], [0, 0, 0], [0, 548.8, 0], [0, 548.8, 559.2]]]
_RED_WALL = [[[552.8, 0, 0], [549.6, 0, 559.2], [556, 548.8, 559.2], [556, 548.8, 0]]]
_SHORT_BLOCK = [[130, 65], [82, 225], [240, 272], [290, 114]], 165
_TALL_BLOCK = [[423, 247], [265, 296], [314, 456], [472, 406]], 330
_WHITE, _RED, _GREEN = (0.73, 0.73, 0.73), (0.63, 0.065, 0.05), (0.14, 0.45, 0.091)


def cornell_box() -> Scene:
    """The Cornell box: a white room with a red and a green wall, two blocks and a point light.

    Exact Lambert everywhere. The walls are double-sided; the front is open.
    """
    scene = Scene(name="cornell-box")
    for name, quads, color in (
        ("room", _ROOM, _WHITE),
        ("green wall", _GREEN_WALL, _GREEN),
        ("red wall", _RED_WALL, _RED),
        ("short block", _block(*_SHORT_BLOCK), _WHITE),
        ("tall block", _block(*_TALL_BLOCK), _WHITE),
    ):
        mesh = polygons([np.array(quad, float) / 100.0 for quad in quads], name)
        scene.add(mesh, material=lambert(color, name, double_sided=True))
    scene.add(PointLight((10.0, 10.0, 10.0)), name="light", translation=(2.78, 5.0, 2.795))
    add_camera(scene, (2.78, 3.6, -2.5), (2.78, 1.7, 2.8))
    return scene


def _block(base: Sequence[Sequence[float]], height: float) -> list[list[list[float]]]:
    """Top and sides of a block that stands on the corners (x, z); it has no underside."""
    low = [[x, 0.0, z] for x, z in base]
    high = [[x, height, z] for x, z in base]
    following = [1, 2, 3, 0]
    return [high, *([low[k], low[j], high[j], high[k]] for k, j in enumerate(following))]


def integrating_sphere(
    radius: float = 2.0, albedo: float = 0.5, flux: float = 100.0, segments: int = 32
) -> Scene:
    """A closed Lambert sphere lit from its centre: radiance is the same everywhere and known.

    L = albedo / (1 - albedo) * flux / (4 pi^2 radius^2) in cd/m2 per channel, all bounces and the
    direct light included. With the default of 20,480 triangles area and volume are 0.03 % and 0.05 % short.

    radius    m
    albedo    reflected share, in [0, 1)
    flux      lm per channel
    segments  cuts along each edge of the icosahedron; 20 segments^2 triangles
    Raises SettingsError for a value out of range.
    """
    for name, value, good in (
        ("radius", radius, radius > 0.0),
        ("albedo", albedo, 0.0 <= albedo < 1.0),
        ("flux", flux, flux >= 0.0),
        ("segments", segments, segments >= 1),
    ):
        if not good:
            raise SettingsError(f"integrating-sphere: {name} cannot be {value}")
    scene = Scene(name="integrating-sphere")
    wall = turned_inside_out(icosphere(radius, segments, "sphere"))
    scene.add(wall, material=lambert((albedo,) * 3, "sphere"))
    intensity = flux / (4.0 * math.pi)
    scene.add(PointLight((intensity,) * 3), name="light")
    add_camera(scene, (0.6 * radius, 0.1 * radius, 0.3 * radius), (-radius, 0.0, 0.0))
    return scene
