"""Opens a window on the display that there is, uses it, and prints what came of it; for test_window.

python in_window.py FOLDER: screenshots go there. The session draws without a renderer.
"""

import json
import sys
import threading
import time
from pathlib import Path

from painting import CAMERA, Painting, boxes
from PIL import ImageGrab

from ispm.settings import Settings
from ispm.viewer.running import Running
from ispm.viewer.session import Session
from ispm.viewer.window import Window


class Bright(Painting):
    """Paints what lies behind a pixel: nothing gray, objects in a color of their own."""

    def view(self, frame, name):
        image = super().view(frame, name)
        image[:] = 90
        for k, color in enumerate([(200, 60, 60), (60, 60, 200), (220, 220, 80)]):
            image[frame.instance == k] = color
        return image


class Hand:
    """What a user does: events, and looks at the screen."""

    def __init__(self, window, running, folder):
        self.window, self.running, self.folder, self.found = window, running, folder, {}

    def event(self, kind, x=0.0, y=0.0, button=0, **more):
        about = dict(button=button, buttons=(), modifiers=(), ntouches=0, touches={}, **more)
        self.window.canvas.submit_event(dict(event_type=kind, x=x, y=y, **about))
        time.sleep(0.15)

    def key(self, name):
        for kind in ("key_down", "key_up"):
            self.event(kind, key=name)

    def click(self, x, y):
        self.event("pointer_move", x, y)
        self.event("pointer_down", x, y, 1)
        self.event("pointer_up", x, y, 1)

    def drag(self, x, y, dx, dy):
        self.event("pointer_move", x, y)
        self.event("pointer_down", x, y, 1)
        self.until("the press is drawn", lambda: self.window._left <= 0)  # or moves merge with it
        for k in range(1, 6):
            self.event("pointer_move", x + dx * k / 5, y + dy * k / 5)
        self.event("pointer_up", x + dx, y + dy, 1)

    def until(self, what, true, seconds=60.0):
        end = time.monotonic() + seconds
        while not true():
            if time.monotonic() > end:
                raise TimeoutError(what)
            time.sleep(0.05)

    def still(self, size):
        """Wait for a picture of the stage at rest, and for the window to show it."""

        def rests():
            picture = self.running.session.picture
            return picture is not None and picture.still and picture.frame.settings.size == size

        self.until(f"a still picture of {size}", rests)
        self.until("that it is shown", lambda: self.window._latest is None and self.window._left <= 0)
        time.sleep(0.5)

    def look(self, name):
        ImageGrab.grab().save(self.folder / f"{name}.png")

    def inspect(self, session):
        """Ask twice for the light of a place, by the key and a click, look at what came, and leave."""
        inspector, told = self.window.inspector, []
        places = lambda: inspector.found["point"]  # noqa: E731
        at = lambda name: tuple(self.place(session.scene[name].translation))  # noqa: E731
        chosen = session.selected
        self.event("pointer_move", *at("right"))
        self.still((732, 726))
        self.look("before")
        self.event("pointer_move", *at("left"))
        self.key("i")
        self.until("the light of the place under the mouse", lambda: places() is not None)
        told.append(places())
        self.click(*at("right"))
        self.until("the light of another place", lambda: places() not in (None, told[0]))
        told.append(places())
        self.still((732, 726))
        self.look("inspected")
        self.found["told"], self.found["kept"] = told, session.selected is chosen
        self.found["place"] = self.place(told[1])
        self.found["way"] = [self.place(place) for place in inspector.found["paths"][0]["places"]]
        self.event("pointer_move", 1100.0, 145.0)  # the row of the only way
        self.until("a way chosen", lambda: inspector._chosen == 0)
        self.still((732, 726))
        self.look("chosen")
        self.event("pointer_move", 240.0, 420.0)
        self.key("Escape")
        self.until("an end", lambda: not inspector.on and session.inspected is None)
        self.still((732, 726))
        self.look("left")
        self.found["kept"] &= session.selected is chosen

    def place(self, point):
        """Where a point in the world is seen in the window."""
        about = self.window._about
        u, v, _, w = (
            sum(a * b for a, b in zip(about["clip"][4 * k : 4 * k + 4], [*point, 1.0], strict=True))
            for k in range(4)
        )
        return 232.0 + 732.0 * (0.5 + 0.5 * u / w), 42.0 + 726.0 * (0.5 - 0.5 * v / w)

    def use(self):
        session, canvas = self.running.session, self.window.canvas
        self.still((732, 726))  # 1280 x 800 without the panels
        self.look("opened")
        self.click(500.0, 400.0)
        self.until("a node selected", lambda: session.selected is not None)
        self.found["selected"] = session.selected.name
        self.until("handles", lambda: self.window._about["handle"] is not None)
        self.still((732, 726))
        self.look("selected")
        handle = self.window._about["handle"]["place"]
        before = session.selected.translation[0]
        (x, _), (far, _) = self.place(handle), self.place([handle[0] + 1.0, *handle[1:]])
        self.drag(x + 40.0, 42.0 + 363.0, 60.0, 0.0)  # along the axis that lies across the picture
        self.until("a node moved", lambda: session.selected.translation[0] != before)
        self.still((732, 726))
        self.found["moved"] = session.selected.translation[0] - before
        self.found["wanted"] = 60.0 / (far - x)
        self.found["undos"] = len(session.history.undos)
        self.event("pointer_move", 240.0, 420.0)
        self.drag(260.0, 100.0, 40.0, 0.0)
        self.until("an orbit", lambda: abs(session.orbit.eye[0]) > 0.01)
        self.inspect(session)
        self.key("?")
        self.until("help", lambda: self.window.panels.help)
        self.still((732, 726))
        self.look("help")
        self.key("?")
        self.key("]")
        self.still((1048, 726))
        canvas.set_logical_size(900, 600)
        self.still((668, 526))
        self.look("small")
        self.found["lines"] = [session.line, self.window.panels.line]
        canvas.close()


def main(folder):
    made = lambda: Session(boxes(), Bright(0.005), Settings(size=(64, 32), preset="fast"), CAMERA)  # noqa: E731
    running = Running(made, fps=50.0).start()
    window = Window(running)
    hand = Hand(window, running, Path(folder))

    def use():
        try:
            hand.use()
        except Exception as error:
            hand.found["error"] = repr(error)
            running.close()

    threading.Thread(target=use, daemon=True).start()
    window.run()
    hand.found["listened"] = running.listened
    running.close()
    print(json.dumps(hand.found))


if __name__ == "__main__":
    main(sys.argv[1])
