"""An eye within glass: what is outside is refracted, and as bright as it is in there."""

import math

import numpy as np
import pytest

from ispm import Camera, Environment, Material, Renderer, Scene, Settings, shapes
from ispm.optics.records import NO_HIT
from ispm.scene.mesh import Mesh
from ispm.scene.packed import pack
from ispm.scene.within import solid_about

IOR, RADIUS = 1.5, 2.0
SIZE = 32, 24


def glass(scene, share, double_sided):
    """A ball of glass about the origin, of which a share of light, RGB, is left after a radius."""
    material = Material(
        transmission=1.0,
        roughness=0.0,
        ior=IOR,
        thickness=1.0,
        attenuation_color=share,
        attenuation_distance=RADIUS,
        double_sided=double_sided,
    )
    scene.add(shapes.sphere(RADIUS, segments=128), material=material)


@pytest.mark.parametrize("double_sided", [False, True])
@pytest.mark.parametrize("share", [(1.0, 1.0, 1.0), (0.9, 0.6, 0.3)])
def test_a_uniform_sky_is_as_bright_as_the_square_of_the_index(gpu, share, double_sided):
    """From a ball's middle, where all rays leave along normals: n^2 T a of the sky, and of what is reflected
    R a^2 times that, again and again. Facets are nearer to the middle by cos(pi / 128), a third of a
    thousandth. Single-sided glass was not there, and double-sided glass showed 1 / n^2 of the light, without
    color."""
    scene = Scene(environment=Environment(np.ones((4, 8, 3), np.float32)))
    glass(scene, share, double_sided)
    camera = Camera.look_at((0.0, 0.0, 0.0), (0.0, 0.2, -1.0), yfov=math.radians(40))
    with Renderer(scene, Settings(size=SIZE, light="none"), camera, gpu=gpu) as renderer:
        found = renderer.render().radiance.mean(axis=(0, 1))
    reflected, left = ((IOR - 1.0) / (IOR + 1.0)) ** 2, np.array(share)
    exact = IOR**2 * (1.0 - reflected) * left / (1.0 - reflected * left**2)
    assert found == pytest.approx(exact, rel=2e-3)


def test_an_eye_is_in_closed_solids_alone():
    """Of two, one in the other, it is in the smaller. Half a ball has a winding number of a half from its
    middle."""
    scene = Scene()
    for radius in (2.0, 1.0):
        glass(scene, (1.0, 1.0, 1.0), False)
        scene.nodes[-1].scale = (radius / RADIUS, radius / RADIUS, -radius / RADIUS)
    ball = shapes.sphere(1.0)
    upper = ball.triangles[ball.positions[ball.triangles].mean(axis=1)[:, 1] > 0.0]
    sheet = Mesh(ball.positions, upper)
    scene.add(sheet, material=scene.nodes[0].parts[0].material, translation=(9.0, 0.0, 0.0))
    packed = pack(scene)
    boxes = packed.boxes[:, 1, 0]
    for place, row in ((0.0, int(np.argmin(boxes))), (1.5, int(np.flatnonzero(np.isclose(boxes, 2.0))[0]))):
        assert solid_about(packed, np.array((place, 0.0, 0.0, 1.0))) == row
    for eye in ((9.0, 0.1, 0.0, 1.0), (2.1, 0.0, 0.0, 1.0), (0.0, 0.0, 0.0, 0.0)):
        assert solid_about(packed, np.array(eye)) == NO_HIT


def test_total_reflection_shows_what_is_within(gpu):
    """Beneath a flat surface light from outside fills 2 asin(1 / n) about straight up; beyond that it mirrors
    a black bottom."""
    scene = Scene(environment=Environment(np.ones((4, 8, 3), np.float32)))
    water = Material(transmission=1.0, roughness=0.0, ior=IOR, thickness=1.0)
    scene.add(shapes.box((400.0, 4.0, 400.0)), material=water, translation=(0.0, -2.0, 0.0))
    black = Material((0.0, 0.0, 0.0), specular=0.0)
    scene.add(shapes.box((390.0, 0.1, 390.0)), material=black, translation=(0.0, -3.6, 0.0))
    camera = Camera.look_at((0.0, -3.0, 0.0), (0.001, 0.0, 0.0), yfov=math.radians(130))
    settings = Settings(size=(64, 64), light="none", antialias=False)
    with Renderer(scene, settings, camera, gpu=gpu) as renderer:
        found = renderer.render().radiance[..., 1]
    y, x = np.indices(found.shape) + 0.5
    slope = np.hypot(x - 32.0, y - 32.0) / 32.0 * math.tan(math.radians(65.0))
    sine = slope / np.sqrt(1.0 + slope**2)
    assert found[sine > 1.02 / IOR].max() < 1e-3
    steep = sine < 0.5 / IOR  # where a few hundredths are reflected
    assert found[steep].min() > 0.95 * IOR**2 and found[steep].max() < IOR**2
