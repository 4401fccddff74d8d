"""The live view in a notebook: a widget that shows the page in a cell, over the notebook's own connection."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import parse_qs

import anywidget
import traitlets

from ispm.errors import IspmError
from ispm.viewer.audience import MOST_IN_FLIGHT
from ispm.viewer.bundle import widget
from ispm.viewer.files import dropped, saved, screenshot
from ispm.viewer.messages import Ack, read
from ispm.viewer.packets import Packet, Rate, packed, told
from ispm.viewer.running import Running
from ispm.viewer.session import Picture, Session

_HEIGHT = 480  # CSS pixels of a cell
_FILES: dict[str, Callable[[Session], bytes]] = {"scene.glb": saved, "picture.png": screenshot}
_OK, _NOTHING, _REFUSED = 200, 204, 422  # as a server's


@dataclass(eq=False)
class _Looking:
    """One cell that shows the widget: what it has, and the pictures on the way to it."""

    has: dict[str, str] = field(default_factory=dict)
    number: int = 0
    flying: set[int] = field(default_factory=set)


class Widget(anywidget.AnyWidget):
    """Shows a session that runs in the cells of a notebook.

    height  CSS pixels
    """

    _esm = widget()
    height = traitlets.Int(_HEIGHT).tag(sync=True)

    def __init__(self, running: Running, **how: Any) -> None:
        super().__init__(**how)
        self._running, self._rate = running, Rate()
        self._looking: dict[str, _Looking] = {}
        self._packet: Packet | None = None
        self._state: dict[str, str] = {}
        self._lock = threading.RLock()  # pictures come in the drawing thread, messages in the notebook's
        self.on_msg(lambda _, content, buffers: self.hear(content, buffers))
        running.on_closing(self._ended)

    def hear(self, content: Any, buffers: Sequence[Any]) -> None:
        """Do what a cell asks for. content: as page/widget.js sends it."""
        if not isinstance(content, dict) or not isinstance(content.get("view"), str):
            return
        view, what = content["view"], content.get("what")
        with self._lock:
            if what == "open":
                self._looking[view] = _Looking()
                self._running.listen(self, self._show, self._tell)
                self._running.ask(self._tell)
                self._feed()
            elif view not in self._looking:
                pass
            elif what == "close":
                del self._looking[view]
                if not self._looking:
                    self._running.leave(self)
            elif what == "message":
                self._message(view, str(content.get("text", "")))
            elif what == "file":
                self._file(view, content, buffers)

    def _message(self, view: str, text: str) -> None:
        looking = self._looking[view]
        try:
            message = read(text)
        except IspmError as error:
            self._say(view, str(error))
            return
        if isinstance(message, Ack):
            looking.flying = {each for each in looking.flying if each > message.number}
            self._feed()
        elif not self._running.post(message, looking):
            self._say(view, "too much is asked for at once")

    def _file(self, view: str, content: dict[str, Any], buffers: Sequence[Any]) -> None:
        """Answer as the server does: what the scene is saved as, the picture, or a file that is dropped."""
        what, _, query = str(content.get("name", "")).partition("?")
        answer = {"view": view, "number": content.get("number")}

        def job(session: Session) -> None:
            try:
                if what == "scene" and buffers:
                    name = parse_qs(query).get("name", [""])[0]
                    session.open(dropped(bytes(buffers[0]), name), name)
                    self.send({**answer, "status": _NOTHING})
                else:
                    self.send({**answer, "status": _OK}, [_FILES[what](session)])
            except (IspmError, KeyError) as error:
                line = str(error) if isinstance(error, IspmError) else "there is no such file"
                self.send({**answer, "status": _REFUSED}, [line.encode()])

        self._running.ask(job)

    def _show(self, picture: Picture, session: Session) -> None:
        packet = packed(picture, session, self._rate.now())
        with self._lock:
            self._packet = packet
        self._tell(session)

    def _tell(self, session: Session) -> None:
        with self._lock:
            self._state = told(session)
            self._feed()

    def _feed(self) -> None:
        """Send each cell what it lacks, as far as it shows what it was sent."""
        for view, looking in self._looking.items():
            for name, text in self._state.items():
                if looking.has.get(name) != text:
                    looking.has[name] = text
                    self.send({"view": view, "text": text})
            packet = self._packet
            if packet and packet.number > looking.number and len(looking.flying) < MOST_IN_FLIGHT:
                looking.number = packet.number
                looking.flying.add(packet.number)
                self.send({"view": view}, [packet.data])

    def _say(self, view: str, line: str) -> None:
        import msgspec

        self.send({"view": view, "text": msgspec.json.encode({"part": "line", "value": line[:500]}).decode()})

    def _ended(self) -> None:
        with self._lock:
            for view in self._looking:
                self.send({"view": view, "end": True})
            self._looking.clear()
