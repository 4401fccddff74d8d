"""A glass pane close above a floor: the floor below is as bright as the pane's transmittance says."""

import pytest

import ispm
from ispm import shapes

_CAMERA = ispm.Camera.look_at(eye=(0.0, 3.0, 0.001), target=(0.0, 0.0, 0.0), yfov=0.2)
_FLOOR = 0.02  # albedo
_REFLECTANCE = 0.04  # of a surface of index 1.5, along its normal


def floor_seen(gap=None):
    """Radiance of the middle of a floor below a lamp, seen from above, through a pane so many m above it."""
    scene = ispm.Scene(name="pane")
    dark = ispm.Material((_FLOOR,) * 3, specular=0.0)
    scene.add(shapes.plane(6.0, 6.0), material=dark)
    scene.add(ispm.PointLight((100.0,) * 3), translation=(0.0, 4.0, 0.0))
    if gap is not None:
        glass = ispm.Material((1.0,) * 3, transmission=1.0, roughness=0.0, ior=1.5, thickness=0.01)
        scene.add(shapes.box((1.0, 0.01, 1.0)), material=glass, translation=(0.0, gap + 0.005, 0.0))
    settings = ispm.Settings(size=(160, 90), photons=100_000)
    with ispm.Renderer(scene, settings, _CAMERA) as renderer:
        return renderer.render().radiance.mean()


@pytest.mark.parametrize("gap", [0.0005, 0.002, 0.02])
def test_a_floor_below_a_pane_is_as_bright_as_the_pane_lets_through(gap):
    """Light passes twice, (1 - r) / (1 + r) of it each time with all reflections within. Floor and pane
    reflect .3 % of it to each other, and the pane's index brings the lamp .2 % nearer; what photons of one
    picture are uneven by is 1 %."""
    passes = (1.0 - _REFLECTANCE) / (1.0 + _REFLECTANCE)
    assert floor_seen(gap) / floor_seen() == pytest.approx(passes**2, rel=0.02)
