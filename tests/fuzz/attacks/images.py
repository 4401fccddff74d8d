"""Images that are small files and large pictures, or no pictures at all."""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Iterator
from functools import cache, partial
from typing import Any

from gltf_builder import QUAD, GltfBuilder
from PIL import Image

from fuzz.attacks.files import WORN, Attack, built, text
from fuzz.seeds import encoded


def pictures() -> Iterator[Attack]:
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


def png(
    width: int, height: int, *, bits: int = 8, kind: int = 2, before: bytes = b"", body: bytes | None = None
) -> bytes:
    """A PNG, all of one color; `body` instead of its pixels."""
    channels = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}.get(kind, 3)
    row = 1 + (width * channels * bits + 7) // 8
    body = squeezed(row, height) if body is None else body
    head = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, bits, kind, 0, 0, 0))
    return b"\x89PNG\r\n\x1a\n" + head + before + chunk(b"IDAT", body) + chunk(b"IEND", b"")


def chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


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
