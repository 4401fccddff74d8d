"""How much light changed, by what probes brought before and now."""

import numpy as np

from ispm.frame import Receivers
from ispm.live.change import SIDE, changed_share, coarse, taken_at_once
from ispm.optics.records import RECEIVER

SIZE = 12, 9  # of the probes' image
FINE = SIZE[0] * SIDE, SIZE[1] * SIDE


def image(values):
    return np.repeat(np.reshape(values, (-1, 1)), 3, axis=1).astype(np.float32)


def share(before, now):
    return changed_share(image(before), image(now), SIZE, FINE).reshape(FINE[1], FINE[0])


def test_what_did_not_change():
    light = np.random.default_rng(1).random(SIZE[0] * SIZE[1])
    assert not share(light, light).any()


def test_light_that_goes_on_or_off():
    light = np.random.default_rng(1).random(SIZE[0] * SIZE[1])
    light[:50] = 0.0  # where no probe came
    assert (share(light, 0.0 * light) == 1.0).all()
    assert (share(0.0 * light, light) == 1.0).all()


def test_darkness():
    none = np.zeros(SIZE[0] * SIZE[1])
    assert not share(none, none).any()


def test_change_at_one_place():
    before = np.ones(SIZE[::-1])
    now = before.copy()
    now[:, :3] = 3.0
    found = share(before.ravel(), now.ravel())
    assert (found[:, : 2 * SIDE] == 1.0).all()  # a change by two thirds of the light, doubled
    assert (found[:, 5 * SIDE :] < 0.1).all()


def test_a_picture_whose_sides_are_no_multiples():
    receivers = np.zeros(10 * 7, RECEIVER)
    receivers["valid"] = 1
    receivers["position"][:, 0] = np.arange(70)
    few = coarse(Receivers(receivers, (10, 7)))
    assert few.size == (4, 3)
    assert few.points["position"][0, 0] == 11  # the middle of the first 3 x 3
    found = changed_share(image(np.ones(12)), image(np.zeros(12)), few.size, (10, 7))
    assert found.shape == (70,)


def test_a_block_takes_a_receiver_that_sees_something():
    receivers = np.zeros(9, RECEIVER)
    receivers["position"][:, 0] = np.arange(9)
    receivers["valid"][7] = 5
    (chosen,) = coarse(Receivers(receivers, (3, 3))).points
    assert chosen["position"][0] == 7
    assert chosen["valid"] == 5


def test_small_changes_of_one_event_count_for_more_and_large_ones_as_they_are():
    changed = np.array([0.0, 0.02, 0.1, 0.3, 0.8, 1.0], np.float32)
    np.testing.assert_allclose(taken_at_once(changed), [0.0, 0.1, 0.5, 0.5, 0.8, 1.0], rtol=1e-6)
