"""Environments on the command line."""

import json
import math

import numpy as np
import pytest
from fake import SMALL, FakeRenderer
from rgbe import hdr

from ispm.cli.info import summary
from ispm.io.named import builtin
from ispm.scene.environment import Environment

TEXELS = np.full((2, 4, 4), 130, np.uint8)


@pytest.fixture(autouse=True)
def sky(place):
    path = place / "sky.hdr"
    path.write_bytes(hdr(TEXELS))
    return path


def test_the_scene_gets_the_environment_of_the_file(ispm_command):
    line = SMALL + "--environment sky.hdr --environment-rotation -90 --environment-intensity 2.5 -o a.png"
    assert ispm_command(line)[0] == 0
    around = FakeRenderer.made[0].scene.environment
    assert (around.rotation, around.intensity, around.background) == (-math.pi / 2, 2.5, True)
    assert (around.name, around.image.shape) == ("sky", (2, 4, 3))
    assert (around.image == 130 / 256 * 4).all()


def test_without_one_there_is_none(ispm_command):
    assert ispm_command(SMALL + "-o a.png")[0] == 0
    assert FakeRenderer.made[0].scene.environment is None


def test_the_picture_says_how_it_is_made_again(ispm_command):
    line = SMALL + "--environment sky.hdr --environment-rotation -45.5 --environment-intensity 0 -o a.png"
    assert ispm_command(line)[0] == 0
    command = json.loads(ispm_command("info a.png --json")[1])["command"]
    assert command == (
        "ispm render cornell-box --environment sky.hdr --environment-rotation=-45.5 "
        "--environment-intensity 0.0 --size 8x6 -o a.png"
    )
    assert ispm_command(command.removeprefix("ispm "))[0] == 0
    one, two = (renderer.scene.environment for renderer in FakeRenderer.made)
    assert (one.rotation, one.intensity) == (two.rotation, two.intensity)


def test_a_picture_is_never_written_over_it(ispm_command, place):
    (place / "sky.exr").write_bytes(b"precious")
    code, _, err = ispm_command(SMALL + "--environment sky.exr -o sky.exr")
    assert (code, err.splitlines()[-1]) == (2, "ispm: sky.exr: is the environment; name another file with -o")
    assert (place / "sky.exr").read_bytes() == b"precious"


def test_what_is_amiss_in_it_is_told(ispm_command, sky):
    sky.write_bytes(hdr(TEXELS, head=b"#?RADIANCE\nEXPOSURE=4\n\n"))
    code, _, err = ispm_command(SMALL + "--environment sky.hdr -o a.png")
    assert code == 0 and "ispm: warning: sky.hdr: EXPOSURE=4 in its header is not taken off" in err


def test_info_says_what_is_around_a_scene():
    scene = builtin("cornell-box")
    assert summary(scene)["environment"] is None
    scene.environment = Environment(np.ones((2, 4, 3)), name="sky")
    assert summary(scene)["environment"] == "sky, 4 x 2"
