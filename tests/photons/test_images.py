"""Light that is even up to a wall stays even there, though kernels end at it."""

import numpy as np
import pytest
from transport import Tracer, lit

from ispm.library.common import lambert
from ispm.library.shapes import polygons
from ispm.optics.records import CAUSTIC, PHOTON, RECEIVER
from ispm.photons.images import with_images
from ispm.photons.walls import end_at_walls
from ispm.renderer.caustics import Caustics
from ispm.scene.scene import Scene

RADIUS, STEP = 0.1, 0.01  # m: of kernels, and between their photons


def quad(*corners):
    return polygons([np.array(corners, float)])


def even_light(lean):
    """Kernels on a floor x < 0 before a wall that leans by `lean` m in 1, of one photon a square of STEP."""
    scene = Scene()
    for corners in (
        ((-2, 0, -2), (-2, 0, 2), (2, 0, 2), (2, 0, -2)),
        ((0, 0, -2), (0, 0, 2), (lean, 1, 2), (lean, 1, -2)),
    ):
        scene.add(quad(*corners), material=lambert((1.0,) * 3))
    tracer = Tracer(lit(scene, (-1, 2, 0)))
    along, across = np.arange(-40, 0) * STEP + STEP / 2, np.arange(-30, 30) * STEP + STEP / 2
    kernels = np.zeros((40, 60), CAUSTIC)
    kernels["position"][..., 0], kernels["position"][..., 2] = along[:, None], across
    kernels = kernels.ravel()
    kernels["u"], kernels["v"], kernels["wi"] = (0, 0, RADIUS), (RADIUS, 0, 0), (0, 1, 0)
    kernels["height"], kernels["flux"] = RADIUS / 4, STEP**2
    end_at_walls(kernels, tracer.world, tracer.surfaces)
    return kernels


def light_at(kernels, distances):
    photons = np.zeros(len(kernels), PHOTON)
    for name in ("position", "flux", "wi"):
        photons[name] = kernels[name]
    photons["normal"] = 0, 1, 0
    points = np.zeros(len(distances), RECEIVER)
    points["position"][:, 0] = -np.asarray(distances)
    points["n"] = points["ng"] = points["wo"] = 0, 1, 0
    points["valid"] = 1
    return Caustics(photons, kernels, len(kernels)).wide_grid().estimate(points, 1)[:, 0]


@pytest.mark.parametrize("lean", [0.0, 0.7])
def test_even_light_stays_even_up_to_the_wall(lean):
    """Kernels that are scaled instead leave .69 at the wall, whatever it leans."""
    light = light_at(even_light(lean), [0.001, 0.01, 0.03, 0.06, 0.1, 0.15])
    assert light == pytest.approx(1.0, abs=3e-3)


def test_images_bring_what_planes_cut_off():
    kernels = even_light(0.0)
    both, rows = with_images(kernels)
    assert 0 < len(rows) < len(kernels) and (both["reach"][len(kernels) :] <= 0.0).all()
    assert (both["flux"] == np.float32(STEP**2)).mean() > 0.5
    assert both["flux"] == pytest.approx(STEP**2, rel=1e-5)
    normals = np.cross(both["u"], both["v"])
    assert (normals[:, 1] > 0).all()


def test_kernels_that_no_plane_cuts_have_none():
    kernels = even_light(0.0)
    kernels["front"] = 0
    both, rows = with_images(kernels)
    assert not len(rows) and (both == kernels).all()
