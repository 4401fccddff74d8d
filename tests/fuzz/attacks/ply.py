"""PLY: headers that promise what does not follow, and numbers that are none."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import Any

from gltf_builder import QUAD

from fuzz.attacks.files import NINES, Attack, text


def ply() -> Iterator[Attack]:
    def head(
        form: str, vertices: Any, faces: Any, listed: str = "list uchar int vertex_indices", more: str = ""
    ) -> str:
        return (f"ply\nformat {form} 1.0\nelement vertex {vertices}\nproperty float x\nproperty float y\nproperty float z\n"
                f"{more}element face {faces}\nproperty {listed}\nend_header\n")  # fmt: skip

    points = "0 0 0\n1 0 0\n0 1 0\n"
    for count in ("-1", "0", "1e3", str(10**9), str(2**63), str(2**64), NINES, "\u0663", "x", ""):
        yield f"PLY of {count[:30]} vertices", text("a.ply", head("ascii", count, 1) + points + "3 0 1 2\n")
        yield f"PLY of {count[:30]} faces", text("a.ply", head("ascii", 3, count) + points + "3 0 1 2\n")
    for length in ("nan", "inf", "-inf", "-1", "1e300", "1e18", "0.5", "2", "9" * 60, NINES):
        yield (
            f"PLY with a list of {length[:30]}",
            text("a.ply", head("ascii", 3, 1) + points + f"{length} 0 1 2\n"),
        )
    for index in ("nan", "inf", "-inf", "-1", "3", "1e300", "1.5"):
        yield f"PLY with index {index}", text("a.ply", head("ascii", 3, 1) + points + f"3 0 1 {index}\n")
        yield (
            f"PLY with index {index} as float",
            text(
                "a.ply", head("ascii", 3, 1, "list uchar float vertex_indices") + points + f"3 0 1 {index}\n"
            ),
        )
    for value in ("nan", "inf", "1e400", "x", "1" * 65):
        yield (
            f"PLY at {value[:20]}",
            text("a.ply", head("ascii", 3, 1) + f"0 0 0\n1 0 0\n0 1 {value}\n3 0 1 2\n"),
        )
        yield (
            f"PLY of bytes at {value[:20]}",
            text(
                "a.ply",
                head("ascii", 3, 1, more="property uchar red\nproperty uchar green\nproperty uchar blue\n")
                + f"0 0 0 {value} 0 0\n" * 3
                + "3 0 1 2\n",
            ),
        )
    for listed in (
        "list float int vertex_indices",
        "list int list vertex_indices",
        "list uchar half vertex_indices",
        "int",
    ):
        yield f"PLY of {listed}", text("a.ply", head("ascii", 3, 1, listed) + points + "3 0 1 2\n")
    for order in "<>":
        form = "binary_little_endian" if order == "<" else "binary_big_endian"
        for length in (-1, 2**31 - 1, 1000, 0):
            body = QUAD.astype(order + "f4").tobytes() + struct.pack(order + "i3i", length, 0, 1, 2)
            yield (
                f"PLY, {form}, with a list of {length}",
                text("a.ply", head(form, 4, 1, "list int int vertex_indices").encode() + body),
            )
    yield (
        "PLY of 2e8 things without properties",
        text(
            "a.ply",
            head("ascii", 3, 1).replace("element vertex", "element x 200000000\nelement vertex")
            + points
            + "3 0 1 2\n",
        ),
    )
    yield (
        "PLY of 2e8 bytes without properties",
        text(
            "a.ply",
            head("binary_little_endian", 0, 0).replace(
                "element vertex", "element x 200000000\nelement vertex"
            ),
        ),
    )
    yield (
        "PLY of 50,000 properties",
        text(
            "a.ply",
            "ply\nformat ascii 1.0\nelement vertex 1\n"
            + "".join(f"property float p{k}\n" for k in range(40_000))
            + "end_header\n"
            + "1 " * 40_000,
        ),
    )
    yield (
        "PLY of 50,000 properties in bytes",
        text(
            "a.ply",
            b"ply\nformat binary_little_endian 1.0\nelement vertex 1\n"
            + b"".join(b"property float p%d\n" % k for k in range(40_000))
            + b"end_header\n"
            + bytes(160_000),
        ),
    )
    yield (
        "PLY of 30,000 elements",
        text(
            "a.ply",
            "ply\nformat ascii 1.0\n"
            + "".join(f"element e{k} 0\nproperty list int int a\n" for k in range(30_000))
            + "end_header\n",
        ),
    )
    yield "PLY without an end", text("a.ply", "ply\nformat ascii 1.0\n" + "comment x\n" * 200_000)
    yield "PLY of a word of 20 MB", text("a.ply", lambda: head("ascii", 3, 1) + "1" * (20 << 20))
    yield (
        "PLY of a million lists of nothing",
        text("a.ply", lambda: head("ascii", 3, 2_000_000) + points + "0\n" * 2_000_000),
    )
