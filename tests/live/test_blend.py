"""Temporal accumulation: what the mean is, and how much it is worth."""

import numpy as np
import pytest

from ispm.live.blend import blend, effective_frames, light_of, no_history

ROWS = np.arange(3)


def add(history, value, rows=ROWS, worth=1.0, changed=0.0):
    light = np.full((len(rows), 16), value, np.float32)
    shares = np.full(len(history), changed, np.float32)
    blend(history, rows, light, light[:, 0].copy(), np.full(len(rows), worth, np.float32), shares)


def test_few_frames_are_a_mean():
    history = no_history(3)
    for k in range(1, 11):
        add(history, float(k))
        np.testing.assert_allclose(light_of(history), (k + 1) / 2, rtol=1e-5)
        np.testing.assert_allclose(history["nearness"], (k + 1) / 2, rtol=1e-5)
        np.testing.assert_allclose(history["variance"], 1 / k, rtol=1e-5)
        np.testing.assert_allclose(effective_frames(history), k, rtol=1e-5)


def test_many_frames_forget_the_first():
    history = no_history(3)
    add(history, 0.0)
    for _ in range(200):
        add(history, 1.0)
    assert (light_of(history) > 1 - 0.95**150).all()
    # the variance of an exponential mean of share a: a / (2 - a)
    np.testing.assert_allclose(history["variance"], 0.05 / 1.95, rtol=1e-2)


def test_an_estimate_of_more_rays_counts_for_more():
    one, four = no_history(3), no_history(3)
    for _ in range(4):
        add(one, 2.0)
    add(four, 2.0, worth=4.0)
    for name in ("frames", "variance"):
        np.testing.assert_allclose(four[name], one[name], rtol=1e-5)
    add(four, 7.0)
    np.testing.assert_allclose(light_of(four), 3.0, rtol=1e-5)  # (4 * 2 + 7) / 5


@pytest.mark.parametrize("share", [0.3, 1.0])
def test_changed_light_counts_for_less(share):
    history = no_history(3)
    for _ in range(30):
        add(history, 0.0)
    add(history, 1.0, changed=share)
    expected = share + (1 - share) / 20  # where the share without a change is .05
    np.testing.assert_allclose(light_of(history), expected, rtol=0.01)


def test_those_without_an_estimate_keep_their_light_and_forget_how_good_it_was():
    history = no_history(3)
    for _ in range(10):
        add(history, 5.0)
    add(history, 1.0, rows=np.array([1]), changed=0.5)
    np.testing.assert_allclose(light_of(history)[[0, 2]], 5.0)
    np.testing.assert_allclose(history["frames"][[0, 2]], 2.0)
