"""A real browser for tests and measurements of the page, found or skipped with a reason."""

import os
import shutil
import time
from contextlib import contextmanager

NAMES = ("chromium", "chromium-browser", "google-chrome")
_WATCH = """
window.faults = [];
addEventListener("securitypolicyviolation",
    (e) => faults.push(`policy: ${e.violatedDirective} ${e.blockedURI}`));
addEventListener("error", (e) => faults.push(`error: ${e.message}`));
addEventListener("unhandledrejection", (e) => faults.push(`rejection: ${e.reason}`));
"""


def found():
    """The browser's path; None where there is none."""
    return next((path for name in NAMES if (path := shutil.which(name))), None)


@contextmanager
def launched(playwright):
    """A browser of its own process."""
    root = hasattr(os, "geteuid") and os.geteuid() == 0
    options = ["--disable-gpu", *(["--no-sandbox"] if root else [])]
    browser = playwright.chromium.launch(executable_path=found(), args=options)
    try:
        yield browser
    finally:
        if browser.is_connected():
            browser.close()


class Tab:
    """A page that shows a view, and all that its browser complains of."""

    def __init__(self, browser, size=(640, 400)):
        self.context = browser.new_context(viewport={"width": size[0], "height": size[1]})
        self.context.add_init_script(_WATCH)
        self.page = self.context.new_page()
        self.console = []
        self.page.on("console", lambda line: self.console.append(line.text))
        self.page.on("pageerror", lambda error: self.console.append(str(error)))

    def open(self, url):
        self.page.goto(url)
        self.page.wait_for_selector("#picture[data-number]", state="attached", timeout=60_000)
        return self

    def still(self):
        """Wait for the picture at rest, as large as its place on the page."""
        fits = "document.getElementById('stage').clientWidth === document.getElementById('picture').width"
        self.until(lambda: self.page.evaluate(fits), 60.0)
        self.page.wait_for_selector('#picture[data-still="true"]', state="attached", timeout=60_000)

    def number(self):
        return int(self.page.get_attribute("#picture", "data-number"))

    def until(self, wanted, seconds=20.0):
        """Wait for something; the page's policy forbids what Playwright would wait with."""
        end = time.monotonic() + seconds
        while not wanted():
            assert time.monotonic() < end, "it did not come"
            self.page.wait_for_timeout(20)

    def center(self, selector):
        box = self.page.locator(selector).bounding_box()
        return box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"]

    def drag(self, start, by, steps=8):
        mouse = self.page.mouse
        mouse.move(*start)
        mouse.down()
        mouse.move(start[0] + by[0], start[1] + by[1], steps=steps)
        mouse.up()

    def faults(self):
        return self.console + self.page.evaluate("window.faults")
