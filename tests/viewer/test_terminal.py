"""The terminal: half blocks, keys, and a run on a pseudo terminal that is left as it was."""

import os
import re
import select
import subprocess
import sys
import time

import numpy as np
import pytest

from ispm.viewer.terminal import blocks, keys_in

pty = pytest.importorskip("pty", reason="this system has no pseudo terminals")
termios = pytest.importorskip("termios", reason="this system has no pseudo terminals")

COLOR = re.compile(r"\x1b\[([34]8);2;(\d+);(\d+);(\d+)m|\x1b\[0m|(▀)")


def pixels(text):
    """Read half blocks as a terminal does: (2 h, w, 3)."""
    rows = []
    for line in text.split("\r\n"):
        now, top, bottom = {"38": None, "48": None}, [], []
        assert COLOR.sub("", line) == ""
        for found in COLOR.finditer(line):
            if found[5]:
                top.append(now["38"])
                bottom.append(now["48"])
            elif found[1]:
                now[found[1]] = [int(v) for v in found.groups()[1:4]]
        rows += [top, bottom]
    return np.array(rows, np.uint8)


@pytest.mark.parametrize("high", [1, 256], ids=["even", "noise"])
def test_half_blocks_show_each_pixel(high):
    image = np.random.default_rng(5).integers(0, high, (6, 11, 3), dtype=np.uint8)
    np.testing.assert_array_equal(pixels(blocks(image)), image)


def test_an_even_picture_tells_its_colors_once_a_line():
    assert blocks(np.zeros((4, 50, 3), np.uint8)).count("\x1b[38") == 2


def test_keys_are_told_apart():
    assert keys_in("a+\x1b[A\x1bOBq") == ["a", "+", "\x1b[A", "\x1b[B", "q"]
    assert keys_in("\x1b") == ["\x1b"]
    assert keys_in("") == []


class Screen:
    """A pseudo terminal with a program in it."""

    def __init__(self, *line, columns=40, lines=13):
        self.here, there = pty.openpty()
        termios.tcsetwinsize(there, (lines, columns))
        self.before = termios.tcgetattr(there)
        environment = {k: v for k, v in os.environ.items() if k not in ("COLUMNS", "LINES", "DISPLAY")}
        pipes = dict(stdin=there, stdout=there, stderr=subprocess.PIPE, start_new_session=True)
        self.run = subprocess.Popen([sys.executable, *line], env=environment, **pipes)
        self.there, self.sent = there, b""

    @property
    def text(self):
        return self.sent.decode("utf-8", "ignore").replace("\r\r\n", "\r\n")  # it adds one itself

    def until(self, true, seconds=60.0):
        end = time.monotonic() + seconds
        while not true(self.text):
            assert time.monotonic() < end and self.run.poll() is None, self.text[-300:]
            if select.select([self.here], [], [], 0.1)[0]:
                self.sent += os.read(self.here, 65536)

    def ended(self, seconds=60.0):
        """Read on until the program ends; its exit status."""
        end = time.monotonic() + seconds
        while self.run.poll() is None or select.select([self.here], [], [], 0.1)[0]:
            assert time.monotonic() < end
            if select.select([self.here], [], [], 0.1)[0]:
                self.sent += os.read(self.here, 65536)
        return self.run.returncode

    def type(self, keys):
        os.write(self.here, keys.encode())

    def picture(self):
        """The last whole picture."""
        shown = [part for part in self.text.split("\x1b[H")[1:] if part.endswith("\x1b[K")]
        return pixels(shown[-1].rpartition("\r\n")[0])

    def pictures(self):
        return self.text.count("\x1b[K")


@pytest.fixture
def screen():
    settings = ["--photons", "500", "--preset", "fast"]
    made = Screen("-m", "ispm", "view", "cornell-box", "--terminal", *settings)
    yield made
    if made.run.poll() is None:
        made.run.kill()
    made.run.communicate()
    os.close(made.here)
    os.close(made.there)


@pytest.mark.gpu
def test_it_draws_orbits_and_leaves_the_terminal_as_it_was(screen):
    screen.until(lambda text: "at rest" in text)
    first = screen.picture()
    assert first.shape == (24, 40, 3)  # all lines but the last, two pixels to each
    assert np.ptp(first.astype(int), axis=(0, 1)).min() > 60
    assert first[:, :6, 0].mean() > 1.5 * first[:, :6, 1].mean()  # the red wall is on the left
    count = screen.pictures()
    screen.type("\x1b[C\x1b[C")
    screen.until(lambda text: screen.pictures() > count + 2)
    screen.until(lambda text: text.endswith("\x1b[K"))
    assert np.abs(screen.picture().astype(int) - first).mean() > 5.0
    screen.type("q")
    assert screen.ended() == 0
    assert screen.text.endswith("\x1b[0m\x1b[?25h\x1b[?1049l")
    assert termios.tcgetattr(screen.there) == screen.before


def test_without_a_terminal_it_says_so_in_one_line():
    line = [sys.executable, "-m", "ispm", "view", "cornell-box", "--terminal"]
    run = subprocess.run(line, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=60)
    assert (run.returncode, run.stdout) == (2, "")
    assert run.stderr == "ispm: --terminal: input and output are no terminal; use --web\n"
