"""Decoders of libraries that `pip install 'ispm[gltf]'` brings, run as a program by `ispm.io.apart`.

It reads requests from stdin and answers on stdout: a line of JSON with the arrays, by name their types and
shapes, or with what is wrong; then the arrays' bytes. It imports nothing of this package: it starts fast.
"""

from __future__ import annotations

import contextlib
import json
import os
import struct
import sys
from typing import Any

REQUEST = struct.Struct("<8sQQ")  # which decoder, bytes of memory that it may take, bytes that follow


def draco(data: bytes) -> dict[str, Any]:
    """Return a mesh's triangles, (T, 3), and its attributes by their numbers, (V, width)."""
    import DracoPy

    mesh = DracoPy.decode(data)
    faces = getattr(mesh, "faces", None)
    if faces is None:
        raise ValueError("it holds points, not triangles")
    return {"faces": faces, **{str(a["unique_id"]): a["data"] for a in mesh.attributes}}


def ktx2(data: bytes) -> dict[str, Any]:
    """Return the largest picture, (h, w, 4) uint8."""
    import opengl_basisu

    return {"pixels": opengl_basisu.open(data).transcode(opengl_basisu.Target.RGBA8).data}


def _limit(memory: int) -> None:
    """Have larger allocations fail from here on, where the system can."""
    with contextlib.suppress(ImportError, OSError, ValueError):
        import resource

        with open("/proc/self/statm") as file:
            taken = int(file.read().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (taken + memory, resource.getrlimit(resource.RLIMIT_AS)[1]))


def _decoded(kind: str, data: bytes) -> tuple[dict[str, Any], list[Any]]:
    """The line that answers a request, and the arrays that follow it."""
    import numpy as np

    try:
        arrays = {"draco": draco, "ktx2": ktx2}[kind](data)
        kept = {name: np.ascontiguousarray(array) for name, array in arrays.items()}
    except MemoryError:
        return {"fault": "there is no memory left to decode it"}, []
    except Exception as error:  # of libraries, whose kinds are their own
        return {"fault": " ".join(str(error).split()) or type(error).__name__}, []
    return {"arrays": {name: (a.dtype.str, a.shape) for name, a in kept.items()}}, list(kept.values())


def main() -> None:
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what libraries say is no answer
    requests = sys.stdin.buffer
    while head := requests.read(REQUEST.size):
        kind, memory, length = REQUEST.unpack(head)
        data = requests.read(length)
        _limit(memory)
        told, arrays = _decoded(kind.rstrip(b"\0").decode(), data)
        answers.write(json.dumps(told).encode() + b"\n")
        for array in arrays:
            answers.write(array.data)
        answers.flush()


if __name__ == "__main__":
    main()
