"""STL files, text or binary: one flat mesh for each solid, whose triangles share vertices. Metres and axes as
written."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np

from ispm.errors import SceneError
from ispm.io.budget import Budget
from ispm.io.folder import map_file
from ispm.io.mtl import plain
from ispm.io.notes import Notes
from ispm.io.surface_mesh import check_counts, make_mesh
from ispm.scene.scene import Node, Part, Scene
from ispm.settings import LoadLimits

HEADER = 84
TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def read_stl(path: Path, limits: LoadLimits) -> Scene:
    """Return the scene of an STL file. Raises SceneError where it cannot be used."""
    from ispm.io.weld import weld  # which loads numba

    notes, budget = Notes(), Budget(limits)
    nodes = []
    for name, corners in _solids(map_file(path, budget), limits):
        points = corners.reshape(-1, 3)
        rows, numbers = weld(points)
        mesh = make_mesh(points[rows], numbers.reshape(-1, 3), notes, budget, name or path.stem)
        if mesh is not None:
            nodes.append(Node(mesh.name, parts=[Part(mesh, plain(mesh))]))
    if not nodes:
        notes.add("it has no triangles, so there is nothing to draw")
    return Scene(nodes, warnings=notes.lines())


def _solids(data: memoryview, limits: LoadLimits) -> list[tuple[str, np.ndarray]]:
    """The name and the (T, 3, 3) float32 corners, without -0, of each solid; by what the file holds, whatever
    its first word."""
    count = struct.unpack_from("<I", data, 80)[0] if len(data) >= HEADER else 0
    whole = HEADER + count * TRIANGLE.itemsize
    if len(data) >= HEADER and whole == len(data):
        check_counts(limits, 3 * count, count)
        return [("", np.frombuffer(data, TRIANGLE, count, HEADER)["corners"] + np.float32(0.0))]
    start = bytes(data[:2048]).lstrip().lower()
    if start.startswith(b"solid") and (b"facet" in start or b"endsolid" in start):
        return _text(data, limits)
    if len(data) < HEADER:
        raise SceneError(f"the header has {len(data)} of its {HEADER} bytes; the file is cut short")
    there = (len(data) - HEADER) // TRIANGLE.itemsize
    raise SceneError(f"its header says {count} triangles, but it has the bytes of {there}")


def _text(data: memoryview, limits: LoadLimits) -> list[tuple[str, np.ndarray]]:
    solids: list[tuple[str, list[float]]] = []
    ended = True
    for number, line in enumerate(bytes(data).splitlines(), 1):
        words: list[bytes] = line.split()
        word = words[0].lower() if words else b""
        if word == b"solid":
            solids.append((b" ".join(words[1:]).decode("utf-8", "replace"), []))
            ended = False
        elif word == b"endsolid":
            ended = True
        elif word == b"vertex" and solids:
            try:
                _, numbers = solids[-1]
                numbers.extend([float(words[1]), float(words[2]), float(words[3])])
            except (ValueError, IndexError):
                raise SceneError(f"line {number}: a vertex needs three numbers") from None
    if not ended or any(len(numbers) % 9 for _, numbers in solids):
        raise SceneError("the file is cut short: a solid has no end, or a triangle not three corners")
    total = sum(len(numbers) // 9 for _, numbers in solids)
    whole = [(name, numbers) for name, numbers in solids if numbers]
    check_counts(limits, 3 * total, total, len(whole))
    with np.errstate(over="ignore"):  # to infinity, which is left out
        return [
            (name, np.array(numbers).astype(np.float32).reshape(-1, 3, 3) + np.float32(0.0))
            for name, numbers in whole
        ]
