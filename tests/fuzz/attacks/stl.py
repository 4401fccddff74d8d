"""STL: counts, numbers and ends that are wrong."""

from __future__ import annotations

import struct
from collections.abc import Iterator

from fuzz.attacks.files import NINES, Attack, text
from fuzz.seeds import stl_bytes


def stl() -> Iterator[Attack]:
    for count in (0, 1, 3, 2**31, 2**32 - 1):
        yield (
            f"STL of {count} triangles",
            text("a.stl", bytes(80) + struct.pack("<I", count) + stl_bytes()[84:]),
        )
    for value in ("nan", "inf", "1e400", NINES, "x", "", "1_0"):
        yield (
            f"STL at {value[:20]}",
            text(
                "a.stl",
                "solid a\nfacet\n" + f"vertex 0 0 {value}\n" + "vertex 1 0 0\nvertex 0 1 0\nendsolid\n",
            ),
        )
    yield "STL of a million solids", text("a.stl", lambda: "solid a\nfacet\nendsolid\n" * 1_000_000)
    solid = "solid a\nfacet\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendsolid\n"
    yield "STL of 100,000 solids of a triangle", text("a.stl", lambda: solid * 100_000)
    yield "STL without an end", text("a.stl", solid.replace("endsolid", ""))
    yield "STL of NaN in bytes", text("a.stl", bytes(80) + struct.pack("<I", 1) + b"\xff" * 50)
    for length in (0, 5, 79, 83, 84, 90):
        yield f"STL of {length} bytes", text("a.stl", stl_bytes()[:length])
