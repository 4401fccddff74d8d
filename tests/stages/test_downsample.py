"""Receivers: one real pixel of each block."""

import numpy as np
import pytest
from exact import mixed_scene, view_of

from ispm.scene.packed import pack
from ispm.stages.downsample import Downsample
from ispm.stages.gbuffer import GBufferStage
from ispm.stages.upload import Upload

SIZE = (61, 43)


def receivers_and_depth(gpu, block, **options):
    """Receivers (h, w) and the reversed depth (H, W) that they were chosen from."""
    view = view_of(SIZE, **options)
    upload, gbuffer, downsample = Upload(gpu), GBufferStage(gpu), Downsample(gpu, block)
    with gpu.frame() as frame:
        scene = upload(pack(mixed_scene()))
        drawn = gbuffer(frame, scene, view)
        downsample(frame, scene, drawn, view)
    width, height = downsample.size(view)
    depth = gpu.read_many([(drawn.depth, np.float32)])[0]
    return downsample.read(gpu, view).reshape(height, width), depth, view


@pytest.mark.parametrize("block", [1, 2, 4, 7, 16])
@pytest.mark.parametrize("options", [{}, {"ymag": 2.5, "near": -3.0, "far": 12.0}])
def test_each_receiver_is_the_pixel_of_median_depth(gpu, block, options):
    """Projected back, it lies in its block, at a pixel's centre and depth; half of what is seen is nearer."""
    receivers, depth, view = receivers_and_depth(gpu, block, **options)
    assert receivers.shape == (-(-SIZE[1] // block), -(-SIZE[0] // block))
    for (row, column), r in np.ndenumerate(receivers):
        part = depth[row * block : (row + 1) * block, column * block : (column + 1) * block]
        if not r["valid"]:
            # blocks above 4 x 4 are looked at in 16 places
            assert not part.any() or block > 4
            continue
        clip = view.clip_from_world @ np.append(r["position"].astype(float), 1.0)
        ndc = clip[:3] / clip[3]
        x, y = (ndc[0] * 0.5 + 0.5) * SIZE[0], (0.5 - ndc[1] * 0.5) * SIZE[1]
        assert (x - 0.5) % 1.0 == pytest.approx(0.0, abs=2e-3) or (x - 0.5) % 1.0 > 0.998
        assert column * block <= x < (column + 1) * block and row * block <= y < (row + 1) * block
        seen = np.sort(part[part > 0.0])
        if block <= 4:
            assert ndc[2] == pytest.approx(seen[::-1][len(seen) // 2], rel=1e-4)


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
