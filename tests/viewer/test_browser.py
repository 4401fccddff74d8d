"""The page in a real browser: what it shows, what its mouse and keys do, and that it breaks no rule."""

import base64
import http.server
import io
import math
import threading
from contextlib import ExitStack, contextmanager

import chromium
import numpy as np
import pytest
from painting import CAMERA, Painting, boxes
from PIL import Image

import ispm
from ispm.renderer import Renderer
from ispm.settings import Settings
from ispm.viewer.drawing import STILL_PASSES
from ispm.viewer.running import Running, live
from ispm.viewer.session import Session

playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
pytest.importorskip("uvicorn", reason="needs the extra web")
pytestmark = pytest.mark.skipif(chromium.found() is None, reason="there is no Chromium")

from ispm.viewer.server import Server  # noqa: E402


class Colored(Painting):
    """Shows what is where: 60, 120, ... by instance, 0 elsewhere."""

    def view(self, frame, name):
        return np.repeat(60 * (frame.instance[..., None] + 1), 3, axis=2).astype(np.uint8)


class Site:
    """A session that draws without a device, served."""

    def __init__(self, seconds=0.005):
        make = lambda: Session(boxes(), Colored(seconds), Settings(size=(64, 32), preset="fast"), CAMERA)  # noqa: E731
        self.running = Running(make, fps=50.0).start()
        self.server = Server(self.running)

    @property
    def session(self):
        return self.running.session

    def url(self):
        return self.server.access.url()

    def asked(self, question):
        """What the drawing thread answers, between pictures."""
        return self.running.ask(question).result(10)


@pytest.fixture(scope="module")
def browser():
    with playwright.sync_playwright() as driver, chromium.launched(driver) as made:
        made.driver = driver
        yield made


@pytest.fixture
def site():
    made = Site()
    yield made
    made.running.close()


@pytest.fixture
def tab(browser, site):
    """A page that has shown the scene at rest, and has nothing to complain of at the end."""
    made = chromium.Tab(browser).open(site.url())
    made.still()
    yield made
    assert made.faults() == []
    made.context.close()


def pixels(tab):
    """The picture that the page shows, (h, w, 3) uint8."""
    data = tab.page.evaluate("document.getElementById('picture').toDataURL('image/png')")
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(data.partition(",")[2]))).convert("RGB"))


def place(tab, session, point):
    """Where a point in the world is on the screen, CSS pixels."""
    clip = session.picture.frame.camera["clip_from_world"] @ np.append(point, 1.0)
    box = tab.page.locator("#picture").bounding_box()
    x, y = 0.5 + 0.5 * clip[0] / clip[3], 0.5 - 0.5 * clip[1] / clip[3]
    return box["x"] + x * box["width"], box["y"] + y * box["height"]


# -- what it shows ---------------------------------------------------------------------------------


@contextmanager
def shown(browser, preset):
    """The pixels of Cornell's box at rest in the page, and the settings and camera that it was drawn by."""
    settings = Settings(preset=preset, size=(64, 64), photons=2000, exposure=0.0)
    with ExitStack() as ends:
        running = live(ispm.builtin("cornell-box"), settings)
        ends.callback(running.close)
        tab = chromium.Tab(browser, (200, 200))
        ends.callback(tab.context.close)
        tab.context.add_init_script(
            "for (const side of ['left', 'right']) localStorage.setItem(`ispm-no-${side}`, 'true');"
        )
        tab.open(Server(running).access.url())
        tab.still()
        assert tab.faults() == []
        session = running.session
        yield pixels(tab), session.settings, session.orbit.placed


def converged(settings, camera, seed):
    """The mean of as many passes as the page shows at rest, drawn without it."""
    with Renderer(ispm.builtin("cornell-box"), settings.replace(seed=seed), camera) as renderer:
        *_, frame = renderer.converge(STILL_PASSES)
        return np.asarray(frame.image[..., :3]).copy()


@pytest.mark.gpu
def test_the_picture_at_rest_is_the_one_that_is_drawn_without_the_page(browser):
    with shown(browser, "fast") as (seen, settings, camera):
        assert np.array_equal(seen, converged(settings, camera, settings.seed))


@pytest.mark.gpu
def test_a_live_picture_at_rest_is_as_near_to_it_as_one_of_another_seed(browser):
    with shown(browser, "live") as (seen, settings, camera):
        first, second = (converged(settings.replace(preset="fast"), camera, seed) for seed in (1, 2))
    rms = lambda a, b: math.sqrt(np.square(a.astype(float) - b).mean())  # noqa: E731
    # One mean and another of as many passes differ by what two seeds do; a tenth for what of the frame that
    # it began with is left in it, as in tests/live.
    assert max(rms(seen, first), rms(seen, second)) < 1.1 * rms(first, second) < 8.0


# -- mouse and keys --------------------------------------------------------------------------------


def test_a_drag_turns_the_camera_by_as_much_as_it_moved(site, tab):
    before, seen = site.asked(lambda session: session.orbit), pixels(tab)
    height = tab.page.locator("#picture").bounding_box()["height"]
    x, y = tab.center("#picture")
    tab.drag((x, y - 60), (40, 24))
    wanted = before.orbited(math.pi * 40 / height, math.pi * 24 / height).pose
    tab.until(lambda: np.allclose(site.asked(lambda session: session.orbit.pose), wanted, atol=1e-9))
    tab.until(lambda: not np.array_equal(pixels(tab), seen))
    assert site.asked(lambda session: session.selected) is None  # it was no click


def test_a_click_selects_what_it_shows(site, tab):
    for name, x in (("right", 1.0), ("left", -1.0)):
        tab.page.mouse.click(*place(tab, site.session, (x, 0.0, 0.5)))
        tab.page.wait_for_selector(f'.node.chosen .label[title="{name}"]')
        assert site.asked(lambda session: session.selected.name) == name
    tab.page.keyboard.press("Escape")
    tab.page.wait_for_selector(".node.chosen", state="detached")


def test_a_slider_changes_a_light_by_one_edit(site, tab):
    strength = lambda: site.asked(lambda session: session.scene["lamp"].light.intensity[0])  # noqa: E731
    tab.page.click('.node .label[title="lamp"]')
    slider = tab.page.locator('.row:has(span:text-is("intensity")) input[type=range]')
    slider.scroll_into_view_if_needed()
    box = slider.bounding_box()
    middle = box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"]
    tab.drag(middle, (0.25 * box["width"], 0))
    tab.until(lambda: strength() > 18.0)
    tab.page.wait_for_selector("#undo:not([disabled])")
    assert site.asked(lambda session: len(session.history.undos)) == 1
    tab.page.click("#undo")
    tab.until(lambda: strength() == 9.0)
    tab.page.wait_for_selector("#undo[disabled]", state="attached")


def test_a_handle_drags_a_light_and_keys_take_it_back_and_make_it_again(site, tab):
    where = lambda: site.asked(lambda session: session.scene["left"].translation)  # noqa: E731
    tab.page.mouse.click(*place(tab, site.session, (-1.0, 0.0, 0.5)))
    tab.page.wait_for_selector('.node.chosen .label[title="left"]')
    tab.still()
    tab.page.wait_for_timeout(100)
    tab.drag(place(tab, site.session, (-1.0, 0.0, 0.0)), (0, -50))
    tab.until(lambda: where()[1] > 0.3)
    tab.until(lambda: site.asked(lambda session: len(session.history.undos)) == 1)
    moved = where()
    assert abs(moved[0] + 1.0) < 1e-6 and abs(moved[2]) < 1e-6  # in the plane of the picture
    tab.page.keyboard.press("Control+z")
    tab.until(lambda: where() == (-1, 0, 0))
    tab.page.keyboard.press("Control+Shift+z")
    tab.until(lambda: where() == moved)


def test_a_click_on_a_handle_and_a_drag_back_leave_nothing_to_undo(site, tab):
    tab.page.mouse.click(*place(tab, site.session, (-1.0, 0.0, 0.5)))
    tab.page.wait_for_selector('.node.chosen .label[title="left"]')
    tab.still()
    tab.page.wait_for_timeout(100)
    x, y = place(tab, site.session, (-1.0, 0.0, 0.0))
    tab.page.mouse.click(x, y)
    mouse = tab.page.mouse
    mouse.move(x, y)
    mouse.down()
    mouse.move(x + 40, y - 20, steps=5)
    mouse.move(x, y, steps=5)
    mouse.up()
    tab.until(lambda: site.asked(lambda session: session.scene["left"].translation) == (-1, 0, 0))
    tab.until(lambda: site.asked(lambda session: session.history.undos) == [])


def test_photons_that_light_a_place_are_listed_and_drawn_until_the_scene_changes(site, tab):
    point = lambda: site.asked(lambda session: session.inspected and session.inspected.position)  # noqa: E731
    drawn = "document.getElementById('overlay').toDataURL()"
    before = tab.page.evaluate(drawn)
    tab.page.mouse.move(*place(tab, site.session, (-1.0, 0.0, 0.5)))
    tab.page.keyboard.press("i")
    rows = tab.page.locator(".ways tbody tr")
    tab.until(lambda: rows.count() == 1)
    assert rows.inner_text().split() == ["1", "diffuse", "1", "0.5"]
    listed = tab.page.evaluate(drawn)
    assert listed != before
    rows.hover()
    tab.until(lambda: tab.page.evaluate(drawn) != listed)
    first = point()
    tab.page.mouse.click(*place(tab, site.session, (1.0, 0.0, 0.5)))
    tab.until(lambda: point() is not None and point()[0] > first[0])
    assert site.asked(lambda session: session.selected) is None  # a click asks for light now
    with site.running.editing() as scene:
        scene["lamp"].translation = (0.0, 2.0, 0.0)
    tab.until(lambda: rows.count() == 0)
    assert tab.page.is_visible("#inspector")
    tab.page.keyboard.press("Escape")
    tab.page.wait_for_selector("#inspector", state="hidden")


# -- several, and strangers ------------------------------------------------------------------------


def test_a_browser_that_is_killed_in_mid_stream_leaves_the_other_its_pictures(site, tab, browser):
    with chromium.launched(browser.driver) as second:
        other = chromium.Tab(second).open(site.url())
        assert site.server.clients == 2
        x, y = other.center("#picture")
        other.page.mouse.move(x, y)
        other.page.mouse.down()
        other.page.mouse.move(x + 30, y, steps=5)
        before = tab.number()
        tab.until(lambda: tab.number() > before)  # one's drag is seen by both
        with pytest.raises(playwright.Error):
            second.new_browser_cdp_session().send("Browser.crash")
    tab.until(lambda: site.server.clients == 1, seconds=30)
    before = tab.number()
    tab.drag(tab.center("#picture"), (30, 0))
    tab.until(lambda: tab.number() > before + 1)
    tab.still()


def test_a_wrong_token_and_a_used_one_show_nothing(site, browser):
    used = site.url()
    chromium.Tab(browser).open(used).context.close()
    for url in (used, used[:-4] + "AAAA", used.partition("?")[0]):
        tab = chromium.Tab(browser)
        answer = tab.page.goto(url)
        assert answer.status == 403
        assert "token" in tab.page.inner_text("body")
        tab.context.close()


def test_another_page_of_this_machine_gets_nothing(site, tab):
    """Cookies go to all ports of a host: it is the Origin that tells pages apart."""

    class Stranger(http.server.BaseHTTPRequestHandler):
        def do_GET(self):
            self.send_response(200)
            self.send_header("content-type", "text/html")
            self.end_headers()

        def log_message(self, *_):
            pass

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Stranger) as other:
        threading.Thread(target=other.serve_forever, daemon=True).start()
        page = tab.context.new_page()
        page.goto(f"http://127.0.0.1:{other.server_port}/")
        host = f"127.0.0.1:{site.server.access.port}"
        outcome = page.evaluate(
            """async (host) => [
                await new Promise((done) => {
                    const line = new WebSocket(`ws://${host}/live`);
                    line.onopen = () => done("open"); line.onerror = () => done("refused"); }),
                await fetch(`http://${host}/scene.glb`, { credentials: "include" })
                    .then(() => "read", () => "refused"),
            ]""",
            host,
        )
        other.shutdown()
    assert outcome == ["refused", "refused"]
    assert site.server.clients == 1
