"""Rays through pixels that show triangles."""

import math

import numpy as np
import pytest
from transport import Tracer

from ispm import Mesh, Scene
from ispm.paths.pixel_rays import rays_to_seen
from ispm.stages.camera import CameraView
from ispm.stages.specular import SEEN

SIZE = 9, 5


@pytest.mark.parametrize("view", [{"yfov": math.radians(40.0)}, {"ymag": 1.5}])
def test_rays_are_those_of_the_view(view):
    """And meet its plane: float64, so to float32's last digit."""
    wall = [(-50.0, -50.0, 0.0), (50.0, -50.0, 0.0), (0.0, 50.0, 0.0)]
    scene = Scene()
    scene.add(Mesh(wall, [(0, 1, 2)]))
    pose = np.eye(4)
    pose[:3, 3] = (0.3, -0.2, 5.0)
    seen_by = CameraView(SIZE, pose, jitter=(0.2, -0.1), principal=(0.1, 0.3), **view)
    seen = np.zeros(SIZE[0] * SIZE[1], SEEN)
    seen["pixel"] = np.arange(len(seen))
    rays = rays_to_seen(seen, seen_by.screen(), Tracer(scene).surfaces, 1)
    origins, directions = (a.reshape(-1, 3) for a in seen_by.rays())
    np.testing.assert_allclose(rays.origins, origins, rtol=2e-7, atol=1e-7)
    np.testing.assert_allclose(rays.directions, directions, rtol=2e-7, atol=1e-7)
    np.testing.assert_allclose(rays.distances, -origins[:, 2] / directions[:, 2], rtol=2e-7)
