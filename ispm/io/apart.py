"""Decoders of other libraries, in a process of their own: untrusted bytes cannot crash, fill or stop ours."""

from __future__ import annotations

import importlib.util
import json
import math
import os
import subprocess
import sys
import threading
import time
from typing import IO

import numpy as np

from ispm.errors import SceneError
from ispm.io import decoders
from ispm.io.budget import Budget

MODULES = {"draco": "DracoPy", "ktx2": "opengl_basisu"}  # what decodes which kind
INSTALL = "pip install 'ispm[gltf]'"
RESERVE = 256 << 20  # bytes above the limit while something is decoded
PATIENCE = 20.0  # s in which all of a scene must be decoded,
PATIENCE_PER_BYTE = 2e-6  # and s more for each byte of it
_LONGEST = 200  # characters of what a decoder says


def has(kind: str) -> bool:
    """Return whether the decoder of a kind is installed."""
    return importlib.util.find_spec(MODULES[kind]) is not None


class Apart:
    """A process that decodes for one scene; it starts at the first request, and again where it ended."""

    def __init__(self, budget: Budget) -> None:
        self._budget = budget
        self._process: subprocess.Popen[bytes] | None = None
        self._seconds = PATIENCE

    def close(self) -> None:
        """End the process."""
        process, self._process = self._process, None
        if process is not None:
            process.kill()
            process.communicate()

    def decode(self, kind: str, data: memoryview | bytes) -> dict[str, np.ndarray]:
        """Return the arrays that a decoder makes of `data`, by the names that it gives them.

        kind  of MODULES
        It may take the memory that is left, where the system can limit it: on Linux.
        Raises SceneError where the data are damaged, or it takes too much memory or time.
        """
        memory = max(self._budget.memory, 0) + RESERVE
        self._seconds += PATIENCE_PER_BYTE * len(data)
        process = self._process = self._process or _started()
        began = time.monotonic()
        clock = threading.Timer(max(self._seconds, 0.0), process.kill)
        clock.start()
        try:
            assert process.stdin is not None and process.stdout is not None
            head = decoders.REQUEST.pack(kind.encode(), memory, len(data))
            process.stdin.write(head)
            process.stdin.write(data)
            process.stdin.flush()
            return _answer(process.stdout, memory)
        except (OSError, EOFError):
            self.close()
            if time.monotonic() - began >= self._seconds:
                raise SceneError("it takes too long to decode") from None
            raise SceneError("its decoder ended; it is damaged, or needs more memory than is left") from None
        finally:
            clock.cancel()
            self._seconds -= time.monotonic() - began


def _started() -> subprocess.Popen[bytes]:
    """A process that waits for requests; it finds modules where this one does, but not in its folder."""
    found = os.pathsep.join(path for path in sys.path if path)
    return subprocess.Popen(
        [sys.executable, "-P", decoders.__file__],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env={**os.environ, "PYTHONPATH": found},
    )


def _answer(pipe: IO[bytes], memory: int) -> dict[str, np.ndarray]:
    """The arrays of an answer of `memory` bytes at most. Raises SceneError, and EOFError where it ends."""
    line = pipe.readline()
    if not line.endswith(b"\n"):
        raise EOFError
    told = json.loads(line)
    if "fault" in told:
        raise SceneError(f"it cannot be decoded: {told['fault'][:_LONGEST]}")
    shapes = {name: (np.dtype(kind), shape) for name, (kind, shape) in told["arrays"].items()}
    if sum(kind.itemsize * math.prod(shape) for kind, shape in shapes.values()) > memory:
        raise EOFError
    found = {}
    for name, (kind, shape) in shapes.items():
        array = np.empty(shape, kind)
        target = array.reshape(-1).view(np.uint8).data
        done = 0
        while done < len(target):
            count = pipe.readinto(target[done:])  # type: ignore[attr-defined]  # a BufferedReader
            if not count:
                raise EOFError
            done += count
        found[name] = array
    return found
