"""camera.wgsl against CameraView, and CameraView against geometry."""

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from ispm.gpu import Gpu
from ispm.scene.camera import look_at_pose
from ispm.stages.camera import CameraView

SHADER = str(Path(__file__).with_name("camera.wgsl"))
POSE = look_at_pose(np.array([1.0, 2.0, 3.0]), np.array([-0.5, 0.3, -4.0]))
VIEWS = {
    "perspective": CameraView((320, 180), POSE, 0.9, near=1e-3),
    "jittered": CameraView((64, 99), POSE, 1.2, near=0.1, jitter=(0.4, -0.3)),
    "orthographic": CameraView((320, 180), POSE, ymag=2.0, near=0.5, far=40.0),
    "off-axis": CameraView((320, 180), POSE, 0.9, near=1e-3, aspect=1.5, principal=(0.3, -0.2)),
    "off-axis orthographic": CameraView(
        (320, 180), POSE, ymag=2.0, near=0.5, far=40.0, aspect=2.5, principal=(-0.4, 0.1)
    ),
}


def points_before(view: CameraView, count: int = 500) -> tuple[np.ndarray, np.ndarray]:
    """Random points and their distances along the view axis, 1 to 30 m."""
    rng = np.random.default_rng(5)
    distance = rng.uniform(1.0, 30.0, count)
    side = rng.uniform(-1.0, 1.0, (count, 2)) * distance[:, None] * 0.3
    local = np.column_stack([side, -distance, np.ones(count)])
    return (local @ view.pose.T)[:, :3], distance


@pytest.mark.parametrize("view", VIEWS.values(), ids=VIEWS)
def test_camera_shader_agrees_with_geometry(gpu: Gpu, view: CameraView) -> None:
    points, distance = points_before(view)
    given = np.ones((len(points), 4), np.float32)
    given[:, :3] = points
    source = gpu.buffer("points").write(given)
    result = gpu.buffer("result").sized(4 * given.nbytes)
    with gpu.frame() as frame:
        gpu.compute(SHADER)(frame, over=len(points), camera=view.uniform(), points=source, result=result)
    rows = gpu.read_buffer(result, np.float32, 16 * len(points)).reshape(-1, 4, 4)
    # float32: about 2^-24 of the values that matrices of this size add up, and their inverse's
    origins, directions = rows[:, 0, :3].astype(float), rows[:, 3, :3].astype(float)
    along = distance if view.ymag is None else distance - view.near
    assert np.abs(origins + along[:, None] * directions - points).max() < 1e-4
    assert rows[:, 0, 3] == pytest.approx(distance, rel=1e-5)
    assert rows[:, 2, 2] == pytest.approx(rows[:, 2, 3], rel=1e-5)
    wo = view.eye - points if view.ymag is None else np.broadcast_to(-view.forward, points.shape)
    wo = wo / np.linalg.norm(wo, axis=1, keepdims=True)
    assert np.abs(rows[:, 1, :3] - wo).max() < 1e-6
    height = 2.0 * math.tan(view.yfov / 2.0) * distance if view.ymag is None else 2.0 * view.ymag
    stretch = 1.0 if view.aspect is None else view.aspect * view.size[1] / view.size[0]
    side = height / view.size[1] * math.sqrt(stretch) * np.ones(len(points))
    assert rows[:, 1, 3] == pytest.approx(side, rel=1e-5)


@pytest.mark.parametrize("view", VIEWS.values(), ids=VIEWS)
def test_rays_pass_the_pixels_samples(view: CameraView) -> None:
    """A point along a pixel's ray projects onto the pixel's centre plus the jitter, without jitter."""
    plain = dataclasses.replace(view, jitter=(0.0, 0.0))
    origins, directions = view.rays()
    points = origins + 7.0 * directions
    clip = np.concatenate([points, np.ones((*points.shape[:2], 1))], -1) @ plain.clip_from_world.T
    ndc = clip[..., :2] / clip[..., 3:]
    pixel = (ndc * (0.5, -0.5) + 0.5) * view.size
    y, x = np.mgrid[: view.size[1], : view.size[0]]
    assert np.abs(pixel - np.stack([x, y], -1) - 0.5 - view.jitter).max() < 1e-9


@pytest.mark.parametrize("view", VIEWS.values(), ids=VIEWS)
def test_sees_keeps_every_box_with_a_point_in_the_picture(view: CameraView) -> None:
    rng = np.random.default_rng(6)
    low = rng.uniform(-12.0, 12.0, (400, 3))
    boxes = np.stack([low, low + rng.uniform(0.0, 6.0, (400, 3))], axis=1)
    inside = boxes[:, :1] + rng.uniform(0.0, 1.0, (400, 200, 3)) * (boxes[:, 1:] - boxes[:, :1])
    clip = np.concatenate([inside, np.ones((400, 200, 1))], -1) @ view.clip_from_world.T
    shown = ((np.abs(clip[..., :2]) <= clip[..., 3:]).all(-1) & (clip[..., 3] > 0.0)).any(axis=1)
    seen = view.sees(boxes)
    assert not (shown & ~seen).any()
    assert 0.0 < seen.mean() < 0.8 and shown.sum() > 20
