"""What a small glossy thing on a wide floor reflects to its foot."""

import numpy as np
import pytest
from transport import Tracer

from ispm import Camera, Environment, Material, Renderer, Settings, shapes
from ispm.library.common import lambert
from ispm.library.studio_light import studio_radiance
from ispm.reference.paths import path_light
from ispm.scene.scene import Scene
from ispm.stages.camera import CameraView

_RADIUS = 0.004  # m, of a ball on a floor of 60 cm


def test_a_small_ball_reflects_the_sky_to_its_foot(gpu):
    """A photon of the sky stands for a beam centimetres wide, and so what a ball of 8 mm reflects of it was
    spread as widely: at its foot a third of that light was left after eight passes.

    On a square of the floor at its foot, whose light paths tell within 2 %. Seven photons in a thousand meet
    the ball: what is left is the blur of their kernels, a tenth of the light.
    """
    scene = Scene(environment=Environment(studio_radiance()))
    scene.add(shapes.plane(0.6, 0.6), material=lambert((0.8,) * 3))
    ball = Material((0.0, 0.0, 0.0), roughness=0.0)
    scene.add(shapes.sphere(_RADIUS), material=ball, translation=(0.0, _RADIUS, 0.0))
    camera = Camera.look_at((0.01, 0.02, 0.03), (0.0, 0.0, 0.75 * _RADIUS), yfov=0.6)
    size, half = (320, 180), 4
    with Renderer(scene, Settings(size=size, bounces=1), camera, gpu=gpu) as renderer:
        *_, frame = renderer.converge(8)
    x0, x1, y0, y1 = size[0] // 2 - half, size[0] // 2 + half, size[1] // 2 - half, size[1] // 2 + half
    window = np.s_[y0:y1, x0:x1]
    assert np.isin(frame.instance[window], 0).all()
    tracer, view, random = Tracer(scene), CameraView(size, camera.pose, camera.yfov), np.random.default_rng(5)
    rays = view.rays_through(random.uniform(x0, x1, 20_000), random.uniform(y0, y1, 20_000))
    with_ball, direct = (
        path_light(tracer.tables, *rays, samples=range(64), bounces=bounces, threads=2).mean()
        for bounces in (1, 0)
    )
    assert frame.indirect[window].mean() == pytest.approx(with_ball - direct, rel=0.25)
