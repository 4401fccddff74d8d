"""Loads the files that are named on stdin, each in a process of its own, and says how each ended."""

from __future__ import annotations

import json
import os
import resource
import signal
import sys
import tempfile
import time
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

import ispm
from ispm.errors import IspmError, SceneWarning
from ispm.io.image import write_exr
from ispm.optics.texture import halved
from ispm.scene.packed import pack

ROOM = 4 << 30  # bytes of address space above what the process has: harm ends here rather than in the machine
LIMIT = 60  # s of a processor, after which a load is taken to hang
WAIT = 300  # s of the clock, likewise


def main() -> None:
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # OpenEXR tells of damage on stdout, too
    Image.init()
    halved(np.zeros((2, 2, 4), np.uint8), True)
    with tempfile.TemporaryDirectory() as folder:  # what reading and packing compile and import
        small = Path(folder) / "a.hdr"
        small.write_bytes(b"#?RADIANCE\n\n-Y 1 +X 2\n" + bytes(8))
        write_exr(small.with_suffix(".exr"), {"full": np.ones((1, 2, 3), np.float32)})
        for path in (small, small.with_suffix(".exr")):
            used(str(path), {})
    ispm.load  # noqa: B018  # imports what loading needs, which is not the files' doing
    for line in sys.stdin:
        print(json.dumps(outcome(*json.loads(line))), file=answers, flush=True)


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
            told = used(bytes.fromhex(path).decode("utf-8", "surrogatepass"), options)
            said = told + [str(w.message) for w in caught if issubclass(w.category, SceneWarning)]
            end = "warn" if said else "ok"
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


def used(path: str, options: dict[str, Any]) -> list[str]:
    """What is said of a scene's file, or an environment's, that can be used."""
    if path.endswith((".hdr", ".exr")):
        scene = ispm.Scene(environment=ispm.Environment(path))
        _ = pack(scene), repr(scene.environment)
    else:
        scene = ispm.load(path, **options)
        _ = scene.triangle_count, scene.materials, repr(scene)
    return list(scene.warnings)


def kept(what: str) -> int:
    """Bytes of memory, by their name in /proc."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return 1024 * next(int(line.split()[1]) for line in lines if line.startswith(what + ":"))


if __name__ == "__main__":
    main()
