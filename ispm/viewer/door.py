"""How long, and how many, connections may wait before they ask: who asks nothing holds no place."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING, Any

from uvicorn.protocols.http.h11_impl import H11Protocol

if TYPE_CHECKING:
    import h11

MOST_WAITING = 64  # connections whose request is not there; of more, the one that waits longest is closed
PATIENCE = 5.0  # s in which a request's head must be there, however it comes


def door() -> type[H11Protocol]:
    """Return what uvicorn makes for each connection of one server."""
    waiting: dict[Any, asyncio.TimerHandle] = {}  # in the order in which they came

    class Door(H11Protocol):
        def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
            super().connection_made(transport)
            self._wait()

        def on_response_complete(self) -> None:
            super().on_response_complete()
            self._wait()

        def data_received(self, data: bytes) -> None:
            super().data_received(data)
            if self.cycle is not None and not self.cycle.response_complete:
                self._forget()

        def handle_websocket_upgrade(self, event: h11.Request) -> None:
            self._forget()
            super().handle_websocket_upgrade(event)

        def connection_lost(self, exc: Exception | None) -> None:
            self._forget()
            super().connection_lost(exc)

        def _wait(self) -> None:
            self._forget()
            if self.transport.is_closing():
                return
            waiting[self] = self.loop.call_later(PATIENCE, self._send_away)
            if len(waiting) > MOST_WAITING:
                next(iter(waiting))._send_away()

        def _send_away(self) -> None:
            self._forget()
            self.transport.abort()

        def _forget(self) -> None:
            timer = waiting.pop(self, None)
            if timer is not None:
                timer.cancel()

    return Door
