"""Ways to damage a file."""

from __future__ import annotations

import json
import re
import struct
from typing import Any

import numpy as np

from fuzz.seeds import Files

ODD = ["nan", "inf", "-inf", "-1", "0", "-0", "1e400", "1e-400", "1e38", "3.5", "255", "65535", "65536",
       "2147483647", "2147483648", "4294967295", "4294967296", "9223372036854775807", "9223372036854775808",
       "99999999999999999999", "-9223372036854775809", "", "x", "0x10", "1_0", "9" * 5000]  # fmt: skip
VALUES: list[Any] = [None, True, -1, 0, 1, 3, 1e300, -1e300, 2**31, 2**32, 2**63, 2**64, 0.5, "", "x", "../a",
                     [], {}, [0], [[]], {"a": {}}, "a" * 5000]  # fmt: skip
NUMBER = re.compile(rb"-?\d+\.?\d*(?:[eE][-+]?\d+)?")


def damaged(files: Files, random: np.random.Generator) -> Files:
    """A copy of `files` with one of them damaged, in one to eight places."""
    name = str(random.choice(sorted(files)))
    data = files[name]
    kind = random.random()
    if data[:4] == b"glTF" and kind < 0.6:
        data = _repacked(data, random)
    elif name.endswith(".gltf") and kind < 0.6:
        data = json.dumps(_changed(json.loads(data), random)).encode()
    elif name.endswith((".obj", ".mtl")) or data[:5] in (b"ply\nf", b"solid"):
        for _ in range(random.integers(1, 5)):
            data = _number(data, random) if random.random() < 0.6 else _bytes(data, random)
    else:
        for _ in range(random.integers(1, 9)):
            data = _bytes(data, random)
    return {**files, name: data}


def _bytes(data: bytes, random: np.random.Generator) -> bytes:
    """Bytes overwritten, left out, put in, repeated, swapped, or cut off."""
    at, to = sorted(int(k) for k in random.integers(0, len(data) + 1, 2))
    near = min(at + int(random.integers(1, 17)), len(data))
    noise = random.integers(0, 256, near - at, np.uint8).tobytes()
    same = bytes([int(random.choice([0, 1, 32, 127, 128, 254, 255]))]) * (near - at)
    ways = [data[:at] + noise + data[near:], data[:at] + same + data[near:], data[:at] + data[near:],
            data[:at] + noise + data[at:],
            data[:to] + data[at:to] + data[to:] if to - at < 4096 else data[:to],
            data[to:] + data[:at] if random.random() < 0.2 else data[:at] + same + data[near:],
            data[:to]]  # fmt: skip
    return ways[int(random.integers(len(ways)))]


def _number(data: bytes, random: np.random.Generator) -> bytes:
    """A number of a text replaced by an odd one."""
    found = list(NUMBER.finditer(data[:200_000]))
    if not found:
        return _bytes(data, random)
    place = found[int(random.integers(len(found)))]
    return data[: place.start()] + ODD[int(random.integers(len(ODD)))].encode() + data[place.end() :]


def _repacked(data: bytes, random: np.random.Generator) -> bytes:
    """A GLB whose JSON is changed, and its lengths with it."""
    length = struct.unpack_from("<I", data, 12)[0]
    text = json.dumps(_changed(json.loads(data[20 : 20 + length]), random)).encode()
    text += b" " * (-len(text) % 4)
    rest = data[20 + length :]
    head = struct.pack("<4sII", b"glTF", 2, 20 + len(text) + len(rest))
    return head + struct.pack("<II", len(text), 0x4E4F534A) + text + rest


def _changed(document: Any, random: np.random.Generator) -> Any:
    """One to four values of JSON replaced, left out, or taken from elsewhere in it."""
    for _ in range(random.integers(1, 5)):
        places = [(owner, key) for owner in _owners(document) for key in _keys(owner)]
        if not places:
            break
        owner, key = places[int(random.integers(len(places)))]
        way = random.random()
        if way < 0.15:
            del owner[key]
        elif way < 0.3:
            other, there = places[int(random.integers(len(places)))]
            owner[key] = json.loads(json.dumps(other[there]))
        elif way < 0.5 and isinstance(owner[key], int):
            owner[key] = owner[key] + int(random.choice([-1, 1, 7, 1000, 10**7]))
        else:
            owner[key] = VALUES[int(random.integers(len(VALUES)))]
    return document


def _owners(value: Any) -> list[Any]:
    """All objects and lists in a JSON value."""
    found, stack = [], [value]
    while stack:
        value = stack.pop()
        if isinstance(value, (dict, list)):
            found.append(value)
            stack.extend(value.values() if isinstance(value, dict) else value)
    return found


def _keys(owner: Any) -> list[Any]:
    return list(owner) if isinstance(owner, dict) else list(range(len(owner)))
