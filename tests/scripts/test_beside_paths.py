"""The comparison of pictures with paths: what it tells is not of the paths' noise."""

from functools import partial

import numpy as np
import pytest
from references.beside_paths import Truth, difference
from references.furnished_scenes import furnished_scene
from references.known_scenes import KNOWN
from references.random_scenes import random_scene


def noisy_truth(exact: np.ndarray, noise: float, seed: int) -> Truth:
    """What 16 independent pictures of paths tell, whose pixels have such noise."""
    random = np.random.default_rng(seed)
    parts = exact * (1.0 + noise * random.normal(size=(16, *exact.shape[:2], 1)))
    blocks = parts.reshape(16, 5, 8, 10, 8, 3).mean(axis=(2, 4))
    halves = parts.reshape(8, 2, *exact.shape).mean(axis=0)
    return Truth(halves, blocks.mean(axis=0), blocks.std(axis=0, ddof=1) / 4.0)


def test_errors_leave_out_the_noise_of_the_truth():
    """A picture that is off by .1 in single pixels, with another sign in each, has relMSE .01 by pixel and
    a 64th of that by blocks, whatever the noise of the paths: in the mean of 200 within four standard errors.
    A bright corner has most of the noise of the whole light, whose standard error is told: to a fifth, as 200
    values know it to 5 % with one standard error."""
    exact = np.full((40, 80, 3), 2.0)
    exact[:8, :8] = 400.0
    sign = np.random.default_rng(1).choice([-1.0, 1.0], exact.shape)
    ours = exact * (1.0 + 0.1 * sign)
    weight = exact / np.sqrt(exact**2 + 1e-3 * exact.mean() ** 2)
    off = (ours / exact - 1.0) * weight
    expected = np.mean(off**2), np.mean(off.reshape(5, 8, 10, 8, 3).mean(axis=(1, 3)) ** 2)
    found = [difference(ours, noisy_truth(exact, 0.8, seed)) for seed in range(200)]
    for values, right in zip(
        ([each.by_pixel for each in found], [each.relmse for each in found]), expected, strict=True
    ):
        error = np.std(values) / np.sqrt(len(values))
        # weights know the truth by blocks, whose noise of 2.5 % they take squared
        assert np.mean(values) == pytest.approx(right, abs=4.0 * error + 0.01 * right)
    spread, told = np.std([each.bias for each in found]), np.mean([each.uncertain for each in found])
    assert spread == pytest.approx(told, rel=0.2)


NUMBERED = [partial(scene, number) for scene in (random_scene, furnished_scene) for number in range(12)]


@pytest.mark.parametrize("scene", [*NUMBERED, *KNOWN.values()])
def test_scenes_are_the_same_every_time(scene):
    one, other = scene(), scene()
    assert one.name == other.name and len(one.nodes) > 5
    assert np.asarray(one.bounds) == pytest.approx(np.asarray(other.bounds), abs=0.0)
