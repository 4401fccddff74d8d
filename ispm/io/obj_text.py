"""The lines of an OBJ file, as arrays."""

from __future__ import annotations

import io
from array import array
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np

from ispm.errors import SceneError
from ispm.io.notes import Notes

FLAT = -1  # the normal of a corner that has none; FLAT - g: smooth within smoothing group g
LARGEST = 1 << 60
CURVES = {b"curv", b"curv2", b"surf", b"cstype", b"deg", b"parm", b"vp"}


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
        self.take: dict[bytes, Callable[[list[bytes]], None]] = {
            **dict.fromkeys((b"p", b"l", *CURVES), self._pass_over),
            b"v": self._vertex,
            b"f": self._face,
            b"vt": self._uv,
            b"vn": self._normal,
            b"s": self._smooth,
            b"o": self._name,
            b"g": self._name,
            b"usemtl": self._use_material,
            b"mtllib": self._library,
        }
        self._names = {b"o": "", b"g": ""}
        self._material = ""
        self._smoothing = 0
        self._smoothings: dict[bytes, int] = {}  # counted, whatever their numbers are
        self._tokens: dict[bytes, int] = {}
        self._faces: tuple[Faces, Faces] | None = None

    def _vertex(self, words: list[bytes]) -> None:
        if len(words) < 4:
            raise SceneError("a vertex needs three numbers")
        if len(words) >= 7:
            self.colors[len(self.positions) // 3] = float(words[4]), float(words[5]), float(words[6])
        self.positions.extend((float(words[1]), float(words[2]), float(words[3])))

    def _uv(self, words: list[bytes]) -> None:
        self.uvs.extend((float(words[1]), float(words[2]) if len(words) > 2 else 0.0))

    def _normal(self, words: list[bytes]) -> None:
        self.normals.extend((float(words[1]), float(words[2]), float(words[3])))

    def _face(self, words: list[bytes]) -> None:
        if len(words) < 4:
            self.notes.count(
                "face of fewer than three corners is left out",
                "faces of fewer than three corners are left out",
            )
            return
        tokens = self._tokens
        try:
            rows = [tokens[word] for word in words[1:]]
        except KeyError:
            rows = [tokens[word] if word in tokens else self._corner(word) for word in words[1:]]
        flat, smooth = self._faces or self._open()
        faces = smooth if self._smoothing or words[1].count(b"/") == 2 else flat
        faces.corners.extend(rows)
        faces.sizes.append(len(rows))

    def _open(self) -> tuple[Faces, Faces]:
        """The flat and the smooth faces of the object and material that hold now."""
        name = self._names[b"o"] or self._names[b"g"]
        flat, smooth = (
            self.groups.setdefault(Group(name, self._material, way), Faces()) for way in (False, True)
        )
        self._faces = flat, smooth
        return self._faces

    def _corner(self, word: bytes) -> int:
        """The row of a corner such as 7, 7/2, 7//3 or -1/-1/-1."""
        v, uv, normal = [*word.split(b"/"), b"", b""][:3]
        n = _index(normal, len(self.normals) // 3) if normal else FLAT - self._smoothing
        key = _index(v, len(self.positions) // 3), _index(uv, len(self.uvs) // 2) if uv else -1, n
        row = self.rows.setdefault(key, len(self.rows))
        if b"-" not in word:  # the meaning of the others changes from line to line
            self._tokens[word] = row
        return row

    def _name(self, words: list[bytes]) -> None:
        self._names[words[0]], self._faces = _rest(words), None

    def _use_material(self, words: list[bytes]) -> None:
        self._material, self._faces = _rest(words), None

    def _smooth(self, words: list[bytes]) -> None:
        number = words[1].lstrip(b"0") if words[1:] and words[1].isdigit() else b""
        self._smoothing = self._smoothings.setdefault(number, len(self._smoothings) + 1) if number else 0
        self._tokens.clear()

    def _library(self, words: list[bytes]) -> None:
        self.libraries.append(_rest(words))

    def _pass_over(self, words: list[bytes]) -> None:
        if words[0] in CURVES:
            self.notes.add("free-form curves and surfaces are not drawn")
        else:
            self.notes.count(
                "element of points or lines is not drawn", "elements of points or lines are not drawn"
            )


def _rest(words: list[bytes]) -> str:
    return b" ".join(words[1:]).decode("utf-8", "replace")


def _index(word: bytes, count: int) -> int:
    """The row, from 0, that an index names: from 1, or, negative, back from the last of `count`."""
    index = int(word)
    if index == 0 or index > LARGEST:
        raise SceneError(f"index {index}; they count from 1" if index == 0 else f"index {index} is too large")
    if index < -count:
        raise SceneError(f"index {index} points before the first of {count}")
    return index - 1 if index > 0 else count + index


def read_text(data: memoryview, notes: Notes) -> ObjText:
    """Return what the text of an OBJ file says. Raises SceneError, with the line, where it makes no sense."""
    reader = _Reader(notes)
    for number, line in enumerate(_lines(data), 1):
        words: list[bytes] = line.split()
        take = reader.take.get(words[0]) if words else None
        if take is None:
            continue
        try:
            take(words)
        except (SceneError, ValueError, IndexError) as error:
            known = isinstance(error, SceneError)
            why = error if known else f"'{words[0].decode()}' with numbers that make no sense"
            raise SceneError(f"line {number}: {why}") from None
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
    text, waiting = bytes(data), list[bytes]()
    if b"\n" not in text:
        text = text.replace(b"\r", b"\n")
    for line in io.BytesIO(text):
        if line.rstrip().endswith(b"\\"):
            waiting.append(line.rstrip()[:-1])
            yield b""
        else:
            yield b" ".join([*waiting, line])
            waiting.clear()
    yield b" ".join(waiting)


def _colors(written: dict[int, tuple[float, ...]], count: int) -> np.ndarray | None:
    """(V, 3) colors, white for vertices without one; None where all are."""
    if not written:
        return None
    colors = np.ones((count, 3))
    colors[list(written)] = list(written.values())
    return colors
