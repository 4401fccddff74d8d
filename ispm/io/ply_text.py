"""A PLY file's elements as arrays: text, or binary of either byte order.

Source: Turk, "The PLY Polygon File Format", 1994.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from itertools import takewhile

import numpy as np

from ispm.errors import SceneError
from ispm.settings import LoadLimits

_C_NAMES = ["char", "uchar", "short", "ushort", "int", "uint", "float", "double"]
_SIZED_NAMES = ["int8", "uint8", "int16", "uint16", "int32", "uint32", "float32", "float64"]
_DTYPES = ["i1", "u1", "i2", "u2", "i4", "u4", "f4", "f8"]
TYPES = dict(zip(_C_NAMES + _SIZED_NAMES, _DTYPES * 2, strict=True))
ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
LONGEST_HEADER = 1 << 20
LONGEST_NUMBER = 64
PIECE = 1 << 22  # bytes
MOST_EVEN = 1024  # values of a list that are read as part of one record


@dataclass
class Property:
    """A named number of an element; with `count`, a list whose length has that type."""

    name: str
    type: str
    count: str = ""


@dataclass
class Element:
    """A kind of record, such as vertices."""

    name: str
    count: int
    properties: list[Property] = field(default_factory=list)


@dataclass
class Table:
    """What an element holds: numbers as (n,) arrays, lists as their lengths and all their values in a row."""

    columns: dict[str, np.ndarray] = field(default_factory=dict)
    lists: dict[str, tuple[np.ndarray, np.ndarray]] = field(default_factory=dict)


def read_tables(data: memoryview, limits: LoadLimits) -> tuple[dict[str, Table], list[str]]:
    """Return the tables of a PLY file by name, and its comments.

    Raises SceneError where the header makes no sense or the body is cut short.
    """
    order, elements, comments, start = _header(data)
    for element in elements:
        if element.count > limits.max_elements:
            raise SceneError(
                f"{element.count} of '{element.name}' are more than max_elements={limits.max_elements} allows"
            )
    tables = _text(data[start:], elements) if order == "" else _binary(data[start:], elements, order)
    return tables, comments


def _header(data: memoryview) -> tuple[str, list[Element], list[str], int]:
    """The byte order, the elements, the comments, and where the body begins."""
    head = bytes(data[:LONGEST_HEADER])
    end = head.find(b"end_header")
    if not head.startswith(b"ply") or end < 0:
        raise SceneError("the header has no end" if head.startswith(b"ply") else "this is no PLY file")
    order, elements, comments = None, [], []
    for line in head[:end].decode("utf-8", "replace").splitlines()[1:]:
        words = line.split()
        if not words:
            continue
        if words[0] in ("comment", "obj_info"):
            comments.append(line[len(words[0]) + 1 :].strip())
        elif words[0] == "format":
            order = ORDERS.get(words[1] if len(words) > 1 else "")
        elif words[0] == "element" and len(words) == 3 and words[2].isdecimal():
            if len(words[2]) > LONGEST_NUMBER:
                raise SceneError(f"'{words[1][:40]}' has a count of {len(words[2])} digits")
            elements.append(Element(words[1], int(words[2])))
        elif not (words[0] == "property" and elements and _append(elements[-1], words[1:])):
            raise SceneError(f"the header's line '{line.strip()[:60]}' makes no sense")
    if order is None:
        raise SceneError(f"its format is none of {', '.join(ORDERS)}")
    newline = head.find(b"\n", end)
    if newline < 0:
        newline = max(end + len(b"end_header"), head.find(b"\r", end))
    return order, elements, comments, newline + 1


def _append(element: Element, words: list[str]) -> bool:
    """Add a property; whether it is one."""
    if len(words) == 2 and words[0] in TYPES:
        element.properties.append(Property(words[1], TYPES[words[0]]))
        return True
    if len(words) == 4 and words[0] == "list" and words[1] in TYPES and words[2] in TYPES:
        element.properties.append(Property(words[3], TYPES[words[2]], TYPES[words[1]]))
        return TYPES[words[1]][0] != "f"
    return False


def _short(element: Element) -> SceneError:
    return SceneError(f"the file is cut short: not all of {element.count} of '{element.name}' are there")


def _text(data: memoryview, elements: list[Element]) -> dict[str, Table]:
    numbers, tables, at = _numbers(data), {}, 0
    for element in elements:
        if any(p.count for p in element.properties):
            tables[element.name], at = _text_lists(numbers, at, element)
            continue
        width = len(element.properties)
        if at + element.count * width > len(numbers):
            raise _short(element)
        rows = numbers[at : at + element.count * width].reshape(element.count, width)
        with np.errstate(invalid="ignore"):
            columns = {p.name: rows[:, i].astype(p.type) for i, p in enumerate(element.properties)}
        tables[element.name] = Table(columns)
        at += element.count * width
    return tables


def _numbers(data: memoryview) -> np.ndarray:
    """The numbers of a text, read in pieces: words take much more memory than what they mean."""
    found, rest = [np.zeros(0)], b""
    for start in range(0, len(data), PIECE):
        text = rest + bytes(data[start : start + PIECE])
        end = (
            len(text)
            if start + PIECE >= len(data)
            else max(text.rfind(b) for b in (b" ", b"\n", b"\r", b"\t")) + 1
        )
        words, rest = text[:end].split(), text[end:]
        if max(map(len, words), default=0) > LONGEST_NUMBER or len(rest) > LONGEST_NUMBER:
            raise SceneError("the body has words that are no numbers")
        try:
            found.append(np.array(words, "S").astype(np.float64) if words else np.zeros(0))
        except ValueError as error:
            raise SceneError(f"the body has a word that is no number: {str(error)[-60:]}") from None
    return np.concatenate(found)


def _text_lists(numbers: np.ndarray, at: int, element: Element) -> tuple[Table, int]:
    """The table of an element with lists, from number `at` on, and where it ends."""
    firsts: list[list[int]] = [[] for _ in element.properties]
    sizes: list[list[int]] = [[] for _ in element.properties]
    total = len(numbers)
    for _ in range(element.count):
        for k, p in enumerate(element.properties):
            if at >= total:
                raise _short(element)
            size = 1
            if p.count:
                length = float(numbers[at])
                if not np.isfinite(length):
                    raise SceneError(f"a list of '{element.name}' has a length that is no number")
                if not 0.0 <= length <= total:
                    raise _short(element)
                size, at = int(length), at + 1
            firsts[k].append(at)
            sizes[k].append(size)
            at += size
            if at > total:
                raise _short(element)
    table = Table()
    for p, begins, lengths in zip(element.properties, firsts, sizes, strict=True):
        if p.count:
            counts = np.array(lengths, np.int64)
            table.lists[p.name] = counts, numbers[_runs(np.array(begins, np.int64), counts)]
        else:
            table.columns[p.name] = numbers[begins]
    return table, at


def _runs(firsts: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """The numbers first, first + 1, ... of each run, one run after the other."""
    ends = np.cumsum(sizes)
    total = int(ends[-1]) if len(ends) else 0
    result: np.ndarray = np.arange(total) + np.repeat(firsts - ends + sizes, sizes)
    return result


def _binary(data: memoryview, elements: list[Element], order: str) -> dict[str, Table]:
    tables, at = {}, 0
    for element in elements:
        lists = [p for p in element.properties if p.count]
        if not lists:
            table, at = _records(data, at, element, order, 0)
        elif len(lists) == 1 and (even := _even(data, at, element, order)):
            table, at = even
        else:
            table, at = _binary_lists(data, at, element, order)
        tables[element.name] = table
    return tables


def _records(data: memoryview, at: int, element: Element, order: str, size: int) -> tuple[Table, int]:
    """The table of an element whose lists, if any, all have `size` values."""
    fields: list[tuple[str, str] | tuple[str, str, tuple[int]]] = []
    for k, p in enumerate(element.properties):
        if p.count:
            fields.append((f"count {k}", order + p.count))
        fields.append((str(k), order + p.type, (size,)) if p.count else (str(k), order + p.type))
    dtype = np.dtype(fields)
    if at + element.count * dtype.itemsize > len(data):
        raise _short(element)
    rows = np.frombuffer(data, dtype, element.count, at) if dtype.itemsize else np.zeros(element.count, dtype)
    table = Table()
    for k, p in enumerate(element.properties):
        if p.count:
            table.lists[p.name] = rows[f"count {k}"].astype(np.int64), rows[str(k)].ravel()
        else:
            table.columns[p.name] = rows[str(k)]
    return table, at + element.count * dtype.itemsize


def _even(data: memoryview, at: int, element: Element, order: str) -> tuple[Table, int] | None:
    """The table of an element whose lists are all as long as the first; None where they are not."""
    plain = list(takewhile(lambda p: not p.count, element.properties))
    listed = element.properties[len(plain)]
    before = sum(np.dtype(p.type).itemsize for p in plain)
    width = np.dtype(listed.count).itemsize
    if not element.count or at + before + width > len(data):
        return None
    size = int(np.frombuffer(data, order + listed.count, 1, at + before)[0])
    if not 0 <= size <= MOST_EVEN:
        return None
    try:
        table, end = _records(data, at, element, order, size)
    except SceneError:
        return None  # the first may be the longest
    return (table, end) if (table.lists[listed.name][0] == size).all() else None


def _binary_lists(data: memoryview, at: int, element: Element, order: str) -> tuple[Table, int]:
    """The table of an element with lists of any lengths."""
    sizes: list[list[int]] = [[] for _ in element.properties]
    chunks: list[list[bytes]] = [[] for _ in element.properties]
    readers = [struct.Struct(order + np.dtype(p.count).char) if p.count else None for p in element.properties]
    widths = [np.dtype(p.type).itemsize for p in element.properties]
    total = len(data)
    for _ in range(element.count):
        for k, reader in enumerate(readers):
            size = 1
            if reader is not None:
                if at + reader.size > total:
                    raise _short(element)
                (size,) = reader.unpack_from(data, at)
                at += reader.size
            end = at + size * widths[k]
            if size < 0 or end > total:
                raise _short(element)
            sizes[k].append(size)
            chunks[k].append(data[at:end].tobytes())
            at = end
    table = Table()
    for p, lengths, chunk in zip(element.properties, sizes, chunks, strict=True):
        values = np.frombuffer(b"".join(chunk), order + p.type)
        if p.count:
            table.lists[p.name] = np.array(lengths, np.int64), values
        else:
            table.columns[p.name] = values
    return table, at
