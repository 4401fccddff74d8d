"""A server, in a thread of its own, that shows a session in browsers."""

from __future__ import annotations

import asyncio
import socket
import threading
from collections.abc import Callable
from typing import Any

from ispm.errors import IspmError, SettingsError
from ispm.viewer.access import Access, require_host
from ispm.viewer.messages import MOST_BYTES
from ispm.viewer.packets import Rate, packed, told
from ispm.viewer.running import Running
from ispm.viewer.session import Picture, Session

_SOON = 5.0  # s in which a server starts and ends
_HOW: dict[str, Any] = dict(
    log_config=None,
    access_log=False,
    lifespan="off",
    ws="websockets-sansio",
    ws_max_size=MOST_BYTES,
    ws_ping_interval=10.0,
    ws_ping_timeout=10.0,  # one that vanished is forgotten after both
    ws_per_message_deflate=False,
    proxy_headers=False,
    server_header=False,
    limit_concurrency=128,
    timeout_graceful_shutdown=1,
)


def require_web() -> None:
    """Raise IspmError where the packages of the extra are missing."""
    try:
        import uvicorn
        import websockets
    except ImportError:
        raise IspmError(
            "the page needs two more packages; in the checkout run: pip install '.[web]'"
        ) from None
    del uvicorn, websockets


class Server:
    """Shows a session that runs at an address.

    host, port    where it listens; port 0: any that is free
    allow_remote  whether others than this machine may reach it
    public        the address that browsers use where a proxy stands between
    spent         called, in the server's thread, when an address was used that was good for one browser
    Raises SettingsError for an address that is taken, or not allowed; IspmError without the extra `web`.
    """

    def __init__(
        self,
        running: Running,
        host: str = "127.0.0.1",
        port: int = 0,
        *,
        allow_remote: bool = False,
        public: str = "",
        spent: Callable[[], None] = lambda: None,
    ) -> None:
        require_web()
        require_host(host, allow_remote)
        self._socket = _listen(host, port)
        try:
            self.access = Access(host, self._socket.getsockname()[1], public)
        except SettingsError:
            self._socket.close()
            raise
        from uvicorn import Config
        from uvicorn import Server as Uvicorn

        from ispm.viewer.door import door
        from ispm.viewer.site import Site

        self._running = running
        self._site = Site(running, self.access, spent, self._watch)
        self._uvicorn = Uvicorn(Config(self._site, http=door(), **_HOW))
        self._rate = Rate()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._begun = threading.Event()
        self._thread = threading.Thread(target=self._run, name="ispm-server", daemon=True)
        self._thread.start()
        self._begun.wait(_SOON)
        running.on_closing(self.close)

    @property
    def clients(self) -> int:
        """How many look."""
        return len(self._site.audience.clients)

    def close(self) -> None:
        """Stop serving; sockets are closed."""
        self._running.leave(self)
        self._uvicorn.should_exit = True
        if threading.current_thread() is not self._thread:
            self._thread.join(_SOON)

    def _run(self) -> None:
        asyncio.run(self._serve())

    async def _serve(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._begun.set()
        await self._uvicorn.serve(sockets=[self._socket])

    def _watch(self, anyone: bool) -> None:
        """Have pictures drawn while anyone looks."""
        if anyone:
            self._running.listen(self, self._show, self._tell)
            self._running.ask(self._tell)
        else:
            self._running.leave(self)

    def _show(self, picture: Picture, session: Session) -> None:
        self._call(self._site.audience.show, packed(picture, session, self._rate.now()))
        self._tell(session)

    def _tell(self, session: Session) -> None:
        self._call(self._site.audience.tell, told(session))

    def _call(self, function: Callable[[Any], None], value: Any) -> None:
        assert self._loop is not None
        try:
            self._loop.call_soon_threadsafe(function, value)
        except RuntimeError:  # it is closed
            self._running.leave(self)


def _listen(host: str, port: int) -> socket.socket:
    """A socket that listens. Raises SettingsError where the address is taken or not this machine's."""
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        made = socket.socket(family, kind, protocol)
        made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        made.bind(address)
        made.listen(128)  # who comes before the loop runs waits
    except (OSError, OverflowError) as error:
        raise SettingsError(
            f"cannot listen at {host}, port {port}: {getattr(error, 'strerror', error)}"
        ) from None
    return made
