"""What keys and the mouse do in a window: messages, as on the page."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import count
from typing import Any

import numpy as np

from ispm.viewer import messages as m
from ispm.viewer.gizmo import Glass, Part, Place

FLY = {"right": (1, 0, 0), "left": (-1, 0, 0), "pageup": (0, 1, 0), "pagedown": (0, -1, 0)}
FLY |= {"up": (0, 0, 1), "down": (0, 0, -1)}
FLY_HELD = {"d": (1, 0, 0), "a": (-1, 0, 0), "e": (0, 1, 0), "q": (0, -1, 0), "w": (0, 0, 1), "s": (0, 0, -1)}
HELP = (
    ("drag", "orbit"),
    ("Shift drag, middle drag", "pan"),
    ("right drag", "look around; with W A S D Q E fly"),
    ("wheel", "zoom"),
    ("arrows, PgUp, PgDn", "fly"),
    ("click", "select"),
    ("double click", "focus there"),
    ("F", "frame what is selected, or all"),
    ("R", "camera as at the beginning"),
    ("Del, Ctrl+D, H", "delete, duplicate, hide"),
    ("Ctrl+Z, Ctrl+Shift+Z", "undo, redo"),
    ("I, then click", "the photons that light a place"),
    ("Space", "play or pause"),
    ("1 to 9", "views"),
    ("S", "save the picture"),
    ("C", "copy the command"),
    ("[ and ]", "fold the panels"),
    ("?", "this"),
)
_SPEED = 0.7  # of the distance to the pivot in a second
_STEPS = 0.25  # powers of 2 for a notch of the wheel
_STILL = 4.0  # units of the canvas that a click may move
_LIGHT = 11.0  # from its mark within which a light is meant
gestures = count(1)


@dataclass
class Drag:
    """What the mouse is about, from button to release."""

    how: str  # "orbit", "pan", "turn", "handle", "light"
    start: Place
    last: Place
    moved: float = 0.0
    gesture: int = 0
    part: Part = "free"
    light: int = 0
    point: np.ndarray = field(default_factory=lambda: np.zeros(3))
    place: np.ndarray = field(default_factory=lambda: np.zeros(3))
    offset: np.ndarray = field(default_factory=lambda: np.zeros(3))
    glass: Glass | None = None


def begun(at: Place, button: int, shift: bool, about: dict[str, Any], glass: Glass) -> Drag:
    """Return the drag that a button begins. button: 0 left, 1 right, 2 middle; about: as `header`."""
    how = {1: "turn", 2: "pan"}.get(button, "pan" if shift else "orbit")
    drag = Drag(how, at, at, gesture=next(gestures))
    handle = about["handle"]
    if button:
        return drag
    if handle is not None:
        point = np.array(handle["place"])
        part = glass.part_at(point, at)
        if part is not None:
            drag.how, drag.part, drag.point, drag.place = "handle", part, point, point
            drag.offset, drag.light, drag.glass = np.array(handle["offset"]), handle["node"], glass
            return drag
    for number, *place, _ in about["lights"]:
        seen = glass.project(np.array(place))
        if seen is not None and math.dist(seen, at) < _LIGHT:
            drag.light = number
    return drag


def dragged(drag: Drag, to: Place, height: float) -> m.Message | None:
    """Return what a drag to a place asks for; None: it may yet be a click. height: the picture's."""
    dx, dy = to[0] - drag.last[0], to[1] - drag.last[1]
    drag.last, drag.moved = to, drag.moved + abs(dx) + abs(dy)
    if drag.moved < _STILL or not (dx or dy):
        return None
    if drag.how == "handle":
        assert drag.glass is not None
        far = to[0] - drag.start[0], to[1] - drag.start[1]
        drag.place = drag.glass.moved(drag.point, drag.part, *far)
        value = [float(v) for v in drag.place - drag.offset]
        return m.Change("node", drag.light, "place", value, gesture=drag.gesture)
    if drag.how == "pan":
        return m.Pan(_bound(dx / height), _bound(-dy / height))
    turn = 2.0 if drag.how == "turn" else math.pi
    right, down = _bound(turn * dx / height), _bound(turn * dy / height)
    return m.Look(right, down, "turn" if drag.how == "turn" else "orbit")


def released(drag: Drag, glass: Glass, inspecting: bool = False) -> m.Message | None:
    """Return what a click asks for that ended a drag; None: it was one.

    inspecting  whether it asks for what lights the place
    """
    if drag.moved >= _STILL or drag.how in ("handle", "turn"):
        return None
    place = inside(glass, drag.last)
    if inspecting and place is not None:
        return m.Inspect(*place)
    if drag.light:
        return m.Select(drag.light)
    return None if place is None else m.Pick(*place)


def inside(glass: Glass, place: Place) -> Place | None:
    """Return a place as parts of the picture's width and height; None: it is beside the picture."""
    x, y = (place[0] - glass.x) / glass.width, (place[1] - glass.y) / glass.height
    return (x, y) if 0.0 <= x <= 1.0 and 0.0 <= y <= 1.0 else None


def zoomed(notches: float) -> m.Message:
    """Return what the wheel asks for."""
    return m.Zoom(_bound(_STEPS * notches))


def flown(held: list[tuple[int, int, int]], seconds: float) -> m.Message | None:
    """Return what keys ask for that were held so long; None where they cancel out."""
    right, up, ahead = (_SPEED * min(seconds, 0.1) * sum(axis) for axis in zip(*held, strict=True))
    return m.Fly(right, up, ahead) if right or up or ahead else None


def key(name: str, ctrl: bool, shift: bool, state: dict[str, Any]) -> m.Message | None:
    """Return what a key asks for, given what panels show; None: nothing, or nothing that a session does."""
    chosen = state["selection"]["node"]
    if ctrl:
        known: dict[str, m.Message | None] = {
            "z": m.Redo() if shift else m.Undo(),
            "y": m.Redo(),
            "d": None if chosen is None else m.Duplicate(chosen),
        }
        return known.get(name)
    if name.isdigit() and name != "0":
        views = state["settings"]["views"]
        return m.Show(views[int(name) - 1]) if int(name) <= len(views) else None
    if name == " " and state["time"]["animations"]:
        return m.Play(playing=not state["time"]["playing"])
    if name == "h" and chosen is not None:
        away = next((row[4] for row in state["scene"]["rows"] if row[0] == chosen), False)
        return m.Change("node", chosen, "hidden", not away)
    plain: dict[str, m.Message | None] = {
        "f": m.FrameAll(chosen),
        "r": m.UseCamera(),
        "delete": None if chosen is None else m.Delete(chosen),
        "escape": m.Select(None),
    }
    return plain.get(name)


def _bound(value: float) -> float:
    return min(max(value, -100.0), 100.0)
