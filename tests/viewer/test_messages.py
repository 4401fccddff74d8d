"""Messages: what is read, what is refused, and what merges."""

import json

import pytest

from ispm.errors import IspmError
from ispm.viewer import messages
from ispm.viewer.messages import Change, Fly, Look, Pan, Play, Resize, Setting, Undo, Zoom, merged, read


def test_a_message_is_read_by_its_type():
    assert read('{"type": "look", "right": 0.5, "down": -1}') == Look(0.5, -1.0)
    assert read(b'{"type":"undo"}') == Undo()
    text = '{"type":"change","what":"light","node":3,"field":"color","value":[1,0,0.5],"gesture":9}'
    assert read(text) == Change("light", 3, "color", [1.0, 0.0, 0.5], 0, 9)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "null",
        "[]",
        "{}",
        '{"type": "close"}',
        '{"type": "look"}',
        '{"type": "look", "right": NaN, "down": 0}',
        '{"type": "look", "right": 1e999, "down": 0}',
        '{"type": "look", "right": 101, "down": 0}',
        '{"type": "look", "right": 1, "down": 0, "more": 1}',
        '{"type": "look", "right": "1", "down": 0}',
        '{"type": "pick", "x": 1.01, "y": 0}',
        '{"type": "resize", "width": 4e99, "height": 10}',
        '{"type": "select", "node": -1}',
        '{"type": "show", "view": "' + "x" * 201 + '"}',
        '{"type": "change", "what": "scene", "node": 1, "field": "x", "value": 1}',
        '{"type": "change", "what": "node", "node": 1, "field": "x", "value": {"a": 1}}',
        '{"type": "change", "what": "node", "node": 1, "field": "x", "value": '
        + json.dumps([0.0] * 17)
        + "}",
        '{"type": "play", "time": -1}',
        "[" * 30_000,
        b"\xff\xfe",
        '{"type": "show", "view": "' + "x" * messages.MOST_BYTES + '"}',
    ],
)
def test_what_is_no_message_is_refused_in_one_line(text):
    with pytest.raises(IspmError) as error:
        read(text)
    assert "\n" not in str(error.value)
    assert len(str(error.value)) < 300


def test_drags_add_up():
    assert merged(Look(1.0, 2.0), Look(0.5, -1.0)) == Look(1.5, 1.0)
    assert merged(Pan(1.0, 2.0), Pan(0.5, -1.0)) == Pan(1.5, 1.0)
    assert merged(Zoom(1.0), Zoom(0.5)) == Zoom(1.5)
    assert merged(Fly(1.0, 2.0, 3.0), Fly(1.0, 1.0, 1.0)) == Fly(2.0, 3.0, 4.0)
    assert merged(Look(1.0, 2.0), Look(1.0, 2.0, "turn")) is None
    assert merged(Zoom(60.0), Zoom(60.0)) is None  # no message may ask for that at once


def test_the_last_of_one_drag_counts():
    first, second = Change("node", 1, "place", [0.0], 0, 5), Change("node", 1, "place", [1.0], 0, 5)
    assert merged(first, second) is second
    assert merged(first, Change("node", 1, "place", [1.0], 0, 6)) is None  # another drag is another edit
    assert merged(Change("node", 1, "name", "a"), Change("node", 1, "name", "b")) is None
    assert merged(Change("node", 1, "place", [0.0], 0, 5), Change("node", 2, "place", [1.0], 0, 5)) is None
    assert merged(Setting("photons", 5.0, 3), Setting("photons", 6.0, 3)) == Setting("photons", 6.0, 3)
    assert merged(Setting("photons", 5.0), Setting("photons", 6.0)) is None
    assert merged(Resize(1, 2), Resize(3, 4)) == Resize(3, 4)


def test_the_time_line_keeps_what_the_last_does_not_say():
    assert merged(Play(playing=True, speed=2.0), Play(time=1.0, playing=False)) == Play(False, 1.0, 2.0, None)


def test_what_counts_one_by_one_is_not_merged():
    assert merged(Undo(), Undo()) is None
    assert merged(Look(1.0, 0.0), Undo()) is None
