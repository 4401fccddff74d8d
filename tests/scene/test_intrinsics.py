"""Cameras: their checks, and the projection of intrinsics."""

import math

import numpy as np
import pytest

from ispm.errors import SettingsError
from ispm.scene.camera import Camera
from ispm.stages.camera import CameraView

K = np.array([[810.0, 0.0, 301.5], [0.0, 745.0, 262.25], [0.0, 0.0, 1.0]])
SIZE = (640, 480)


def random_pose(random):
    """A camera-to-world matrix: a rotation by QR, made right-handed, and a place within 20 m."""
    turn, _ = np.linalg.qr(random.normal(size=(3, 3)))
    pose = np.eye(4)
    pose[:3, :3] = turn * np.linalg.det(turn)
    pose[:3, 3] = random.uniform(-20.0, 20.0, 3)
    return pose


def project(camera, size, points):
    """Where world points lie in a picture, (n, 2) pixels from its top left corner."""
    view = CameraView(size, camera.pose, camera.yfov, aspect=camera.aspect, principal=camera.principal)
    clip = np.column_stack([points, np.ones(len(points))]) @ view.clip_from_world.T
    return (clip[:, :2] / clip[:, 3:] * (0.5, -0.5) + 0.5) * size


@pytest.mark.parametrize("seed", range(5))
def test_intrinsics_project_as_k_does(seed):
    random = np.random.default_rng(seed)
    pose = random_pose(random)
    local = np.column_stack([random.uniform(-3.0, 3.0, (400, 2)), random.uniform(0.5, 30.0, 400)])
    world = local @ pose[:3, :3].T + pose[:3, 3]
    expected = local @ K.T
    expected = expected[:, :2] / expected[:, 2:]
    camera = Camera.from_intrinsics(K, SIZE, pose)
    assert np.abs(project(camera, SIZE, world) - expected).max() < 1e-4
    scaled = project(camera, (1280, 480), world)  # another size shows the same view
    assert np.abs(scaled - expected * (2.0, 1.0)).max() < 1e-4


def test_intrinsics_in_opengl_axes_are_the_same_camera():
    random = np.random.default_rng(9)
    pose = random_pose(random)
    turned = pose @ np.diag([1.0, -1.0, -1.0, 1.0])
    assert np.allclose(
        Camera.from_intrinsics(K, SIZE, pose).pose, Camera.from_intrinsics(K, SIZE, turned, "opengl").pose
    )


def test_intrinsics_of_a_plain_camera_are_plain():
    focal = 240.0 / math.tan(0.4)
    plain = [[focal, 0.0, 320.0], [0.0, focal, 240.0], [0.0, 0.0, 1.0]]
    camera = Camera.from_intrinsics(plain, SIZE, np.eye(4))
    assert camera.yfov == pytest.approx(0.8)
    assert camera.aspect == pytest.approx(640 / 480)
    assert camera.principal == pytest.approx((0.0, 0.0))


def test_rays_follow_the_intrinsics():
    camera = Camera.from_intrinsics(K, SIZE, np.eye(4))
    view = CameraView(SIZE, camera.pose, camera.yfov, aspect=camera.aspect, principal=camera.principal)
    _, directions = view.rays()
    x, y = 17, 400
    expected = np.array([(x + 0.5 - 301.5) / 810.0, (y + 0.5 - 262.25) / 745.0, 1.0])
    np.testing.assert_allclose(directions[y, x], expected / np.linalg.norm(expected), atol=1e-12)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (dict(K=np.eye(4)), "K must have shape .3, 3."),
        (dict(K=np.diag([-1.0, 1.0, 1.0])), "focal lengths above 0"),
        (dict(K=[[810.0, 3.0, 301.5], *K[1:]]), "skew"),
        (dict(size=(0, 4)), "size, width and height"),
        (dict(pose=np.eye(3)), "the pose must have shape"),
        (dict(pose=2.0 * np.eye(4)), "a rotation and a translation"),
        (dict(pose=np.diag([1.0, 1.0, -1.0, 1.0])), "a rotation and a translation"),
        (dict(convention="opncv"), "'opncv' is not one of opencv, opengl"),
    ],
)
def test_intrinsics_that_make_no_sense_are_refused(change, says):
    with pytest.raises(SettingsError, match=says):
        Camera.from_intrinsics(**{**dict(K=K, size=SIZE, pose=np.eye(4)), **change})


@pytest.mark.parametrize(
    "numbers", [dict(yfov=0.0), dict(ymag=-1.0), dict(aspect=0.0), dict(principal=(math.nan, 0.0))]
)
def test_a_camera_that_shows_nothing_is_refused(numbers):
    with pytest.raises(SettingsError, match="camera: "):
        Camera(**numbers)


@pytest.mark.parametrize("convention", ["opencv", "opengl"])
@pytest.mark.parametrize("seed", range(3))
def test_intrinsics_and_pose_come_back(seed, convention):
    random = np.random.default_rng(seed)
    pose, size = random_pose(random), tuple(random.integers(50, 4000, 2))
    k = np.diag([*random.uniform(0.3, 3.0, 2) * size[0], 1.0])
    k[:2, 2] = random.uniform(-0.5, 1.5, 2) * size
    camera = Camera.from_intrinsics(k, size, pose, convention)
    np.testing.assert_allclose(camera.intrinsics(size), k, rtol=1e-12, atol=1e-9)
    np.testing.assert_allclose(camera.extrinsics(convention), pose, atol=1e-12)
    twice = (2 * size[0], size[1])  # of another size: the same view
    np.testing.assert_allclose(camera.intrinsics(twice), np.diag([2.0, 1.0, 1.0]) @ k, rtol=1e-12, atol=1e-9)


def test_a_plain_camera_has_square_pixels_and_its_middle_in_the_middle():
    k = Camera(yfov=0.8).intrinsics(SIZE)
    focal = 240.0 / math.tan(0.4)
    np.testing.assert_allclose(k, [[focal, 0, 320], [0, focal, 240], [0, 0, 1]])


@pytest.mark.parametrize("camera", [Camera(yfov=0.7), Camera(yfov=0.7, aspect=1.9, principal=(0.3, -0.2))])
def test_k_and_pose_project_as_the_renderer_does(camera):
    random = np.random.default_rng(3)
    camera.pose = random_pose(random)
    local = np.column_stack([random.uniform(-3.0, 3.0, (50, 2)), random.uniform(-30.0, -0.5, 50)])
    world = local @ camera.pose[:3, :3].T + camera.pose[:3, 3]
    x, y, z = (
        camera.intrinsics(SIZE)
        @ (np.linalg.inv(camera.extrinsics()) @ np.column_stack([world, np.ones(50)]).T)[:3]
    )
    np.testing.assert_allclose(project(camera, SIZE, world), np.column_stack([x / z, y / z]), atol=1e-3)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: Camera(ymag=1.0).intrinsics(SIZE), "an orthographic camera has no K"),
        (lambda: Camera().intrinsics((640,)), "size, width and height"),
        (lambda: Camera().extrinsics(), "it has no pose of its own; take renderer.camera"),
        (lambda: Camera(pose=np.eye(4)).extrinsics("opencl"), "'opencl' is not one of opencv, opengl"),
    ],
)
def test_cameras_without_them_say_so(make, says):
    with pytest.raises(SettingsError, match=says):
        make()
