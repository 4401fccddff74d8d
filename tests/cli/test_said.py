"""What is asked for and cannot be as one may think is said, in a line."""

import numpy as np
import pytest

from ispm import Scene, SceneError, load, save, shapes
from ispm.scene.animation import Animation, Channel


@pytest.fixture
def place(tmp_path, monkeypatch):
    """A folder of a test's own, with the renderer as it is."""
    monkeypatch.chdir(tmp_path)


def test_a_picture_of_the_screen_is_told_from_one_of_light(ispm_command, place):
    ispm_command("render cornell-box --size 8x6 -o a.png --quiet")
    ispm_command("render cornell-box --size 8x6 -o a.exr --quiet")
    code, _, err = ispm_command("compare a.png a.exr")
    assert code == 0 and "warning: a.png: a PNG was exposed, tone mapped and clipped" in err
    assert "warning" not in ispm_command("compare a.png a.png")[2]
    assert "warning" not in ispm_command("compare a.exr a.exr")[2]


def test_passes_that_are_there_already_are_counted(ispm_command, place):
    line = "render cornell-box --size 8x6 --resume passes.npz -o a.png"
    assert "already" not in ispm_command(f"{line} --passes 3")[2]
    code, _, err = ispm_command(f"{line} --passes 2")
    assert code == 0
    assert "warning: passes.npz holds 3 passes already; --passes 2 adds none" in err
    assert "already" not in ispm_command(f"{line} --passes 3")[2]


@pytest.mark.parametrize("kind", ["sky", "studio"])
def test_a_kind_of_light_is_no_environment(ispm_command, place, kind):
    code, _, err = ispm_command(f"render cornell-box --environment {kind} -o a.png")
    assert code == 2 and f"--light {kind} lights a scene that has no light" in err and err.count("\n") == 1


def test_a_time_at_which_nothing_moves_is_told(ispm_command, place):
    code, _, err = ispm_command("render cornell-box --size 8x6 --time 5 -o a.png")
    assert code == 0 and "warning: --time: nothing moves in cornell-box" in err


def test_an_animation_without_a_name_is_told_of(place):
    scene = Scene()
    ball = scene.add(shapes.box())
    keys = np.array([(0.0, 0, 0), (1.0, 0, 0)], np.float32)
    scene.animations.append(Animation([Channel(ball, "translation", np.array([0.0, 1.0]), keys)], ""))
    save(scene, "a.glb")
    with pytest.raises(SceneError, match="no animation is called 'fly'; the scene has one without a name"):
        load("a.glb").at(0.5, "fly")


@pytest.mark.filterwarnings("error")
def test_a_scale_that_is_infinite_is_named_without_a_warning():
    scene = Scene()
    scene.add(shapes.box(), name="crate").scale = (np.inf, 1.0, 1.0)
    with pytest.raises(SceneError, match="crate"):
        scene.bounds  # noqa: B018
