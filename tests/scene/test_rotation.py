"""Rotations beside SciPy's, and nodes that are turned to look at places."""

import itertools
import math
import warnings

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import ispm
from ispm.errors import SceneError, SceneWarning, SettingsError
from ispm.scene.rotation import rotation_matrix

ORDERS = ["".join(order) for order in itertools.permutations("xyz")]


def turn_of(quaternion):
    return rotation_matrix(np.array(quaternion))


@pytest.mark.parametrize("order", [*ORDERS, *(order.upper() for order in ORDERS)])
def test_euler_is_scipys(order):
    angles = dict(x=0.3, y=-1.1, z=2.4)
    theirs = Rotation.from_euler(order, [angles[axis] for axis in order.lower()])
    np.testing.assert_allclose(turn_of(ispm.euler(**angles, order=order)), theirs.as_matrix(), atol=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_axis_angle_is_scipys(seed):
    random = np.random.default_rng(seed)
    axis, angle = random.normal(size=3), random.uniform(-10.0, 10.0)
    theirs = Rotation.from_rotvec(angle * axis / np.linalg.norm(axis))
    np.testing.assert_allclose(turn_of(ispm.axis_angle(axis, angle)), theirs.as_matrix(), atol=1e-12)


@pytest.mark.parametrize("order", ["xyz", "ZXY"])
def test_degrees_are_scipys(order):
    angles = dict(x=30, y=-110.5, z=720)
    theirs = Rotation.from_euler(order, [angles[axis] for axis in order.lower()], degrees=True)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ours = ispm.euler(**angles, order=order, degrees=True)
        assert ispm.axis_angle((0, 1, 0), 90, degrees=True) == ispm.axis_angle((0, 1, 0), math.pi / 2)
    np.testing.assert_allclose(turn_of(ours), theirs.as_matrix(), atol=1e-12)


def test_radians_that_look_like_degrees_are_told():
    said = r"x is 90 radians, more than two turns; for degrees say degrees=True"
    with pytest.warns(SceneWarning, match=said) as caught:
        ispm.euler(x=90)
    assert len(caught) == 1 and caught[0].filename == __file__
    with pytest.warns(SceneWarning, match="axis_angle: angle is -45 radians"):
        ispm.axis_angle((0, 1, 0), -45.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ispm.euler(12, 0.5, -3)
        for frame in range(1000):  # what spins is no slip
            ispm.axis_angle((0, 1, 0), 0.1 * frame * math.pi / 3)


def test_a_quarter_turn_about_y_takes_z_to_x():
    for quaternion in (ispm.euler(y=math.pi / 2), ispm.axis_angle((0, 2, 0), math.pi / 2)):
        np.testing.assert_allclose(turn_of(quaternion) @ (0, 0, 1), (1, 0, 0), atol=1e-15)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: ispm.euler(x="1"), "euler: x, in radians, must be a number"),
        (lambda: ispm.euler(y=math.inf), "euler: y, in radians,"),
        (lambda: ispm.euler(order="xyx"), "order must be x, y and z in some order"),
        (lambda: ispm.euler(order="xYz"), "order must be x, y and z in some order"),
        (lambda: ispm.axis_angle((0, 0, 0), 1.0), "axis must not be 0, 0, 0"),
        (lambda: ispm.axis_angle((0, 1), 1.0), "axis must be 3 numbers"),
        (lambda: ispm.axis_angle((0, 1, 0), None), "angle, in radians,"),
    ],
)
def test_what_is_no_rotation_is_refused(make, says):
    with pytest.raises(SceneError, match=says):
        make()


def random_node(random):
    return ispm.Node("n", random.uniform(-3, 3, 3), random.normal(size=4), random.uniform(0.5, 2.0, 3))


@pytest.mark.parametrize("seed", range(8))
def test_a_node_looks_along_its_minus_z(seed):
    random = np.random.default_rng(seed)
    node, target, up = random_node(random), random.uniform(-3, 3, 3), random.normal(size=3)
    if seed % 2:  # as a matrix, which keeps its place and its scale
        node.matrix = node.local_matrix()
    place, scale = node.local_matrix()[:3, 3], node.scale
    assert node.look_at(target, up) is node
    matrix = node.local_matrix()
    np.testing.assert_allclose(matrix[:3, 3], place)
    np.testing.assert_allclose(np.linalg.norm(matrix[:3, :3], axis=0), scale)
    right, above, back = (matrix[:3, k] / scale[k] for k in range(3))
    ahead = target - place
    np.testing.assert_allclose(-back, ahead / np.linalg.norm(ahead), atol=1e-9)
    np.testing.assert_allclose(np.cross(right, above), back, atol=1e-9)
    assert right @ up == pytest.approx(0.0, abs=1e-9) and above @ up > 0.0


def test_a_node_below_another_looks_within_its_space():
    scene = ispm.Scene()
    arm = scene.add(ispm.shapes.box(), rotation=ispm.euler(z=0.7), translation=(1, 2, 3), scale=(2, 2, 2))
    lamp = scene.add(ispm.SpotLight(), name="lamp", translation=(0, 1, 0), parent=arm).look_at((0.5, 0, 0.25))
    world = scene.world_matrix(lamp)
    target = (scene.world_matrix(arm) @ (0.5, 0, 0.25, 1))[:3]
    ahead = target - world[:3, 3]
    np.testing.assert_allclose(-world[:3, 2] / 2.0, ahead / np.linalg.norm(ahead), atol=1e-12)


def test_cameras_by_look_at_and_nodes_by_look_at_are_the_same():
    scene = ispm.Scene()
    node = scene.add(ispm.Camera(), translation=(1, 2, 3)).look_at((0, 0.5, 0), up=(0, 0, 1))
    pose = ispm.Camera.look_at((1, 2, 3), (0, 0.5, 0), up=(0, 0, 1)).pose
    np.testing.assert_allclose(scene.world_matrix(node), pose, atol=1e-12)


@pytest.mark.parametrize(
    ("up", "above"),
    [((0, 1, 0), (0, 0, -1)), ((0, -1, 0), (0, 0, -1)), ((0, 0, 1), (0, 0, 1)), ((1, 0, 0), (1, 0, 0))],
)
def test_a_camera_that_looks_down_has_a_top(up, above):
    pose = ispm.Camera.look_at((0, 5, 0), (0, 0, 0), up=up).pose
    np.testing.assert_allclose(pose[:3, 1], above, atol=1e-12)
    assert np.linalg.det(pose) == pytest.approx(1.0)


def test_maps_have_north_up():
    pose = ispm.Camera.look_at((0, 0, 9), (0, 0, 0), up=(0, 0, 1)).pose  # +Z is up, seen from above
    np.testing.assert_allclose(pose[:3, 1], (0, 1, 0), atol=1e-12)


def test_what_cannot_be_looked_at_is_refused():
    node = ispm.Node("lamp", (1.0, 0.0, 0.0))
    for target, up, says in (
        ((1, 0, 0), (0, 1, 0), "the place and the point looked at are the same"),
        ((0, 0, 0), (0, 0, 0), "up is 0, 0, 0"),
        ((0, 0), (0, 1, 0), "node 'lamp': target must be 3 numbers"),
        ((0, 0, 0), "y", "node 'lamp': up must be 3 numbers"),
    ):
        with pytest.raises(SceneError, match=says):
            node.look_at(target, up)
    assert node.rotation == (0.0, 0.0, 0.0, 1.0)
    with pytest.raises(SettingsError, match="are the same"):
        ispm.Camera.look_at((1, 2, 3), (1, 2, 3))
    posed = ispm.Node("eye", camera=ispm.Camera.look_at((0, 0, 1), (0, 0, 0)))
    with pytest.raises(SceneError, match="node 'eye': its camera has a pose"):
        posed.look_at((0, 0, 0))
