"""Files that the page of the live view gives and takes."""

import socket

import pytest
from painting import boxes

import ispm
from ispm.io.save import save
from ispm.viewer.site import MOST_UPLOADED

websockets = pytest.importorskip("websockets", reason="needs the extra web")
pytest.importorskip("uvicorn", reason="needs the extra web")
from serving import Eye  # noqa: E402


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
