"""Make every pipeline in Chromium, whose compiler of WGSL is Tint, and print what it objects to.

python -m drivers.tint             # in tests/
python -m drivers.tint CHROMIUM    # the browser to ask; default: the first on the PATH

The calls that `ispm.gpu` would make of a device are written down, and a page makes them again. The exit code
is 1 where there is a message, 2 where there is no browser.
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
import tempfile
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

from drivers.pipelines import Pipeline, all_pipelines
from ispm import wgsl
from ispm.gpu import Gpu
from ispm.gpu.device import FEATURES

_BROWSERS = "chromium", "chromium-browser", "google-chrome"
_FLAGS = (
    "--headless", "--no-sandbox", "--enable-unsafe-webgpu", "--use-webgpu-adapter=swiftshader",
    "--enable-features=Vulkan",
)  # fmt: skip
_PATIENCE = 300.0  # seconds
_PAGE = Path(__file__).with_suffix(".html")


class _Script(Gpu):
    """In a device's place: keeps its calls, and gives their numbers for what they would make."""

    def __init__(self) -> None:
        self.device = self
        self.calls: list[list[Any]] = []
        self._computes, self._rasters = {}, {}

    def __getattr__(self, name: str) -> Any:
        def call(**described: Any) -> dict[str, int]:
            self.calls.append([_camel(name), _plain(described)])
            return {"made": len(self.calls) - 1}

        return call


def main() -> int:
    """Ask and print; return the exit code."""
    given = sys.argv[1:] or [path for name in _BROWSERS if (path := shutil.which(name))]
    if not given:
        print(f"no browser: none of {', '.join(_BROWSERS)} is on the PATH", file=sys.stderr)
        return 2
    pipelines = all_pipelines()
    answer = ask(given[0], {"features": FEATURES, "jobs": [_calls(each) for each in pipelines]})
    lines = [
        line for each, told in zip(pipelines, answer["told"], strict=True) for line in _lines(each, told)
    ]
    found = dict.fromkeys(lines)  # once each, though many include the same file
    print(*found, f"{len(pipelines)} pipelines, {answer['browser']}: {len(found)} messages", sep="\n")
    return bool(found)


def ask(browser: str, question: dict[str, Any]) -> dict[str, Any]:
    """Open the page beside this file in a browser, hand it `question`, and return what it posts back.

    Raises TimeoutError where it does not answer, RuntimeError where it cannot.
    """
    answer: dict[str, Any] = {}
    answered = threading.Event()

    class Server(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            kind, body = ("text/html", _PAGE.read_bytes())
            if self.path == "/question":
                kind, body = ("application/json", json.dumps(question).encode())
            self.send_response(200)
            self.send_header("Content-Type", kind)
            self.end_headers()
            self.wfile.write(body)

        def do_POST(self) -> None:
            answer.update(json.loads(self.rfile.read(int(self.headers["Content-Length"]))))
            self.send_response(204)
            self.end_headers()
            answered.set()

        def log_message(self, *_: Any) -> None: ...

    with (
        ThreadingHTTPServer(("127.0.0.1", 0), Server) as server,
        tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile,
    ):
        threading.Thread(target=server.serve_forever, daemon=True).start()
        page = f"http://127.0.0.1:{server.server_port}/"
        command = [browser, *_FLAGS, f"--user-data-dir={profile}", page]
        with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as running:
            answered.wait(_PATIENCE)
            running.terminate()
        server.shutdown()
    if not answer:
        raise TimeoutError(f"{browser} did not answer within {_PATIENCE:.0f} s")
    if "error" in answer:
        raise RuntimeError(f"{browser}: {answer['error']}")
    return answer


def _calls(pipeline: Pipeline) -> list[list[Any]]:
    script = _Script()
    pipeline.make(script)
    return script.calls


def _camel(name: str) -> str:
    """WebGPU's name of what wgpu calls `name`; constants of ours, in capitals, stay."""
    return re.sub(r"_([a-z])", lambda found: found[1].upper(), name)


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {_camel(key): _plain(item) for key, item in value.items() if item is not None}
    return [_plain(item) for item in value] if isinstance(value, (list, tuple)) else value


def _lines(pipeline: Pipeline, told: list[dict[str, Any]]) -> list[str]:
    origin = wgsl.load(pipeline.path).origin
    places = [":".join(map(str, origin[m["line"] - 1])) if m["line"] else pipeline.label for m in told]
    return [
        f"{place}: {m['kind']}: {' '.join(m['text'].split())}" for place, m in zip(places, told, strict=True)
    ]


if __name__ == "__main__":
    sys.exit(main())
