"""What canvases tell a session, defined once: kinds, fields, their ranges, and how they merge.

Places in the picture are parts of its width and height from the top left; angles radians; lengths metres.
"""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec
from msgspec import Meta, Struct

from ispm.errors import IspmError

MOST_BYTES = 64 * 1024
LEAST_SIDE, MOST_SIDE = 16, 2048  # pixels of the picture

Part = Annotated[float, Meta(ge=0.0, le=1.0)]
Turn = Annotated[float, Meta(ge=-100.0, le=100.0)]
Length = Annotated[float, Meta(ge=-1e12, le=1e12)]
Count = Annotated[int, Meta(ge=0, le=2**53)]
Word = Annotated[str, Meta(max_length=200)]
Numbers = Annotated[list[Annotated[float, Meta(ge=-1e18, le=1e18)]], Meta(max_length=16)]


class Message(Struct, frozen=True, forbid_unknown_fields=True, tag_field="type"):
    """What all have in common: nothing but how they are tagged."""


class Look(Message, frozen=True, tag="look"):
    """Turn the camera: about its pivot, or where it stands."""

    right: Turn
    down: Turn
    how: Literal["orbit", "turn"] = "orbit"


class Pan(Message, frozen=True, tag="pan"):
    """Move what is seen by parts of the picture's height."""

    right: Turn
    up: Turn


class Zoom(Message, frozen=True, tag="zoom"):
    """Go nearer, by powers of 2."""

    steps: Turn


class Fly(Message, frozen=True, tag="fly"):
    """Move the eye, in parts of its distance from the pivot."""

    right: Turn
    up: Turn
    ahead: Turn


class Focus(Message, frozen=True, tag="focus"):
    """Look at what a place in the picture shows."""

    x: Part
    y: Part


class FrameAll(Message, frozen=True, tag="frame"):
    """See all of the scene, or of one node."""

    node: Count | None = None


class UseCamera(Message, frozen=True, tag="camera"):
    """Look through one of the scene's cameras; None: as at the beginning."""

    index: Count | None = None


class Up(Message, frozen=True, tag="up"):
    """Take another axis as upright."""

    axis: Literal["x", "y", "z"]


class Resize(Message, frozen=True, tag="resize"):
    """Ask for a picture of this size; sides are brought within LEAST_SIDE and MOST_SIDE."""

    width: Annotated[int, Meta(ge=-(2**31), le=2**31)]
    height: Annotated[int, Meta(ge=-(2**31), le=2**31)]


class Pick(Message, frozen=True, tag="pick"):
    """Select what a place in the picture shows."""

    x: Part
    y: Part


class Inspect(Message, frozen=True, tag="inspect"):
    """Show the photons that light a place in the picture; None: no more."""

    x: Part | None = None
    y: Part | None = None


class Select(Message, frozen=True, tag="select"):
    """Select a node by its number, or nothing."""

    node: Count | None


class Change(Message, frozen=True, tag="change"):
    """Give a field of a node, of its light or of one of its materials another value.

    gesture  the same for all steps of one drag, which is undone at once
    """

    what: Literal["node", "light", "material"]
    node: Count
    field: Word
    value: float | bool | Word | Numbers
    part: Count = 0
    gesture: Count = 0


class Add(Message, frozen=True, tag="add"):
    """Add a light, before the camera."""

    light: Literal["point", "spot", "directional", "rect", "disk", "sphere"]


class Delete(Message, frozen=True, tag="delete"):
    """Take a node out, with all below it."""

    node: Count


class Duplicate(Message, frozen=True, tag="duplicate"):
    """Place a copy of a node beside it."""

    node: Count


class Undo(Message, frozen=True, tag="undo"):
    """Take the last edit back."""


class Redo(Message, frozen=True, tag="redo"):
    """Make the edit again that was taken back last."""


class Setting(Message, frozen=True, tag="setting"):
    """Give one of the settings another value; None: as it was at the beginning. `gesture` as of Change."""

    name: Word
    value: float | bool | Word | Numbers | None
    gesture: Count = 0


class Show(Message, frozen=True, tag="show"):
    """Show another view."""

    view: Word


class Play(Message, frozen=True, tag="play"):
    """The time line: what is not None changes."""

    playing: bool | None = None
    time: Annotated[float, Meta(ge=0.0, le=1e9)] | None = None
    speed: Annotated[float, Meta(ge=-100.0, le=100.0)] | None = None
    animation: Word | None = None  # "": all


class Hold(Message, frozen=True, tag="hold"):
    """Something is about to be dragged: for a moment, what stands still is not drawn better."""


class Ack(Message, frozen=True, tag="ack"):
    """A picture was shown: for what carries messages, which sends no more than are shown."""

    number: Count


ANY = (
    Ack
    | Hold
    | Look
    | Pan
    | Zoom
    | Fly
    | Focus
    | FrameAll
    | UseCamera
    | Up
    | Resize
    | Pick
    | Inspect
    | Select
    | Change
    | Add
    | Delete
    | Duplicate
    | Undo
    | Redo
    | Setting
    | Show
    | Play
)
_DECODER = msgspec.json.Decoder(ANY)


def read(data: bytes | str) -> Message:
    """Return the message in JSON. Raises IspmError in one line where it is none, or out of range."""
    if len(data) > MOST_BYTES:
        raise IspmError(f"a message of {len(data):,} bytes is longer than {MOST_BYTES:,}")
    try:
        message: Message = _DECODER.decode(data)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise IspmError(f"not a message: {error}") from None
    return message


def merged(first: Message, second: Message) -> Message | None:
    """Return the one message that does what two do in a row; None where there is none."""
    if isinstance(first, Look) and isinstance(second, Look) and first.how == second.how:
        return _within(Look, first.right + second.right, first.down + second.down, first.how)
    if isinstance(first, Pan) and isinstance(second, Pan):
        return _within(Pan, first.right + second.right, first.up + second.up)
    if isinstance(first, Zoom) and isinstance(second, Zoom):
        return _within(Zoom, first.steps + second.steps)
    if isinstance(first, Fly) and isinstance(second, Fly):
        return _within(Fly, first.right + second.right, first.up + second.up, first.ahead + second.ahead)
    if isinstance(first, Change) and isinstance(second, Change):
        return second if _aim(first) == _aim(second) and second.gesture else None
    if isinstance(first, Setting) and isinstance(second, Setting):
        return second if first.name == second.name and first.gesture == second.gesture != 0 else None
    if isinstance(first, Play) and isinstance(second, Play):
        return _overlaid(first, second)
    if type(first) is type(second) and isinstance(second, (Inspect, Resize, Select, Show, UseCamera)):
        return second
    return None


def _overlaid(first: Play, second: Play) -> Play:
    names = Play.__struct_fields__
    return Play(*(getattr(first if getattr(second, n) is None else second, n) for n in names))


def _aim(change: Change) -> tuple[object, ...]:
    return change.what, change.node, change.part, change.field, change.gesture


def _within(kind: type[Message], *values: float | str) -> Message | None:
    """A message of sums; None where one of them leaves the range of a message."""
    sums = [value for value in values if not isinstance(value, str)]
    return kind(*values) if max(map(abs, sums)) <= 100.0 else None
