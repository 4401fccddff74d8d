"""Lamps that are thinner than a pixel bring all of their light to a picture of one pass."""

import math

import numpy as np
import pytest
from transport import render

from ispm import Material, shapes
from ispm.scene.camera import Camera
from ispm.scene.light import RectLight
from ispm.scene.scene import Scene

SIZE, YFOV = (320, 180), math.radians(40)
RADIANCE, SIDE, HEIGHT = 100.0, 0.5, 4.0
FAR = np.linspace(14.0, 30.0, 9)  # m before the eye


def hall(has_ceiling):
    """Panels along a hall, which look down; from afar they are a few pixels wide and a part of one high."""
    scene = Scene()
    if has_ceiling:
        dark = Material((0.0, 0.0, 0.0), specular=0.0)
        scene.add(shapes.box((20.0, 0.2, 80.0)), material=dark, translation=(0.0, HEIGHT + 0.12, 0.0))
    for z in FAR:
        lamp = scene.add(RectLight((RADIANCE,) * 3, SIDE, SIDE), translation=(0.0, HEIGHT, -z))
        lamp.look_at((0.0, 0.0, -z), up=(0.0, 0.0, 1.0))
    return scene


def covered(eye):
    """Pixels that all panels cover together, by the areas of quadrilaterals in the picture (shoelace)."""
    half, total = math.tan(YFOV / 2.0), 0.0
    for z in FAR:
        corners = np.array([(x, HEIGHT, y - z) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))], float)
        corners[:, 0] *= SIDE / 2.0
        corners[:, 2] = -z + (corners[:, 2] + z) * SIDE / 2.0
        x, y, depth = corners[:, 0] - eye[0], corners[:, 1] - eye[1], eye[2] - corners[:, 2]
        x, y = x / depth / half * SIZE[1] / 2.0, y / depth / half * SIZE[1] / 2.0
        total += abs(np.dot(x, np.roll(y, 1)) - np.dot(y, np.roll(x, 1))) / 2.0
    return total


@pytest.mark.parametrize("has_ceiling", [False, True])
def test_far_panels_bring_all_of_their_light(gpu, has_ceiling):
    """From 24 heights, at each of which a pixel's four samples lie otherwise on them, .81 of it had come."""
    shares = []
    for eye_y in np.linspace(1.5, 1.9, 24):
        eye = np.array((0.0, eye_y, 0.0))
        camera = Camera.look_at(tuple(eye), (0.0, eye_y, -1.0), yfov=YFOV)
        frame, _ = render(gpu, hall(has_ceiling), camera, size=SIZE, bounces=0)
        shares.append(frame.emission.mean(axis=-1).sum() / RADIANCE / covered(eye))
    error = np.std(shares, ddof=1) / math.sqrt(len(shares))
    assert abs(np.mean(shares) - 1.0) < 4.0 * error
