"""Loads the files that are named on stdin, each in a process of its own, and says how each ended."""

from __future__ import annotations

import json
import os
import resource
import signal
import sys
import time
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

import ispm
from ispm.errors import IspmError, SceneWarning
from ispm.optics.texture import halved

ROOM = 4 << 30  # bytes of address space above what the process has: harm ends here rather than in the machine
LIMIT = 60  # s of a processor, after which a load is taken to hang
WAIT = 300  # s of the clock, likewise


def main() -> None:
    Image.init()
    halved(np.zeros((2, 2, 4), np.uint8), True)
    ispm.load  # noqa: B018  # imports what loading needs, which is not the files' doing
    for line in sys.stdin:
        print(json.dumps(outcome(*json.loads(line))), flush=True)


def outcome(path: str, options: dict[str, Any]) -> dict[str, Any]:
    """How loading the file ends, with its processor time in s and its peak of memory in bytes."""
    read, write = os.pipe()
    child = os.fork()
    if not child:
        os.close(read)
        signal.alarm(WAIT)
        spent = int(time.process_time())
        resource.setrlimit(resource.RLIMIT_CPU, (spent + LIMIT, spent + LIMIT))
        os.write(write, json.dumps(attempt(path, options)).encode())
        os._exit(0)
    os.close(write)
    with os.fdopen(read, "rb") as pipe:
        told = pipe.read()
    _, status = os.waitpid(child, 0)
    if not told:
        return {"end": f"signal {os.WTERMSIG(status)}", "said": [], "seconds": float(LIMIT), "bytes": 0}
    return dict(json.loads(told))


def attempt(path: str, options: dict[str, Any]) -> dict[str, Any]:
    """Load the file in this process."""
    before = kept("VmRSS")
    resource.setrlimit(resource.RLIMIT_AS, (kept("VmSize") + ROOM,) * 2)
    start = time.process_time()  # a busy machine is no fault of the loader
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            scene = ispm.load(bytes.fromhex(path).decode("utf-8", "surrogatepass"), **options)
            end, said = ("warn" if scene.warnings else "ok"), scene.warnings
            _ = scene.triangle_count, scene.materials, repr(scene)
        except IspmError as error:
            end, said = "error", [str(error)]
        except BaseException as error:
            end, said = type(error).__name__, [str(error)]
    seconds = time.process_time() - start
    stray = [w for w in caught if not issubclass(w.category, SceneWarning)]
    if stray and end in ("ok", "warn", "error"):
        end, said = stray[0].category.__name__, [str(stray[0].message)]
    if any(not line.isprintable() for line in said):
        end = "unprintable"
    return {"end": end, "said": said[:3], "seconds": seconds, "bytes": kept("VmHWM") - before}


def kept(what: str) -> int:
    """Bytes of memory, by their name in /proc."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return 1024 * next(int(line.split()[1]) for line in lines if line.startswith(what + ":"))


if __name__ == "__main__":
    main()
