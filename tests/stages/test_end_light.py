"""Soft shadows in mirrors and through glass: smooth in one pass, and right in the mean of passes."""

import math

import numpy as np
import pytest
from exact_light import polygon_irradiance

from ispm import Camera, Environment, Material, RectLight, Renderer, Scene, Settings, euler, shapes
from ispm.library.common import lambert
from ispm.library.shapes import box, polygons
from ispm.stages.camera import CameraView

SIZE = 128, 96
HEIGHT = 3.0  # m, of a wall
EYE, TARGET = np.array([0.0, 8.0, 1.5]), np.array([0.0, 0.0, 1.6])
BEFORE = 0.3  # m, from the eye to a mirror or pane of that size
RAYS = 16 * 9  # squares of 4 x 4 pixels, of which the filter takes 3 x 3 at least
MIRROR = Material((1.0, 1.0, 1.0), metallic=1.0, roughness=0.0, double_sided=True)
CLEAR = Material(transmission=1.0, roughness=0.0, ior=1.0, specular=0.0, double_sided=True)
METAL = Material((1.0, 1.0, 1.0), metallic=1.0, roughness=0.1, double_sided=True)


def look(scene, eye, target, surface, degrees=20.0):
    """Add a small plane through which or by which a camera looks from `eye` to `target`.

    -> the camera, and a function from (n, 3) rays of it to those behind the pane or off the mirror
    """
    ahead = (target - eye) / np.linalg.norm(target - eye)
    if surface is CLEAR:
        camera, n = Camera.look_at(eye, target, yfov=math.radians(degrees)), ahead
        at = eye + BEFORE * ahead
    else:
        back = np.array([1.0, 0.0, 0.0])
        camera = Camera.look_at(eye + BEFORE * back, eye, up=(0, 0, -1), yfov=math.radians(degrees))
        n, at = (ahead + back) / np.linalg.norm(ahead + back), eye
    u = np.cross(n, (0.0, 0.0, 1.0) if abs(n[2]) < 0.9 else (1.0, 0.0, 0.0))
    u /= np.linalg.norm(u)
    v, half = np.cross(n, u), BEFORE / 2
    corners = [at + half * (i * u + j * v) for i, j in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    scene.add(polygons(np.array([corners])), material=surface)

    def beyond(origin, d):
        if surface is CLEAR:
            return origin, d
        return origin - 2 * ((origin - at) @ n)[:, None] * n, d - 2 * (d @ n)[:, None] * n

    return camera, beyond


def wall_over_floor(surface):
    """A floor, and a black wall without end along x at z = 0, in a uniform environment; who looks at the
    floor beside it; and the share of its irradiance, (h, w), that the wall takes away: the form factor of a
    long strip."""
    scene = Scene(environment=Environment(np.ones((4, 8, 3), np.float32)))
    scene.add(shapes.plane(400, 400), material=lambert((0.5,) * 3))
    scene.add(box((-300, -1, -1), (300, HEIGHT, 0)), material=lambert((0.0,) * 3))
    camera, beyond = look(scene, EYE, TARGET, surface)
    z = on_floor(camera, beyond)[..., 2]
    return scene, camera, (1.0 - z / np.hypot(z, HEIGHT)) / 2.0


def on_floor(camera, beyond):
    """(h, w, 3) m, where pixels' rays meet y = 0."""
    view = CameraView(SIZE, camera.pose, camera.yfov, camera.ymag)
    x, y = np.meshgrid(np.arange(SIZE[0]) + 0.5, np.arange(SIZE[1]) + 0.5)
    origin, d = beyond(*view.rays_through(x.ravel(), y.ravel()))
    return (origin - d * (origin[:, 1:2] / d[:, 1:2])).reshape(*SIZE[::-1], 3)


@pytest.mark.parametrize("surface", [CLEAR, MIRROR, METAL], ids=["glass", "mirror", "metal"])
def test_one_pass_is_as_smooth_as_a_ray_from_each_of_nine_squares(gpu, surface):
    scene, camera, shaded = wall_over_floor(surface)
    with Renderer(scene, Settings(size=SIZE, bounces=0, light="none"), camera, gpu=gpu) as renderer:
        found = renderer.render().direct[..., 1]
    error = found / (0.5 * (1.0 - shaded)) - 1.0
    # of rays that hit or miss independently; those of a square are spread evenly, and do better
    each = np.sqrt(shaded / (1.0 - shaded) / RAYS)
    assert error.std() < each.mean()
    assert abs(error.mean()) < 4.5 * each.mean() / math.sqrt(error.size / RAYS)


def sheet_over_floor(surface):
    """A floor, a black sheet 1 m above it that ends at x = 0, and two square lamps, the farther of which is
    brighter, and who looks at the floor below the sheet's edge."""
    scene, lamps = Scene(), []
    scene.add(shapes.plane(40.0, 40.0), material=lambert((0.5,) * 3))
    scene.add(shapes.plane(20.0, 20.0), material=lambert((0.0,) * 3), translation=(-10.0, 1.0, 0.0))
    for x, luminance in ((-0.5, 10.0), (1.5, 40.0)):
        lamp = RectLight((luminance,) * 3, width=1.0, height=1.0)
        scene.add(lamp, translation=(x, 4.0, 0.0), rotation=euler(-90, 0, 0, degrees=True))
        lamps.append((luminance, x))
    eye = np.array([2.0, 2.5, 0.5])
    camera, beyond = look(scene, eye, np.array([0.4, 0.0, 0.0]), surface, degrees=12.0)
    return scene, camera, lamps, on_floor(camera, beyond)


def seen_of_lamps(lamps, place):
    """What the lamps bring to a place on the floor beside the sheet, cd/m2 of white: each is cut where the
    line from the place by the sheet's edge meets its plane."""
    total, up = 0.0, np.array([0.0, 1.0, 0.0])
    for luminance, x in lamps:
        begins = min(max(place[0] - 4.0 * place[0] / 1.0, x - 0.5), x + 0.5)
        corners = [(i, 4.0, 0.5 * j) for i, j in ((begins, -1), (x + 0.5, -1), (x + 0.5, 1), (begins, 1))]
        total += luminance / math.pi * polygon_irradiance(np.array(corners), place, up)
    return total


@pytest.mark.parametrize("surface", [CLEAR, MIRROR], ids=["glass", "mirror"])
def test_shadows_of_lamps_are_right_in_the_mean_of_passes(gpu, surface):
    """16 passes; a pixel's draws hit or miss one of two lamps: over all pixels the mean is known to within
    1 / sqrt(N) of what the brighter one brings, N pixels' draws, and lies within 4.5 times that."""
    scene, camera, lamps, places = sheet_over_floor(surface)
    settings = Settings(size=SIZE, bounces=0, light="none")
    with Renderer(scene, settings, camera, gpu=gpu) as renderer:
        *_, last = renderer.converge(16)
    some = slice(None, None, 4)
    found = last.direct[some, some, 1]
    exact = 0.5 * np.array([[seen_of_lamps(lamps, p) for p in row] for row in places[some, some]])
    assert abs(found.mean() - exact.mean()) < 4.5 * exact.max() / math.sqrt(16 * last.direct[..., 1].size)
