"""What is as narrow as a pixel: most of it has no receiver of its own."""

import numpy as np
import pytest
from transport import box_room, lit, render

from ispm.library.common import lambert
from ispm.library.shapes import box
from ispm.scene.camera import Camera
from ispm.scene.scene import Scene

WIDTH, APART = 0.005, 0.08  # m


@pytest.fixture(scope="module")
def fins() -> Scene:
    """Thin walls that turn their narrow sides to the eye, each a pixel or two wide."""
    scene = lit(box_room(), (-0.2, 0.3, -0.2))
    for k in range(5):
        x = APART * (k - 2)
        fin = box((x - WIDTH / 2, -0.45, -0.1), (x + WIDTH / 2, 0.45, 0.3))
        scene.add(fin, material=lambert((0.5,) * 3, "fin"))
    scene.add(Camera.look_at((0.3, 0.0, -0.45), (0.0, 0.0, 0.05)))
    return scene


def test_slivers_are_lit_smoothly_and_right(gpu, fins):
    """Four rays of a pixel's own spread by 0.2; the filter takes sixteen and more of its neighbours."""
    frame, _ = render(gpu, fins, size=(320, 180))
    fine, _ = render(gpu, fins, size=(320, 180), gather=64, photons=200_000, subsampling=1)
    narrow = (frame["normal"][..., 2] < -0.9) & (frame.depth < 0.6)
    light, truth = (each.indirect.mean(axis=-1) for each in (frame, fine))
    assert narrow.sum() > 1000
    assert light[narrow].mean() == pytest.approx(truth[narrow].mean(), rel=0.03)
    pairs = narrow[1:] & narrow[:-1]
    step = (light[1:] - light[:-1])[pairs] / light[1:][pairs]
    assert np.sqrt(np.square(step).mean()) < 0.2 / 4
