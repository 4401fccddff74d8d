"""Frames shown: in a notebook, in the system's window, and where there is neither."""

import io
import sys
import types

import numpy as np
import pytest
from PIL import Image, ImageShow

import ispm
from ispm.renderer import show
from ispm.settings import LAYERS

SIZE = (9, 5)


@pytest.fixture
def frame():
    """A frame of random light."""
    light = np.random.default_rng(1).random((5, 9, 3), np.float32)
    layers = {"full": light, "direct": 0.5 * light, "depth": light[..., 0]}
    settings = ispm.Settings(size=SIZE, exposure=0.0)
    return ispm.Frame(layers, ispm.Stats(), settings, {}, "room")


@pytest.fixture
def viewer(monkeypatch):
    """What the system's viewer is given, as (title, array)."""
    seen = []

    class Viewer(ImageShow.Viewer):
        def show(self, image, **options):
            seen.append((options["title"], np.asarray(image)))
            return True

    monkeypatch.setattr(ImageShow, "_viewers", [Viewer()])
    return seen


def test_a_window_shows_the_view_that_is_asked_for(frame, viewer, monkeypatch):
    monkeypatch.setattr(show, "has_display", lambda: True)
    assert frame.show() is None
    frame.show("direct")
    assert [title for title, _ in viewer] == ["room, full", "room, direct"]
    np.testing.assert_array_equal(viewer[0][1], frame.image)
    np.testing.assert_array_equal(viewer[1][1], frame.view("direct"))


@pytest.mark.parametrize("name", ["DISPLAY", "WAYLAND_DISPLAY"])
def test_linux_has_a_display_where_one_is_named(frame, viewer, monkeypatch, name):
    monkeypatch.setattr(sys, "platform", "linux")
    for variable in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(variable, raising=False)
    with pytest.warns(ispm.SceneWarning, match="no display .* use save, or view for an array") as said:
        frame.show()
    assert viewer == [] and len(said) == 1 and said[0].filename == __file__
    monkeypatch.setenv(name, ":0")
    frame.show()
    assert len(viewer) == 1


def test_a_system_without_a_viewer_says_so(frame, monkeypatch):
    monkeypatch.setattr(show, "has_display", lambda: True)
    monkeypatch.setattr(ImageShow, "_viewers", [])
    with pytest.warns(ispm.SceneWarning, match="no display"):
        frame.show()


def test_a_notebook_shows_it_in_the_page(frame, viewer, monkeypatch):
    """With a stand-in for IPython, as its kernels load it."""
    shown = []
    ipython, page = types.ModuleType("IPython"), types.ModuleType("IPython.display")
    ipython.get_ipython = lambda: types.SimpleNamespace(kernel=object())
    ipython.display, page.display, page.Image = page, shown.append, lambda data: data
    monkeypatch.setitem(sys.modules, "IPython", ipython)
    monkeypatch.setitem(sys.modules, "IPython.display", page)
    frame.show("direct")
    with Image.open(io.BytesIO(shown[0])) as picture:
        np.testing.assert_array_equal(np.asarray(picture), frame.view("direct"))
    assert viewer == []
    ipython.get_ipython = lambda: types.SimpleNamespace()  # a terminal's shell has no kernel
    monkeypatch.setattr(show, "has_display", lambda: True)
    frame.show()
    assert len(viewer) == 1


def test_an_unknown_view_is_refused_before_anything_is_shown(frame, viewer):
    with pytest.raises(ispm.SettingsError, match="there is no view 'dirct'; did you mean 'direct'"):
        frame.show("dirct")
    assert viewer == []


def test_layers_are_attributes_that_editors_see(frame):
    assert set(LAYERS) - {"full"} | {"radiance", "image", "names"} <= set(dir(frame))
    assert frame.depth is frame["depth"] and frame.radiance is frame["full"]
    assert list(frame) == ["full", "direct", "depth"] and "depth" in frame and "dpth" not in frame
    for missing in ("albedo", "dpth"):
        assert not hasattr(frame, missing)
    with pytest.raises(AttributeError, match="no layer 'albedo'; it has full, direct, depth"):
        _ = frame.albedo
    with pytest.raises(KeyError, match="there is no layer 'dpth'; did you mean 'depth'"):
        frame["dpth"]
