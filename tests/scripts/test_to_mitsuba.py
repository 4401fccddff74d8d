"""What hands scenes to Mitsuba still does, where Mitsuba is installed (the extra `references`)."""

import numpy as np
import pytest
from references import SMALL, stored
from references.scenes import SCENES

from ispm.bench.metrics import compare
from ispm.library.common import add_camera
from ispm.library.shapes import box
from ispm.scene.material import Material
from ispm.scene.scene import Scene

mi = pytest.importorskip("mitsuba", reason="the extra `references` is not installed")


@pytest.fixture(scope="module")
def to_mitsuba():
    mi.set_variant("scalar_rgb")
    from references.to_mitsuba import to_mitsuba

    return to_mitsuba


@pytest.mark.parametrize("name", ["cornell-box", "mirror-ring"])
def test_direct_light_is_that_of_the_stored_picture(to_mitsuba, name):
    """16 paths a pixel, which differ only in where they meet it."""
    reference = stored(f"{name}-direct")
    scene = to_mitsuba(SCENES[name](), SMALL, {"type": "path", "max_depth": 2})
    picture = np.array(mi.render(scene, spp=16, seed=1))
    assert compare(picture, reference.radiance, reference.masks["whole"]).relmse < 1e-4


def test_what_mitsuba_shows_otherwise_is_refused(to_mitsuba):
    scene = Scene()
    scene.add(box((0, 0, 0), (1, 1, 1)), material=Material((0.5, 0.5, 0.5), name="plastic"))
    add_camera(scene, (2.0, 2.0, 2.0), (0.0, 0.0, 0.0))
    with pytest.raises(ValueError, match="plastic"):
        to_mitsuba(scene, SMALL, {"type": "path"})
