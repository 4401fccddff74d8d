"""Light that a lone thing brings to open ground, far from it."""

import numpy as np
import pytest
from transport import Tracer

from ispm import Camera, DirectionalLight, Environment, Renderer, Settings, shapes
from ispm.library.common import lambert
from ispm.library.shapes import box
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


def test_a_small_thing_on_wide_ground_keeps_its_shades(gpu):
    """The light that 200 m of ground in the sun send to the back wall of an open shed of 2 m, row by row. The
    filter took what is within a hundredth of the scene for as far away as that, and the upper half had .8 of
    its light. Paths tell rows within 2 %."""
    scene = Scene()
    scene.add(shapes.plane(200.0, 200.0), material=lambert((0.2,) * 3))
    for low, high in [
        ((-1, 0, -0.1), (1, 1.4, 0)),
        ((-1, 1.4, -0.5), (1, 1.45, 1)),
        ((-1, 0.2, 0), (1, 0.3, 1)),
        ((-1.03, 0, -0.1), (-0.97, 1.4, 1)),
        ((0.97, 0, -0.1), (1.03, 1.4, 1)),
    ]:
        scene.add(box(low, high), material=lambert((0.5,) * 3))
    sun = scene.add(DirectionalLight((3.0,) * 3), translation=(0.0, 5.0, 0.0))
    sun.look_at((0.8, 4.2, 0.6))
    camera, size = Camera.look_at((0.0, 0.85, 1.3), (0.0, 0.85, 0.0), yfov=1.05), (320, 240)
    settings = Settings(size=size, bounces=1)
    with Renderer(scene, settings, camera, gpu=gpu) as renderer:
        *_, frame = renderer.converge(4)
    tracer, view = Tracer(scene), CameraView(size, camera.pose, camera.yfov)
    for top in (60, 90, 120, 150):
        y, x = np.mgrid[top : top + 12, 110:210].reshape(2, -1) + 0.5
        rays = view.rays_through(x, y)
        truth = path_light(tracer.tables, *rays, samples=range(64), bounces=1, threads=2).mean()
        assert frame.radiance[top : top + 12, 110:210].mean() == pytest.approx(truth, rel=0.05), top
