"""Sunlight through a blind whose slats are thinner than a shadow map's texel in a small picture."""

import math

import pytest

from ispm import Camera, DirectionalLight, Renderer, Scene, Settings, euler, shapes
from ispm.library.common import lambert

SIZE = 192, 128
ELEVATION = math.radians(17.0)
SPACING, WIDTH, THICKNESS = 0.045, 0.05, 0.002  # m
PERIODS = 30  # of light and shadow across the picture


def blind(tilt):
    """A blind of long slats at x = 0, which a sun shines through toward -x, and a floor."""
    scene = Scene()
    sun = scene.add(DirectionalLight((1.0,) * 3))
    sun.look_at((-math.cos(ELEVATION), -math.sin(ELEVATION), 0.0))
    scene.add(shapes.plane(40.0, 40.0), material=lambert((0.5,) * 3))
    slat = shapes.box((WIDTH, THICKNESS, 20.0))
    for row in range(60):
        place = (0.0, 0.5 + SPACING * row, 0.0)
        turned = euler(0, 0, tilt, degrees=True)
        scene.add(slat, material=lambert((0.0,) * 3), translation=place, rotation=turned)
    return scene


@pytest.mark.parametrize("tilt", [25, 10, -5])
def test_a_small_picture_shows_what_a_blind_lets_through(gpu, tilt):
    """Each edge of light and shadow is placed to a pixel's width at random, a deviation of a pixel over
    sqrt(12); those of all add up as squares, and one error in 16,000 is more than four times that. In maps
    as coarse as the picture slats were missing: .11 of the light too much."""
    camera = Camera.look_at((-5.0, 6.0, 0.0), (-4.999, 0.0, 0.0))
    along = SPACING / math.tan(ELEVATION)
    camera = Camera(pose=camera.pose, ymag=PERIODS * along * SIZE[1] / SIZE[0] / 2)
    with Renderer(blind(tilt), Settings(size=SIZE, bounces=0), camera, gpu=gpu) as renderer:
        found = renderer.render().direct[..., 1].mean() / (0.5 / math.pi * math.sin(ELEVATION))
    turned = math.radians(tilt) - ELEVATION
    blocked = WIDTH * abs(math.sin(turned)) + THICKNESS * abs(math.cos(turned))
    exact = 1.0 - blocked / (SPACING * math.cos(ELEVATION))
    deviation = math.sqrt(2 * PERIODS / 12) / SIZE[0]
    assert abs(found - exact) < 4.0 * deviation
