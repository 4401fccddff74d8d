"""How far passes are, on a terminal."""

import math
import os
import re
import signal
import subprocess
import sys

import pytest

from ispm.cli.passes import seconds_left
from ispm.settings import Settings

pty = pytest.importorskip("pty", reason="pseudo-terminals")
SMALL = ["render", "cornell-box", "--size", "64x36", "--photons", "1000", "-o", "a.png"]


def on_a_terminal(folder, *words, until=None):
    """Run the command with stderr on a terminal; return (exit code, stdout, what the terminal was sent).

    until  text after which to interrupt it
    """
    ours, theirs = pty.openpty()
    environment = dict(os.environ, TERM="xterm", COLUMNS="120", PYTHONPATH=os.pathsep.join(sys.path))
    command = [sys.executable, "-m", "ispm", *SMALL, *words]
    with subprocess.Popen(
        command, cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=theirs, text=True
    ) as process:
        os.close(theirs)
        sent = ""
        while part := _read(ours):
            sent += part
            if until and until in sent:
                process.send_signal(signal.SIGINT)
                until = None
        out, _ = process.communicate(timeout=60)
    os.close(ours)
    return process.returncode, out, sent


def _read(terminal):
    try:
        return os.read(terminal, 4096).decode()
    except OSError:  # nobody writes there any more
        return ""


def test_a_bar_tells_passes_error_and_time(tmp_path):
    code, out, sent = on_a_terminal(tmp_path, "--passes", "5")
    assert (code, out) == (0, "a.png\n")
    assert re.search(r"5 of 5 passes, error about \d+\.\d+%.*\b0 s left", sent)
    assert "\x1b[2K" in sent  # a line written over
    assert not re.search(r"^  [124] pass", sent, re.M)  # not the lines of a file as well


def test_quiet_has_no_bar(tmp_path):
    assert on_a_terminal(tmp_path, "--passes", "2", "--quiet") == (0, "a.png\n", "")


def test_an_interrupt_ends_the_bar_after_the_pass(tmp_path):
    code, out, sent = on_a_terminal(tmp_path, "--passes", "100k", until="2 of 100000 passes")
    assert (code, out) == (130, "a.png\n")
    assert re.search(r"a\.png is the mean of \d+ passes", sent) and "Traceback" not in sent
    assert sent.rstrip().endswith("interrupted") and "\x1b[?25h" in sent  # the cursor is back


def test_time_left_is_to_the_first_end():
    assert seconds_left(Settings(passes=10), 4, 2.0, 8.0) == 12.0
    assert seconds_left(Settings(passes=10, time_limit=15.0), 4, 2.0, 8.0) == 7.0
    assert seconds_left(Settings(time_limit=5.0), 4, 2.0, 8.0) == 0.0
    assert seconds_left(Settings(target_error=0.1), 4, 2.0, 8.0) == math.inf
