"""Who may look: a token that is good once, then a cookie; and whose pages may speak to the server."""

from __future__ import annotations

import hmac
import ipaddress
import secrets
from collections.abc import Iterable
from urllib.parse import SplitResult, urlsplit

from ispm.errors import SettingsError

_MOST_TOKENS = 16  # that wait to be used


def require_host(host: str, allow_remote: bool) -> None:
    """Raise SettingsError for an address that others reach, unless that is allowed."""
    if not allow_remote and not is_loopback(host):
        raise SettingsError(
            f"--host: {host} can be reached from other machines; add --allow-remote if that is meant"
        )


def is_loopback(host: str) -> bool:
    """Whether only this machine reaches an address."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


class Access:
    """The keys to one server, and the names that it goes by.

    host, port  where it listens
    public      the address that browsers use where a proxy stands between, as https://example.org/view/
    """

    def __init__(self, host: str, port: int, public: str = "") -> None:
        self.host, self.port, self.public = host, port, public
        self.cookie = f"ispm-{port}"  # browsers send cookies to all ports of a host
        self._session = secrets.token_urlsafe(32)
        self._tokens: list[str] = []
        self._hosts = {f"{name}:{port}" for name in ("127.0.0.1", "localhost", "[::1]", _bracketed(host))}
        self._any_address = not is_loopback(host)
        self._public = urlsplit(public)
        if public and not _is_base(self._public):
            raise SettingsError(f"--public-url: {public} is not an address such as https://example.org/view/")

    def url(self) -> str:
        """Return an address with a token that nobody has used."""
        token = secrets.token_urlsafe(32)
        self._tokens = [*self._tokens, token][-_MOST_TOKENS:]
        base = self.public.rstrip("/") if self.public else f"http://{self._shown()}:{self.port}"
        return f"{base}/?token={token}"

    def spend(self, token: str) -> str | None:
        """Return what the cookie must hold for a token, which is used up; None for a wrong one."""
        fits = [hmac.compare_digest(each.encode(), token.encode()) for each in self._tokens]
        if not any(fits):
            return None
        del self._tokens[fits.index(True)]
        return self._session

    def knows(self, cookies: Iterable[str]) -> bool:
        """Whether one of the cookies, as the headers hold them, is the session's."""
        for text in cookies:
            for each in text.split(";"):
                name, _, value = each.strip().partition("=")
                if name == self.cookie and hmac.compare_digest(value.encode(), self._session.encode()):
                    return True
        return False

    def is_host(self, host: str) -> bool:
        """Whether a Host header is one of this server's names: another's page may have had its name changed
        to this address."""
        own = host.lower() in self._hosts or (self._any_address and self._is_address(host))
        return own or self._is_public(host)

    def is_origin(self, origin: str, host: str) -> bool:
        """Whether an Origin header is of this server's own pages, got from the name in the Host header."""
        scheme, _, name = origin.lower().partition("://")
        if self._is_public(name):
            return scheme == self._public.scheme  # whatever the proxy calls this server
        return scheme == "http" and name == host.lower() and self.is_host(host)

    def _is_public(self, name: str) -> bool:
        """Whether it is the name that a proxy goes by."""
        return bool(self.public) and name.lower() == self._public.netloc.lower()

    def _is_address(self, host: str) -> bool:
        """Whether it is a bare IP address with this port: no name that could be changed."""
        name, _, port = host.rpartition(":")
        try:
            ipaddress.ip_address(name.strip("[]"))
        except ValueError:
            return False
        return port == str(self.port)

    def _shown(self) -> str:
        unspecified = self.host in ("0.0.0.0", "::")
        return "127.0.0.1" if unspecified else _bracketed(self.host)


def _is_base(parts: SplitResult) -> bool:
    """Whether pages can lie below an address."""
    return parts.scheme in ("http", "https") and bool(parts.netloc) and not (parts.query or parts.fragment)


def _bracketed(host: str) -> str:
    return f"[{host}]" if ":" in host else host
