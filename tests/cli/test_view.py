"""`ispm view`: what it refuses before it begins, and that it ends."""

import http.client
import os
import signal
import subprocess
import sys
from urllib.parse import urlsplit

import pytest

from ispm.viewer import screen


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("view", "requires an argument"),
        ("view nowhere.glb --web", "there is no such file"),
        ("view cornell-box --web --host 0.0.0.0", "add --allow-remote"),
        ("view cornell-box --web --host 192.168.0.9", "add --allow-remote"),
        ("view cornell-box --web --fps 0", "fps: 0 is not within"),
        ("view cornell-box --web --fps nan", "fps: nan is not within"),
        ("view cornell-box --web --port 99999", "--port: 99999 is not within"),
        ("view cornell-box --web --watch", "--watch: cornell-box is no file"),
        ("view cornell-box --web --photons 4M", "the most that a viewer grants"),
        ("view cornell-box --web --show backdoor", "--show: 'backdoor' is not one of"),
        ("view cornell-box --web --threads 0", "--threads: 0 is less than 1"),
        ("view cornell-box --web --look-from 1,2,3", "go together"),
        ("view cornell-box --web --public-url example.org", "--public-url: example.org is not an address"),
    ],
)
def test_what_makes_no_sense_is_refused_in_one_line(ispm_command, line, said):
    code, out, err = ispm_command(line)
    assert (code, out) == (2, "")
    assert said in err.splitlines()[-1]


def test_without_the_extra_it_says_what_to_install(ispm_command, monkeypatch):
    monkeypatch.setitem(sys.modules, "uvicorn", None)
    code, out, err = ispm_command("view cornell-box --web")
    assert (code, out) == (2, "")
    assert err == "ispm: the page needs two more packages; in the checkout run: pip install '.[web]'\n"


def test_without_the_packages_for_a_window_it_says_what_to_install(monkeypatch):
    monkeypatch.setattr(screen, "has_display", lambda: True)
    monkeypatch.setattr(screen, "find_spec", lambda name: None)
    assert screen.why_no_window().endswith("in the checkout run: pip install '.[view]'")


@pytest.mark.gpu
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="elsewhere there always is a display")
@pytest.mark.parametrize("ending", [signal.SIGINT, signal.SIGTERM])
def test_it_prints_an_address_that_serves_and_ends_cleanly(ending):
    line = [sys.executable, "-m", "ispm", "view", "cornell-box", "--size", "64x36"]
    blind = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY")}
    pipes = dict(stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    with subprocess.Popen(line, env=blind, **pipes) as run:
        url = urlsplit(run.stdout.readline().strip())
        asked = http.client.HTTPConnection(url.netloc, timeout=30)
        asked.request("GET", f"{url.path}?{url.query}")
        assert asked.getresponse().status == 303
        asked.close()
        run.send_signal(ending)
        out, err = run.communicate(timeout=60)
    assert run.returncode == 0
    assert out == ""
    said = err.splitlines()
    assert said[0] == "no window can be opened: there is no display; the page is served instead"
    assert said[1].startswith("for another browser: http://127.0.0.1:")
    assert said[-1] == "closed"
