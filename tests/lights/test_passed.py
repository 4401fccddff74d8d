"""What reaches points of their lights, by shadow rays."""

import numpy as np
from transport import Tracer

from ispm.library.common import lambert
from ispm.library.shapes import polygons
from ispm.lights.passed import passed_light
from ispm.scene.light import DirectionalLight, PointLight
from ispm.scene.scene import Scene


def test_each_point_asks_for_its_own_light():
    """A wall of 2 x 2 m at z = 0, a point light 1 m above its middle, and a sun that shines along -z."""
    scene = Scene()
    wall = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], float)
    scene.add(polygons([wall]), material=lambert((0.5,) * 3))
    scene.add(PointLight((1.0,) * 3), translation=(0.0, 0.0, 1.0))
    scene.add(DirectionalLight((1.0,) * 3))
    tracer = Tracer(scene)
    points = {(0, 0, -1): [0, 0], (1.2, 0, -0.4): [0, 1], (3, 0, -1): [1, 1], (0.9, 0, 0.5): [1, 1]}
    starts, lights = np.repeat(np.float32(list(points)), 2, axis=0), np.tile(np.uint32((0, 1)), len(points))
    share = passed_light(tracer.packed, tracer.world, tracer.surfaces, starts, lights)
    assert share[:, 0].reshape(-1, 2).tolist() == list(points.values())
    assert (share == share[:, :1]).all()
