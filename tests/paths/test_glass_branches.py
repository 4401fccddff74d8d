"""Glass beside paths: where one path serves for both branches, and lamps that rough glass reflects."""

import numpy as np
import pytest
from transport import Tracer

from ispm import Camera, Environment, Material, RectLight, Renderer, Settings, SphereLight, shapes
from ispm.library.common import lambert
from ispm.library.shapes import box
from ispm.reference.paths import path_light
from ispm.scene.scene import Scene
from ispm.stages.camera import CameraView

SIZE = 64, 48
SETTINGS = Settings(size=SIZE, bounces=32, antialias=False)


def truth_of(scene, camera, samples):
    """(48, 64, 3) light by paths from the pixels' middles."""
    tracer, view = Tracer(scene), CameraView(SIZE, camera.pose, camera.yfov)
    y, x = np.mgrid[:48, :64] + 0.5
    rays = (each.reshape(-1, 3) for each in view.rays_through(x, y))
    light = path_light(tracer.tables, *rays, samples=range(samples), bounces=32, threads=2)
    return light.reshape(48, 64, 3)


@pytest.mark.parametrize("roughness", [0.0, 0.4, 0.8])
def test_light_within_a_sheet_is_shared_among_both_branches(gpu, roughness):
    """A slab of sheets without inside between a dark room and bright ground. Its lower face reflects what is
    dark and lets through what is bright, which the weight of both made too bright by 8 % and more, in all
    passes; where it is clear it still is in the first. Paths and means are uncertain by less than 0.3 %."""
    ground = np.zeros((16, 32, 3))
    ground[8:] = 1.0
    scene = Scene(environment=Environment(ground))
    glass = Material(transmission=1.0, thickness=0.0, roughness=roughness)
    scene.add(shapes.box((6.0, 0.1, 6.0)), material=glass)
    scene.add(box((-3.0, 0.06, -3.2), (3.0, 3.0, -3.0)), material=lambert((0.1,) * 3))
    camera = Camera.look_at((0.0, 0.5, 2.0), (0.0, 0.0, 0.8), yfov=0.3)
    with Renderer(scene, SETTINGS, camera, gpu=gpu) as renderer:
        means = [frame.radiance.mean() for frame in renderer.converge(33)]
    truth = truth_of(scene, camera, 64).mean()
    later = (33.0 * means[-1] - means[0]) / 32.0
    assert later == pytest.approx(truth, rel=0.01)
    assert roughness == 0.0 or means[0] == pytest.approx(truth, rel=0.01)


def test_a_small_lamp_is_seen_through_two_rough_sheets(gpu):
    """A frosted sheet above a mirror, which shows the lamp through it twice. Paths met the lamp one by one,
    and what stood out was cut: a tenth of the light was left, in all passes. Two standard errors of the
    truth's 64 paths a pixel are 0.5 %, of four passes with draws from the lamp as much."""
    scene = Scene()
    frosted = Material(transmission=1.0, roughness=0.5)
    scene.add(shapes.plane(2.0, 2.0), material=frosted, translation=(0.0, 0.03, 0.0))
    scene.add(shapes.plane(2.0, 2.0), material=Material((0.9,) * 3, metallic=1.0, roughness=0.0))
    scene.add(SphereLight((2000.0,) * 3, 0.07), translation=(0.0, 1.6, 0.0))
    camera = Camera.look_at((0.0, 1.2, 2.0), (0.0, 0.0, 0.0), yfov=0.3)
    with Renderer(scene, SETTINGS, camera, gpu=gpu) as renderer:
        *_, shown = renderer.converge(4)
    assert shown.radiance.mean() == pytest.approx(truth_of(scene, camera, 64).mean(), rel=0.02)


@pytest.mark.parametrize(("shape", "roughness"), [("box", 0.0), ("box", 0.3), ("cone", 0.3)])
def test_light_within_cloudy_glass_goes_on_after_its_matte_part(gpu, shape, roughness):
    """Solids that scatter a tenth: at each turn within a path has an end, of which it may store two, and all
    turns count. Half of the light was lost. Paths and means are uncertain by less than 0.5 %, and kernels at
    the edges lose some."""
    scene = Scene(environment=Environment(np.ones((16, 32, 3))))
    cloudy = Material((0.6, 0.5, 0.4), roughness=roughness, transmission=0.9, thickness=0.1)
    mesh = {"box": shapes.box((0.6, 0.7, 0.6)), "cone": shapes.cone(0.5, 0.8)}[shape]
    scene.add(mesh, material=cloudy, translation=(0.0, 0.55, 0.0))
    scene.add(shapes.plane(4.0, 4.0), material=lambert((0.5,) * 3))
    camera = Camera.look_at((0.0, 0.7, 2.5), (0.0, 0.45, 0.0), yfov=0.3)
    with Renderer(scene, SETTINGS, camera, gpu=gpu) as renderer:
        *_, shown = renderer.converge(8)
    truth = truth_of(scene, camera, 64)
    found = shown.radiance[16:36, 24:40].mean() / truth[16:36, 24:40].mean()
    assert found == pytest.approx(1.0, abs=0.02)


def test_no_light_is_made_within_cloudy_glass(gpu):
    """A white solid that absorbs nothing, before a sky that is even, vanishes. Beside total reflection its
    Lambert lobe made five times the light, and each turn within more."""
    scene = Scene(environment=Environment(np.ones((16, 32, 3))))
    cloudy = Material((1.0, 1.0, 1.0), roughness=0.0, transmission=0.5, thickness=0.1)
    scene.add(shapes.box((0.6, 0.7, 0.6)), material=cloudy)
    camera = Camera.look_at((0.0, 0.35, 2.5), (0.0, 0.0, 0.0), yfov=0.3)
    with Renderer(scene, SETTINGS.replace(bounces=64), camera, gpu=gpu) as renderer:
        *_, shown = renderer.converge(8)
    assert shown.radiance[18:30, 26:38].mean() == pytest.approx(1.0, abs=0.01)


def test_rough_glass_reflects_a_small_lamp_without_specks(gpu):
    """Beside the lamp's image, where the lobe's tail is all that shows. A pixel's two paths by the lobe met
    the lamp once in thousands; a draw from the lamp leaves the little noise of what is drawn of it."""
    scene = Scene()
    scene.add(shapes.plane(4.0, 4.0), material=Material(transmission=1.0, roughness=0.5))
    lamp = RectLight((400.0,) * 3, width=0.1, height=0.1)
    scene.add(lamp, translation=(0.0, 2.0, 0.0)).look_at((0.0, 0.0, 0.0))
    camera = Camera.look_at((0.0, 1.5, 1.6), (0.0, 0.0, 0.0), yfov=0.3)
    with Renderer(scene, SETTINGS, camera, gpu=gpu) as renderer:
        shown = renderer.render().radiance[..., 1].astype(float)
    truth = truth_of(scene, camera, 512)[..., 1]
    assert shown.mean() == pytest.approx(truth.mean(), rel=0.05)
    squares = shown.reshape(12, 4, 16, 4)
    assert np.median(squares.std(axis=(1, 3)) / squares.mean(axis=(1, 3))) < 0.25
