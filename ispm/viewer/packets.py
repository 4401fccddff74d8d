"""Pictures and state as bytes, for whatever carries them to a page."""

from __future__ import annotations

import struct
import time
from dataclasses import dataclass

import msgspec

from ispm.viewer.describe import describe, header
from ispm.viewer.pictures import encoded
from ispm.viewer.session import Picture, Session

_SMOOTH = 0.8  # of the last rate in the one that is shown
_PAUSE = 1.0  # s after which a rate begins anew


@dataclass(frozen=True, eq=False)
class Packet:
    """A picture as it is sent.

    data  the header's length in 4 bytes, little end first, the header as JSON, a JPEG or PNG
    """

    number: int
    data: bytes


class Rate:
    """Pictures a second, smoothed."""

    def __init__(self) -> None:
        self._rate, self._before = 0.0, 0.0

    def now(self) -> float:
        """Count a picture; return pictures a second."""
        now = time.monotonic()
        rate = 1.0 / max(now - self._before, 1e-6)
        going = now - self._before < _PAUSE
        self._rate = _SMOOTH * self._rate + (1.0 - _SMOOTH) * rate if going else rate
        self._before = now
        return self._rate


def packed(picture: Picture, session: Session, rate: float) -> Packet:
    """Return a picture with its header. rate: pictures a second."""
    moving = picture.frame.stats.passes == 1 and not picture.still
    kind, data = encoded(picture.image, moving=moving, lossless=picture.still)
    about = msgspec.json.encode({"kind": kind, **header(session, picture, rate)})
    return Packet(picture.number, struct.pack("<I", len(about)) + about + data)


def told(session: Session) -> dict[str, str]:
    """Return what panels show, JSON by panel."""
    return {
        name: msgspec.json.encode({"part": name, "value": value}).decode()
        for name, value in describe(session).items()
    }
