"""The page and what it asks for, as an ASGI application: who is not let in gets nothing."""

from __future__ import annotations

import asyncio
import contextlib
import tempfile
from collections.abc import Awaitable, Callable, Mapping, MutableMapping
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs

from ispm.errors import IspmError
from ispm.viewer.access import Access
from ispm.viewer.audience import MOST_CLIENTS, Audience, Client
from ispm.viewer.files import MOST_UPLOADED, ending_of, loaded, saved, screenshot
from ispm.viewer.messages import Ack, read
from ispm.viewer.running import Running
from ispm.viewer.session import Session

Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send = Callable[[Mapping[str, Any]], Awaitable[None]]

_PAGE = Path(__file__).parent / "page"
_KINDS = {".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml"}
_FILES = {path.name: _KINDS[path.suffix] for path in sorted(_PAGE.iterdir())}
_HEADERS = {
    "content-security-policy": "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; "
    "img-src 'self' blob:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "cache-control": "no-store",
}
_POLICY, _FULL = 1008, 1013  # codes that a socket is closed with


class Site:
    """Serves one session.

    spent  called when a token was used, so that another address can be told
    watch  called with whether anyone looks, as the first comes and the last goes
    """

    def __init__(
        self, running: Running, access: Access, spent: Callable[[], None], watch: Callable[[bool], None]
    ) -> None:
        self.running, self.access, self.spent, self.watch = running, access, spent, watch
        self.audience = Audience()
        self._busy = asyncio.Lock()  # one file is read or written at a time

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request, or carry one socket."""
        if scope["type"] == "lifespan":
            return
        headers: dict[str, list[str]] = {}
        for name, value in scope["headers"]:
            headers.setdefault(name.decode("latin-1"), []).append(value.decode("latin-1"))
        what = (
            scope["path"].rsplit("/", 1)[1] if "/" in scope["path"] else ""
        )  # a proxy may put a path before it
        refused = self._refused(scope, headers)
        if scope["type"] == "websocket":
            if refused or what != "live":
                await _deny(scope, receive, send, *(refused or (404, "there is no such page")))
            else:
                await self._live(receive, send)
            return
        method = scope["method"]
        if (
            refused is None
            and what == ""
            and "token" in (query := parse_qs(scope["query_string"].decode("latin-1")))
        ):
            await self._enter(headers, query["token"][0], send)
        elif refused is not None:
            await _answer(send, refused[0], refused[1].encode())
        elif not self.access.knows(headers.get("cookie", [])):
            await _answer(send, 403, b"this address needs its token: open the one that ispm printed\n")
        elif method == "PUT" and what == "scene":
            await self._upload(scope, receive, send)
        elif method not in ("GET", "HEAD"):
            await _answer(send, 405, b"not here\n")
        else:
            await self._get(what, send)

    def _refused(self, scope: Scope, headers: Mapping[str, list[str]]) -> tuple[int, str] | None:
        """A status and a reason why a request is not even looked at; None: it is."""
        hosts, origins = headers.get("host", []), headers.get("origin", [])
        if len(hosts) != 1 or not self.access.is_host(hosts[0]):
            return 421, "this server does not go by that name\n"
        must = scope["type"] == "websocket" or scope["method"] not in ("GET", "HEAD")
        if (must or origins) and (len(origins) != 1 or not self.access.is_origin(origins[0], hosts[0])):
            return 403, "another page may not ask this server\n"
        if scope["type"] == "websocket" and not self.access.knows(headers.get("cookie", [])):
            return 403, "open the page first\n"
        return None

    async def _enter(self, headers: Mapping[str, list[str]], token: str, send: Send) -> None:
        """Exchange a token for the cookie; the address without it follows."""
        if self.access.knows(headers.get("cookie", [])):
            await _answer(send, 303, b"", {"location": "./"})
            return
        value = self.access.spend(token)
        if value is None:
            await _answer(
                send, 403, b"this token is wrong or was used: open the address that ispm printed last\n"
            )
            return
        self.spent()
        # without a path it is that of the page, also where a proxy puts one before it
        cookie = f"{self.access.cookie}={value}; HttpOnly; SameSite=Strict"
        cookie += "; Secure" * self.access.public.startswith("https:")
        await _answer(send, 303, b"", {"location": "./", "set-cookie": cookie})

    async def _get(self, what: str, send: Send) -> None:
        name = what or "index.html"
        if name in _FILES:
            await _answer(send, 200, (_PAGE / name).read_bytes(), {"content-type": _FILES[name]})
        elif name == "scene.glb":
            await self._made(send, saved, "model/gltf-binary", "scene.glb")
        elif name == "picture.png":
            await self._made(send, screenshot, "image/png", "picture.png")
        else:
            await _answer(send, 404, b"there is no such page\n")

    async def _made(self, send: Send, make: Callable[[Session], bytes], kind: str, name: str) -> None:
        """Answer with a file that the drawing thread makes."""
        async with self._busy:
            try:
                data = await asyncio.wrap_future(self.running.ask(make))
            except IspmError as error:
                await _answer(send, 409, f"{error}\n".encode())
                return
        about = {"content-type": kind, "content-disposition": f'attachment; filename="{name}"'}
        await _answer(send, 200, data, about)

    async def _upload(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Take a file that was dropped on the page, and show it."""
        name = Path(parse_qs(scope["query_string"].decode("latin-1")).get("name", [""])[0]).name
        try:
            ending = ending_of(name)
        except IspmError as error:
            await _answer(send, 415, f"{error}\n".encode())
            return
        too_large = f"{name[:80]}: is larger than {MOST_UPLOADED >> 20} MiB\n".encode()
        length = dict(scope["headers"]).get(b"content-length", b"0")
        if not length.isdigit() or int(length) > MOST_UPLOADED:
            await _answer(send, 413, too_large, {"connection": "close"})
            return
        with tempfile.TemporaryDirectory(prefix="ispm-") as folder:
            path, size = Path(folder) / f"scene{ending}", 0
            with path.open("wb") as file:
                more = True
                while more:
                    event = await receive()
                    if event["type"] == "http.disconnect":
                        return
                    size += len(event.get("body", b""))
                    if size > MOST_UPLOADED:
                        await _answer(send, 413, too_large, {"connection": "close"})
                        return
                    file.write(event.get("body", b""))
                    more = event.get("more_body", False)
            async with self._busy:
                try:
                    scene = await asyncio.to_thread(loaded, path, Path(name).stem)
                    await asyncio.wrap_future(self.running.ask(lambda session: session.open(scene, name)))
                except IspmError as error:
                    await _answer(send, 422, f"{error}\n".replace(path.name, name[:80]).encode())
                    return
        await _answer(send, 204, b"")

    async def _live(self, receive: Receive, send: Send) -> None:
        """Carry one client's messages and pictures until it goes."""
        await receive()  # the request to connect
        await send({"type": "websocket.accept"})
        if len(self.audience.clients) >= MOST_CLIENTS:
            await send({"type": "websocket.close", "code": _FULL, "reason": f"{MOST_CLIENTS} look already"})
            return

        async def text(line: str) -> None:
            await send({"type": "websocket.send", "text": line})

        async def data(packet: bytes) -> None:
            await send({"type": "websocket.send", "bytes": packet})

        client = Client(text, data)
        self.audience.clients.add(client)
        self.watch(True)
        feeding = asyncio.create_task(self.audience.feed(client))
        client.wake.set()
        try:
            reason = await self._hear(client, receive)
            if reason:
                await send({"type": "websocket.close", "code": _POLICY, "reason": reason})
        finally:
            self.audience.clients.discard(client)
            if not self.audience.clients:
                self.watch(False)
            feeding.cancel()
            with contextlib.suppress(asyncio.CancelledError, Exception):
                await feeding

    async def _hear(self, client: Client, receive: Receive) -> str:
        """Take messages until the client goes; return why it is sent away, if it is."""
        while not client.fault:
            event = await receive()
            if event["type"] == "websocket.disconnect":
                return ""
            if not client.grants():
                continue
            try:
                message = read(event.get("text") or event.get("bytes") or b"")
            except IspmError as error:
                client.bad()
                client.lines.append(_line(str(error)))
                client.wake.set()
                continue
            if isinstance(message, Ack):
                client.shown(message.number)
            elif not self.running.post(message, client):
                client.lines.append(_line("too much is asked for at once"))
                client.wake.set()
        return client.fault


def _line(text: str) -> str:
    import msgspec

    return msgspec.json.encode({"part": "line", "value": text[:500]}).decode()


async def _answer(send: Send, status: int, body: bytes, more: Mapping[str, str] | None = None) -> None:
    headers = {"content-type": "text/plain; charset=utf-8", **_HEADERS, **(more or {})}
    headers["content-length"] = str(len(body))
    if status == 204:
        del headers["content-length"], headers["content-type"]
    raw = [(name.encode(), value.encode("latin-1")) for name, value in headers.items()]
    await send({"type": "http.response.start", "status": status, "headers": raw})
    await send({"type": "http.response.body", "body": body})


async def _deny(scope: Scope, receive: Receive, send: Send, status: int, reason: str) -> None:
    """Refuse a socket before it is one."""
    await receive()
    if "websocket.http.response" not in scope.get("extensions", {}):
        await send({"type": "websocket.close", "code": _POLICY})
        return
    headers = [(b"content-type", b"text/plain"), (b"content-length", str(len(reason)).encode())]
    await send({"type": "websocket.http.response.start", "status": status, "headers": headers})
    await send({"type": "websocket.http.response.body", "body": reason.encode()})
