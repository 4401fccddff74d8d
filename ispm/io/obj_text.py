"""The lines of an OBJ file, as arrays."""

from __future__ import annotations

from array import array
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from ispm.errors import SceneError
from ispm.io.notes import Notes
from ispm.settings import LoadLimits

FLAT = -1  # the normal of a corner that has none; FLAT - g: smooth within smoothing group g
LARGEST = 1 << 60
CURVES = {b"curv", b"curv2", b"surf", b"cstype", b"deg", b"parm", b"vp"}
PASSED = CURVES | {b"p", b"l", b"g", b"o", b"s", b"usemtl", b"mtllib"}


@dataclass
class Faces:
    """The polygons of one object in one material.

    corners  numbers of rows of ObjText.corners, polygon after polygon
    sizes    corners of each polygon
    """

    corners: array[int] = field(default_factory=lambda: array("q"))
    sizes: array[int] = field(default_factory=lambda: array("q"))


@dataclass(frozen=True)
class Group:
    """What the faces of one mesh have in common."""

    object: str
    material: str
    smooth: bool


@dataclass
class ObjText:
    """What an OBJ file says.

    positions  (V, 3) m;  colors: (V, 3) as written, or None where no vertex has one
    uvs        (U, 2), v upwards;  normals: (N, 3)
    corners    (C, 3) rows of positions, of uvs (-1: none), and of normals (below 0: FLAT, FLAT - group)
    libraries  names of MTL files
    """

    positions: np.ndarray
    colors: np.ndarray | None
    uvs: np.ndarray
    normals: np.ndarray
    corners: np.ndarray
    groups: dict[Group, Faces]
    libraries: list[str]


class _Reader:
    """Reads lines; keeps what the last `o`, `g`, `usemtl` and `s` said."""

    def __init__(self, notes: Notes) -> None:
        self.notes = notes
        self.positions, self.uvs, self.normals = array("d"), array("d"), array("d")
        self.colors: dict[int, tuple[float, ...]] = {}
        self.groups: dict[Group, Faces] = {}
        self.libraries: list[str] = []
        self.rows: dict[tuple[int, int, int], int] = {}
        self._object = self._part = self._material = ""
        self._smoothing = 0
        self._tokens: dict[bytes, tuple[int, bool]] = {}
        self._faces: tuple[Faces, Faces] | None = None

    def line(self, words: list[bytes], line: bytes) -> None:
        """Take a line in. Raises ValueError or SceneError where it makes no sense."""
        word = words[0]
        if word == b"v":
            self._vertex([float(w) for w in words[1:]])
        elif word == b"f":
            self._face(words[1:])
        elif word == b"vt":
            self.uvs.extend((float(words[1]), float(words[2]) if len(words) > 2 else 0.0))
        elif word == b"vn":
            self.normals.extend((float(words[1]), float(words[2]), float(words[3])))
        elif word in PASSED:
            self._state(word, line[len(word) :].strip().decode("utf-8", "replace"))

    def _vertex(self, numbers: list[float]) -> None:
        if len(numbers) < 3:
            raise SceneError("a vertex needs three numbers")
        if len(numbers) >= 6:
            self.colors[len(self.positions) // 3] = tuple(numbers[3:6])
        self.positions.extend(numbers[:3])

    def _face(self, words: list[bytes]) -> None:
        if len(words) < 3:
            self.notes.count("face of fewer than three corners is left out",
                             "faces of fewer than three corners are left out")  # fmt: skip
            return
        found = [self._tokens.get(word) or self._corner(word) for word in words]
        flat, smooth = self._faces or self._open()
        faces = smooth if all(is_smooth for _, is_smooth in found) else flat
        faces.corners.extend([row for row, _ in found])
        faces.sizes.append(len(found))

    def _open(self) -> tuple[Faces, Faces]:
        """The flat and the smooth faces of the object and material that hold now."""
        name = self._object or self._part
        flat, smooth = (
            self.groups.setdefault(Group(name, self._material, way), Faces()) for way in (False, True)
        )
        self._faces = flat, smooth
        return self._faces

    def _corner(self, word: bytes) -> tuple[int, bool]:
        """The row of a corner such as 7, 7/2, 7//3 or -1/-1/-1, and whether it has a normal."""
        v, uv, normal = [*word.split(b"/"), b"", b""][:3]
        n = _index(normal, len(self.normals) // 3) if normal else FLAT - self._smoothing
        key = _index(v, len(self.positions) // 3), _index(uv, len(self.uvs) // 2) if uv else -1, n
        result = self.rows.setdefault(key, len(self.rows)), n != FLAT
        if b"-" not in word:  # the meaning of the others changes from line to line
            self._tokens[word] = result
        return result

    def _state(self, word: bytes, rest: str) -> None:
        if word == b"usemtl":
            self._material, self._faces = rest, None
        elif word == b"o":
            self._object, self._faces = rest, None
        elif word == b"g":
            self._part, self._faces = rest, None
        elif word == b"s":
            self._smoothing = int(rest) if rest.isdecimal() else 0
            self._tokens.clear()
        elif word == b"mtllib":
            self.libraries.append(rest)
        elif word in (b"p", b"l"):
            self.notes.count("element of points or lines is not drawn",
                             "elements of points or lines are not drawn")  # fmt: skip
        else:
            self.notes.add("free-form curves and surfaces are not drawn")


def _index(word: bytes, count: int) -> int:
    """The row, from 0, that an index names: from 1, or, negative, back from the last of `count`."""
    index = int(word)
    if index == 0 or index > LARGEST:
        raise SceneError(f"index {index}; they count from 1" if index == 0 else f"index {index} is too large")
    if index < -count:
        raise SceneError(f"index {index} points before the first of {count}")
    return index - 1 if index > 0 else count + index


def read_text(data: memoryview, notes: Notes, limits: LoadLimits) -> ObjText:
    """Return what the text of an OBJ file says. Raises SceneError, with the line, where it makes no sense."""
    reader = _Reader(notes)
    for number, line in enumerate(_lines(data), 1):
        words = line.split()
        if not words or words[0][:1] == b"#":
            continue
        try:
            reader.line(words, line.strip())
        except (SceneError, ValueError, IndexError, OverflowError) as error:
            why = (
                error
                if isinstance(error, SceneError)
                else f"'{words[0].decode()}' with numbers that make no sense"
            )
            raise SceneError(f"line {number}: {why}") from None
        if len(reader.positions) > 3 * limits.max_elements:
            raise SceneError(f"more vertices than max_elements={limits.max_elements} allows")
    return ObjText(
        np.array(reader.positions).reshape(-1, 3),
        _colors(reader.colors, len(reader.positions) // 3),
        np.array(reader.uvs).reshape(-1, 2),
        np.array(reader.normals).reshape(-1, 3),
        np.array(list(reader.rows), np.int64).reshape(-1, 3),
        {group: faces for group, faces in reader.groups.items() if faces.sizes},
        reader.libraries,
    )


def _lines(data: memoryview) -> Iterator[bytes]:
    """The lines of a text, each with those that a backslash at its end adds; their number is of the last."""
    waiting = b""
    for line in bytes(data).splitlines():
        if line.endswith(b"\\"):
            waiting += line[:-1] + b" "
            yield b""
        else:
            yield waiting + line
            waiting = b""
    yield waiting


def _colors(written: dict[int, tuple[float, ...]], count: int) -> np.ndarray | None:
    """(V, 3) colors, white for vertices without one; None where all are."""
    if not written:
        return None
    colors = np.ones((count, 3))
    colors[list(written)] = list(written.values())
    return colors
