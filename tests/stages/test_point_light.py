"""Shadow rays to lights without a surface bring what shadow maps do, of few lights and of many."""

import math

import numpy as np
import pytest

from ispm import Camera, DirectionalLight, Material, PointLight, Renderer, Settings, SpotLight, shapes
from ispm.scene.scene import Scene

_EYE = Camera.look_at((0.0, 2.4, 5.0), (0.0, 0.3, 0.0), yfov=0.8)
_PASSES = 24


def yard(lamps: int) -> Scene:
    """Balls, a box and a colored sheet on a floor, under lamps in a ring."""
    scene = Scene()
    scene.add(shapes.plane(6.0, 6.0), material=Material((0.6, 0.6, 0.6)))
    scene.add(shapes.box(0.7), material=Material((0.7, 0.3, 0.2)), translation=(-0.9, 0.35, 0.2))
    scene.add(
        shapes.sphere(0.4), material=Material((0.3, 0.5, 0.7), roughness=0.4), translation=(0.7, 0.4, 0.0)
    )
    sheet = Material((0.2, 0.7, 0.9), roughness=0.0, transmission=1.0)
    scene.add(shapes.box((0.8, 0.02, 0.8)), material=sheet, translation=(0.0, 0.9, 1.2))
    for k in range(lamps):
        turn = 2.0 * math.pi * k / lamps
        place = (1.8 * math.cos(turn), 1.6 + 0.4 * math.sin(3.0 * turn), 1.8 * math.sin(turn))
        intensity = (2.0 + k % 3, 3.0, 4.0 - k % 4)
        light = SpotLight(intensity, outer_angle=1.0) if k % 3 == 0 else PointLight(intensity, range=9.0)
        scene.add(light, translation=place).look_at((0.0, 0.0, 0.0))
    scene.add(DirectionalLight((1.0, 0.8, 0.6)), translation=(1.0, 3.0, 2.0)).look_at((0.0, 0.0, 0.0))
    return scene


def direct(gpu, scene, passes=_PASSES, **settings):
    """The direct light of each pass, (n, h, w, 3)."""
    told = Settings(size=(96, 64), bounces=0, antialias=False, **settings)
    means = []
    with Renderer(scene, told, _EYE, gpu=gpu) as renderer:
        for frame in renderer.converge(passes):
            means.append(frame.direct.astype(float))
    sums = np.stack(means) * np.arange(1, len(means) + 1)[:, None, None, None]
    return np.diff(sums, axis=0, prepend=0.0)


def test_two_lights_have_a_ray_each(gpu):
    """Without antialiasing pixels that maps leave in doubt have the same rays: all agree, but rounding at an
    edge."""
    scene = yard(1)
    rays, maps = (direct(gpu, scene, 1, shadows=by)[0] for by in ("rays", "map"))
    same = np.abs(rays - maps).max(axis=-1) <= 1e-3 * maps.max()
    assert same.mean() > 0.999
    assert rays.mean() == pytest.approx(maps.mean(), rel=0.01)


def test_of_many_lights_few_rays_have_the_mean(gpu):
    """The passes after the first have no bias: the mean of blocks of 6 x 4 pixels lies within 4.5 standard
    errors of that of all lights' maps, one of 3 x 256 beyond it in 200 runs; 1 % is left to maps' edges."""
    scene = yard(13)
    rays, maps = (direct(gpu, scene, shadows=by)[1:] for by in ("rays", "map"))
    blocks = [each.reshape(_PASSES - 1, 16, 4, 16, 6, 3).mean(axis=(2, 4)) for each in (rays, maps)]
    difference = blocks[0] - blocks[1]
    error = difference.std(axis=0, ddof=1) / math.sqrt(_PASSES - 1)
    assert (error.mean() < 0.02 * blocks[1].mean()).all()
    assert (np.abs(difference.mean(axis=0)) <= 4.5 * error + 0.01 * blocks[1].mean(axis=0)).all()


def test_the_first_pass_blurs_no_more_than_a_few_pixels(gpu):
    """A ratio of means over 5 x 5 pixels: the mean over 12 x 8 of them is off by 3 % on average."""
    scene = yard(13)
    rays, maps = direct(gpu, scene, 1, shadows="rays")[0], direct(gpu, scene, 8, shadows="map").mean(axis=0)
    blocks = [each.reshape(8, 8, 8, 12, 3).mean(axis=(1, 3)) for each in (rays, maps)]
    lit = blocks[1] > 0.1 * blocks[1].max()
    assert np.abs(blocks[0] / np.where(lit, blocks[1], 1.0) - 1.0)[lit].mean() < 0.03


def test_without_lights_there_are_no_rays(gpu):
    scene = Scene()
    scene.add(shapes.plane(1.0, 1.0), material=Material(emission=(1.0, 1.0, 1.0)))
    assert not direct(gpu, scene, 1, shadows="rays").any()


def test_the_first_pass_is_exact_where_nothing_is_shaded(gpu):
    """Of any surface: all lights are added before one is drawn for the shadows. Both sides round some hundred
    times, of which a lobe doubles or trebles the error: 2^-15."""
    scene = Scene()
    scene.add(shapes.plane(12.0, 12.0), material=Material((0.9, 0.9, 0.9), metallic=1.0, roughness=0.6))
    for k in range(13):
        turn = 2.0 * math.pi * k / 13
        scene.add(PointLight((3.0, 3.0, 3.0)), translation=(1.8 * math.cos(turn), 1.6, 1.8 * math.sin(turn)))
    rays, exact = (direct(gpu, scene, 1, shadows=by)[0] for by in ("rays", "map"))
    floor = exact[..., 0] > 0.0
    assert floor.sum() > 3500
    assert np.abs(rays[floor] / exact[floor] - 1.0).max() < 2.0**-15
