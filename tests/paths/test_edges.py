"""Edges of what mirrors show."""

from dataclasses import replace

import numpy as np
import pytest

from ispm.optics.records import RECEIVER
from ispm.paths.branch import REFLECTED, SCATTERED
from ispm.paths.edges import edge_rows
from ispm.paths.eye_paths import EyePaths
from ispm.paths.vertices import COLUMNS, FIRST_VERTEX, PATH_END

# A mirror of 3 x 2 pixels in a picture 4 wide; the rays, row by row:  0 1 2 / 3 4 5
PIXELS, WIDTH = np.array([0, 1, 2, 4, 5, 6]), 4
NONE = np.zeros(0, np.int64)


def mirror(shown):
    """Paths of which each shows the surface of a number, -1 none; surfaces face one way."""
    count = len(shown)
    firsts = np.zeros(count, FIRST_VERTEX)
    firsts["ng"] = (0.0, 0.0, 1.0)
    slots = np.flatnonzero(np.array(shown) >= 0)
    ends, points = np.zeros(len(slots), PATH_END), np.zeros(len(slots), RECEIVER)
    ends["slot"], ends["lane"], ends["weight"] = slots, REFLECTED, 0.5
    ends["instance"] = np.array(shown)[slots]
    points["ng"] = (0.0, 1.0, 0.0)
    return EyePaths(np.zeros((count, COLUMNS), np.float32), firsts, ends, points)


@pytest.mark.parametrize(
    ("shown", "rows"),
    [
        ([7, 7, 7, 7, 7, 7], []),
        ([7, 7, 7, 7, 7, 8], [2, 4, 5]),
        ([7, -1, 7, 7, 7, 7], [0, 1, 2, 4]),
        ([-1, -1, -1, -1, -1, -1], []),
    ],
)
def test_edges_lie_between_surfaces(shown, rows):
    assert edge_rows(mirror(shown), NONE, PIXELS, WIDTH).tolist() == rows


def test_pixels_side_by_side_in_the_list_alone_are_no_neighbours():
    """The last of one row of the picture and the first of the next."""
    assert edge_rows(mirror([7, 8]), NONE, np.array([3, 4]), WIDTH).tolist() == []


def test_a_crease_is_an_edge():
    paths = mirror([7, 7, 7, 7, 7, 7])
    paths.points["ng"][5] = (1.0, 0.0, 0.0)
    assert edge_rows(paths, NONE, PIXELS, WIDTH).tolist() == [2, 4, 5]


def test_faint_ends_have_no_edges_and_neither_has_what_is_rough_or_not_the_same_mirror():
    paths = mirror([7, 7, 7, 7, 7, 8])
    faint, scattered = paths.ends.copy(), paths.ends.copy()
    faint["weight"], scattered["lane"] = 0.01, SCATTERED
    rough, other = paths.firsts.copy(), paths.firsts.copy()
    rough["blur"], other["instance"][5] = 1.0, 1
    for changed in (dict(ends=faint), dict(ends=scattered), dict(firsts=rough), dict(firsts=other)):
        assert not len(edge_rows(replace(paths, **changed), NONE, PIXELS, WIDTH))


def test_a_lobe_without_paths_of_its_own_has_no_edge_unless_it_is_alone():
    """One of 2 x 2 pixels has the path, and its light is theirs: rays through them would be for nothing."""
    paths = mirror([7, -1, -1, -1, -1, -1])
    paths.firsts["reflectance"] = 0.5
    paths.firsts["samples"][0], paths.firsts["blur"][0] = 1, 3.0
    assert edge_rows(paths, NONE, PIXELS, WIDTH).tolist() == []
    assert edge_rows(paths, np.array([1, 4]), PIXELS, WIDTH).tolist() == [1]
