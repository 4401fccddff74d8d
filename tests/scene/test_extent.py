"""A scene's size is that of a sphere about it, and does not change as it turns."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from transport import box_room

from ispm.scene.extent import enclosing_diameter
from ispm.scene.packed import pack
from ispm.scene.scene import Node, Scene


def test_a_box_has_its_diagonal_and_nothing_has_none():
    corners = np.array([[i & 1, 2 * (i >> 1 & 1), 3 * (i >> 2)] for i in range(8)], float)
    assert enclosing_diameter(corners) == pytest.approx(math.sqrt(14), rel=1e-12)
    assert enclosing_diameter(corners[:0]) == 0.0
    assert enclosing_diameter(corners[:1]) == 0.0


@pytest.mark.parametrize("count", [2, 5, 100, 20_000])
def test_no_sphere_is_smaller_than_the_farthest_pair_nor_this_much_larger(count):
    """Jung's theorem: the smallest is at most sqrt(3/2) times the largest distance; this a bit more."""
    points = np.random.default_rng(count).normal(size=(count, 3)) * (1.0, 2.0, 0.3) + 5.0
    far = points[np.argsort(-np.square(points - points.mean(axis=0)).sum(axis=1))[:300]]
    apart = np.linalg.norm(far[:, None] - far, axis=-1).max()
    assert apart * 0.999 <= enclosing_diameter(points) <= 1.05 * math.sqrt(1.5) * apart


def test_a_scene_is_as_large_when_it_is_turned():
    sizes = []
    for turn in np.eye(4)[3:], *Rotation.random(5, np.random.default_rng(1)).as_quat()[:, None]:
        scene = box_room((-1, 0, -2), (3, 1, 2))
        turned = Scene([Node(rotation=tuple(turn[0]), children=scene.roots)])
        sizes.append(pack(turned).diagonal)
    assert sizes == pytest.approx([math.sqrt(33)] * 6, rel=1e-6)
