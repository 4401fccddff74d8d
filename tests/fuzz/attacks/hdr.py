"""Radiance pictures: headers without an end, sizes that are none, and runs that go on and on."""

from __future__ import annotations

from collections.abc import Iterator

from rgbe import HEAD

from fuzz.attacks.files import NINES, Attack, text


def environments() -> Iterator[Attack]:
    body = bytes((9, 9, 9, 129)) * 64
    for size in (
        "0 +X 8",
        "8 +X 0",
        "99999 +X 99999",
        "8192 +X 16384",
        "1 +X 134217728",
        f"{NINES} +X 8",
        "-1 +X 8",
    ):
        yield f"HDR of -Y {size[:30]}", text("a.hdr", HEAD + f"-Y {size}\n".encode() + body)
    yield "HDR of two axes alike", text("a.hdr", HEAD + b"-Y 8 +Y 8\n" + body)
    yield "HDR of a size and no more", text("a.hdr", HEAD + b"-Y 8 +X 8\n")
    yield "HDR of a header of 64 MiB", text("a.hdr", lambda: b"#?RADIANCE\n" + b"A=1\n" * (16 << 20))
    yield "HDR of lines without an end", text("a.hdr", lambda: b"#?RADIANCE" + b" " * (16 << 20))
    yield "HDR of a word of bytes", text("a.hdr", b"#?RADIANCE\nFORMAT=\x1b[2J\xff\n\n-Y 8 +X 8\n" + body)
    yield "HDR of an exposure of bytes", text("a.hdr", b"#?RADIANCE\nEXPOSURE=\x1b[2J\n\n-Y 8 +X 8\n" + body)
    most = b"-Y 8192 +X 16384\n"
    row = bytes((9, 9, 9, 129, 1, 1, 1, 255, 1, 1, 1, 63))  # 1 + 255 + 63 * 256 pixels
    yield "HDR of 8192 rows of repeats", text("a.hdr", lambda: HEAD + most + row * 8192)
    runs = b"".join(bytes((255, value)) * 129 + bytes((129, value)) for value in (1, 2, 3, 129))
    channels = bytes((2, 2, 64, 0)) + runs
    yield "HDR of 8192 rows of runs", text("a.hdr", lambda: HEAD + most + channels * 8192)
    nothing = bytes((9, 9, 9, 129)) + bytes((1, 1, 1, 0)) * 4_000_000
    yield "HDR of repeats of none", text("a.hdr", lambda: HEAD + b"-Y 1 +X 8\n" + nothing)
    yield "HDR of the brightest", text("a.hdr", HEAD + b"-Y 8 +X 8\n" + b"\xff" * 256)
