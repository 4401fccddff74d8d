"""What lamps with a surface bring without shadows, where it is known, and in pictures close to thin ones."""

import math

import numpy as np
import pytest
from exact_light import polygon_irradiance

from ispm import Camera, Material, Renderer, Scene, Settings, shapes
from ispm.library.common import lambert
from ispm.lights.known import form_factor
from ispm.scene.mesh import Mesh
from ispm.stages.camera import CameraView

SIZE = 128, 96


def test_a_triangle_brings_what_polygons_of_its_corners_do():
    """Above the horizon, below, and across it either way."""
    random = np.random.default_rng(5)
    up, cut = np.array([0.0, 1.0, 0.0]), 0
    for corners in random.normal(size=(200, 3, 3)) + random.normal(size=(200, 1, 3)):
        cut += 0 < (corners[:, 1] < 0.0).sum() < 3
        exact = polygon_irradiance(corners, np.zeros(3), up)
        assert form_factor(*(tuple(c) for c in corners), tuple(up)) == pytest.approx(exact, abs=1e-12)
    assert cut > 50


def tube(sides, parts):
    """A tube along x of 1.2 m, 13 mm thick, whose triangles face outward; (n, 3, 3) m of these about 0."""
    angle = 2 * math.pi * np.arange(sides) / sides
    ring = 0.013 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    x = np.linspace(-0.6, 0.6, parts + 1)
    positions = np.array([(place, *p) for place in x for p in ring])
    k, j = np.meshgrid(np.arange(parts), np.arange(sides), indexing="ij")
    a, b = (k * sides + j).ravel(), (k * sides + (j + 1) % sides).ravel()
    return positions, np.concatenate([np.stack([a, b, a + sides], 1), np.stack([b, b + sides, a + sides], 1)])


@pytest.mark.parametrize(("sides", "parts", "noise"), [(6, 1, 0.0), (8, 16, 0.01)])
def test_beside_a_tube_one_pass_has_hardly_any_grain(gpu, sides, parts, noise):
    """A wall 0.1 m behind a tube, of few triangles and of more than are added up, beside closed forms.
    The filter takes in .09 of the distance d, over which (1 + (x / d)^2)^-1.5 and its like bend by half of a
    hundredth, and 5 x 5 pixels of 2 mm, by a quarter of one. Draws alone err by .089 and .049.

    noise  of triangles drawn: 16 of each of 25 pixels at least, which differ by less than a fifth
    """
    positions, triangles = tube(sides, parts)
    scene = Scene()
    scene.add(shapes.box((4.0, 4.0, 0.1)), material=lambert((0.5,) * 3), translation=(0.0, 0.0, -0.05))
    glows = Material(base_color=(0.0, 0.0, 0.0), specular=0.0, emission=(10.0, 10.0, 10.0))
    scene.add(Mesh(positions, triangles=triangles), material=glows, translation=(0.0, 0.0, 0.1))
    camera = Camera.look_at((0.0, 0.15, 1.0), (0.0, 0.15, 0.0), yfov=0.2)
    with Renderer(scene, Settings(size=SIZE, bounces=0, light="none"), camera, gpu=gpu) as renderer:
        found = renderer.render().direct[..., 1].ravel().astype(float)
    view = CameraView(SIZE, camera.pose, camera.yfov, None)
    x, y = np.meshgrid(np.arange(SIZE[0]) + 0.5, np.arange(SIZE[1]) + 0.5)
    origin, d = view.rays_through(x.ravel(), y.ravel())
    places = (origin - d * (origin[:, 2:] / d[:, 2:]))[::37]
    corners = positions[triangles] + (0.0, 0.0, 0.1)
    outward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    away, exact = np.array([0.0, 0.0, 1.0]), []
    for place in places:
        facing = ((place - corners[:, 0]) * outward).sum(axis=1) > 0.0
        exact.append(sum(polygon_irradiance(each, place, away) for each in corners[facing]))
    error = found[::37] / (0.5 / math.pi * 10.0 * np.array(exact)) - 1.0
    bend = 2 / 3 * 0.09**2 + 0.0025
    assert error.std() < math.hypot(bend, noise)
    assert abs(error.mean()) < bend
