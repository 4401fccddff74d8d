"""Lamps close to what they light, seen from afar, do not stand in their own light."""

import math

import pytest

from ispm import Camera, RectLight, Renderer, Settings, shapes
from ispm.library.common import lambert
from ispm.scene.scene import Scene


@pytest.mark.parametrize("away", [3.0])
def test_floor_below_a_near_lamp_is_lit_as_its_form_factor_says(gpu, away):
    """A square of half side a and radiance 1, at the height h over its middle: E = 4 a / s atan(a / s), with
    s^2 = a^2 + h^2. Over the few millimetres that are looked at it falls by less than a percent; the shadow
    rays of 16 passes and 8 x 8 pixels have a relative error of .2 %."""
    a, h, albedo = 0.1, 0.2, 0.5
    scene = Scene()
    scene.add(shapes.plane(2.0, 2.0), material=lambert((albedo,) * 3))
    scene.add(RectLight((1.0,) * 3, width=2 * a, height=2 * a), translation=(0.0, h, 0.0)).look_at((0, 0, 0))
    eye = (0.0, 0.5 * away, 0.866 * away)
    camera = Camera.look_at(eye, (0.0, 0.0, 0.0), yfov=0.01 / away)
    with Renderer(scene, Settings(size=(8, 8), bounces=0), camera, gpu=gpu) as renderer:
        *_, frame = renderer.converge(16)
    s = math.hypot(a, h)
    exact = albedo / math.pi * 4.0 * a / s * math.atan(a / s)
    assert frame.direct.mean() == pytest.approx(exact, rel=0.01)
