"""Sheen and far sides of sheets in one pass: how much noise they have, how sharp shadows on them are."""

import math

import numpy as np
from transport import render

from ispm import Environment, euler, shapes
from ispm.library.studio_light import studio_radiance
from ispm.scene.camera import Camera
from ispm.scene.light import RectLight
from ispm.scene.material import Material
from ispm.scene.scene import Scene

SIZE = 160, 90
BLACK = (0.0, 0.0, 0.0)


def deviation(frames):
    """What pixels of pictures deviate by from their mean, as a share of it."""
    frames = np.array(frames)
    return float(np.sqrt((frames.std(axis=0, ddof=1) ** 2).mean()) / frames.mean())


def test_velvet_in_the_studio_is_smooth_in_one_pass(gpu):
    """Directions that the cosine drew alone left .097 of noise, eight candidates .017."""
    scene = Scene()
    velvet = Material(BLACK, specular=0.0, sheen_color=(1.0, 1.0, 1.0), sheen_roughness=0.4)
    scene.add(shapes.plane(8, 8), material=velvet)
    scene.environment = Environment(studio_radiance())
    camera = Camera.look_at((0.0, 0.6, 2.0), (0.0, 0.0, 0.0), yfov=math.radians(20))
    frames = [render(gpu, scene, camera, size=SIZE, seed=seed)[0].radiance for seed in range(6)]
    assert deviation([frame[20:70] for frame in frames]) < 0.04


def test_a_shadow_on_the_far_side_of_paper_is_sharp(gpu):
    """A black bar 36 mm wide, whose middle is 25 mm behind paper, before a lamp of .2 m at 1.5 m: its umbra
    is 30 mm wide, 5 pixels as the filter's squares; penumbra and half a square end 5.5 from its middle.
    """
    scene = Scene()
    paper = Material(BLACK, specular=0.0, diffuse_transmission=1.0, double_sided=True)
    scene.add(shapes.plane(1.0, 1.0), material=paper, rotation=euler(90.0, 0.0, 0.0, degrees=True))
    scene.add(shapes.box((0.036, 1.0, 0.02)), material=Material(BLACK), translation=(0, 0, -0.025))
    lamp = scene.add(RectLight((100.0,) * 3, 0.2, 0.2), translation=(0.0, 0.0, -1.5))
    lamp.look_at((0.0, 0.0, 0.0))
    camera = Camera.look_at((0.0, 0.0, 1.0), (0.0, 0.0, 0.0), yfov=math.radians(30))
    row = render(gpu, scene, camera, size=SIZE, antialias=False)[0].direct[20:70].mean((0, 2))
    row /= np.median(row)
    assert row.min() < 0.02
    assert (row[[73, 86]] > 0.99).all()
