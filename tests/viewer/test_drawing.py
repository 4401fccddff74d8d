"""A live view drawn by a renderer: on a device, in small."""

import time

import numpy as np
import pytest

import ispm
from ispm.settings import Settings
from ispm.viewer import messages as m
from ispm.viewer.drawing import STILL_PASSES
from ispm.viewer.running import live

pytestmark = pytest.mark.gpu


@pytest.fixture(scope="module")
def running():
    made = live(ispm.builtin("cornell-box"), Settings(preset="fast", size=(64, 36), photons=2000), fps=0.2)
    yield made
    made.close()


def settled(running):
    """Have all drawn anew, and listen until a picture is still; return all that came."""
    pictures, key = [], object()
    running.ask(lambda session: session.touch()).result(timeout=60)
    running.listen(key, lambda picture, _: pictures.append(picture), lambda _: None)
    try:
        end = time.monotonic() + 120.0
        while time.monotonic() < end:
            if pictures and pictures[-1].still:
                return pictures
            time.sleep(0.02)
    finally:
        running.leave(key)
    raise AssertionError("no picture was still")


def test_a_first_picture_is_that_of_render_and_converges_at_rest(running):
    pictures = settled(running)
    settings = running.session.settings.replace(exposure=pictures[0].frame.exposure)
    with ispm.Renderer(ispm.builtin("cornell-box"), settings) as renderer:
        once = renderer.render()
        *_, mean = renderer.converge(STILL_PASSES)
    np.testing.assert_array_equal(pictures[0].frame.radiance, once.radiance)
    np.testing.assert_array_equal(pictures[0].image, once.image)
    np.testing.assert_array_equal(pictures[-1].frame.radiance, mean.radiance)
    assert [p.frame.stats.passes for p in pictures] == [*range(1, STILL_PASSES + 1), STILL_PASSES]


def test_light_follows_an_edit_and_its_undoing(running):
    before = settled(running)[-1].image
    lamp = running.ask(lambda s: s.numbering.of(s.scene["light"])).result()
    running.post(m.Change("light", lamp, "strength", 1.0))
    darker = settled(running)[-1].image
    assert darker.mean() < 0.6 * before.mean()  # at the exposure that is held
    running.post(m.Undo())
    np.testing.assert_array_equal(settled(running)[-1].image, before)


@pytest.mark.parametrize("view", ["photons", "overdraw", "depth", "instance", "ambient", "split"])
def test_every_kind_of_view_is_shown(running, view):
    running.post(m.Show(view))
    pictures = settled(running)
    assert running.session.view == view, running.session.line
    assert np.ptp(pictures[-1].image) > 0
    running.post(m.Show("full"))


def test_a_scene_that_cannot_be_drawn_is_told_and_the_view_goes_on(running):
    session, told = running.session, []
    settled(running)
    running.listen(settled, lambda *_: None, lambda s: told.append(s.line))
    with running.editing() as scene:
        scene["light"].light.intensity = (-1.0, 0.0, 0.0)
    for _ in range(200):
        if any("intensity" in line for line in told):
            break
        running.ask(lambda _: None).result(timeout=60)
    else:
        raise AssertionError(told)
    with running.editing() as scene:
        scene["light"].light.intensity = (10.0, 10.0, 10.0)
    running.leave(settled)
    assert settled(running)[-1].still
    assert session.scene["light"].light.intensity == (10.0, 10.0, 10.0)
