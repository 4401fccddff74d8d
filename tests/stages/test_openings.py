"""Direct light of environments through windows: draws are guided by what those of neighbors found open."""

import math

import numpy as np
import pytest
from exact_light import polygon_irradiance

from ispm import Camera, Environment, Material, Renderer, Settings, shapes
from ispm.optics.jit import jit
from ispm.scene.scene import Scene
from ispm.stages.openings import (
    DREW,
    PASSED,
    draw_opening,
    find_openings,
    opening_pdf,
    openings_around,
)

COLUMNS, ROWS = 40, 36


@jit
def _draws(openings, marks, i, numbers, directions, densities):
    around = openings_around(openings, marks, i, np.int64(COLUMNS))
    for k in range(len(numbers)):
        d = draw_opening(openings, around, numbers[k, 0], numbers[k, 1], numbers[k, 2])
        for c in range(3):
            directions[k, c] = d[c]
        densities[k] = opening_pdf(openings, around, d)
    return around


@jit
def _densities(openings, marks, i, directions, densities):
    around = openings_around(openings, marks, i, np.int64(COLUMNS))
    for k in range(len(directions)):
        d = directions[k]
        densities[k] = opening_pdf(openings, around, (d[0], d[1], d[2]))


def few_found() -> tuple[np.ndarray, np.ndarray]:
    """Marks and directions of pixels of which one in 150 found the environment, all about one direction."""
    rng = np.random.default_rng(3)
    marks = np.full(COLUMNS * ROWS, DREW, np.uint8)
    marks[rng.random(len(marks)) < 1 / 150] |= PASSED
    marks[20 * COLUMNS + 20] |= PASSED
    marks[20 * COLUMNS + 24] |= PASSED
    found = rng.normal((0.0, 0.0, 2.0), 0.5, (len(marks), 3)).astype(np.float32)
    return marks, found / np.linalg.norm(found, axis=1, keepdims=True)


def test_directions_are_drawn_by_their_density():
    """The mean of z / pdf over draws is the integral of z over the caps, as of even directions of the sphere;
    and their density is 1 in all. Both by 400,000 random numbers: four standard errors."""
    marks, found = few_found()
    openings, pixel = find_openings(marks, found, COLUMNS, 2), 20 * COLUMNS + 20
    rng = np.random.default_rng(5)
    numbers = rng.random((400_000, 3), np.float32)
    directions, densities = np.empty((400_000, 3), np.float32), np.empty(400_000, np.float32)
    around = _draws(openings, marks, pixel, numbers, directions, densities)
    assert around.draws == 4 and around.sizes == 3
    assert (densities > 0.0).all()
    drawn = directions[:, 0] ** 2 / densities  # any function will do
    even = rng.normal(size=(400_000, 3))
    even = (even / np.linalg.norm(even, axis=1, keepdims=True)).astype(np.float32)
    of_even = np.empty(400_000, np.float32)
    _densities(openings, marks, pixel, even, of_even)
    known = 4.0 * math.pi * np.where(of_even > 0.0, even[:, 0] ** 2, 0.0)
    for values, expected in (
        (drawn - known, 0.0),
        (4.0 * math.pi * of_even.astype(float) - 1.0, 0.0),
    ):
        assert values.mean() == pytest.approx(expected, abs=4.0 * float(values.std()) / math.sqrt(400_000))


def test_no_pixel_is_guided_by_what_it_found_itself():
    """Of a picture in which one pixel alone found the environment, that one is not guided; its neighbors
    are, toward what it found."""
    marks, found = np.full(COLUMNS * ROWS, DREW, np.uint8), np.zeros((COLUMNS * ROWS, 3), np.float32)
    lone = 17 * COLUMNS + 23
    marks[lone] |= PASSED
    found[lone] = 0.6, 0.0, 0.8
    openings = find_openings(marks, found, COLUMNS, 2)
    numbers = np.random.default_rng(1).random((100, 3), np.float32)
    directions, densities = np.empty((100, 3), np.float32), np.empty(100, np.float32)
    assert _draws(openings, marks, lone, numbers, directions, densities).draws == 0
    assert (densities == 0.0).all()
    for pixel in (lone + 1, 0):  # in the same square, and in another
        assert _draws(openings, marks, pixel, numbers, directions, densities).draws == 4
        assert (directions @ found[lone] > math.cos(math.radians(12.5))).all()


def test_pixels_whose_draws_mostly_pass_are_not_guided():
    marks = np.full(COLUMNS * ROWS, DREW, np.uint8)
    marks[::8] |= PASSED
    found = np.tile(np.float32([0.0, 0.0, 1.0]), (len(marks), 1))
    openings = find_openings(marks, found, COLUMNS, 2)
    numbers = np.zeros((1, 3), np.float32)
    around = _draws(openings, marks, 100, numbers, np.empty((1, 3), np.float32), np.empty(1, np.float32))
    assert around.draws == 0


HOLE = np.array([[-0.2, 3.0, -0.3], [0.2, 3.0, -0.3], [0.2, 3.0, 0.3], [-0.2, 3.0, 0.3]])


def lit_by_a_hole() -> Scene:
    """A floor below a wide ceiling with a hole, under an even sky of radiance 10."""
    scene = Scene(environment=Environment(np.full((4, 8, 3), 10.0)))
    matte = Material((0.6, 0.6, 0.6), specular=0.0, roughness=1.0)
    scene.add(shapes.plane(4.0, 4.0), material=matte)
    for size, aside in (((6e3, 0.01, 6e3), (3e3 + 0.2, 0.0)), ((0.4, 0.01, 3e3), (0.0, 1500.3))):
        for side in (-1.0, 1.0):
            x, z = side * aside[0], side * aside[1]
            scene.add(shapes.box(size), material=matte, translation=(x, 3.005, z))
    return scene


def test_light_through_a_hole_is_exact_and_has_little_noise(gpu):
    """One cosine draw in 230 passes. By these alone, a mean over squares of 45 x 45 pixels is off by a third
    (.41 was measured). Of draws in caps about the hole, which is seen some 8 degrees wide, one in six passes
    at least: four to a pixel, and 25 pixels to the smallest square, err by sqrt(5 / 100) = .22 at most. The
    mean of 48 pictures is exact to four of its standard errors, by Lambert's formula for polygons."""
    camera = Camera.look_at((0.0, 2.5, 0.0), (0.0, 0.0, -1e-3), yfov=0.6)
    settings = Settings(size=(96, 64), bounces=0, antialias=False)
    scene, means = lit_by_a_hole(), []
    with Renderer(scene, settings, camera, gpu=gpu) as renderer:
        frame = renderer.render()
        depth = frame.depth.astype(float)
        first = frame.direct[..., 1].astype(float)
        for seed in range(48):
            renderer.settings = settings.replace(seed=seed)
            means.append(renderer.render().direct[..., 1].astype(float).mean())
    assert depth.std() < 0.2  # the floor alone
    tangent = math.tan(0.3)
    x, z = np.meshgrid(
        2.5 * tangent * 1.5 * (2 * (np.arange(96) + 0.5) / 96 - 1),
        2.5 * tangent * (2 * (np.arange(64) + 0.5) / 64 - 1),
    )
    up = np.array([0.0, 1.0, 0.0])
    truth = (
        np.array(
            [
                [polygon_irradiance(HOLE, np.array([a, 0.0, b]), up) for a, b in zip(*rows, strict=True)]
                for rows in zip(x, z, strict=True)
            ]
        )
        * 10.0
        * 0.6
        / math.pi
    )
    assert np.sqrt(((first / truth - 1.0) ** 2).mean()) < 0.22
    assert np.mean(means) == pytest.approx(truth.mean(), abs=4.0 * float(np.std(means)) / math.sqrt(48))
