"""Wide soft shadows in one pass: as smooth as many rays make them, and right in the mean."""

import math

import numpy as np
import pytest
from exact_light import polygon_irradiance

from ispm import Camera, Environment, RectLight, Renderer, Scene, Settings, euler, shapes
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


def lamps_over_floor():
    """A floor, and four panels 3 m above it, of which one is much brighter: none casts a shadow."""
    scene, panels = Scene(), []
    scene.add(shapes.plane(20.0, 20.0), material=lambert((0.5,) * 3))
    for x, luminance in ((-2.4, 10.0), (-0.8, 10.0), (0.8, 60.0), (2.4, 10.0)):
        panel = RectLight((luminance,) * 3, width=0.2, height=1.5)
        scene.add(panel, translation=(x, 3.0, 0.0), rotation=euler(-90, 0, 0, degrees=True))
        corners = [(x + 0.1 * i, 3.0, 0.75 * j) for i, j in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        panels.append((luminance, np.array(corners)))
    return scene, panels


@pytest.mark.parametrize("seed", [0, 1])
def test_light_that_nothing_shades_has_hardly_any_grain_in_one_pass(gpu, seed):
    """The filter takes in what lies within .09 of the panels' distance d, over which light that falls off as
    (1 + (x / d)^2)^-2 bends by 2 / 3 .09^2, half a hundredth. 25 draws err by .013 here, and 9 times as many
    by a third of it."""
    scene, panels = lamps_over_floor()
    camera = Camera.look_at((0.0, 2.5, 3.0), (0.0, 0.0, 0.0), yfov=0.2)
    with Renderer(scene, Settings(size=SIZE, bounces=0, seed=seed), camera, gpu=gpu) as renderer:
        found = renderer.render().direct[..., 1].ravel().astype(float)
    view = CameraView(SIZE, camera.pose, camera.yfov, None)
    x, y = np.meshgrid(np.arange(SIZE[0]) + 0.5, np.arange(SIZE[1]) + 0.5)
    origin, d = view.rays_through(x.ravel(), y.ravel())
    places = origin - d * (origin[:, 1:2] / d[:, 1:2])
    some = slice(None, None, 7)
    up = np.array([0.0, 1.0, 0.0])
    exact = [sum(e * polygon_irradiance(c, p, up) for e, c in panels) for p in places[some]]
    error = found[some] / (0.5 / math.pi * np.array(exact)) - 1.0
    bend = 2 / 3 * 0.09**2
    assert error.std() < math.hypot(bend, 0.013 / 3)
    assert abs(error.mean()) < bend
