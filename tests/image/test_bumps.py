"""Normal maps under indirect light: as much contrast as paths find."""

import math

import numpy as np
import pytest
from references.bias_scenes import BOUNCES, cases
from references.biases import _indirect, _seen, _view
from transport import render

CASE = cases()["bumps"][0]
SIZE = 640, 360
PATHS, GROUPS = 32, 16
LOST = 0.06  # share of contrast: 3.6 and 5.2 % with receivers of 4 x 4 and 1 pixels; unfitted 22 and more


@pytest.fixture(scope="module")
def wall(gpu):
    """Of a ninth of a bumpy wall's pixels x and y, and what two runs of paths bring, (2, n) cd/m2."""
    frame, _ = render(gpu, CASE.scene(), size=SIZE, photons=1000)
    y, x = np.nonzero(CASE.regions(_seen(frame, _view(CASE.scene())))["wall"])
    some = (x % 3 == 0) & (y % 3 == 0)
    x, y = x[some], y[some]
    runs = [_indirect(CASE.scene(), x + 0.5, y + 0.5, PATHS, k * PATHS) for k in (0, 1)]
    return x, y, np.array(runs)


def contrast_kept(picture, runs):
    """Slope of a picture's deviations from its mean over those of paths, both as shares; noise cancels."""
    ours, first, second = (each / each.mean() - 1.0 for each in (picture, *runs))
    return (ours * (first + second)).mean() / (2.0 * (first * second).mean())


@pytest.mark.parametrize("block", [4, 1])
def test_bumps_keep_their_contrast(gpu, wall, block):
    x, y, runs = wall
    frame, _ = render(gpu, CASE.scene(), size=SIZE, bounces=BOUNCES, subsampling=block)
    picture = frame.indirect.mean(axis=-1)[y, x]
    kept = contrast_kept(picture, runs)
    groups = np.random.default_rng(0).integers(0, GROUPS, len(x))
    without = [contrast_kept(picture[groups != k], runs[:, groups != k]) for k in range(GROUPS)]
    error = math.sqrt((GROUPS - 1) * np.var(without))  # jackknife
    assert error < 0.03
    assert abs(kept - 1.0) < LOST + 3.0 * error


def test_bumps_are_neither_black_nor_infinite_under_photons_alone(gpu):
    frame, _ = render(gpu, CASE.scene(), size=(160, 90), gather=0, photons=3000)
    assert np.isfinite(frame.indirect).all() and (frame.indirect >= 0.0).all()
    assert (frame.indirect > 0.0).mean() > 0.99
