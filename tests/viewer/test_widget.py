"""The widget of a notebook, by its messages, without a browser; and the page in one piece."""

import json
import shutil
import struct
import subprocess
import time

import pytest
from painting import CAMERA, Painting, boxes

import ispm
from ispm.io.save import save
from ispm.renderer import show
from ispm.settings import Settings
from ispm.viewer import viewer as module
from ispm.viewer.audience import MOST_IN_FLIGHT
from ispm.viewer.bundle import page, script, widget
from ispm.viewer.running import Running
from ispm.viewer.session import Session

pytest.importorskip("anywidget", reason="needs the extra notebook")
from ispm.viewer.widget import Widget


class Cell(Widget):
    """A widget, and what it sent to its cells."""

    def __init__(self, running):
        self.sent = []
        super().__init__(running)

    def send(self, content, buffers=None):
        self.sent.append((content, buffers))

    def says(self, view="a", buffers=(), **content):
        self.hear({"view": view, **content}, list(buffers))

    def message(self, view="a", **message):
        self.says(view, what="message", text=json.dumps(message))

    def parts(self, view="a"):
        """The state that a cell was told, by part."""
        told = [json.loads(c["text"]) for c, _ in self.sent if c["view"] == view and "text" in c]
        return {each["part"]: each["value"] for each in told}

    def pictures(self, view="a"):
        """The headers of the pictures that a cell was sent."""
        packets = [b[0] for c, b in self.sent if c["view"] == view and b and "status" not in c]
        return [json.loads(p[4 : 4 + struct.unpack_from("<I", p)[0]]) for p in packets]

    def shown(self, view="a"):
        """Say that the pictures so far were shown."""
        for each in self.pictures(view)[-MOST_IN_FLIGHT:]:
            self.message(view, type="ack", number=each["number"])


def until(true, seconds=20.0):
    end = time.monotonic() + seconds
    while not (found := true()):
        assert time.monotonic() < end, "it did not come"
        time.sleep(0.01)
    return found


@pytest.fixture
def painted():
    painting = Painting(0.002)
    made = lambda: Session(boxes(), painting, Settings(size=(64, 32), preset="fast"), CAMERA)  # noqa: E731
    running = Running(made, fps=50.0).start()
    yield running, painting
    running.close()


@pytest.fixture
def cell(painted):
    return Cell(painted[0])


def test_a_cell_that_opens_is_told_everything_and_sent_pictures(cell, painted):
    assert not painted[1].drawn  # for nobody
    cell.says(what="open")
    until(cell.pictures)
    parts = {"scene", "selection", "inspected", "settings", "time", "history", "about"}
    until(lambda: set(cell.parts()) == parts)
    assert cell.pictures()[0]["size"] == [64, 32]


def test_no_more_pictures_fly_than_are_shown_and_the_last_one_comes(cell):
    cell.says(what="open")
    for k in range(30):
        cell.message(type="look", right=0.01 * k, down=0.0)
        time.sleep(0.005)
    assert len(cell.pictures()) <= MOST_IN_FLIGHT
    until(lambda: cell.shown() or cell.pictures()[-1]["still"])


def test_messages_are_those_of_the_page(cell, painted):
    session = painted[0].session
    cell.says(what="open")
    until(cell.pictures)
    before = session.orbit.eye
    cell.message(type="look", right=0.5, down=0.0)
    until(lambda: (session.orbit.eye != before).any())
    cell.message(type="add", light="point")
    until(lambda: len(session.scene.nodes) == 4)
    cell.message(type="undo")
    until(lambda: len(session.scene.nodes) == 3)


@pytest.mark.parametrize(
    "text", ["", "{", '{"type": "format"}', '{"type": "look", "right": 1e9, "down": 0}', "x" * 70_000]
)
def test_what_is_no_message_is_told_in_one_line(cell, text):
    cell.says(what="open")
    cell.says(what="message", text=text)
    assert "not a message" in cell.parts()["line"] or "longer than" in cell.parts()["line"]


@pytest.mark.parametrize(
    "content", [None, 3, {}, {"view": 5, "what": "open"}, {"view": "b", "what": "close"}]
)
def test_what_comes_from_nobody_is_dropped(cell, content):
    cell.hear(content, [])
    assert not cell.sent


def test_each_of_two_cells_has_its_own_pictures_and_one_may_go(cell, painted):
    cell.says("a", what="open")
    cell.says("b", what="open")
    until(lambda: cell.pictures("a") and cell.pictures("b"))
    cell.says("a", what="close")
    gone = len(cell.pictures("a"))
    cell.message("b", type="look", right=0.5, down=0.0)
    until(lambda: cell.shown("b") or cell.pictures("b")[-1]["still"])
    assert len(cell.pictures("a")) == gone
    cell.says("b", what="close")
    assert not painted[0].listened


def test_files_are_answered_and_opened(cell, painted, tmp_path):
    cell.says(what="open")
    until(cell.pictures)
    for number, name in enumerate(["scene.glb", "picture.png", "nothing"]):
        cell.says(what="file", name=name, number=number)
    scene = ispm.Scene(name="other")
    scene.add(ispm.shapes.box(), name="alone")
    data = save(scene, tmp_path / "other.glb").read_bytes()
    cell.says(what="file", name="scene?name=other.glb", number=3, buffers=[memoryview(data)])
    cell.says(what="file", name="scene?name=other.txt", number=4, buffers=[b"x"])
    cell.says(what="file", name="scene?name=other.glb", number=5, buffers=[b"x"])
    until(lambda: sum("status" in c for c, _ in cell.sent) == 6)
    answers = {c["number"]: (c["status"], (b or [b""])[0]) for c, b in cell.sent if "status" in c}
    assert [answers[k][0] for k in range(6)] == [200, 200, 422, 204, 422, 422]
    assert answers[0][1][:4] == b"glTF"
    assert answers[1][1][1:4] == b"PNG"
    assert b"is none of" in answers[4][1]
    assert [n.name for n in painted[0].session.scene.nodes] == ["alone"]


def test_cells_are_told_when_it_closes(cell, painted):
    cell.says(what="open")
    until(cell.pictures)
    painted[0].close()
    assert cell.sent[-1][0] == {"view": "a", "end": True}


@pytest.mark.gpu
def test_view_is_a_widget_in_a_notebook_alone(monkeypatch, capsys):
    monkeypatch.setattr(module, "in_notebook", lambda: True)
    with ispm.view("cornell-box", Settings(size=(32, 18), preset="fast", photons=500)) as viewer:
        assert isinstance(viewer.widget, Widget)
        assert "application/vnd.jupyter.widget-view+json" in viewer._repr_mimebundle_()[0]
        assert viewer._display_() is viewer.widget
        with pytest.raises(ispm.IspmError, match="no address"):
            _ = viewer.url
    assert capsys.readouterr().out == ""


def test_marimo_is_asked_where_it_runs(monkeypatch):
    assert not show.in_marimo()
    running = type("marimo", (), {"running_in_notebook": staticmethod(lambda: True)})
    monkeypatch.setitem(show.sys.modules, "marimo", running)
    assert show.in_marimo()


# -- the page in one piece -----------------------------------------------------------------------------------


def test_the_bundle_has_each_module_once_before_those_that_import_it():
    text = script("app.js", {"link.js": "comm.js"})
    order = [text.index(f"const module_{name}_js = ") for name in ("link", "comm", "app")]
    assert order == sorted(order)
    assert text.count("const module_link_js = ") == 1
    assert "const { Link: Socket } = module_link_js;" in text
    assert "const { Link } = module_comm_js;" in text
    assert not [line for line in text.splitlines() if line.startswith(("import ", "export "))]


def test_the_page_in_one_piece_asks_nobody_for_files():
    text = page()
    assert "src=" not in text.partition("<script")[0]
    assert "stylesheet" not in text
    assert text.count("</script>") == 1


@pytest.mark.skipif(shutil.which("node") is None, reason="node is not installed")
def test_what_the_notebook_runs_is_a_module(tmp_path):
    for name, text in (("widget", widget()), ("page", script("app.js", {"link.js": "comm.js"}))):
        path = tmp_path / f"{name}.mjs"
        path.write_text(text, "utf-8")
        subprocess.run(["node", "--check", path], check=True, timeout=60)
