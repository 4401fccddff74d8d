"""Environments as plain data: what they take, what they refuse, and that scenes keep them."""

import copy
import pickle

import numpy as np
import pytest

from ispm import Environment, Scene, SceneError, shapes
from ispm.optics.environment_table import environment_power
from ispm.scene.environment import HIGHEST, WIDEST
from ispm.scene.packed import pack

GREY = np.full((4, 8, 3), 0.5)


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"image": np.ones((2, 4))}, r"environment: image must have shape \(n, n, 3\), not \(2, 4\)"),
        ({"image": np.ones((2, 4, 4))}, r"image must have shape"),
        ({"image": np.ones((0, 4, 3))}, "the image has no pixels"),
        ({"image": -GREY}, r"image must be numbers of 0 to 1e\+12, but \[0, 0, 0\] is -0.5"),
        ({"image": GREY * np.nan}, "image must be numbers of 0 to"),
        ({"image": GREY * np.inf}, "image must be numbers of 0 to"),
        ({"image": [[[1.0, 1.0, 1.0]]]}, "image must be a numpy array, not a list"),
        ({"image": 3}, "image must have shape"),
        ({"rotation": np.inf}, "rotation, in radians, must be a number"),
        ({"rotation": "90"}, "rotation, in radians, must be a number"),
        ({"intensity": -1.0}, r"intensity must be a number of 0 to"),
        ({"intensity": 1e12, "image": GREY * 4}, "brightest pixel, times the intensity,"),
        ({"intensity": None, "name": "sky"}, "environment 'sky': intensity must be a number"),
    ],
)
def test_values_that_cannot_be_used_are_refused_in_a_line(given, says):
    with pytest.raises(SceneError, match=says) as told:
        Environment(**{"image": GREY, **given})
    assert str(told.value).isprintable()


def test_names_that_it_has_not_are_refused():
    with pytest.raises(TypeError, match="a Environment has no 'rotate'; did you mean 'rotation'"):
        Environment(GREY, rotate=1.0)
    with pytest.raises(AttributeError, match="intensity"):
        Environment(GREY).intensty = 3.0


def test_an_image_too_large_for_kernels_is_refused_where_it_is_set_later():
    around = Environment(GREY)
    around.image = np.broadcast_to(np.float32(1.0), (HIGHEST, WIDEST + 1, 3))
    with pytest.raises(SceneError, match="4097 x 2048 pixels, and 4096 x 2048 is the most; make a new"):
        around.check()


def test_a_scene_takes_nothing_else():
    scene = Scene(environment=GREY)
    scene.add(shapes.box())
    with pytest.raises(
        SceneError, match=r"environment must be an ispm.Environment, an ispm.Sky or None, not a ndarray"
    ):
        pack(scene)


def test_copies_of_a_scene_have_its_environment():
    scene = Scene(environment=Environment(GREY))
    scene.add(shapes.box())
    for other in (scene.at(1.0), scene.at_rest(), copy.copy(scene)):
        assert other.environment is scene.environment
    assert (pickle.loads(pickle.dumps(scene)).environment.image == GREY).all()


def test_a_packed_scene_has_its_table():
    scene = Scene()
    scene.add(shapes.box())
    assert pack(scene).environment.rows.size == 0 and pack(scene).surround.power == 0.0
    scene.environment = Environment(GREY, intensity=4.0)
    packed = pack(scene)
    assert (packed.environment.radiance == 2.0).all()
    assert packed.surround.power == pytest.approx(8.0 * np.pi)  # 2 cd/m2 from 4 pi
    assert packed.surround.power == pytest.approx(environment_power(packed.environment))
