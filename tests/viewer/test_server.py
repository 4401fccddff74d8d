"""The server, by real sockets: what is bounded, and that no client can harm another."""

import socket
import threading
import time
from contextlib import ExitStack

import pytest

from ispm.errors import IspmError
from ispm.viewer.audience import MOST_CLIENTS
from ispm.viewer.messages import MOST_BYTES

websockets = pytest.importorskip("websockets", reason="needs the extra web")
pytest.importorskip("uvicorn", reason="needs the extra web")
from serving import Eye  # noqa: E402
from websockets.exceptions import ConnectionClosed  # noqa: E402

from ispm.viewer import running  # noqa: E402
from ispm.viewer.door import MOST_WAITING, PATIENCE  # noqa: E402


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
            bad.send("x" * (MOST_BYTES + 1))  # the rest of a longer one may reset the line before it is told
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


def test_a_better_picture_waits_for_a_drag_that_is_about_to_begin(site, monkeypatch):
    """For so long that no stall of the machine passes for it: it would come .15 s after the last message."""
    monkeypatch.setattr(running, "_HELD", 3.0)
    site.enter()
    with site.live() as line:
        eye = Eye(line)
        eye.still()
        eye.send(type="hold")
        eye.send(type="look", right=0.1, down=0.0)
        eye.until(lambda: site.painting.settled == 0)
        time.sleep(0.6)
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
