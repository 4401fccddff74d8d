"""The slow truth: paths from the eye, against a path tracer that is not ours and against exact answers."""

import math

import numpy as np
import pytest
from references import stored
from references.scenes import pictured
from test_specular_paths import glass, rectangle
from transport import Tracer, box_room, lit

from ispm import Material, Sky, shapes
from ispm.library.common import lambert
from ispm.library.shapes import icosphere
from ispm.reference.paths import path_light
from ispm.scene.scene import Scene
from ispm.stages.camera import CameraView


def seen(scene, size, samples, bounces):
    """(samples, h, w, 3): pictures of one path a pixel, through places in the pixels drawn at random."""
    tracer, random = Tracer(scene), np.random.default_rng(3)
    camera = scene.default_camera(size)
    view = CameraView(size, camera.pose, camera.yfov, camera.ymag, 1e-3, 100.0)
    pictures = []
    for k in range(samples):
        x, y = random.random((2, size[1], size[0]))
        origins, directions = view.rays_through(np.arange(size[0]) + x, np.arange(size[1])[:, None] + y)
        rays = origins.reshape(-1, 3), directions.reshape(-1, 3)
        found = path_light(tracer.tables, *rays, samples=range(k, k + 1), bounces=bounces, threads=2)
        pictures.append(found.reshape(size[1], size[0], 3))
    return np.array(pictures)


@pytest.mark.parametrize("name", ["cornell-box", "ggx-floor", "spot", "sun", "textured", "door"])
def test_paths_find_the_light_that_mitsuba_finds(name):
    """24 pictures of a path a pixel; means of 10 x 10 pixels are off by their standard errors, and no part is
    by more than 4.5 of them, which happens once in 1000 runs; nor is the whole by more than 3.5."""
    reference = stored(name)
    scene, factor = pictured(name)
    pictures = seen(scene, reference.size, 24, reference.bounces) / factor
    mask = reference.masks["whole"]
    light = np.where(mask, pictures.mean(axis=-1), 0.0)
    truth = np.where(mask, reference.radiance.mean(axis=-1), 0.0)
    own = np.where(mask, reference.standard_error, 0.0) ** 2

    def parts(a):
        return a.reshape(*a.shape[:-2], 9, 10, 16, 10).sum(axis=(-3, -1))

    # fireflies: the spread of 24 values is itself known to a fifth, so take that of the whole as the least
    sums = parts(light)
    spread = sums.std(axis=0, ddof=1) / math.sqrt(len(sums))
    spread = np.maximum(spread, np.median(spread))
    score = (sums.mean(axis=0) - parts(truth)) / np.sqrt(spread**2 + parts(own))
    assert np.abs(score).max() < 4.5
    whole = light.sum(axis=(1, 2))
    error = math.sqrt(whole.var(ddof=1) / len(whole) + own.sum())
    assert abs(whole.mean() - truth.sum()) < 3.5 * error


def test_a_sphere_of_albedo_a_half_doubles_its_light():
    """V1: radiance everywhere is albedo / (1 - albedo) Phi / (pi A) with the light in the middle; 4 bounces
    are 15/16 of what comes after direct light. 20,000 paths: each is exact but for facets, a thousandth."""
    scene = Scene()
    scene.add(icosphere(1.0, 24), material=lambert((0.5,) * 3))
    scene.nodes[0].parts[0].material.double_sided = True
    tracer = Tracer(lit(scene))
    directions = np.random.default_rng(1).normal(size=(20_000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    for bounces, exact in ((0, 1.0), (4, 1.9375), (40, 2.0)):
        rays = np.zeros((20_000, 3)), directions
        found = path_light(tracer.tables, *rays, samples=range(1), bounces=bounces, threads=2)
        assert found.mean() == pytest.approx(0.5 / math.pi * exact, rel=3e-3)


def test_paths_see_the_sun_of_a_sky_in_mirrors():
    """A perfect mirror adds nothing: the ray shows the disc, and beside it the sky alone."""
    sky = Sky(sun_elevation=0.8, sun_azimuth=0.0)
    disc, scene = sky.disc(), Scene(environment=sky)
    scene.add(shapes.plane(4.0, 4.0), material=Material((1.0,) * 3, metallic=1.0, roughness=0.0))
    tracer = Tracer(scene)
    angles = 0.8 + disc.radius * np.array([0.0, 0.9, -0.9, 1.5, -1.5])
    down = np.stack(
        [np.zeros(5), -np.sin(angles), np.array(disc.direction)[2] / math.cos(0.8) * np.cos(angles)], axis=1
    )
    found = path_light(tracer.tables, -down, down, samples=range(8), bounces=0)
    sun, beside = found[:3], found[3:].mean(axis=0)
    assert sun == pytest.approx(np.tile(np.array(disc.radiance) + beside, (3, 1)), rel=1e-3)
    assert beside.max() < 1e-3 * max(disc.radiance)


def test_paths_go_through_glass_and_stay_the_same_for_any_threads():
    scene = lit(box_room(albedo=0.5))
    scene.add(rectangle((-0.5, -0.5, 0.2), (1, 0, 0), (0, 1, 0)), material=glass(thickness=0.0))
    tracer = Tracer(scene)
    directions = np.random.default_rng(2).normal(size=(2000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    rays = np.zeros((2000, 3)), directions
    found = [
        path_light(tracer.tables, *rays, samples=range(2), bounces=3, threads=threads) for threads in (1, 2)
    ]
    assert (found[0] == found[1]).all() and np.isfinite(found[0]).all()
    assert (found[0].mean(axis=1) > 0).mean() > 0.99
