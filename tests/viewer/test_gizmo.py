"""Handles over the picture: where they are seen, what is meant, and where a drag takes them."""

from dataclasses import replace

import numpy as np
import pytest

import ispm
from ispm.stages.camera import CameraView
from ispm.viewer.gizmo import LENGTH, Glass

SIZE = (400, 200)
PERSPECTIVE = ispm.Camera.look_at((3, 4, 5), (0.5, 0, 0), yfov=0.8)
PARALLEL = replace(PERSPECTIVE, ymag=2.0)
POINT = np.array([0.3, 0.2, -0.1])


def glass_of(camera):
    view = CameraView(SIZE, camera.pose, camera.yfov, camera.ymag, 0.01, 100.0)
    return Glass(view.clip_from_world, 10.0, 20.0, *map(float, SIZE))


@pytest.fixture(params=[PERSPECTIVE, PARALLEL], ids=["perspective", "parallel"])
def glass(request):
    return glass_of(request.param)


def test_the_point_looked_at_is_in_the_middle(glass):
    np.testing.assert_allclose(glass.project(np.array([0.5, 0, 0])), (210.0, 120.0), atol=1e-4)


def test_what_is_behind_the_eye_is_not_seen():
    assert glass_of(PERSPECTIVE).project(np.array([6.0, 8.0, 10.0])) is None


def test_a_line_is_seen_as_far_as_it_lies_before_the_eye(glass):
    behind = np.array([6.0, 8.0, 10.0])
    ahead = np.array([0.5, 0.1, -0.3])
    assert glass.segment(POINT, ahead) == (glass.project(POINT), glass.project(ahead))
    start, end = np.array(glass.segment(POINT, behind))
    np.testing.assert_allclose((end, start), glass.segment(behind, POINT), atol=1e-6)
    np.testing.assert_allclose(start, glass.project(POINT))
    direction = np.array(glass.project(POINT + 0.01 * (behind - POINT))) - start
    size = np.linalg.norm(direction) * np.linalg.norm(end - start)
    assert direction @ (end - start) == pytest.approx(size, rel=1e-6)  # they point the same way
    assert np.isfinite(end).all()


def test_a_line_behind_the_eye_is_not_seen():
    glass = glass_of(PERSPECTIVE)
    assert glass.segment(np.array([6.0, 8.0, 10.0]), np.array([7.0, 8.0, 10.0])) is None


def test_perspective_is_that_of_a_pinhole():
    """By hand: similar triangles, and a picture of 200 units' height that shows 2 tan(yfov / 2) at 1 m."""
    local = np.linalg.inv(PERSPECTIVE.pose) @ np.append(POINT, 1.0)
    unit = 200.0 / (2.0 * np.tan(0.4)) / -local[2]
    seen = 210.0 + unit * local[0], 120.0 - unit * local[1]
    np.testing.assert_allclose(glass_of(PERSPECTIVE).project(POINT), seen, rtol=1e-6)


def test_the_longest_axis_is_about_as_long_as_wanted(glass):
    base = np.array(glass.project(POINT))
    lengths = [np.linalg.norm(np.array(tip) - base) for tip in glass.tips(POINT)]
    assert 0.6 * LENGTH < max(lengths) < 1.4 * LENGTH  # exact but for what perspective adds


@pytest.mark.parametrize("part", [0, 1, 2])
def test_an_axis_is_meant_along_all_of_it_and_nothing_beside_it(glass, part):
    base, tip = np.array(glass.project(POINT)), np.array(glass.tips(POINT)[part])
    for share in (0.3, 0.6, 1.0):
        assert glass.part_at(POINT, tuple(base + share * (tip - base))) == part
    assert glass.part_at(POINT, tuple(base)) == "free"
    assert glass.part_at(POINT, tuple(base + 1.5 * (tip - base))) is None


@pytest.mark.parametrize("part", [0, 1, 2])
@pytest.mark.parametrize("far", [-0.4, 0.05, 0.7])
def test_a_drag_along_an_axis_takes_the_point_to_what_the_mouse_is_over(glass, part, far):
    goal = POINT + far * np.eye(3)[part]
    (x0, y0), (x1, y1) = glass.project(POINT), glass.project(goal)
    np.testing.assert_allclose(glass.moved(POINT, part, x1 - x0, y1 - y0), goal, atol=1e-6)


def test_a_free_drag_stays_at_its_depth_and_under_the_mouse(glass):
    moved = glass.moved(POINT, "free", 30.0, -12.0)
    x, y = glass.project(POINT)
    np.testing.assert_allclose(glass.project(moved), (x + 30.0, y - 12.0), atol=1e-4)
    assert abs((moved - POINT) @ PERSPECTIVE.pose[:3, 2]) < 1e-6


def test_a_drag_along_an_axis_that_points_at_the_eye_leads_nowhere():
    glass = glass_of(ispm.Camera.look_at((0, 0, 5), (0, 0, 0)))
    np.testing.assert_array_equal(glass.moved(np.zeros(3), 2, 10.0, 10.0), np.zeros(3))


def test_no_drag_leaves_the_point(glass):
    for part in (0, 1, 2, "free"):
        np.testing.assert_allclose(glass.moved(POINT, part, 0.0, 0.0), POINT, atol=1e-9)
