"""The comparison of pictures with paths: what it tells is not of the paths' noise."""

import numpy as np
import pytest
from references.beside_paths import Truth, difference
from references.furnished_scenes import furnished_scene
from references.random_scenes import random_scene


def noisy_truth(exact: np.ndarray, noise: float, seed: int) -> Truth:
    """What 16 independent pictures of paths tell, whose pixels have such noise."""
    random = np.random.default_rng(seed)
    parts = exact * (1.0 + noise * random.normal(size=(16, *exact.shape)))
    blocks = parts.reshape(16, 5, 8, 10, 8, 3).mean(axis=(2, 4))
    halves = parts.reshape(8, 2, *exact.shape).mean(axis=0)
    return Truth(halves, blocks.mean(axis=0), blocks.std(axis=0, ddof=1) / 4.0)


def test_errors_leave_out_the_noise_of_the_truth():
    """A picture that is off by .1 in single pixels, with another sign in each, has relMSE .01 by pixel and a
    64th of that by blocks, whatever the noise of the paths: in the mean of 200 within four standard errors."""
    exact = np.full((40, 80, 3), 2.0)
    sign = np.random.default_rng(1).choice([-1.0, 1.0], exact.shape)
    ours = exact * (1.0 + 0.1 * sign)
    expected = 0.01, np.mean(((ours - exact) / 2.0).reshape(5, 8, 10, 8, 3).mean(axis=(1, 3)) ** 2)
    found = [difference(ours, noisy_truth(exact, 0.8, seed)) for seed in range(200)]
    for values, right in zip(
        ([each.by_pixel for each in found], [each.relmse for each in found]), expected, strict=True
    ):
        error = np.std(values) / np.sqrt(len(values))
        # weights are over the mean's square and a thousandth of it
        assert np.mean(values) == pytest.approx(right / 1.001, abs=4.0 * error + 0.01 * right)
    assert abs(np.mean([each.bias for each in found])) < 1e-3


@pytest.mark.parametrize("scene", [random_scene, furnished_scene])
def test_scenes_are_the_same_every_time(scene):
    for number in range(12):
        one, other = scene(number), scene(number)
        assert one.name == other.name and len(one.nodes) > 5
        assert np.asarray(one.bounds) == pytest.approx(np.asarray(other.bounds), abs=0.0)
