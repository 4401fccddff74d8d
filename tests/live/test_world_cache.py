"""The world's cache: what it returns, learns and forgets."""

import numpy as np
import pytest

from ispm.live.cache import WorldCache
from ispm.optics.records import INNER, RECEIVER

WIDTH = 0.1


def floor(side=40, extent=4.0, up=(0.0, 1.0, 0.0)):
    points = np.zeros(side * side, RECEIVER)
    x, z = np.meshgrid(np.linspace(0, extent, side), np.linspace(0, extent, side))
    points["position"] = np.stack([x.ravel(), np.zeros(side * side), z.ravel()], axis=1)
    points["ng"] = points["n"] = up
    points["valid"] = 1
    return points


class Estimate:
    """Irradiance as told, with noise that frames do not share; counts how many points were asked."""

    def __init__(self, value, noise=0.0):
        self.value, self.noise, self.asked = value, noise, 0
        self.draw = np.random.default_rng(3)

    def __call__(self, points):
        self.asked += len(points)
        light = np.zeros((len(points), 16), np.float32)
        value = self.value(points) if callable(self.value) else self.value
        light[:, :3] = np.reshape(value, (-1, 1)) + self.noise * self.draw.standard_normal((len(points), 3))
        return light


def test_light_is_what_was_estimated():
    cache, points = WorldCache(WIDTH), floor()
    for frame in range(4):
        found = cache.light(points, Estimate(3.0), frame, frame)
        np.testing.assert_allclose(found[:, :3], 3.0, rtol=1e-6)


def test_few_points_are_asked_once_cells_are_known():
    cache, points, estimate = WorldCache(WIDTH), floor(), Estimate(1.0)
    asked = []
    for frame in range(40):
        estimate.asked = 0
        cache.light(points, estimate, frame, frame)
        asked.append(estimate.asked / len(points))
    assert asked[0] == 1.0  # nothing is known
    assert asked[-1] < 0.25  # an eighth, and those in cells at the rim that jitter seldom finds


def test_noise_falls_with_the_frames():
    """A cell of 5 x 5 points asks them all at first, and then 25 / 8 a frame: of n frames each with the
    variance 8 / 25 of its mean, 1 / n of it is left."""
    cache, points, estimate = WorldCache(0.5), floor(), Estimate(10.0, noise=1.0)
    errors = [cache.light(points, estimate, frame, frame)[:, :3].std() for frame in range(60)]
    assert errors[0] == pytest.approx(np.sqrt(1 / 25), rel=0.5)
    assert errors[-1] < 2.0 * np.sqrt(8 / 25 / 60)


def test_one_frame_counts_once_however_many_points_it_has():
    cache, points = WorldCache(100.0), floor()  # few cells
    for frame, value in enumerate((0.0, 0.0, 0.0, 8.0)):
        found = cache.light(points[: 1 if frame == 3 else None], Estimate(value), frame, frame)
    assert (found[:, :3] <= 8.0 / 2 + 1e-6).all()  # of 3 frames and 1, if that one was asked at all


def test_both_sides_of_a_sheet_are_told_apart():
    cache, above, below = WorldCache(WIDTH), floor(), floor(up=(0.0, -1.0, 0.0))
    for frame in range(4):
        top = cache.light(above, Estimate(5.0), frame, frame)
        bottom = cache.light(below, Estimate(0.0), frame, 100 + frame)
    np.testing.assert_allclose(top[:, :3], 5.0)
    assert not bottom.any()


def test_the_inside_of_a_wall_is_told_from_the_outside_of_another():
    cache, outer, inner = WorldCache(WIDTH), floor(), floor()
    inner["valid"] |= INNER
    for frame in range(4):
        bright = cache.light(outer, Estimate(5.0), frame, frame)
        dark = cache.light(inner, Estimate(0.0), frame, 100 + frame)
    np.testing.assert_allclose(bright[:, :3], 5.0)
    assert not dark.any()


def test_changed_light_is_forgotten():
    cache, points = WorldCache(WIDTH), floor()
    for frame in range(20):
        cache.light(points, Estimate(1.0), frame, frame)
    cache.change(1.0)
    found = cache.light(points, Estimate(7.0), 20, 20)
    np.testing.assert_allclose(found[:, :3], 7.0)


def test_points_that_are_not_there_get_nothing():
    cache, points = WorldCache(WIDTH), floor()
    points["valid"][::2] = 0
    found = cache.light(points, Estimate(1.0), 0, 0)
    assert not found[::2].any()
    assert (found[1::2, :3] == 1.0).all()


def test_a_full_cache_starts_anew():
    cache = WorldCache(1e-3)  # a cell a point, and others for each jitter
    for frame in range(400):
        found = cache.light(floor(), Estimate(2.0), frame, frame)
        np.testing.assert_allclose(found[:, :3], 2.0)
