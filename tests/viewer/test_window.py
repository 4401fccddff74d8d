"""The window, on a display that nobody sees: it opens, draws, hears, resizes and closes."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageGrab

for package in ("glfw", "imgui_bundle"):
    pytest.importorskip(package, reason="needs the extra view")
pytestmark = [
    pytest.mark.gpu,
    pytest.mark.skipif(shutil.which("Xvfb") is None, reason="Xvfb is not installed"),
]
HERE = Path(__file__).parent


@pytest.fixture(scope="module")
def display():
    """The environment of programs that are to open their windows on a display of their own."""
    read, write = os.pipe()
    line = ["Xvfb", "-displayfd", str(write), "-screen", "0", "1280x800x24", "-nolisten", "tcp"]
    with subprocess.Popen(line, pass_fds=[write], stderr=subprocess.DEVNULL) as server:
        os.close(write)
        number = os.fdopen(read).readline().strip()
        if not number:
            pytest.skip("Xvfb does not start here")
        try:
            yield {**os.environ, "DISPLAY": f":{number}", "WAYLAND_DISPLAY": ""}
        finally:
            server.terminate()


@pytest.fixture(scope="module")
def used(display, tmp_path_factory):
    """What a user saw and did: the folder of screenshots, and what came of it."""
    folder = tmp_path_factory.mktemp("window")
    run = subprocess.run(
        [sys.executable, HERE / "in_window.py", folder],
        env=display,
        capture_output=True,
        text=True,
        timeout=200,
    )
    assert run.returncode == 0, run.stderr
    found = json.loads(run.stdout.splitlines()[-1])
    assert "error" not in found, found
    return folder, found


def picture(folder, name):
    return np.asarray(Image.open(folder / f"{name}.png").convert("RGB"))


def test_the_picture_is_shown_pixel_by_pixel_between_the_panels(used):
    screen = picture(used[0], "opened")
    stage = screen[42:768, 232:964]
    colors = {tuple(c) for c in stage[::5, ::5].reshape(-1, 3)}
    assert {(90, 90, 90), (200, 60, 60), (60, 60, 200)} <= colors
    assert tuple(stage[2, 2]) == tuple(stage[-3, -3]) == (90, 90, 90)
    assert {tuple(c) for c in screen[300:560, 20:200].reshape(-1, 3)} == {(27, 29, 33)}  # an empty panel


def test_a_click_selects_and_shows_handles(used):
    folder, found = used
    assert found["selected"] == "left"
    before, after = (picture(folder, name)[42:768, 232:964] for name in ("opened", "selected"))
    assert 200 < (before != after).any(axis=-1).sum() < 4000  # three axes of 70 units


def test_a_handle_moves_the_node_along_its_axis_as_one_edit(used):
    found = used[1]
    assert found["moved"] == pytest.approx(found["wanted"], rel=0.02)  # a unit of the screen in 60
    assert found["undos"] == 1


def test_photons_that_light_a_place_are_listed_and_drawn_until_the_mode_is_left(used):
    folder, found = used
    assert found["told"][0] != found["told"][1]  # by the key where the mouse is, then by a click
    assert found["kept"]  # which selects nothing then
    before, after, chosen, left = (picture(folder, k) for k in ("before", "inspected", "chosen", "left"))
    stage = np.s_[42:768, 232:964]
    ways = np.argwhere((before != after).any(axis=-1)[stage])[:, ::-1] + (232, 42)
    lamp, wall, end = np.array(found["way"])
    far = np.minimum(off_line(ways, lamp, wall), off_line(ways, wall, end))
    ring = np.hypot(*(ways - found["place"]).T) < 9.0
    far = far[~ring]
    assert len(far) > 400
    assert far.max() < 5.0  # 3.5 units, dots of 3.3, and their smooth edges
    column, row = (ways[~ring][far.argmin()]).astype(int)
    assert after[row, column] == pytest.approx(
        0.7 * np.array([240, 176, 79]) + 0.3 * before[row, column], abs=4
    )
    panel = np.s_[42:536, 964:1280]
    assert (after[panel] != before[panel]).any(axis=-1).sum() > 1000
    strong = (chosen[stage] == 255).all(axis=-1).sum()
    assert strong > (after[stage] == 255).all(axis=-1).sum() + 15  # a dot where it met the wall
    assert (left == before).all()


def off_line(points, a, b):
    """How far (n, 2) points are from the line between two others."""
    along = np.clip((points - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
    return np.linalg.norm(points - a - along[:, None] * (b - a), axis=1)


def test_it_follows_its_size_and_closes(used):
    folder, found = used
    assert (picture(folder, "small")[600:, :] == 0).all()  # the window became smaller than the screen
    assert not found["listened"]
    assert found["lines"] == ["", ""]


def test_help_is_in_front(used):
    dark = picture(used[0], "help")[300:500, 450:830]
    assert (dark == (27, 29, 33)).all(axis=-1).mean() > 0.5


def test_ispm_view_opens_it_and_ends_by_a_signal(display):
    line = [sys.executable, "-m", "ispm", "view", "cornell-box", "--photons", "1000"]
    pipes = dict(stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    with subprocess.Popen(line, env=display, **pipes) as run:
        end = time.monotonic() + 120.0
        while not np.asarray(ImageGrab.grab(xdisplay=display["DISPLAY"])).any():  # nothing is open yet
            assert run.poll() is None and time.monotonic() < end
            time.sleep(0.2)
        run.send_signal(signal.SIGTERM)
        out, err = run.communicate(timeout=60)
    assert (run.returncode, out) == (0, "")
    assert err.splitlines()[-1] == "closed"
    assert "page" not in err
