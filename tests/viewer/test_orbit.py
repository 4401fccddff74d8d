"""Where drags take the camera: exact places, and invariants after many."""

import math
from dataclasses import replace

import numpy as np
import pytest

from ispm.scene.camera import Camera, look_at_pose
from ispm.viewer.orbit import Orbit, orbit_of

ORIGIN = np.zeros(3)


def orbit(eye=(0.0, 0.0, 5.0), target=ORIGIN, **camera):
    eye, target = np.array(eye), np.array(target)
    return Orbit(Camera(**camera), look_at_pose(eye, target), float(np.linalg.norm(eye - target)))


def seen(view, point):
    """Place of a point in the picture, in parts of its height from the middle: right and up."""
    x, y, z, _ = np.linalg.inv(view.pose) @ np.append(point, 1.0)
    half = view.camera.ymag or -z * math.tan(view.camera.yfov / 2)
    return np.array([x, y]) / half / 2.0


def test_a_quarter_turn_to_the_right_looks_from_the_left():
    turned = orbit().orbited(math.pi / 2, 0.0)
    np.testing.assert_allclose(turned.eye, [-5, 0, 0], atol=1e-12)
    np.testing.assert_allclose(turned.back, [-1, 0, 0], atol=1e-12)


def test_an_eighth_down_looks_from_above():
    turned = orbit().orbited(0.0, math.pi / 4)
    np.testing.assert_allclose(turned.eye, [0, 5 / math.sqrt(2), 5 / math.sqrt(2)], atol=1e-12)


@pytest.mark.parametrize("up", ["x", "y", "z"])
def test_orbiting_keeps_the_point_and_its_distance_and_the_horizon(up):
    view = orbit((1.0, 2.0, 3.0), (0.5, -1.0, 0.25)).upright(up)
    for right, down in np.random.default_rng(1).normal(size=(200, 2)):
        turned = view.orbited(right, down)
        np.testing.assert_allclose(turned.pivot, view.pivot, atol=1e-11)
        assert abs(turned.pose["xyz".index(up), 0]) < 1e-12  # the picture's right is level
        view = turned
    np.testing.assert_allclose(view.pose[:3, :3] @ view.pose[:3, :3].T, np.eye(3), atol=1e-12)


def test_turning_there_and_back_is_no_turn():
    view = orbit((1.0, 2.0, 3.0))
    back = view.orbited(0.3, 0.2).orbited(-0.3, -0.2)
    np.testing.assert_allclose(back.pose, view.pose, atol=1e-12)


@pytest.mark.parametrize("down", [10.0, -10.0])
def test_no_turn_goes_over_the_pole(down):
    view = orbit()
    for _ in range(20):
        view = view.orbited(0.1, down)
    assert math.degrees(math.acos(abs(view.back[1]))) == pytest.approx(1.0, abs=1e-6)
    assert view.pose[1, 1] > 0.0  # the top of the picture is up


def test_looking_turns_the_view_and_leaves_the_eye():
    view = orbit().looked(math.pi / 2, 0.0)
    np.testing.assert_allclose(view.eye, [0, 0, 5], atol=1e-12)
    np.testing.assert_allclose(-view.back, [1, 0, 0], atol=1e-12)
    assert orbit().looked(0.0, 0.5).back[1] == pytest.approx(math.sin(0.5))


@pytest.mark.parametrize("lens", [dict(yfov=0.7), dict(ymag=2.0)])
def test_panning_takes_what_is_at_the_pivot_along(lens):
    view = orbit((3.0, 1.0, 2.0), **lens)
    np.testing.assert_allclose(seen(view.panned(0.25, -0.1), ORIGIN), [0.25, -0.1], atol=1e-12)


def test_zooming_halves_the_distance_or_the_height():
    near = orbit((0.0, 3.0, 4.0)).zoomed(1.0)
    assert near.distance == 2.5
    np.testing.assert_allclose(near.pivot, ORIGIN, atol=1e-12)
    flat = orbit(ymag=2.0)
    assert flat.zoomed(2.0).camera.ymag == 0.5
    np.testing.assert_array_equal(flat.zoomed(2.0).pose, flat.pose)


def test_flying_takes_the_pivot_along():
    view = orbit().flown(1.0, 2.0, 3.0)
    np.testing.assert_allclose(view.eye, [1, 2, 2], atol=1e-12)
    np.testing.assert_allclose(view.pivot, [1, 2, -3], atol=1e-12)


@pytest.mark.parametrize("lens", [dict(yfov=0.7), dict(ymag=2.0)])
def test_focus_brings_a_point_to_the_middle(lens):
    point = np.array([0.4, -0.3, 1.0])
    view = orbit((3.0, 1.0, 2.0), **lens).focused(point)
    np.testing.assert_allclose(seen(view, point), 0.0, atol=1e-12)
    np.testing.assert_allclose(view.pivot, point, atol=1e-12)


@pytest.mark.parametrize("lens", [dict(yfov=0.7), dict(ymag=2.0)])
@pytest.mark.parametrize("aspect", [0.5, 1.0, 1.9])
def test_framing_shows_all_of_a_box_and_not_much_more(lens, aspect):
    bounds = np.array([[-1.0, 2.0, 3.0], [4.0, 2.5, 5.0]])
    view = orbit((9.0, -4.0, 2.0), **lens).orbited(0.7, 0.2).framed(bounds, aspect)
    corners = np.array(
        [[bounds[i, 0], bounds[j, 1], bounds[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)]
    )
    places = np.abs([seen(view, corner) for corner in corners]) / [0.5 * aspect, 0.5]
    assert places.max() < 1.0
    assert places.max() > 0.4


def test_a_first_orbit_is_the_camera_as_it_was():
    bounds = np.array([[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]])
    pose = look_at_pose(np.array([0.0, 0.0, 6.0]), np.array([0.0, 1.0, 0.0]))
    pose[:3, :3] = pose[:3, :3] @ np.array(
        [[0.8, -0.6, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]]
    )  # it may be rolled
    view = orbit_of(replace(Camera(), pose=pose), bounds)
    np.testing.assert_array_equal(view.placed.pose, pose)
    assert view.distance == pytest.approx(6.0 * pose[2, 2])
    inside = orbit_of(Camera.look_at((0, 0, -0.9), (0, 0, -5)), bounds)  # the middle lies behind
    assert inside.distance == pytest.approx(0.3 * math.sqrt(12.0))
