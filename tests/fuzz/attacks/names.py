"""Names: of files that a file asks for, and of the file itself."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

from fuzz.attacks.files import WORN, Attack, gltf, text
from fuzz.seeds import MTL, OBJ, furnished, stl_bytes


def names() -> Iterator[Attack]:
    """Names of files that a glTF, an MTL or a PLY asks for."""
    given = {"long": "a" * 300, "very long": "a" * 1_000_000, "deep": "a/" * 5000 + "a", "up": "../" * 5000 + "etc/passwd",
             "absolute": "/etc/passwd", "NUL": "a\0b", "ring": "ring/a", "dots": ".", "none": "", "folder": "folder",
             "pipe": "pipe", "device": "zero", "surrogate": "\ud800", "no UTF-8": "%ff%fe.bin", "scheme": "file:///etc/passwd",
             "server": "//host/share", "drive": "C:\\a", "newline": "a\nb", "escape": "\x1b[2J"}  # fmt: skip

    def prepared(folder: Path) -> None:
        (folder / "ring").symlink_to("ring2")
        (folder / "ring2").symlink_to("ring")
        (folder / "folder").mkdir()
        os.mkfifo(folder / "pipe")
        (folder / "zero").symlink_to("/dev/zero")
        (folder / os.fsdecode(b"\xff\xfe.bin")).write_bytes(b"x")

    def asked(kind: str, name: str, folder: Path) -> Path:
        prepared(folder)
        if kind == "gltf":
            data = json.dumps({"asset": {"version": "2.0"}, "buffers": [{"byteLength": 1, "uri": name}],
                "bufferViews": [{"buffer": 0, "byteLength": 1}], "nodes": [{"mesh": 0}],
                "accessors": [{"bufferView": 0, "componentType": 5121, "count": 1, "type": "VEC3"}],
                "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}]})  # fmt: skip
            return text("a.gltf", data)(folder)
        name = name.encode("utf-8", "surrogatepass")
        if kind == "ply":
            head = (
                b"ply\nformat ascii 1.0\ncomment TextureFile "
                + name
                + b"\nelement vertex 3\nproperty float x\n"
            )
            head += (
                b"property float y\nproperty float z\nproperty float s\nproperty float t\nelement face 1\n"
            )
            return text("a.ply", head + b"property list uchar int vertex_indices\nend_header\n0 0 0 0 0\n1 0 0 0 0\n"
                        b"0 1 0 0 0\n3 0 1 2\n")(folder)  # fmt: skip
        if kind == "mtllib":
            return text("a.obj", b"mtllib " + name + b"\n" + WORN.encode())(folder)
        return text("a.obj", "mtllib a.mtl\n" + WORN, **{"a.mtl": b"newmtl m\nmap_Kd " + name + b"\n"})(
            folder
        )

    for kind in ("gltf", "ply", "mtllib", "map"):
        for about, name in given.items():
            yield f"{kind} asks for a name that is {about}", partial(asked, kind, name)
    yield (
        "an mtllib of 300,000 names",
        text("a.obj", "mtllib " + " ".join(f"n{k}" for k in range(300_000)) + "\n" + WORN),
    )
    yield "300,000 mtllibs", text("a.obj", "".join(f"mtllib n{k}\n" for k in range(300_000)) + WORN)
    yield "one MTL under 20,000 names", text(
        "a.obj", "mtllib " + " ".join("./" * k + "a.mtl" for k in range(600)) + "\n" + WORN,
        **{"a.mtl": "".join(f"newmtl {k}\nKd 1 1 1\n" for k in range(20_000))})  # fmt: skip
    yield "100,000 images that are not there", gltf(
        accessors=[{"componentType": 5126, "count": 3, "type": t} for t in ("VEC3", "VEC2")],
        images=[{"uri": f"{k}.png"} for k in range(100_000)], textures=[{"source": k} for k in range(100_000)],
        materials=[{"normalTexture": {"index": k}} for k in range(100_000)],
        meshes=[{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "material": k} for k in range(100_000)]}],
        nodes=[{"mesh": 0}])  # fmt: skip


def places() -> Iterator[Attack]:
    """What is given for the file itself."""
    yield "a folder", lambda folder: _made(folder / "a.obj", lambda p: p.mkdir())
    yield "a pipe", lambda folder: _made(folder / "a.obj", os.mkfifo)
    yield "a link to a device", lambda folder: _made(folder / "a.obj", lambda p: p.symlink_to("/dev/zero"))
    yield "a link to itself", lambda folder: _made(folder / "a.obj", lambda p: p.symlink_to("a.obj"))
    yield "a link to nothing", lambda folder: _made(folder / "a.obj", lambda p: p.symlink_to("b.obj"))
    yield "a file below a file", lambda folder: text("a", "x")(folder) / "b.obj"
    for kind, data in (("obj", OBJ.encode()), ("stl", stl_bytes())):
        yield f"a name that is no UTF-8, {kind}", lambda folder, k=kind, d=data: _made(
            folder / os.fsdecode(b"caf\xe9." + k.encode()), lambda p: p.write_bytes(d))  # fmt: skip
    for name in (
        "a" * 300 + ".obj",
        "a" * 100_000 + ".obj",
        "a/" * 3000 + "a.obj",
        "a\0.obj",
        "\n.obj",
        ".obj",
        "obj",
        "a.OBJ ",
        "\ud800.obj",
    ):
        yield f"the name {name[:20]!r}", lambda folder, n=name: f"{folder}/{n}"
    yield "an empty file of each kind: obj", text("a.obj", "")
    for kind in ("gltf", "glb", "ply", "stl"):
        yield f"an empty file of each kind: {kind}", text(f"a.{kind}", "")
        yield f"an OBJ called {kind}", text(f"a.{kind}", OBJ)
    for name, value in (("up", "z"), ("smooth_normals", True)):
        for kind in ("a.obj", "a.glb"):
            yield (
                f"{kind} with {name}",
                lambda folder, k=kind, o={name: value}: (
                    (text("a.obj", OBJ, **{"a.mtl": MTL})(folder), o)
                    if k == "a.obj"
                    else (furnished().save_glb(folder / k), o)
                ),
            )


def _made(path: Path, make: Callable[[Path], Any]) -> Path:
    make(path)
    return path
