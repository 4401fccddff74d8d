"""Light that a lone thing brings to open ground, far from it."""

import numpy as np
import pytest
from transport import Tracer

from ispm import Camera, Environment, Renderer, Settings, shapes
from ispm.library.common import lambert
from ispm.reference.paths import path_light
from ispm.scene.scene import Scene
from ispm.stages.camera import CameraView


def test_light_of_a_lone_box_falls_off_as_far_as_it_does(gpu):
    """A filter as wide as two fifths of the mean way to what is around, most of which is nothing, had spread
    it over metres: 1.5 times as much where it is an eighth of what it is at the box. Paths tell these
    squares within 4 %, and so do eight passes; what is left of the filter's blur is 6 %."""
    scene = Scene(environment=Environment(np.ones((8, 16, 3))))
    scene.add(shapes.plane(14.0, 14.0), material=lambert((0.9,) * 3))
    scene.add(shapes.box((0.8, 0.8, 0.8)), material=lambert((0.8, 0.2, 0.2)), translation=(0.0, 0.6, 0.0))
    camera, size = Camera.look_at((0.0, 1.2, 3.0), (0.0, 0.35, 0.0), yfov=0.75), (640, 360)
    with Renderer(scene, Settings(size=size), camera, gpu=gpu) as renderer:
        *_, frame = renderer.converge(8)
    tracer, view, random = Tracer(scene), CameraView(size, camera.pose, camera.yfov), np.random.default_rng(5)
    x, y = random.uniform(272.0, 368.0, 40_000), random.uniform(328.0, 352.0, 40_000)
    rays = view.rays_through(x, y)
    with_bounces, without = (
        path_light(tracer.tables, *rays, samples=range(16), bounces=bounces, threads=2).mean()
        for bounces in (8, 0)
    )
    found = frame.indirect[328:352, 272:368].mean()
    assert found == pytest.approx(with_bounces - without, rel=0.2)
