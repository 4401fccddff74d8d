"""The server, by real sockets: who gets in, what is bounded, and that no client can harm another."""

import http.client
import json
import socket
import struct
import threading
import time
from contextlib import ExitStack
from pathlib import Path

import pytest
from painting import CAMERA, Painting, boxes

import ispm
from ispm.errors import IspmError, SettingsError
from ispm.io.save import save
from ispm.settings import Settings
from ispm.viewer.audience import MOST_CLIENTS
from ispm.viewer.running import Running
from ispm.viewer.server import Server
from ispm.viewer.session import Session
from ispm.viewer.site import MOST_UPLOADED

websockets = pytest.importorskip("websockets", reason="needs the extra web")
pytest.importorskip("uvicorn", reason="needs the extra web")
from websockets.exceptions import ConnectionClosed, InvalidStatus  # noqa: E402
from websockets.sync.client import connect  # noqa: E402

from ispm.viewer.door import MOST_WAITING, PATIENCE  # noqa: E402


class Site:
    """A server of a session that draws without a device, and what a browser does with it."""

    def __init__(self, seconds=0.01, **how):
        self.painting = Painting(seconds)
        make = lambda: Session(boxes(), self.painting, Settings(size=(64, 32), preset="fast"), CAMERA)  # noqa: E731
        self.running = Running(make, fps=50.0).start()
        self.spent = 0
        self.server = Server(self.running, spent=self._spend, **how)
        self.port = self.server.access.port
        self.host = f"127.0.0.1:{self.port}"
        self.cookie = ""

    def _spend(self):
        self.spent += 1

    def enter(self):
        answer = self.get("/?" + self.server.access.url().partition("?")[2])
        assert answer.status == 303
        self.cookie = answer.headers["set-cookie"].partition(";")[0]
        return answer

    def get(self, path, method="GET", body=None, **headers):
        sent = {"Host": self.host, "Cookie": self.cookie, **{k.title(): v for k, v in headers.items()}}
        line = http.client.HTTPConnection("127.0.0.1", self.port, timeout=20)
        line.request(method, path, body, {k: v for k, v in sent.items() if v})
        answer = line.getresponse()
        answer.text = answer.read()
        line.close()
        return answer

    def live(self, origin=None, cookie=None, path="/live", **how):
        headers = {"Cookie": self.cookie if cookie is None else cookie}
        origin = f"http://{self.host}" if origin is None else origin
        return connect(
            f"ws://{self.host}{path}",
            origin=origin or None,
            additional_headers=headers,
            compression=None,
            **how,
        )


@pytest.fixture
def site():
    made = Site()
    yield made
    made.running.close()
    assert made.painting.closed


class Eye:
    """A client that takes what comes."""

    def __init__(self, socket_):
        self.socket, self.state, self.pictures, self.lines = socket_, {}, [], []

    def take(self, ack=True, timeout=10.0):
        data = self.socket.recv(timeout)
        if isinstance(data, str):
            told = json.loads(data)
            if told["part"] == "line":
                self.lines.append(told["value"])
            else:
                self.state[told["part"]] = told["value"]
            return None
        length = struct.unpack("<I", data[:4])[0]
        about = json.loads(data[4 : 4 + length])
        self.pictures.append((about, data[4 + length :]))
        if ack:
            self.send(type="ack", number=about["number"])
        return about

    def until(self, wanted, ack=True, seconds=20.0):
        end = time.monotonic() + seconds
        while not wanted():
            assert time.monotonic() < end, "it did not come"
            self.take(ack, end - time.monotonic())

    def still(self):
        self.until(lambda: self.pictures and self.pictures[-1][0]["still"])

    def send(self, **message):
        self.socket.send(json.dumps(message))


# -- who gets in -----------------------------------------------------------------------------------


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


@pytest.mark.parametrize(
    "path", ["/", "/app.js", "/style.css", "/scene.glb", "/picture.png", "/address", "/nothing"]
)
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


# -- pictures and messages -------------------------------------------------------------------------


def test_pictures_come_and_the_last_is_lossless(site):
    site.enter()
    with site.live() as line:
        eye = Eye(line)
        eye.still()
        about, data = eye.pictures[-1]
        assert about["kind"] == "image/png" and data.startswith(b"\x89PNG")
        assert eye.pictures[0][0]["kind"] == "image/jpeg" and eye.pictures[0][1].startswith(b"\xff\xd8")
        assert {"scene", "selection", "settings", "time", "inspected", "history", "about"} == set(eye.state)
        eye.send(type="look", right=0.2, down=0.1)
        count = len(eye.pictures)
        eye.until(lambda: len(eye.pictures) > count)
        assert eye.pictures[-1][0]["clip"] != about["clip"]


def test_the_state_survives_a_reload(site):
    site.enter()
    with site.live() as line:
        eye = Eye(line)
        eye.still()
        eye.send(type="select", node=eye.state["scene"]["rows"][1][0])
        eye.send(type="setting", name="photons", value=1234)
        eye.until(lambda: eye.state["history"]["undo"] == "photons")
    with site.live() as line:
        eye = Eye(line)
        eye.still()
        assert eye.state["selection"]["name"] == "right"
        assert {f["name"]: f["value"] for f in eye.state["settings"]["fields"]}["photons"] == 1234


def test_faults_are_told_in_one_line(site):
    site.enter()
    with site.live() as line:
        eye = Eye(line)
        eye.still()
        line.send("nonsense")
        eye.until(lambda: eye.lines)
        assert eye.lines[0].startswith("not a message")
        eye.send(type="setting", name="fotons", value=1)
        eye.until(lambda: "photons" in eye.state["about"]["line"])


def test_a_client_that_sends_nonsense_on_and_on_is_sent_away(site):
    site.enter()
    with site.live() as line, pytest.raises(ConnectionClosed) as error:
        eye = Eye(line)
        for _ in range(30):
            line.send("nonsense")
        eye.until(lambda: False, seconds=10)
    assert error.value.rcvd.code == 1008


def test_a_message_that_is_too_long_ends_its_socket_alone(site):
    site.enter()
    with site.live() as good, site.live() as bad:
        with pytest.raises(ConnectionClosed) as error:
            bad.send("x" * (1 << 20))
            Eye(bad).until(lambda: False, seconds=10)
        assert error.value.rcvd.code == 1009
        Eye(good).still()


def test_a_flood_is_refused_and_its_socket_closed_with_a_reason(site):
    site.enter()
    with site.live() as good, site.live(max_queue=None) as bad:
        began = time.monotonic()
        with pytest.raises(ConnectionClosed) as error:
            for k in range(20_000):
                bad.send('{"type": "look", "right": 0.001, "down": 0}')
                if k % 10 == 9:
                    time.sleep(0.01)  # about 1,000 a second
        assert error.value.rcvd.code == 1008
        assert "300 messages a second" in error.value.rcvd.reason
        assert time.monotonic() - began < 10.0
        eye = Eye(good)
        eye.still()
        eye.send(type="select", node=eye.state["scene"]["rows"][0][0])
        eye.until(lambda: eye.state["selection"]["node"])


def test_what_a_mouse_sends_is_never_refused(site):
    site.enter()
    with site.live() as line:
        eye = Eye(line)
        for _ in range(240):  # a fast mouse, for two seconds
            eye.send(type="look", right=0.01, down=0.0)
            time.sleep(1 / 120)
        eye.still()
        assert site.running.session.orbit.eye[0] != 0.0
        turned = site.running.session.orbit
        assert eye.lines == []
    # all of it was added up: 2.4 rad about the origin, 5 m off
    assert turned.eye[2] == pytest.approx(5 * -0.737393715541245, abs=1e-6)


def test_no_client_can_ask_for_a_picture_beyond_limits(site):
    site.enter()
    with site.live() as line:
        eye = Eye(line)
        eye.still()
        eye.send(type="resize", width=1, height=-40000)
        eye.until(lambda: eye.state["about"]["size"] == [16, 16])
        eye.still()


def test_a_client_that_acknowledges_nothing_gets_two_pictures_and_starves_no_one(site):
    site.enter()
    with site.live() as quick, site.live() as slow:
        fast, idle = Eye(quick), Eye(slow)
        fast.still()
        for _ in range(10):
            fast.send(type="look", right=0.1, down=0.0)
            count = len(fast.pictures)
            fast.until(lambda count=count: len(fast.pictures) > count)
        with pytest.raises(TimeoutError):
            while True:
                idle.take(ack=False, timeout=0.5)
        assert len(idle.pictures) == 2
        assert len(fast.pictures) > 10
        idle.send(type="ack", number=idle.pictures[-1][0]["number"])
        idle.still()  # and then the last at once
        assert idle.pictures[2][0]["number"] >= fast.pictures[-1][0]["number"]


def test_one_that_reads_nothing_starves_no_one(site):
    site.enter()
    with site.live() as quick, site.live(max_size=None, max_queue=1) as stuck:
        stuck.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        fast = Eye(quick)
        fast.still()
        for _ in range(20):
            fast.send(type="look", right=0.1, down=0.0)
            count = len(fast.pictures)
            fast.until(lambda count=count: len(fast.pictures) > count, seconds=5)
        stuck.socket.shutdown(socket.SHUT_RDWR)


def test_one_that_vanishes_leaves_nothing(site):
    site.enter()
    with site.live() as line:
        eye = Eye(line)
        eye.still()
        with site.live() as gone:
            Eye(gone).still()
            assert site.server.clients == 2
            gone.socket.shutdown(socket.SHUT_RDWR)  # in mid-stream, without a word
        end = time.monotonic() + 10
        while site.server.clients != 1:
            assert time.monotonic() < end
            time.sleep(0.02)
        eye.send(type="look", right=0.1, down=0.0)
        count = len(eye.pictures)
        eye.until(lambda: len(eye.pictures) > count)
    end = time.monotonic() + 10
    while site.server.clients or site.running.listened:
        assert time.monotonic() < end
        time.sleep(0.02)
    drawn = len(site.painting.drawn)
    site.running.session.touch()
    time.sleep(0.3)
    assert len(site.painting.drawn) == drawn  # nothing is drawn for nobody


def test_clients_are_bounded(site):
    site.enter()
    with ExitStack() as others:
        lines = [others.enter_context(site.live()) for _ in range(MOST_CLIENTS)]
        with site.live() as more, pytest.raises(ConnectionClosed) as error:
            Eye(more).until(lambda: False, seconds=5)
        assert error.value.rcvd.code == 1013
        lines[0].close()
        end = time.monotonic() + 10
        while site.server.clients == MOST_CLIENTS:
            assert time.monotonic() < end
            time.sleep(0.02)
        with site.live() as line:
            Eye(line).still()


def test_a_better_picture_waits_for_a_drag_that_is_about_to_begin(site):
    site.enter()
    with site.live() as line:
        eye = Eye(line)
        eye.still()
        eye.send(type="look", right=0.1, down=0.0)
        for _ in range(4):
            eye.send(type="hold")
            time.sleep(0.2)
        assert site.painting.settled == 0
        eye.until(lambda: eye.pictures[-1][0]["still"] and site.painting.settled == 3)


def closed(line, seconds):
    """Whether the server ends a connection in time; what it answers is read."""
    line.settimeout(seconds)
    try:
        while line.recv(1000):
            pass
    except TimeoutError:
        return False
    except OSError:
        pass
    return True


def test_strangers_who_ask_nothing_hold_no_place(site):
    site.enter()
    with ExitStack() as ends:
        lines = [
            ends.enter_context(socket.create_connection(("127.0.0.1", site.port)))
            for _ in range(3 * MOST_WAITING)
        ]
        began = time.monotonic()
        assert site.get("/").status == 200
        with site.live() as line:
            Eye(line).still()
        assert time.monotonic() - began < PATIENCE  # no one had to wait until they gave up
        assert all(closed(line, 2.0) for line in lines[:MOST_WAITING])


@pytest.mark.parametrize("before", [b"", b"GET / HTTP/1.1\r\nHost: x\r\n\r\n"])
def test_a_head_that_trickles_in_is_not_waited_for(site, monkeypatch, before):
    monkeypatch.setattr("ispm.viewer.door.PATIENCE", 0.5)
    with socket.create_connection(("127.0.0.1", site.port)) as line:
        line.sendall(before)
        began = time.monotonic()
        with pytest.raises(OSError):
            while time.monotonic() - began < 10.0:
                line.sendall(b"G" if time.monotonic() - began < 0.1 else b"x")
                time.sleep(0.1)
        assert time.monotonic() - began < 5.0


def test_a_refused_socket_is_closed(site):
    head = f"GET /live HTTP/1.1\r\nHost: {site.host}\r\nOrigin: http://{site.host}\r\nUpgrade: websocket\r\n"
    head += "Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
    head += "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n"
    with socket.create_connection(("127.0.0.1", site.port)) as line:
        line.sendall(head.encode())
        assert closed(line, 5.0)


def test_sockets_and_answers_that_take_long_are_waited_for(site, monkeypatch, tmp_path):
    monkeypatch.setattr("ispm.viewer.door.PATIENCE", 0.3)
    site.enter()
    with site.live() as line:
        eye = Eye(line)
        eye.still()
        time.sleep(1.0)
        eye.send(type="look", right=0.1, down=0.0)
        count = len(eye.pictures)
        eye.until(lambda: len(eye.pictures) > count)
        with site.running.editing():  # nothing is drawn, nor saved, meanwhile
            answers = []
            asking = threading.Thread(target=lambda: answers.append(site.get("/picture.png")))
            asking.start()
            time.sleep(1.0)
        asking.join(10)
    assert answers[0].text.startswith(b"\x89PNG")


# -- files -----------------------------------------------------------------------------------------


def test_the_edited_scene_and_the_picture_are_downloaded(site, tmp_path):
    site.enter()
    with site.live() as line:
        eye = Eye(line)
        eye.still()
        eye.send(
            type="change", what="light", node=eye.state["scene"]["rows"][2][0], field="strength", value=30
        )
        eye.until(lambda: eye.state["history"]["undo"])
    answer = site.get("/scene.glb")
    assert "attachment" in answer.headers["content-disposition"]
    (tmp_path / "a.glb").write_bytes(answer.text)
    assert ispm.load(tmp_path / "a.glb")["lamp"].light.intensity == (30.0, 30.0, 30.0)
    assert site.get("/picture.png").text.startswith(b"\x89PNG")


def test_a_file_is_dropped_and_shown(site, tmp_path):
    site.enter()
    scene = boxes()
    scene.remove("left")
    data = save(scene, tmp_path / "one.glb").read_bytes()
    own = {"origin": f"http://{site.host}"}
    with site.live() as line:
        eye = Eye(line)
        eye.still()
        assert site.get("/scene?name=my%20room.glb", "PUT", data, **own).status == 204
        eye.until(lambda: len(eye.state["scene"]["rows"]) == 2)
        eye.still()


@pytest.mark.parametrize(
    ("name", "data", "status"),
    [
        ("a.exe", b"x", 415),
        ("glb", b"x", 415),
        ("../../a.glb", b"nothing", 422),
        ("a.glb", b"", 422),
        ("a.obj", b"v 1", 422),
    ],
)
def test_a_file_that_cannot_be_used_is_refused_in_one_line(site, name, data, status):
    site.enter()
    answer = site.get(f"/scene?name={name}", "PUT", data, origin=f"http://{site.host}")
    assert answer.status == status
    assert answer.text.decode().strip().count("\n") == 0
    assert "/tmp" not in answer.text.decode()
    assert [n.name for n in site.running.session.scene.nodes] == ["left", "right", "lamp"]


def test_a_file_that_is_too_large_is_refused_before_it_is_read(site):
    site.enter()
    head = f"PUT /scene?name=a.glb HTTP/1.1\r\nHost: {site.host}\r\nOrigin: http://{site.host}\r\n"
    head += f"Cookie: {site.cookie}\r\n"
    with socket.create_connection(("127.0.0.1", site.port), timeout=20) as line:
        line.sendall((head + f"Content-Length: {MOST_UPLOADED + 1}\r\n\r\n").encode())
        assert b" 413 " in line.recv(200)


# -- programs --------------------------------------------------------------------------------------


def test_changes_of_the_scene_show_at_once_and_together(site):
    site.enter()
    with site.live() as line:
        eye = Eye(line)
        eye.still()
        lamp = site.running.session.scene["lamp"]
        lamp.translation = (1.0, 2.0, 0.5)  # without a word
        eye.until(
            lambda: eye.pictures[-1][0]["lights"] and eye.pictures[-1][0]["lights"][0][1:4] == [1.0, 2.0, 0.5]
        )
        with site.running.editing() as scene:
            drawn = len(site.painting.drawn)
            scene["left"].translation = (-2.0, 0.0, 0.0)
            time.sleep(0.2)
            assert len(site.painting.drawn) == drawn
        eye.still()


def test_a_viewer_that_closes_ends_its_sockets_and_refuses_more(site):
    site.enter()
    with site.live() as line:
        eye = Eye(line)
        eye.still()
        began = time.monotonic()
        site.running.close()
        assert time.monotonic() - began < 5.0
        with pytest.raises(ConnectionClosed):
            eye.until(lambda: False, seconds=5)
    with pytest.raises(OSError):
        site.get("/")
    with pytest.raises(IspmError, match="closed"):
        site.running.ask(lambda session: session).result()


def test_a_client_is_told_which_photons_light_a_place(site):
    site.enter()
    with site.live() as socket_:
        eye = Eye(socket_)
        eye.still()
        eye.send(type="inspect", x=0.36, y=0.5)
        eye.until(lambda: eye.state["inspected"]["point"] is not None)
        (path,) = eye.state["inspected"]["paths"]
        assert path["events"] == ["light", "diffuse", "stored"] and len(path["places"]) == 3
        eye.send(type="inspect", x=1.5, y=0.5)
        eye.until(lambda: eye.lines)
        assert eye.state["inspected"]["point"] is not None
        eye.send(type="inspect")
        eye.until(lambda: eye.state["inspected"]["point"] is None)
