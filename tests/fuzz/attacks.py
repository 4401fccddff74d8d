"""Files made to do harm: a table of what was found, and of what might be tried.

Each is a name and a function that writes files into a folder and returns the path to load, or the path and options.
"""

from __future__ import annotations

import io
import json
import os
import struct
import zlib
from collections.abc import Callable, Iterator
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from gltf_builder import GltfBuilder
from PIL import Image

from fuzz.seeds import MTL, OBJ, QUAD, encoded, furnished, stl_bytes

Target = Path | str | tuple[Path, dict[str, Any]]
Attack = tuple[str, Callable[[Path], Target]]
TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
CORNERS = "vt 0 0\nvt 1 0\nvt 0 1\n"
WORN = TRIANGLE + CORNERS + "usemtl m\nf 1/1 2/2 3/3\n"
NINES = "9" * 5000


def attacks() -> Iterator[Attack]:
    """Yield all of them."""
    for source in (_accessors, _pictures, _numbers, _nodes, _names, _obj, _mtl, _ply, _stl, _places, _large):
        yield from source()


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


def chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def png(
    width: int, height: int, *, bits: int = 8, kind: int = 2, before: bytes = b"", body: bytes | None = None
) -> bytes:
    """A PNG, all of one color; `body` instead of its pixels."""
    channels = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}.get(kind, 3)
    row = 1 + (width * channels * bits + 7) // 8
    body = squeezed(row, height) if body is None else body
    head = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, bits, kind, 0, 0, 0))
    return b"\x89PNG\r\n\x1a\n" + head + before + chunk(b"IDAT", body) + chunk(b"IEND", b"")


@cache
def squeezed(row: int, count: int) -> bytes:
    """So many rows of zeros, compressed."""
    squeeze = zlib.compressobj(9)
    return b"".join(squeeze.compress(bytes(row)) for _ in range(count)) + squeeze.flush()


def jpeg(width: int, height: int, scans: int, mode: str = "L") -> bytes:
    """A JPEG whose last scan is there many times."""
    data = saved("JPEG", (width, height), mode, progressive=True, quality=20)
    return data[:-2] + data[data.rfind(b"\xff\xda") : -2] * scans + data[-2:]


@cache
def saved(kind: str, size: tuple[int, int], mode: str = "RGB", **options: Any) -> bytes:
    stream = io.BytesIO()
    Image.new(mode, size).save(stream, kind, **options)
    return stream.getvalue()


def showing(pictures: list[bytes], *, share: bool = False) -> GltfBuilder:
    """A triangle for each picture; with `share`, all images are of the first's bytes."""
    builder, views = GltfBuilder(), []
    points, uv = builder.accessor(QUAD[:3]), builder.accessor(QUAD[:3, :2].copy())
    for k, picture in enumerate(pictures):
        views.append(views[0] if share and views else builder.view(picture))
        image = builder.put("images", {"bufferView": views[-1], "name": f"p{k}"})
        texture = builder.put("textures", {"source": image})
        pbr = {"baseColorTexture": {"index": texture}, "metallicRoughnessTexture": {"index": texture}}
        material = builder.put("materials", {"pbrMetallicRoughness": pbr})
        primitive = {"attributes": {"POSITION": points, "TEXCOORD_0": uv}, "material": material}
        builder.node(mesh=builder.put("meshes", {"primitives": [primitive]}))
    return builder


def _accessors() -> Iterator[Attack]:
    zeros = {"componentType": 5126, "count": 1_000_000, "type": "VEC3"}

    def meshes(number: int, mode: int, names: tuple[str, ...], **more: Any) -> Callable[[Path], Path]:
        kinds = {"POSITION": "VEC3", "NORMAL": "VEC3", "TANGENT": "VEC4", "TEXCOORD_0": "VEC2", "TEXCOORD_1": "VEC2",
                 "COLOR_0": "VEC4"}  # fmt: skip
        accessors = [{**zeros, "type": kinds[name], **more} for _ in range(number) for name in names]
        primitives = [
            {"mode": mode, "attributes": {name: k * len(names) + i for i, name in enumerate(names)}}
            for k in range(number)
        ]
        return gltf(accessors=accessors, meshes=[{"primitives": primitives}], nodes=[{"mesh": 0}])

    full = ("POSITION", "NORMAL", "TANGENT", "TEXCOORD_0", "TEXCOORD_1", "COLOR_0")
    for count in (1, 30, 300, 3000):
        for mode in (4, 5, 6):
            yield f"{count} primitives over nothing, mode {mode}", meshes(count, mode, ("POSITION",))
        yield f"{count} primitives over nothing, all attributes", meshes(count, 4, full)
    for count in (10**6 + 1, 10**9, 2**31, 2**63, 10**30):
        yield f"an accessor of {count}", meshes(1, 4, ("POSITION",), count=count)

    def few_of_many(count: int) -> GltfBuilder:
        builder = GltfBuilder()
        points = builder.put("accessors", zeros)
        for k in range(count):
            corners = builder.accessor(np.array([0, k, 999_999], np.uint32))
            builder.put("meshes", {"primitives": [{"attributes": {"POSITION": points}, "indices": corners}]})
            builder.node(mesh=k)
        return builder

    def patched(count: int) -> GltfBuilder:
        builder = GltfBuilder()
        at, value = builder.view(struct.pack("<I", 5)), builder.view(QUAD[:1].tobytes())
        sparse = {
            "count": 1,
            "indices": {"bufferView": at, "componentType": 5125},
            "values": {"bufferView": value},
        }
        points = builder.put("accessors", {**zeros, "sparse": sparse})
        for k in range(count):
            corners = builder.accessor(np.array([0, k, 999_999], np.uint32))
            builder.put("meshes", {"primitives": [{"attributes": {"POSITION": points}, "indices": corners}]})
            builder.node(mesh=k)
        return builder

    def channels(count: int, times: int, share: bool) -> GltfBuilder:
        builder = GltfBuilder()
        builder.node(name="a")
        keys = builder.accessor(np.arange(times, dtype=np.float32))
        samplers = []
        for _ in range(1 if share else count):
            values = builder.put("accessors", {**zeros, "count": times})
            samplers.append({"input": keys, "output": values})
        target = {"node": 0, "path": "translation"}
        moves = [{"sampler": k % len(samplers), "target": target} for k in range(count)]
        builder.put("animations", {"channels": moves, "samplers": samplers})
        return builder

    def copies(count: int, nodes: int) -> GltfBuilder:
        builder = GltfBuilder()
        mesh = builder.mesh()
        places = builder.put("accessors", {**zeros, "count": count})
        for _ in range(nodes):
            builder.node(
                mesh=mesh, extensions={"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": places}}}
            )
        return builder

    for count in (100, 5000):
        yield f"{count} triangles over a million vertices", built(partial(few_of_many, count))
        yield f"{count} triangles over a sparse accessor", built(partial(patched, count))
    for share in (True, False):
        yield f"2,000 channels over nothing, share {share}", built(partial(channels, 2000, 1_000_000, share))
        yield f"20,000 channels over nothing, share {share}", built(partial(channels, 20_000, 1000, share))
    for count, nodes in ((1_000_000, 1), (1_000_000, 1000), (1000, 100_000), (10**9, 1)):
        yield f"{nodes} nodes of {count} copies", built(partial(copies, count, nodes))


def _pictures() -> Iterator[Attack]:
    side = 4096
    yield "60 images share a PNG of 4096", built(lambda: showing([png(side, side)] * 60, share=True))
    yield "60 equal PNG of 4096", built(lambda: showing([png(side, side)] * 60))
    shades = partial(png, side, side)
    yield (
        "60 PNG of 4096",
        built(lambda: showing([shades(before=chunk(b"tEXt", b"k\0%d" % k)) for k in range(60)])),
    )
    yield (
        "400 PNG of 4096",
        built(lambda: showing([shades(before=chunk(b"tEXt", b"k\0%d" % k)) for k in range(400)])),
    )
    yield (
        "5,000 PNG of 1024",
        built(
            lambda: showing(
                [(p := png(1024, 1024))[:-12] + chunk(b"tEXt", b"k\0%d" % k) + p[-12:] for k in range(5000)]
            )
        ),
    )
    yield "5,000 broken PNG", built(lambda: showing([png(64, 64)[:-30] + b"%d" % k for k in range(5000)]))
    yield "20,000 images of noise", built(lambda: showing([b"noise %d" % k for k in range(20_000)]))
    for scans in (100, 1000, 3000, 20_000):
        yield f"a JPEG of {scans} scans", built(lambda n=scans: showing([jpeg(side, side, n)]))
    yield "a JPEG of 64 M pixels", built(lambda: showing([jpeg(8000, 8000, 0, "RGB")]))
    yield "a JPEG of 64 M pixels of four bands", built(lambda: showing([jpeg(8000, 8000, 0, "CMYK")]))
    yield "a JPEG of 64 M pixels and 20 scans", built(lambda: showing([jpeg(8000, 8000, 20, "RGB")]))
    yield "20 JPEG of 64 M pixels", built(lambda: showing([jpeg(8000, 8000, k, "RGB") for k in range(20)]))
    for kind in (0, 2, 3, 4, 6):
        yield (
            f"a PNG of 64 M pixels, kind {kind}",
            built(
                lambda k=kind: showing(
                    [png(8000, 8000, kind=k, before=chunk(b"PLTE", bytes(768)) * (k == 3))]
                )
            ),
        )
    for width, height in (
        (64_000_000, 1),
        (1, 64_000_000),
        (60_000, 1000),
        (1000, 60_000),
        (0, 5),
        (2**31 - 1, 2**31 - 1),
    ):
        yield (
            f"a PNG of {width} x {height}",
            built(lambda w=width, h=height: showing([png(w, h, body=None if w * h < 10**8 else b"")])),
        )
    yield "a PNG of 16 bits and 32 M pixels", built(lambda: showing([png(8000, 4000, bits=16)]))
    yield "a PNG of 16-bit gray and 64 M pixels", built(lambda: showing([png(8000, 8000, bits=16, kind=0)]))
    for kind in (1, 5, 7, 200):
        yield f"a PNG of color type {kind}", built(lambda k=kind: showing([png(64, 64, kind=k)]))
    for bits in (0, 3, 32, 255):
        yield f"a PNG of {bits} bits", built(lambda b=bits: showing([png(64, 64, bits=b)]))
    for name in (b"zTXt", b"iTXt", b"iCCP", b"tEXt"):
        bomb = b"k\0" + (b"\0\0\0\0" if name == b"iTXt" else b"\0") + zlib.compress(bytes(100 << 20))
        yield (
            f"a PNG with a bomb in {name.decode()}",
            built(lambda n=name, b=bomb: showing([png(4, 4, before=chunk(n, b) * 3)])),
        )
    yield (
        "a PNG of a million chunks",
        built(lambda: showing([png(4, 4, before=chunk(b"abCd", b"") * 1_000_000)])),
    )
    yield (
        "a PNG of a million IDAT",
        built(
            lambda: showing([png(4, 4, body=b"").replace(chunk(b"IDAT", b""), chunk(b"IDAT", b"") * 10**6)])
        ),
    )
    yield (
        "a PNG whose pixels are a bomb",
        built(lambda: showing([png(4, 4, body=zlib.compress(bytes(200 << 20)))])),
    )
    for size in ((16383, 3900), (8000, 8000)):
        yield f"a WebP of {size}", built(lambda s=size: showing([saved("WEBP", s, lossless=True, method=0)]))
    head = b"\xff\xd8\xff\xc0" + struct.pack(">HBHHB", 8 + 3 * 255, 8, 4096, 4096, 255)
    yield (
        "a JPEG of 255 bands",
        built(lambda: showing([head + b"".join(bytes([k, 17, 0]) for k in range(255)) + b"\xff\xd9"])),
    )
    yield (
        "a JPEG of a million markers",
        built(lambda: showing([b"\xff\xd8" + b"\xff\xe1\0\2" * 10**6 + encoded("JPEG")[2:]])),
    )
    many = {"PNG": 8000, "JPEG": 8000, "BMP": 7000, "TGA": 7000, "GIF": 8000, "TIFF": 7000}
    for kind, wide in many.items():
        options = {"TGA": {"compression": "tga_rle"}, "TIFF": {"compression": "tiff_lzw"}}.get(kind, {})
        mode = {"GIF": "P", "BMP": "1"}.get(kind, "RGB")
        yield f"an MTL with a {kind} of {wide}", text("a.obj", "mtllib a.mtl\n" + WORN,
            **{"a.mtl": "newmtl m\nmap_Kd p\n", "p": partial(saved, kind, (wide, wide), mode, **options)})  # fmt: skip
    frames = [Image.new("P", (1000, 1000), k) for k in range(50)]
    yield "a GIF of 50 pictures", text("a.obj", "mtllib a.mtl\n" + WORN, **{"a.mtl": "newmtl m\nmap_Kd p\n",
          "p": partial(saved.__wrapped__, "GIF", (1000, 1000), "P", save_all=True, append_images=frames)})  # fmt: skip


def _numbers() -> Iterator[Attack]:
    """One number of a glTF file, replaced."""
    values = (-1, 2**31, 2**32, 2**63, 2**64, 10**30, 1e308, 0.5, "1", None, [], {}, True)
    places = [("accessors", "count"), ("accessors", "byteOffset"), ("accessors", "bufferView"),
              ("bufferViews", "byteOffset"), ("bufferViews", "byteLength"), ("bufferViews", "byteStride"),
              ("nodes", "mesh"), ("nodes", "children"), ("nodes", "scale")]  # fmt: skip

    def replaced(kind: str, name: str, value: Any) -> GltfBuilder:
        builder = furnished()
        builder.json[kind][0][name] = value
        return builder

    for kind, name in places:
        for value in values:
            yield f"{kind}[0].{name} = {value!r}", built(partial(replaced, kind, name, value))


def _nodes() -> Iterator[Attack]:
    def chain(count: int) -> Callable[[Path], Path]:
        return gltf(nodes=[{"children": [k + 1]} for k in range(count)] + [{}], scenes=[{"nodes": [0]}])

    yield "a chain of 100,000 nodes", chain(100_000)
    yield "a chain of 900,000 nodes", chain(900_000)
    yield (
        "a ring of nodes",
        gltf(nodes=[{"children": [(k + 1) % 9]} for k in range(9)], scenes=[{"nodes": [0]}]),
    )
    yield "a million nodes", gltf(nodes=[{}] * 1_000_000)
    yield "two million nodes", gltf(nodes=[{}] * 2_000_000)
    yield "a node whose children are all", gltf(nodes=[{"children": list(range(1, 100_000))}] + [{}] * 99_999)
    yield "all nodes share a child", gltf(nodes=[{"children": [0]} for _ in range(100_000)])
    yield "a scene of a million roots of one", gltf(nodes=[{}], scenes=[{"nodes": [0] * 1_000_000}])
    for kind in ("materials", "textures", "samplers", "images", "scenes"):
        yield f"a million {kind}", gltf(**{kind: [{}] * 1_000_000})
    yield "100,000 extensions", gltf(extensionsUsed=[f"EXT_{k}" for k in range(100_000)])
    yield "brackets", text("a.gltf", b'{"asset":{"version":"2.0"},"extras":' + b"[" * 10**6)
    yield (
        "braces",
        text("a.gltf", b'{"asset":{"version":"2.0"},"x":' + b'{"a":' * 10**5 + b"1" + b"}" * 10**5 + b"}"),
    )
    yield "a camera's deep extras", text("a.gltf", b'{"asset":{"version":"2.0"},"cameras":[{"type":"x","extras":'
                                         + b"[" * 900 + b"]" * 900 + b"}]}")  # fmt: skip
    yield "an integer of 5,000 digits", text("a.gltf", '{"asset":{"version":"2.0"},"scene":' + NINES + "}")
    yield (
        "a float of 100,000 digits",
        text("a.gltf", '{"asset":{"version":"2.0"},"nodes":[{"scale":[1,1,0.' + "1" * 10**5 + "]}]}"),
    )
    yield "50,000 primitives of one mesh", gltf(
        accessors=[{"componentType": 5126, "count": 3, "type": "VEC3"}] * 2,
        meshes=[{"primitives": [{"attributes": {"POSITION": k % 2, f"_{k}": 0}} for k in range(50_000)]}],
        nodes=[{"mesh": 0}])  # fmt: skip


def _names() -> Iterator[Attack]:
    """Names of files that a glTF, an MTL or a PLY asks for."""
    names = {"long": "a" * 300, "very long": "a" * 1_000_000, "deep": "a/" * 5000 + "a", "up": "../" * 5000 + "etc/passwd",
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
        for about, name in names.items():
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


def _obj() -> Iterator[Attack]:
    lines = [
        f"s {s}"
        for s in (
            "1e3",
            "-1",
            str(2**31),
            str(2**63 - 1),
            str(2**63),
            str(2**64),
            NINES,
            "0" * 5000,
            "on",
            "",
        )
    ]
    lines += [f"f 1 2 {i}" for i in ("0", "4", "-4", str(2**63), f"-{2**63}", NINES, "-" + NINES, "1.5", "nan", "", "x", "/",
                                     "//", "1/", "1//9", "1/9", "1/1/1/1", "1/-1", "1//-1", "\xb2", "1_0", "+1")]  # fmt: skip
    lines += [
        f"v 0 0 {x}\nf 1 2 4"
        for x in ("nan", "inf", "-1e400", NINES, "0x10", "1_0", "", "x", "1 1 1 nan", "1 1 1 1 1")
    ]
    lines += [f"vn {x}" for x in ("", "1", "nan nan nan")] + [f"vt {x}" for x in ("", "nan", "1e400 1")]
    lines += [f"{k} {'n' * 10**6}" for k in ("o", "g", "usemtl", "#", "call", "mtllib")]
    lines += ["curv 0 1", "p 1", "l 1 2", "call x", "csh rm", "\\", "f", "v", "o", "usemtl", "\0" * 1000]
    for line in lines:
        yield f"OBJ with {line[:40]!r}", text("a.obj", f"{TRIANGLE}{line}\nf 1 2 3\n")
    yield "OBJ in UTF-16", text("a.obj", OBJ.encode("utf-16"))
    yield "OBJ of 20 MB of zeros", text("a.obj", bytes(20 << 20))
    yield "OBJ of 5 M empty lines", text("a.obj", b"\n" * 5_000_000)
    yield "OBJ of continued lines", text("a.obj", b"\\\n" * 2_000_000)
    yield (
        "OBJ of continued lines of words",
        text("a.obj", TRIANGLE.encode() + b"f 1 2 3" + b" \\\n 1" * 500_000),
    )
    yield (
        "OBJ of 30,000 objects",
        text("a.obj", TRIANGLE + "".join(f"o {k}\nf 1 2 3\n" for k in range(30_000))),
    )
    yield (
        "OBJ of 100,000 objects",
        text("a.obj", TRIANGLE + "".join(f"o {k}\nf 1 2 3\n" for k in range(100_000))),
    )
    yield (
        "OBJ of 100,000 materials",
        text("a.obj", TRIANGLE + "".join(f"usemtl {k}\nf 1 2 3\n" for k in range(100_000))),
    )
    yield (
        "OBJ of 100,000 smoothing groups",
        text("a.obj", TRIANGLE + "".join(f"s {k}\nf 1 2 3\n" for k in range(100_000))),
    )
    far = "".join(f"v {k} 0 0\n" for k in range(100_000))
    yield (
        "OBJ of 5,000 objects over 100,000 vertices",
        text("a.obj", far + "".join(f"o {k}\nf 1 {k + 2} 100000\n" for k in range(5000))),
    )
    yield "OBJ of 500 kinds of glass over 100,000 vertices", text(
        "a.obj", "mtllib a.mtl\n" + far + "".join(f"usemtl {k}\nf 1 {k + 2} 100000\n" for k in range(500)),
        **{"a.mtl": "".join(f"newmtl {k}\nillum 7\n" for k in range(500))})  # fmt: skip
    yield "OBJ with a face of a million corners", text("a.obj", TRIANGLE + "f" + " 1 2 3" * 333_333 + "\n")
    star = "".join(
        f"v {x} {y} 0\n"
        for x, y in (((1 + k % 2) * np.cos(k / 20.4), (1 + k % 2) * np.sin(k / 20.4)) for k in range(128))
    )
    comb = "".join(f"v {k} {(k % 2) * 50} 0\n" for k in range(126)) + "v 126 -1 0\nv 0 -1 0\n"
    for about, shape in (("stars", star), ("combs", comb)):
        for count in (300, 3000):
            yield (
                f"OBJ of {count} {about}",
                text("a.obj", shape + ("f " + " ".join(map(str, range(1, 129))) + "\n") * count),
            )
    yield (
        "OBJ of faces of 2,000 sizes",
        text("a.obj", TRIANGLE + "".join("f" + " 1 2 3" * k + "\n" for k in range(1, 1500))),
    )


def _mtl() -> Iterator[Attack]:
    said = [f"illum {x}" for x in ("nan", "inf", "-1", "11", "1e400", NINES, "x", "")]
    said += [
        f"{k} {x}"
        for k in ("Kd", "Ks", "Ns", "d", "Tr", "Ni", "Tf", "Ke", "Pr", "Pm")
        for x in ("nan", "-inf 1 2", NINES, "x")
    ]
    said += ["map_Kd", "map_Kd -s", "map_Kd -s nan 1 p", "map_Kd -o 1e400 p", "map_Kd -mm 1", "map_Kd -s 1e30 1e30 1e30 p",
             "map_Kd " + "-s 1 1 " * 300_000 + "p", "map_Kd " + "-mm 0 1 " * 300_000 + "p", "map_Kd " + "-s " * 500_000 + "p",
             "map_Kd " + "p " * 500_000, "map_Kd p\nmap_d p", "map_Pr p\nmap_Pm q", "norm p\nmap_Ke p"]  # fmt: skip
    for line in said:
        yield (
            f"MTL with {line[:40]!r}",
            text("a.obj", "mtllib a.mtl\n" + WORN, **{"a.mtl": f"newmtl m\n{line}\n", "p": encoded("PNG")}),
        )

    def cutouts(count: int, folder: Path) -> Path:
        """Each of many small masks over one large picture."""
        (folder / "big").write_bytes(png(4096, 4096))
        for k in range(count):
            (folder / f"m{k}").write_bytes(png(2, 2, before=chunk(b"tEXt", b"k\0%d" % k)))
        mtl = "".join(f"newmtl {k}\nmap_Kd big\nmap_d m{k}\n" for k in range(count))
        obj = TRIANGLE + CORNERS + "".join(f"usemtl {k}\nf 1/1 2/2 3/3\n" for k in range(count))
        return text("a.obj", "mtllib a.mtl\n" + obj, **{"a.mtl": mtl})(folder)

    def same(count: int, folder: Path) -> Path:
        (folder / "big").write_bytes(png(4096, 4096, kind=6))
        mtl = "".join(f"newmtl {k}\nmap_Kd big\nmap_Pr big\n" for k in range(count))
        obj = TRIANGLE + CORNERS + "".join(f"usemtl {k}\nf 1/1 2/2 3/3\n" for k in range(count))
        return text("a.obj", "mtllib a.mtl\n" + obj, **{"a.mtl": mtl})(folder)

    for count in (60, 1000):
        yield f"{count} cutouts of one picture", partial(cutouts, count)
        yield f"{count} materials of one picture", partial(same, count)
    yield (
        "MTL of 300,000 materials",
        text("a.obj", "mtllib a.mtl\n" + WORN, **{"a.mtl": "".join(f"newmtl {k}\n" for k in range(300_000))}),
    )


def _ply() -> Iterator[Attack]:
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


def _stl() -> Iterator[Attack]:
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


def _places() -> Iterator[Attack]:
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


def _large() -> Iterator[Attack]:
    """Smooth normals where they are hard to find."""

    def fan(folder: Path) -> Target:
        """One vertex that 300,000 triangles share."""
        turn = np.linspace(0.0, 6.28, 300_001)
        rim = np.stack([np.cos(turn), np.sin(turn), turn * 0.0], axis=1)
        triangles = np.stack([rim * 0.0, rim, np.roll(rim, -1, axis=0)], axis=1).astype("<f4")
        record = np.zeros(len(triangles), np.dtype([("n", "<f4", 3), ("c", "<f4", (3, 3)), ("a", "<u2")]))
        record["c"] = triangles
        path = text("a.stl", bytes(80) + struct.pack("<I", len(record)) + record.tobytes())(folder)
        return path, {"smooth_normals": True, "crease_degrees": 180}

    def leaves(folder: Path) -> Target:
        """One edge that 100,000 triangles share."""
        path = text("a.obj", "".join(f"v {k} 1 0\n" for k in range(100_000)) + "v 0 0 0\nv 0 0 1\n"
                    + "".join(f"f {k + 1} 100001 100002\n" for k in range(100_000)))(folder)  # fmt: skip
        return path, {"smooth_normals": True}

    yield "a fan of 300,000 triangles made smooth", fan
    yield "a book of 100,000 leaves made smooth", leaves
