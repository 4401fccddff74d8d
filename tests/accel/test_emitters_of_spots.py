"""Spots with a radius among other lamps: drawn where they shine, and nowhere else."""

import math

import numpy as np
from test_emitters import ball_lamps, chances_at, emitters_of

from ispm.accel.emitter_tree import FLOATS

HALF_ANGLE = 0.3


def test_a_tree_without_spots_has_no_cones():
    for half_angles, more in (([], False), ([HALF_ANGLE], True)):
        emitters = emitters_of(ball_lamps(2), lamps=2, half_angles=half_angles)
        assert (emitters.nodes.shape[1] > FLOATS) == more


def test_a_spot_is_drawn_in_its_cone_alone():
    """A spot along X among four balls, as bright in its cone as these: there a point draws all lamps as if it
    shone to all sides, but for rounding; beyond the cone the others alone. Seen from all over the spheres
    about its triangles, which reach 20 cm out."""
    count, corners = 5, ball_lamps(5)
    of_spot = np.arange(len(corners)) < len(corners) // count
    share = np.where(of_spot, (1.0 - math.cos(HALF_ANGLE)) / 2.0, 1.0)
    spot = emitters_of(corners, share, lamps=count, half_angles=[HALF_ANGLE])
    balls = emitters_of(corners, lamps=count)
    first, random = spot.triangles["instance"] == 0, np.random.default_rng(2)
    middle, inside, outside = np.array([-6.0, -1.2, -1.8]), 0, 0
    for _ in range(400):
        d = np.array([random.uniform(0.5, 1.0), *random.uniform(-0.4, 0.4, 2)])
        distance = random.uniform(2.0, 8.0)
        p = middle + distance * d / np.linalg.norm(d)
        angle, ball_seen = math.acos(d[0] / np.linalg.norm(d)), math.asin(0.2 / distance)
        found, expected = chances_at(spot, p, np.zeros(3)), chances_at(balls, p, np.zeros(3))
        if angle + ball_seen < HALF_ANGLE:
            np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-6)
            inside += 1
        elif angle - ball_seen > HALF_ANGLE:
            assert found[first].max() == 0.0
            more = found[~first].sum() / expected[~first].sum()
            np.testing.assert_allclose(found[~first], more * expected[~first], rtol=1e-4, atol=1e-6)
            assert more > 1.0
            outside += 1
    assert min(inside, outside) > 50
