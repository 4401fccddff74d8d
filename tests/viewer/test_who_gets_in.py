"""Who gets into the page of the live view, by real sockets."""

import socket
from pathlib import Path

import pytest

import ispm
from ispm.errors import SettingsError
from ispm.viewer.server import Server

websockets = pytest.importorskip("websockets", reason="needs the extra web")
pytest.importorskip("uvicorn", reason="needs the extra web")
from serving import Eye, Site  # noqa: E402
from websockets.exceptions import InvalidStatus  # noqa: E402
from websockets.sync.client import connect  # noqa: E402


def test_a_token_gives_a_strict_cookie_once(site):
    query = "/?" + site.server.access.url().partition("?")[2]
    answer = site.get(query)
    assert (answer.status, answer.headers["location"]) == (303, "./")
    cookie = answer.headers["set-cookie"]
    assert (
        "HttpOnly" in cookie
        and "SameSite=Strict" in cookie
        and "Path" not in cookie
        and "Domain" not in cookie
    )
    assert site.spent == 1
    again = site.get(query)
    assert again.status == 403 and "set-cookie" not in again.headers
    site.cookie = cookie.partition(";")[0]
    assert site.get("/").status == 200
    assert site.get(query).status == 303  # who is in already is sent on


@pytest.mark.parametrize("path", ["/", "/app.js", "/style.css", "/scene.glb", "/picture.png", "/nothing"])
def test_nothing_comes_without_the_cookie(site, path):
    assert site.get(path).status == 403
    assert site.get(path + "?token=wrong").status == 403
    site.cookie = f"{site.server.access.cookie}=wrong"
    assert site.get(path).status == 403


@pytest.mark.parametrize("host", ["evil.example", "evil.example:80", "", "127.0.0.1:1"])
def test_another_host_is_misdirected(site, host):
    site.enter()
    assert site.get("/", host=host or " ").status in ((400, 421) if not host else (421,))
    with (
        pytest.raises(InvalidStatus) as error,
        connect(
            f"ws://{site.host}/live",
            origin=f"http://{site.host}",
            additional_headers={"Cookie": site.cookie},
            user_agent_header=None,
            sock=_Renamed.to(site, host or "x"),
        ),
    ):
        pass
    assert error.value.response.status_code in (421, 400)


class _Renamed(socket.socket):
    """A socket that sends another Host header."""

    @classmethod
    def to(cls, site, host):
        made = cls(socket.AF_INET, socket.SOCK_STREAM)
        made.connect(("127.0.0.1", site.port))
        made.names = f"Host: {site.host}".encode(), f"Host: {host}".encode()
        return made

    def sendall(self, data, *flags):
        super().sendall(bytes(data).replace(*self.names), *flags)


@pytest.mark.parametrize("origin", ["http://evil.example", "null", "", "https://127.0.0.1"])
def test_pages_of_others_open_no_socket_and_change_nothing(site, origin):
    site.enter()
    with pytest.raises(InvalidStatus) as error, site.live(origin=origin):
        pass
    assert error.value.response.status_code == 403
    assert site.get("/scene?name=a.glb", "PUT", b"x", origin=origin).status == 403
    if origin:
        assert site.get("/", origin=origin).status == 403


def test_no_socket_without_the_cookie_or_elsewhere(site):
    site.enter()
    for cookie in ("", f"{site.server.access.cookie}=wrong"):
        with pytest.raises(InvalidStatus) as error, site.live(cookie=cookie):
            pass
        assert error.value.response.status_code == 403
    with pytest.raises(InvalidStatus) as error, site.live(path="/elsewhere"):
        pass
    assert error.value.response.status_code == 404


def test_pages_run_no_script_but_their_own_and_lie_in_no_frame(site):
    site.enter()
    page = site.get("/")
    policy = page.headers["content-security-policy"]
    assert "default-src 'none'" in policy and "frame-ancestors 'none'" in policy
    assert "unsafe" not in policy
    text = page.text.decode()
    assert " style=" not in text and "<style" not in text and "onclick" not in text
    assert all("src=" in tag for tag in text.split("<script")[1:])
    assert "http:" not in text and "https:" not in text and '="/' not in text  # all is near, below any path
    for name in sorted(path.name for path in (Path(ispm.__file__).parent / "viewer/page").glob("*.js")):
        answer = site.get(f"/{name}")
        assert answer.status == 200 and answer.headers["content-type"] == "text/javascript"
        assert answer.headers["x-content-type-options"] == "nosniff"
        assert b"innerHTML" not in answer.text and b"eval(" not in answer.text


@pytest.mark.parametrize(
    "path", ["/../server.py", "/%2e%2e/server.py", "/page/../../server.py", "/..%2fserver.py"]
)
def test_nothing_but_the_page_is_served(site, path):
    site.enter()
    assert site.get(path).status == 404


def test_other_methods_are_refused(site):
    site.enter()
    own = {"origin": f"http://{site.host}"}
    for method in ("POST", "DELETE", "OPTIONS", "PUT"):
        assert site.get("/", method, b"", **own).status == 405


def test_behind_a_proxy_with_a_path(site):
    site.running.close()
    proxied = Site(public="https://example.org/view/")
    try:
        assert proxied.server.access.url().startswith("https://example.org/view/?token=")
        token = proxied.server.access.url().partition("?")[2]
        answer = proxied.get(f"/view/?{token}", host="example.org")
        assert "Secure" in answer.headers["set-cookie"]
        proxied.cookie = answer.headers["set-cookie"].partition(";")[0]
        assert proxied.get("/view/app.js", host="example.org").status == 200  # the path kept
        assert proxied.get("/app.js").status == 200  # or taken off
        with proxied.live(origin="https://example.org", path="/view/live") as line:
            Eye(line).still()
    finally:
        proxied.running.close()


def test_addresses_that_cannot_be_used_are_told_in_one_line(site):
    with pytest.raises(SettingsError, match=r"cannot listen at 127\.0\.0\.1, port"):
        Server(site.running, port=site.port)
    with pytest.raises(SettingsError, match="--allow-remote"):
        Server(site.running, host="0.0.0.0")
