"""The photon inspector of the window: when it asks, and what it writes."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("imgui_bundle", reason="needs the extra view")

from ispm.viewer import inspector as module
from ispm.viewer import messages as m
from ispm.viewer.gizmo import Glass
from ispm.viewer.inspector import Inspector, short, together

PAGE = Path(module.__file__).parent / "page" / "inspector.js"
GLASS = Glass(np.diag([1.0, 2.0, 1.0, 1.0]), 0.0, 0.0, 200.0, 100.0)


class Lines:
    """A draw list that keeps what is drawn."""

    def __init__(self):
        self.drawn = []

    def __getattr__(self, name):
        return lambda *given: self.drawn.append((name, *given))

    def of(self, name):
        return [given for kind, *given in self.drawn if kind == name]


def way(light, bounce, *places):
    return {"light": light, "bounce": bounce, "flux": [1.0] * len(places), "places": places, "events": []}


def test_it_asks_for_the_place_under_the_mouse_and_says_when_it_ends():
    posted = []
    made = Inspector(posted.append)
    assert not made.key("escape", None)
    assert not made.key("f", (0.5, 0.5))
    assert made.key("i", (0.25, 0.75))
    assert (made.on, posted) == (True, [m.Inspect(0.25, 0.75)])
    made.found = {"point": [0, 0, 0], "light": 1.0, "photons": 1, "paths": []}
    assert made.key("escape", (0.5, 0.5))
    assert (made.on, posted[1:], made.found["point"]) == (False, [m.Inspect()], None)
    made.toggle()
    assert (made.on, len(posted)) == (True, 2)  # the mouse is beside the picture
    assert made.key("i", None)
    assert (made.on, posted[2:]) == (False, [m.Inspect()])


def test_ways_are_as_wide_as_what_they_bring_and_the_strongest_are_in_front():
    made, lines = Inspector(print), Lines()
    made.draw(GLASS, lines)
    assert not lines.drawn
    low, middle, high = (-0.5, 0.0, 0.0), (0.5, 0.25, 0.0), (0.5, -0.25, 0.0)
    made.found = {"point": high, "paths": [way(4.0, 1, low, middle, high), way(1.0, 7, low, high)]}
    made.draw(GLASS, lines)
    drawn = lines.of("add_line")
    assert [each[:2] for each in drawn] == [
        [(50.0, 50.0), (150.0, 75.0)],
        [(50.0, 50.0), (150.0, 25.0)],
        [(150.0, 25.0), (150.0, 75.0)],
    ]
    assert [each[3] for each in drawn] == [2.25, 3.5, 3.5]  # 1 + 2.5 sqrt(1 / 4), and the widest
    assert drawn[0][2] != drawn[1][2] == drawn[2][2]
    assert [each[0] for each in lines.of("add_circle_filled")] == [(150.0, 25.0)]
    assert [each[0] for each in lines.of("add_circle")] == [(150.0, 75.0)] * 2
    made.found["paths"].clear()  # no photon reaches it
    lines.drawn.clear()
    made.draw(GLASS, lines)
    assert not lines.of("add_line")
    assert len(lines.of("add_circle")) == 2


def test_colors_are_those_of_the_page():
    page = json.loads(re.search(r"const COLORS = (\[.*?\]);", PAGE.read_text("utf-8"))[1])
    own = ["#" + "".join(f"{round(255 * value):02x}" for value in rgb) for rgb in module._COLORS]
    assert own == page


@pytest.mark.parametrize(
    ("value", "written"),
    [
        (0.0, "0"),
        (3e-15, "3.0e-15"),
        (0.00057, "5.7e-4"),
        (0.00123456, "0.00123"),
        (0.5, "0.5"),
        (1234.0, "1230"),
        (9999.9, "10000"),
        (12345.0, "1.2e4"),
    ],
)
def test_numbers_are_short(value, written):
    assert short(value) == written


def test_equal_words_in_a_row_are_counted():
    assert together([]) == ""
    assert together(["diffuse", "diffuse", "glass", "diffuse"]) == "diffuse ×2 · glass · diffuse"
