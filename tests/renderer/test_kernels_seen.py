"""Which kernels of caustics are drawn sharp as an eye comes closer, and which are summed coarsely."""

import numpy as np

from ispm import Camera, Settings
from ispm.optics.records import CAUSTIC, PHOTON
from ispm.renderer.caustics import Caustics
from ispm.stages.camera import CameraView

SIZE, YFOV = (160, 90), 0.8


def seen_from(caustics, distance):
    camera = Camera.look_at((0.0, distance, 1e-3), (0.0, 0.0, 0.0), yfov=YFOV)
    return caustics.seen_in(CameraView(SIZE, camera.pose, camera.yfov), Settings(size=SIZE, subsampling=4))


def test_kernels_that_come_close_are_summed_at_low_resolution():
    """Drawn sharp, each covers much of the picture, and frames of a live view stall."""
    photons, kernels = np.zeros(64, PHOTON), np.zeros(64, CAUSTIC)
    radii = np.geomspace(1e-3, 1.0, 64).astype(np.float32)
    kernels["u"][:, 0], kernels["v"][:, 2] = radii, radii
    kernels["flux"] = photons["flux"] = radii[:, None]
    caustics = Caustics(photons, kernels, 0)
    for distance in (8.0, 2.0, 0.5):
        view = seen_from(caustics, distance)
        pixel = 2.0 * np.tan(YFOV / 2.0) * distance / SIZE[1]
        # Three pixels of the low resolution to a side.
        assert view.wide == np.count_nonzero(radii > 3.0 * 4 * pixel)
        assert view.kernels["u"][: view.wide, 0].min(initial=np.inf) > view.kernels["u"][view.wide :, 0].max()
        assert np.array_equal(view.kernels["flux"], view.photons["flux"])
        assert np.array_equal(np.sort(view.kernels["u"][:, 0]), radii)
    again = seen_from(seen_from(caustics, 0.5), 8.0)
    assert again.wide == seen_from(caustics, 8.0).wide
