"""Lamps with a surface in pictures: what pixels show of them, and that they count as the scene's light."""

import math
import warnings

import numpy as np
import pytest

from ispm import Camera, DiskLight, Material, RectLight, Renderer, Scene, Settings, SphereLight, shapes
from ispm.scene.camera import look_at_pose
from ispm.viewer.pick import pick

SETTINGS = Settings(size=(96, 96), preset="fast", photons=200, antialias=False)
AHEAD = Camera(yfov=math.radians(60.0), pose=look_at_pose(np.array((0.0, 0.0, 4.0)), np.zeros(3)))
LAMPS = {"rect": RectLight((3.0, 2.0, 1.0), 2.0, 1.0), "disk": DiskLight((3.0, 2.0, 1.0), 1.0)}
LAMPS |= {"sphere": SphereLight((3.0, 2.0, 1.0), 0.8)}


@pytest.mark.filterwarnings("ignore::ispm.SceneWarning")
@pytest.mark.parametrize("kind", LAMPS)
@pytest.mark.parametrize("turned", [False, True], ids=["towards", "away"])
def test_a_lamp_fills_its_pixels_with_its_radiance(gpu, kind, turned):
    """Its area in the picture is that of its shape, to a pixel along the outline; flat ones have no back."""
    lamp, scene = LAMPS[kind], Scene()
    scene.add(shapes.box((9.0, 9.0, 0.1)), material=Material(), name="wall", translation=(0.0, 0.0, -3.0))
    scene.add(lamp, name="lamp").look_at((0.0, 0.0, -4.0 if turned else 4.0))
    with Renderer(scene, SETTINGS, AHEAD, threads=2, gpu=gpu) as renderer:
        frame = renderer.render()
    seen = frame.instance == 1
    glowing = frame.emission.any(axis=-1)
    assert (glowing == seen).all() and (frame.emission[glowing] == (3.0, 2.0, 1.0)).all()
    if turned and kind != "sphere":
        assert not seen.any()
        return
    assert frame.names[1].name == "lamp" and pick(frame, 0.5, 0.5).node == 1
    per_metre = 48.0 / math.tan(math.radians(30.0)) / 4.0
    rim = 0.8 / math.sqrt(
        1.0 - (0.8 / 4.0) ** 2
    )  # of a sphere, nearer than its middle: the cone that touches
    area = math.pi * rim**2 if kind == "sphere" else lamp.area
    outline = 2.0 * math.sqrt(math.pi * area) * 1.2 * per_metre
    assert abs(seen.sum() - area * per_metre**2) < outline


def test_a_scene_of_lamps_alone_is_given_no_other_light(gpu):
    scene = Scene()
    scene.add(SphereLight(radius=0.5))
    with (
        warnings.catch_warnings(record=True) as caught,
        Renderer(scene, SETTINGS, AHEAD, gpu=gpu) as renderer,
    ):
        warnings.simplefilter("always")
        frame = renderer.render()
    assert frame.emission.any() and not frame.direct.any()
    assert not [each for each in caught if "has no light" in str(each.message)]
