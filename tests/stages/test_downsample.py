"""Receivers: one real pixel of each block."""

import numpy as np
import pytest
from exact import mixed_scene, quad, view_of

from ispm.scene.camera import look_at_pose
from ispm.scene.packed import pack
from ispm.scene.scene import Scene
from ispm.stages.camera import CameraView
from ispm.stages.downsample import Downsample
from ispm.stages.gbuffer import GBufferStage
from ispm.stages.upload import Upload

SIZE = (61, 43)


def receivers_of(gpu, scene, block, view):
    """Receivers (h, w) and the reversed depth (H, W) that they were chosen from."""
    upload, gbuffer, downsample = Upload(gpu), GBufferStage(gpu), Downsample(gpu, block)
    with gpu.frame() as frame:
        packed = upload(pack(scene))
        drawn = gbuffer(frame, packed, view)
        downsample(frame, packed, drawn, view)
    width, height = downsample.size(view)
    depth = gpu.read_many([(drawn.depth, np.float32)])[0]
    return downsample.read(gpu, view).reshape(height, width), depth


def receivers_and_depth(gpu, block, **options):
    """Those of the mixed scene, and the view."""
    view = view_of(SIZE, **options)
    return *receivers_of(gpu, mixed_scene(), block, view), view


@pytest.mark.parametrize("block", [1, 2, 4, 7, 16])
@pytest.mark.parametrize("options", [{}, {"ymag": 2.5, "near": -3.0, "far": 12.0}])
def test_each_receiver_is_a_pixel_in_the_plane_of_that_of_median_depth(gpu, block, options):
    """Projected back, it lies in its block, at a pixel's centre and depth. Where all of a block lies in its
    plane it is one in the middle."""
    receivers, depth, view = receivers_and_depth(gpu, block, **options)
    assert receivers.shape == (-(-SIZE[1] // block), -(-SIZE[0] // block))
    planes, beside = 0, []
    for (row, column), r in np.ndenumerate(receivers):
        part = depth[row * block : (row + 1) * block, column * block : (column + 1) * block]
        if not r["valid"]:
            # blocks above 4 x 4 are looked at in 16 places
            assert not part.any() or block > 4
            continue
        clip = view.clip_from_world @ np.append(r["position"].astype(float), 1.0)
        ndc = clip[:3] / clip[3]
        x, y = (ndc[0] * 0.5 + 0.5) * SIZE[0], (0.5 - ndc[1] * 0.5) * SIZE[1]
        beside.append(max(abs(x % 1.0 - 0.5), abs(y % 1.0 - 0.5)))
        assert column * block <= x < (column + 1) * block and row * block <= y < (row + 1) * block
        assert ndc[2] == pytest.approx(depth[int(y), int(x)], rel=1e-4)
        if block > 4 or part.shape != (block, block) or not part.all():
            continue
        # a plane's depth is linear on the screen: its second differences vanish
        bends = [np.abs(np.diff(part, 2, axis=k)).max(initial=0.0) for k in (0, 1)]
        twist = np.abs(np.diff(np.diff(part, axis=0), axis=1)).max(initial=0.0)
        if max(*bends, twist) < 1e-6 * part.max():
            place = np.array([x, y]) - block * np.array([column, row])
            assert np.abs(place - block / 2).max() < 0.6
            planes += 1
    assert planes > 20 or block > 4
    # where its ray misses the triangle, for a grid of 1/16 pixel at the coarsest, it lies beside the centre
    assert max(beside) < 0.0625 and np.median(beside) < 2e-3 and (np.array(beside) > 2e-3).mean() < 0.05


@pytest.mark.parametrize("block", [2, 4, 7])
def test_passes_visit_every_pixel_of_a_block(gpu, block):
    """Any K^2 passes in a row but the first, each at the same place in all blocks of a floor."""
    scene, places = Scene(), []
    scene.add(quad(4.0))
    pose = look_at_pose(np.array([0.0, 3.0, 0.0]), np.zeros(3))
    for index in range(3, 3 + block * block):
        view = CameraView((28, 28), pose, ymag=2.0, near=0.1, far=10.0, pass_index=index)
        points = receivers_of(gpu, scene, block, view)[0]["position"]
        pixels = points[..., [0, 2]] * 7.0 + 13.5  # 28 pixels to 4 m, centres at .5
        inside = pixels - block * np.stack(np.meshgrid(*[np.arange(28 // block)] * 2), axis=-1)
        assert inside == pytest.approx(np.broadcast_to(inside[0, 0], inside.shape), abs=1e-3)
        places.append(tuple(np.rint(inside[0, 0]).astype(int)))
    assert sorted(places) == [(x, y) for x in range(block) for y in range(block)]


def test_where_a_pass_sees_nothing_the_median_serves(gpu):
    """No block loses its receiver, whichever of its pixels see the sky or lie outside the picture."""
    first, depth, _ = receivers_and_depth(gpu, 4)
    assert (depth == 0.0).any()
    for index in range(1, 17):
        later, *_ = receivers_and_depth(gpu, 4, pass_index=index)
        np.testing.assert_array_equal(later["valid"] > 0, first["valid"] > 0)


@pytest.mark.parametrize("block", [1, 4])
def test_receivers_say_where_the_eye_is_and_how_wide_they_are(gpu, block):
    receivers, _, view = receivers_and_depth(gpu, block)
    some = receivers[receivers["valid"] == 1]
    wo = view.eye - some["position"]
    wo /= np.linalg.norm(wo, axis=1, keepdims=True)
    assert some["wo"] == pytest.approx(wo, abs=1e-5)
    along = (some["position"] - view.eye) @ view.forward
    assert some["footprint"] == pytest.approx(along * view.footprint * block, rel=1e-4)
    facing = np.maximum((wo * some["ng"]).sum(axis=1), 0.02)
    assert some["slant"] == pytest.approx(1 / facing, rel=1e-3)
    assert (facing > 0.0).all() and np.linalg.norm(some["n"], axis=1) == pytest.approx(1.0, abs=1e-4)
