"""The live view in a terminal: two pixels to a character, as half blocks in 24-bit color."""

from __future__ import annotations

import os
import select
import shutil
import sys
from collections.abc import Callable
from typing import Any

import numpy as np

from ispm.errors import IspmError
from ispm.viewer import messages as m
from ispm.viewer.describe import describe
from ispm.viewer.messages import Message
from ispm.viewer.packets import Rate
from ispm.viewer.running import Running
from ispm.viewer.session import Picture, Session

_BEGIN, _END = "\x1b[?1049h\x1b[?25l\x1b[2J", "\x1b[0m\x1b[?25h\x1b[?1049l"  # another screen, no cursor
_HELP = "arrows orbit  + - zoom  w a s d e c fly  r home  f all  1-9 views  space plays  u undoes  q ends"
_TURN, _STEP = 0.15, 0.1  # radians, and parts of the distance to the pivot, for a key
_WAIT = 0.03  # s for a key, before pictures are looked at again
_KEYS: dict[str, Message] = {
    "\x1b[A": m.Look(0.0, -_TURN),
    "\x1b[B": m.Look(0.0, _TURN),
    "\x1b[C": m.Look(_TURN, 0.0),
    "\x1b[D": m.Look(-_TURN, 0.0),
    "+": m.Zoom(0.25),
    "=": m.Zoom(0.25),
    "-": m.Zoom(-0.25),
    "w": m.Fly(0.0, 0.0, _STEP),
    "s": m.Fly(0.0, 0.0, -_STEP),
    "d": m.Fly(_STEP, 0.0, 0.0),
    "a": m.Fly(-_STEP, 0.0, 0.0),
    "e": m.Fly(0.0, _STEP, 0.0),
    "c": m.Fly(0.0, -_STEP, 0.0),
    "r": m.UseCamera(),
    "f": m.FrameAll(),
    "u": m.Undo(),
}


def require_terminal() -> None:
    """Raise IspmError where input and output are no terminal that can be drawn on."""
    if sys.platform == "win32":
        raise IspmError("--terminal: works on Linux and macOS alone; use --web")
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        raise IspmError("--terminal: input and output are no terminal; use --web")


def blocks(image: np.ndarray) -> str:
    """Return (2 h, w, 3) uint8 as h lines of w half blocks, the upper pixel before the lower one.

    Colors are told where they change alone.
    """
    lines = []
    for top, bottom in zip(image[::2].tolist(), image[1::2].tolist(), strict=True):
        line, before, behind = [], None, None
        for upper, lower in zip(top, bottom, strict=True):
            if upper != before:
                line.append("\x1b[38;2;{};{};{}m".format(*upper))
            if lower != behind:
                line.append("\x1b[48;2;{};{};{}m".format(*lower))
            line.append("▀")
            before, behind = upper, lower
        lines.append("".join(line) + "\x1b[0m")
    return "\r\n".join(lines)


def keys_in(text: str) -> list[str]:
    """Return the keys in what a terminal sent: characters, and arrows as it names them."""
    keys = []
    while text:
        length = 3 if text[:2] in ("\x1b[", "\x1bO") else 1
        key, text = text[:length], text[length:]
        keys.append("\x1b[" + key[2:] if length == 3 else key)  # either of two ways to name an arrow
    return keys


class Terminal:
    """Shows a session that runs in the terminal that the program has. Raises IspmError where it has none."""

    def __init__(self, running: Running) -> None:
        require_terminal()
        self._running, self._rate = running, Rate()
        self._latest: tuple[Picture, str] | None = None  # set by the drawing thread
        self._line = ""
        self._size = (0, 0)

    def run(self, asked: Callable[[], bool] = lambda: False) -> None:
        """Draw until `q`, until the session ends, or `asked` says so; the terminal is then as before."""
        import termios
        import tty

        inside, outside = sys.stdin.fileno(), sys.stdout.fileno()
        before = termios.tcgetattr(inside)
        try:
            tty.setcbreak(inside)
            _write(outside, _BEGIN)
            self._running.listen(self, self._show, self._tell)
            while not (asked() or self._running.closed):
                self._measure()
                self._draw(outside)
                if select.select([inside], [], [], _WAIT)[0]:
                    sent = os.read(inside, 1024)
                    keys = keys_in(sent.decode("utf-8", "ignore"))
                    if not sent or "q" in keys:
                        break
                    for key in keys:
                        self._key(key)
        finally:
            self._running.leave(self)
            _write(outside, _END)
            termios.tcsetattr(inside, termios.TCSADRAIN, before)

    def _show(self, picture: Picture, session: Session) -> None:
        rate = "at rest" if picture.still else f"{self._rate.now():.1f} fps"
        self._latest = picture, f"{rate}  {picture.frame.stats.total_ms:.0f} ms"
        self._tell(session)

    def _tell(self, session: Session) -> None:
        self._line = session.line

    def _measure(self) -> None:
        """Ask for pictures of the terminal's size, but for the last line."""
        columns, lines = shutil.get_terminal_size()
        size = max(columns, 1), 2 * max(lines - 1, 1)
        if size != self._size:
            self._size = size
            self._running.post(m.Resize(*size), self)

    def _draw(self, outside: int) -> None:
        from PIL import Image

        latest, self._latest = self._latest, None
        if latest is None:
            return
        picture, about = latest
        image = Image.fromarray(picture.image)
        if image.size != self._size:
            image = image.resize(self._size, Image.Resampling.BOX)
        line = (self._line or f"{about}  {_HELP}")[: self._size[0] - 1]
        _write(outside, f"\x1b[H{blocks(np.asarray(image))}\r\n{line}\x1b[K")

    def _key(self, key: str) -> None:
        if key.isdigit() and key != "0":
            self._ask(lambda state: m.Show(state["settings"]["views"][int(key) - 1]))
        elif key == " ":
            self._ask(lambda state: m.Play(playing=not state["time"]["playing"]))
        elif key in _KEYS:
            self._running.post(_KEYS[key], self)

    def _ask(self, make: Callable[[dict[str, dict[str, Any]]], Message]) -> None:
        """Post a message that depends on the state."""
        self._running.ask(lambda session: self._running.post(make(describe(session)), self))


def _write(outside: int, text: str) -> None:
    data = text.encode()
    while data:
        data = data[os.write(outside, data) :]
