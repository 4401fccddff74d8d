"""Scenes of any size, and far from the origin."""

import math
import warnings

import numpy as np
import pytest
from transport import box_room, render

import ispm
from ispm.errors import SceneWarning
from ispm.library.shapes import box, icosphere
from ispm.scene.scene import Node, Scene


def on_plate(size=1.0, at=(0.0, 0.0, 0.0)):
    """A ball on a plate, 2.8 m across at size 1, without a light."""
    scene = Scene()
    scene.add(box((-1.0, -0.1, -1.0), (1.0, 0.0, 1.0)))
    scene.add(icosphere(0.5, 8), translation=(0.0, 0.5, 0.0))
    return Scene([Node("all", translation=at, scale=(size,) * 3, children=scene.roots)])


def scaled_room(size):
    return Scene([Node("all", scale=(size,) * 3, children=box_room().roots)])


@pytest.mark.parametrize("make", [on_plate, scaled_room])
@pytest.mark.parametrize("size", [1e-4, 8e3, 1e4, 1e8])
def test_scenes_without_light_look_alike_at_any_size(gpu, make, size):
    """The same photons take the same ways but for rounding; a sun is not quite a lamp 20 sizes away."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SceneWarning)
        small, large = (render(gpu, make(s), size=(64, 36), photons=4000)[0] for s in (1.0, size))
    assert np.abs(large.image.astype(float) - small.image).mean() < 1.0  # codes; single pixels on edges flip
    assert large.image.mean() == pytest.approx(small.image.mean(), rel=0.02)


def test_a_scene_far_from_the_origin_is_told(gpu):
    """At 1e4 m nothing of it shows; at 1e6 m places are rounded to 6 cm, and most of its light is lost."""

    def picture(away):
        scene = on_plate(at=(away, 0.0, 0.0))
        scene.add(ispm.PointLight((10.0,) * 3), translation=(away + 1.0, 2.0, 1.0))
        return render(gpu, scene, size=(64, 36), photons=4000)[0]

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        near, far = picture(0.0), picture(1e4)
    assert far.indirect.mean() == pytest.approx(near.indirect.mean(), rel=0.03)
    with pytest.warns(
        SceneWarning, match=r"stands 1e\+06 m from the origin, where places are rounded to 0.062 m"
    ):
        picture(1e6)


LAMPS = {
    "rectangle": ispm.RectLight((4000.0,) * 3, width=0.4, height=0.4),
    "disk": ispm.DiskLight((4000.0,) * 3, radius=0.2),
    "ball": ispm.SphereLight((4000.0,) * 3, radius=0.2),
}


@pytest.mark.parametrize("lamp", LAMPS)
def test_lamps_with_a_surface_shine_alike_far_from_the_origin(gpu, lamp):
    """At 2 km places are rounded to 1.2e-4 m, over which neither light nor shadows change by 1e-3; rays that
    ended on a lamp, not before it, would take its light for shadowed."""

    def picture(away):
        scene = Scene(
            [Node("all", translation=(away, 0, away), children=box_room((-2.0,) * 3, (2.0,) * 3).roots)]
        )
        down = ispm.euler(math.radians(-90.0), 0.0, 0.0)
        scene.add(LAMPS[lamp], translation=(away, 1.5, away), rotation=down)
        camera = ispm.Camera.look_at((away + 1.8, 0.0, away + 1.8), (away, 0.0, away))
        return render(gpu, scene, camera, size=(64, 36), photons=4000)[0]

    near, far = picture(0.0), picture(2000.0)
    assert far.direct.mean() == pytest.approx(near.direct.mean(), rel=0.003)
    # Of photons, some go elsewhere.
    assert far.indirect.mean() == pytest.approx(near.indirect.mean(), rel=0.02)
