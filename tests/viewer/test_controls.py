"""What keys and the mouse ask for in a window."""

import math

import numpy as np
import pytest

from ispm.viewer import controls
from ispm.viewer import messages as m
from ispm.viewer.describe import describe
from ispm.viewer.gizmo import Glass

GLASS = Glass(np.diag([1.0, 2.0, 1.0, 1.0]), 0.0, 0.0, 200.0, 100.0)
NOTHING = {"handle": None, "lights": []}


def drag(*places, button=0, shift=False, about=NOTHING):
    """What is asked for on the way, and at the end."""
    made = controls.begun(places[0], button, shift, about, GLASS)
    asked = [controls.dragged(made, place, GLASS.height) for place in places[1:]]
    return [each for each in asked if each], controls.released(made, GLASS)


@pytest.mark.parametrize(
    ("button", "shift", "asked"),
    [
        (0, False, m.Look(math.pi * 0.2, math.pi * 0.1)),
        (0, True, m.Pan(0.2, -0.1)),
        (2, False, m.Pan(0.2, -0.1)),
        (1, False, m.Look(0.4, 0.2, "turn")),
    ],
)
def test_drags_are_those_of_the_page(button, shift, asked):
    assert drag((50, 50), (70, 60), button=button, shift=shift) == ([asked], None)


def test_a_click_picks_and_one_beside_the_picture_does_not():
    assert drag((50, 25)) == ([], m.Pick(0.25, 0.25))
    assert drag((50, 25), (51, 26)) == ([], m.Pick(51 / 200, 26 / 100))
    assert drag((300, 25)) == ([], None)


def test_a_click_on_a_mark_selects_its_light():
    assert drag((104, 52), about={"handle": None, "lights": [[7, 0.0, 0.0, 0.0, "point"]]}) == (
        [],
        m.Select(7),
    )


def test_a_click_asks_for_the_light_of_a_place_while_the_inspector_is_on():
    about = {"handle": None, "lights": [[7, 0.0, 0.0, 0.0, "point"]]}
    for place, asked in (
        ((50, 25), m.Inspect(0.25, 0.25)),
        ((104, 52), m.Inspect(0.52, 0.52)),
        ((300, 25), None),
    ):
        made = controls.begun(place, 0, False, about, GLASS)
        assert controls.released(made, GLASS, inspecting=True) == asked


def test_a_drag_of_a_handle_moves_the_node_by_one_gesture():
    about = {"handle": {"node": 3, "place": [0.0, 0.0, 0.0], "offset": [0.0, 0.5, 0.0]}, "lights": []}
    asked, end = drag((100, 50), (110, 50), (120, 50), about=about)
    assert end is None
    assert [(a.what, a.node, a.field) for a in asked] == [("node", 3, "place")] * 2
    assert asked[0].gesture == asked[1].gesture > 0
    np.testing.assert_allclose(asked[-1].value, [0.2, -0.5, 0.0], atol=1e-12)  # 20 of 100 units to a side
    another, _ = drag((100, 50), (110, 50), about=about)
    assert another[0].gesture != asked[0].gesture


def test_keys_ask_for_what_the_help_says(session):
    state = describe(session)
    session.handle(m.Select(1))
    chosen = describe(session)
    for name, ctrl, shift, asked in [
        ("z", True, False, m.Undo()),
        ("z", True, True, m.Redo()),
        ("y", True, False, m.Redo()),
        ("f", False, False, m.FrameAll(1)),
        ("r", False, False, m.UseCamera()),
        ("delete", False, False, m.Delete(1)),
        ("d", True, False, m.Duplicate(1)),
        ("h", False, False, m.Change("node", 1, "hidden", True)),
        ("escape", False, False, m.Select(None)),
        ("2", False, False, m.Show(state["settings"]["views"][1])),
        (" ", False, False, None),  # nothing is animated
        ("d", False, False, None),
        ("0", False, False, None),
    ]:
        assert controls.key(name, ctrl, shift, chosen) == asked, name
    for name, ctrl in [("delete", False), ("d", True), ("h", False)]:
        assert controls.key(name, ctrl, False, state) is None


def test_flying_goes_with_time_and_stops_for_keys_that_cancel():
    assert controls.flown([(1, 0, 0), (0, 0, 1)], 0.05) == m.Fly(0.7 * 0.05, 0.0, 0.7 * 0.05)
    assert controls.flown([(1, 0, 0), (-1, 0, 0)], 0.05) is None
    assert controls.flown([(1, 0, 0)], 10.0) == m.Fly(0.7 * 0.1, 0.0, 0.0)  # after a pause no leap


def test_the_wheel_zooms_within_what_a_message_may_say():
    assert controls.zoomed(2.0) == m.Zoom(0.5)
    assert controls.zoomed(1e9) == m.Zoom(100.0)
