"""What attacks are, how they write their files, and bits that several of them spoil."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from gltf_builder import GltfBuilder

Target = Path | str | tuple[Path, dict[str, Any]]
Attack = tuple[str, Callable[[Path], Target]]
TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
CORNERS = "vt 0 0\nvt 1 0\nvt 0 1\n"
WORN = TRIANGLE + CORNERS + "usemtl m\nf 1/1 2/2 3/3\n"
NINES = "9" * 5000


def text(
    name: str, content: str | bytes | Callable[[], str | bytes], **beside: Any
) -> Callable[[Path], Path]:
    """A writer of one file, and of others beside it."""

    def write(folder: Path) -> Path:
        for other, data in {**beside, name: content}.items():
            made = data() if callable(data) else data
            (folder / other).write_bytes(made.encode() if isinstance(made, str) else made)
        return folder / name

    return write


def gltf(**json_: Any) -> Callable[[Path], Path]:
    return text("a.gltf", lambda: json.dumps({"asset": {"version": "2.0"}, **json_}))


def built(make: Callable[[], GltfBuilder]) -> Callable[[Path], Path]:
    return lambda folder: make().save_glb(folder / "a.glb")
