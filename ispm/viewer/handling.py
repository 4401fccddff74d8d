"""What each message has a session do; errors are IspmErrors of one line, and leave it as it was."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ispm.errors import SceneError, SettingsError
from ispm.framing.camera import find_camera
from ispm.settings import VIEWS, Settings, convert, knob_of, nearest
from ispm.viewer import actions, fields, messages
from ispm.viewer.edits import Assign, Edit
from ispm.viewer.orbit import orbit_of
from ispm.viewer.timeline import TimeLine

if TYPE_CHECKING:
    from ispm.scene.node import Node
    from ispm.viewer.session import Session

_LOOK_AHEAD = 0.5  # of the diagonal: a new light stands no farther off
_TURNED_IN = 0.5  # of the diagonal: where a light of another kind stays as bright


def look(session: Session, m: messages.Look, _: object) -> None:
    """Turn the camera."""
    turned = session.orbit.orbited if m.how == "orbit" else session.orbit.looked
    session.orbit = turned(m.right, m.down)


def pan(session: Session, m: messages.Pan, _: object) -> None:
    """Move what is seen."""
    session.orbit = session.orbit.panned(m.right, m.up)


def zoom(session: Session, m: messages.Zoom, _: object) -> None:
    """Go nearer."""
    session.orbit = session.orbit.zoomed(m.steps)


def fly(session: Session, m: messages.Fly, _: object) -> None:
    """Move the eye."""
    reach = max(session.orbit.distance, 0.02 * session.diagonal())
    session.orbit = session.orbit.flown(m.right * reach, m.up * reach, m.ahead * reach)


def focus(session: Session, m: messages.Focus, _: object) -> None:
    """Look at what a place in the picture shows."""
    found = session.picked(m.x, m.y)
    if found is not None:
        session.orbit = session.orbit.focused(found.position)


def frame_all(session: Session, m: messages.FrameAll, _: object) -> None:
    """See all of the scene or of a node."""
    bounds = session.shown().bounds if m.node is None else session.bounds_of(session.node(m.node))
    width, height = session.settings.size
    session.orbit = session.orbit.framed(bounds, width / height)


def use_camera(session: Session, m: messages.UseCamera, _: object) -> None:
    """Look through one of the scene's cameras."""
    if m.index is None:
        session.orbit = session.home
        return
    found = find_camera(session.shown(), m.index)
    assert found is not None
    camera, pose = found
    session.orbit = orbit_of(replace(camera, pose=pose), session.scene.bounds)


def up(session: Session, m: messages.Up, _: object) -> None:
    """Take another axis as upright."""
    session.orbit = session.orbit.upright(m.axis)


def resize(session: Session, m: messages.Resize, _: object) -> None:
    """Draw pictures of another size."""
    least, most = messages.LEAST_SIDE, messages.MOST_SIDE
    size = min(max(m.width, least), most), min(max(m.height, least), most)
    session.settings = session.settings.replace(size=size)


def pick(session: Session, m: messages.Pick, _: object) -> None:
    """Select what a place in the picture shows."""
    found = session.picked(m.x, m.y)
    session.selected = None
    if found is not None:
        nodes = session.scene.nodes
        session.selected = nodes[found.node] if found.node < len(nodes) else None
        if session.on_pick is not None:
            session.on_pick(found)


def inspect(session: Session, m: messages.Inspect, _: object) -> None:
    """Find the photons that light a place in the picture."""
    session.inspected = None
    if m.x is not None and m.y is not None:
        session.inspected = session.lit_by(m.x, m.y)


def select(session: Session, m: messages.Select, _: object) -> None:
    """Select a node."""
    session.selected = None if m.node is None else session.node(m.node)


def change(session: Session, m: messages.Change, sender: object) -> None:
    """Give a field another value."""
    node = session.node(m.node)
    gesture = (sender, m.gesture) if m.gesture else None
    session.history.make(_change(session, node, m, gesture))


def _change(session: Session, node: Node, m: messages.Change, gesture: object) -> Edit:
    if m.what == "light":
        return fields.light_edit(node, m.field, m.value, 0.5 * session.diagonal(), gesture)
    if m.what == "material":
        if m.part >= len(node.parts):
            raise SceneError(f"node '{node.name}' has no part {m.part}")
        return fields.material_edit(node.parts[m.part].material, m.field, m.value, gesture)
    if m.field == "hidden":
        return actions.hide(session.hidden, node, bool(m.value))
    if m.field == "place":
        return actions.move(session.scene, node, np.array(fields.three("place", m.value)), gesture)
    return fields.node_edit(node, m.field, m.value, gesture)


def add(session: Session, m: messages.Add, _: object) -> None:
    """Add a light before the camera, and select it."""
    edit, node = actions.add_light(
        session.scene,
        m.light,
        session.orbit.pose,
        min(session.orbit.distance, _LOOK_AHEAD * session.diagonal()),
    )
    session.history.make(edit)
    session.selected = node


def delete(session: Session, m: messages.Delete, _: object) -> None:
    """Take a node out."""
    node = session.node(m.node)
    session.history.make(actions.delete(session.scene, node))
    if session.selected is not None and session.selected not in session.scene:
        session.selected = None


def duplicate(session: Session, m: messages.Duplicate, _: object) -> None:
    """Place a copy of a node beside it, and select that."""
    shift = session.orbit.pose[:3, 0] * 0.1 * min(session.orbit.distance, session.diagonal())
    edit, node = actions.duplicate(session.scene, session.node(m.node), shift)
    session.history.make(edit)
    session.selected = node


def undo(session: Session, _m: messages.Undo, _: object) -> None:
    """Take the last edit back."""
    session.history.undo()
    _after_history(session)


def redo(session: Session, _m: messages.Redo, _: object) -> None:
    """Make it again."""
    session.history.redo()
    _after_history(session)


def _after_history(session: Session) -> None:
    if session.selected is not None and session.selected not in session.scene:
        session.selected = None


def setting(session: Session, m: messages.Setting, sender: object) -> None:
    """Give a setting another value."""
    if m.name in fields.NOT_LIVE:
        raise SettingsError(f"{m.name}: cannot be changed here")
    knob = knob_of(Settings, m.name)
    value: Any = getattr(session.begun, m.name) if m.value is None else convert(knob, m.value)
    changes: Any = {m.name: value}
    if m.name == "preset":
        kept = {f.name: getattr(session.settings, f.name) for f in dataclasses.fields(Settings)}
        changes |= {name: kept[name] for name in (*fields.NOT_LIVE, "exposure", "tonemap", "background")}
        new = Settings().replace(**changes)
    else:
        new = session.settings.replace(**changes)
    fields.granted(new)
    if value == "hold":
        session.draw.exposed()
    gesture = (sender, m.gesture) if m.gesture else None
    session.history.make(Edit(f"{m.name.replace('_', ' ')}", (Assign(session, "settings", new),), gesture))


def show(session: Session, m: messages.Show, _: object) -> None:
    """Show another view."""
    if m.view not in VIEWS:
        raise SettingsError(f"there is no view '{m.view}'{nearest(m.view, VIEWS)}")
    session.view = m.view


def play(session: Session, m: messages.Play, _: object) -> None:
    """Move along the time line."""
    if not session.scene.animations:
        raise SceneError("the scene has no animation")
    line = session.timeline
    if m.animation is not None:
        name = m.animation or None
        if name is not None and all(a.name != name for a in session.scene.animations):
            raise SceneError(f"no animation is called '{name}'")
        line = replace(TimeLine.of(session.scene, name), playing=line.playing, speed=line.speed)
    if m.speed is not None:
        line = replace(line, speed=m.speed)
    if m.playing is not None:
        line = replace(line, playing=m.playing)
    session.timeline = line if m.time is None else line.at(m.time)
    session.timed, session.inspected = True, None


QUIET = (messages.Inspect,)
"""The messages after which the picture is what it was."""

HANDLERS: dict[type[messages.Message], Callable[[Session, Any, object], None]] = {
    messages.Look: look,
    messages.Pan: pan,
    messages.Zoom: zoom,
    messages.Fly: fly,
    messages.Focus: focus,
    messages.FrameAll: frame_all,
    messages.UseCamera: use_camera,
    messages.Up: up,
    messages.Resize: resize,
    messages.Pick: pick,
    messages.Inspect: inspect,
    messages.Select: select,
    messages.Change: change,
    messages.Add: add,
    messages.Delete: delete,
    messages.Duplicate: duplicate,
    messages.Undo: undo,
    messages.Redo: redo,
    messages.Setting: setting,
    messages.Show: show,
    messages.Play: play,
}

EDITS = (messages.Change, messages.Add, messages.Delete, messages.Duplicate, messages.Undo, messages.Redo)
"""The messages that change the scene; others change how it is looked at."""

SAME_FRAME = (messages.Pick, messages.Select, messages.Show)
"""The messages after which the last frame is shown anew, with other marks or by another view of it."""
