"""Wide soft shadows in one pass: as smooth as many rays make them, and right in the mean."""

import math

import numpy as np
import pytest

from ispm import Environment, Renderer, Scene, Settings, shapes
from ispm.library.common import add_camera, lambert
from ispm.library.shapes import box
from ispm.stages.camera import CameraView

SIZE = 128, 96
HEIGHT = 3.0  # m, of the wall
RAYS = 16 * 9  # squares of 4 x 4 pixels, of which the filter takes 3 x 3 at least


def wall_over_floor():
    """A floor, and a black wall without end along x at z = 0, in a uniform environment."""
    scene = Scene(environment=Environment(np.ones((4, 8, 3), np.float32)))
    scene.add(shapes.plane(400, 400), material=lambert((0.5,) * 3))
    scene.add(box((-300, -1, -1), (300, HEIGHT, 0)), material=lambert((0.0,) * 3))
    add_camera(scene, (0.0, 8.0, 1.5), (0.0, 0.0, 1.6), math.radians(20))
    return scene


def shaded_share(scene):
    """(h, w) share of the floor's irradiance that the wall takes away: the form factor of a long strip."""
    camera = scene.default_camera(SIZE)
    view = CameraView(SIZE, camera.pose, camera.yfov, camera.ymag)
    x, y = np.meshgrid(np.arange(SIZE[0]) + 0.5, np.arange(SIZE[1]) + 0.5)
    origin, d = view.rays_through(x.ravel(), y.ravel())
    z = (origin - d * (origin[:, 1:2] / d[:, 1:2]))[:, 2].reshape(SIZE[::-1])
    return (1.0 - z / np.hypot(z, HEIGHT)) / 2.0


@pytest.mark.parametrize("seed", [0, 1])
def test_one_pass_is_as_smooth_as_a_ray_from_each_of_nine_squares(gpu, seed):
    scene = wall_over_floor()
    shaded = shaded_share(scene)
    with Renderer(scene, Settings(size=SIZE, bounces=0, light="none", seed=seed), gpu=gpu) as renderer:
        found = renderer.render().direct[..., 1]
    error = found / (0.5 * (1.0 - shaded)) - 1.0
    # of rays that hit or miss independently; those of a square are spread evenly, and do better
    each = np.sqrt(shaded / (1.0 - shaded) / RAYS)
    assert error.std() < each.mean()
    assert abs(error.mean()) < 4.5 * each.mean() / math.sqrt(error.size / RAYS)
