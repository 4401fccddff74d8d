"""Those who look at a view: what each has seen, what it may ask for, and how fast."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field

from ispm.viewer.packets import Packet

MOST_CLIENTS = 16
MOST_IN_FLIGHT = 2  # pictures on the way to a client that it has not said to have shown
RATE = 300.0  # messages a second of one client; more are refused
_PATIENCE = 300  # refused messages after which a client is sent away
_MOST_BAD = 20  # messages that are none, likewise


@dataclass(eq=False)
class Client:
    """One who looks.

    send_text, send_bytes  to it; they wait until there is room
    """

    send_text: Callable[[str], Awaitable[None]]
    send_bytes: Callable[[bytes], Awaitable[None]]
    wake: asyncio.Event = field(default_factory=asyncio.Event)
    number: int = 0
    flying: set[int] = field(default_factory=set)
    has: dict[str, str] = field(default_factory=dict)
    lines: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._credit, self._at = RATE, time.monotonic()
        self._refused, self._bad = 0, 0

    def grants(self) -> bool:
        """Whether one message more may come now."""
        now = time.monotonic()
        self._credit = min(RATE, self._credit + RATE * (now - self._at))
        self._at = now
        if self._credit < 1.0:
            self._refused += 1
            return False
        self._credit -= 1.0
        return True

    def bad(self) -> None:
        """Count a message that is none."""
        self._bad += 1

    @property
    def fault(self) -> str:
        """Why it is to be sent away; empty: it may stay."""
        if self._refused > _PATIENCE:
            return f"more than {RATE:.0f} messages a second"
        return "too many messages that are none" if self._bad > _MOST_BAD else ""

    def shown(self, number: int) -> None:
        """Hear that a picture was shown, and so all before it."""
        self.flying = {each for each in self.flying if each > number}
        self.wake.set()


class Audience:
    """All who look, in the server's loop: each gets the latest picture and state when it has room."""

    def __init__(self) -> None:
        self.clients: set[Client] = set()
        self.packet: Packet | None = None
        self.state: dict[str, str] = {}

    def show(self, packet: Packet) -> None:
        """Have a picture sent to all."""
        self.packet = packet
        self._wake()

    def tell(self, state: dict[str, str]) -> None:
        """Have the parts of the state that a client lacks sent to it. state: JSON by name."""
        self.state = state
        self._wake()

    def _wake(self) -> None:
        for client in self.clients:
            client.wake.set()

    async def feed(self, client: Client) -> None:
        """Send a client what it lacks, until cancelled."""
        while True:
            await client.wake.wait()
            client.wake.clear()
            while client.lines:
                await client.send_text(client.lines.pop(0))
            for name, text in self.state.items():
                if client.has.get(name) != text:
                    client.has[name] = text
                    await client.send_text(text)
            packet = self.packet
            if packet is None or packet.number <= client.number or len(client.flying) >= MOST_IN_FLIGHT:
                continue
            client.number = packet.number
            client.flying.add(packet.number)
            await client.send_bytes(packet.data)
            client.wake.set()  # while it was sent, another may have come
