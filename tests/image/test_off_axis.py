"""A camera whose axis is not in the middle of the picture shows what a wider one shows there."""

import numpy as np
import pytest
from scipy.ndimage import maximum_filter, minimum_filter

from ispm.framing.camera import find_camera
from ispm.gpu import Gpu
from ispm.library.builtin import builtin
from ispm.renderer import Renderer
from ispm.scene.camera import Camera
from ispm.settings import Settings


def intrinsics(fx: float, fy: float, cx: float, cy: float) -> np.ndarray:
    return np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])


def test_a_part_of_a_picture_is_an_off_axis_picture(gpu: Gpu) -> None:
    scene = builtin("cornell-box")
    found = find_camera(scene, None)
    assert found is not None
    settings = Settings(size=(120, 90), bounces=0, antialias=False, exposure=0.0)
    whole = Camera.from_intrinsics(intrinsics(130.0, 110.0, 60.0, 45.0), (120, 90), found[1], "opengl")
    part = Camera.from_intrinsics(
        intrinsics(130.0, 110.0, 60.0 - 50.0, 45.0 - 8.0), (60, 70), found[1], "opengl"
    )
    with Renderer(scene, settings, camera=whole, gpu=gpu) as renderer:
        wide = renderer.render()
        renderer.settings, renderer.camera = settings.replace(size=(60, 70)), part
        cut = renderer.render()
    np.testing.assert_allclose(
        cut.camera["intrinsics"], intrinsics(130.0, 110.0, 60.0 - 50.0, 45.0 - 8.0), rtol=1e-12
    )
    window = slice(8, 78), slice(50, 110)
    assert np.isfinite(cut.depth).mean() > 0.5
    # The two views round their samples apart; on edges one may see another surface.
    near = np.isclose(cut.depth, wide.depth[window], rtol=1e-5)
    assert near.mean() > 0.99
    # Shadow maps are fitted to what each view sees: they may part on a shadow's edge, and there alone.
    light = wide.direct.max(axis=-1)
    edge = (maximum_filter(light, 3) > 1.2 * minimum_filter(light, 3) + 1e-3)[window]
    assert edge.mean() < 0.2
    same = near & ~edge
    assert cut.direct[same] == pytest.approx(wide.direct[window][same], rel=0.05, abs=1e-3)
