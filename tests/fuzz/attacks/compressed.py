"""Small streams of large arrays and pictures: meshopt, Draco, KTX2."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import Any

import numpy as np
from gltf_builder import QUAD, GltfBuilder

from fuzz.attacks.files import Attack, built

ELEMENTS = 1 << 20


def streams() -> Iterator[Attack]:
    yield "a meshopt view of a terabyte", built(lambda: zeros(1, 1 << 38, b"\xa0" + bytes(32)))
    yield "a meshopt view of zeros", built(lambda: zeros(1, ELEMENTS))
    yield "2,000 meshopt views of the same zeros", built(lambda: zeros(2000, ELEMENTS))
    yield "a meshopt stream of no bytes", built(lambda: zeros(1, ELEMENTS, b""))
    yield "3,000 Draco streams of noise", built(lambda: draco(3000))
    yield "a Draco stream of 1e8 vertices", built(lambda: draco(1, 10**8))
    for side in (4096, 8000, 60_000):
        yield f"60 KTX2 of {side}", built(lambda side=side: showing(60, side))
    yield "3,000 KTX2 of noise", built(lambda: showing(3000, 64, noise=True))


def zeros(count: int, elements: int, stream: bytes | None = None) -> GltfBuilder:
    """`count` meshes whose positions are zeros, packed 64 to 1: no bits for each group but two in its header."""
    most = 256  # elements of a block
    blocks = [min(most, elements - first) for first in range(0, elements, most)] if stream is None else []
    body = b"".join(bytes(12 * ((each + 63) // 64)) for each in blocks)
    builder = GltfBuilder(extensionsRequired=["EXT_meshopt_compression"])
    packed = builder.view(b"\xa0" + body + bytes(32) if stream is None else stream)
    about = {**builder.json["bufferViews"][packed], "byteStride": 12, "count": elements, "mode": "ATTRIBUTES"}
    for _ in range(count):
        view = builder.put("bufferViews", {"buffer": 0, "byteLength": 12 * elements,
                                           "extensions": {"EXT_meshopt_compression": about}})  # fmt: skip
        accessor = {"bufferView": view, "componentType": 5126, "count": elements, "type": "VEC3"}
        primitive = {"attributes": {"POSITION": builder.put("accessors", accessor)}}
        builder.node(mesh=builder.put("meshes", {"primitives": [primitive]}))
    return builder


def draco(count: int, vertices: int = 100) -> GltfBuilder:
    """`count` meshes of streams that are one only in their first bytes."""
    name, rng = "KHR_draco_mesh_compression", np.random.default_rng(1)
    builder = GltfBuilder(extensionsUsed=[name])
    for _ in range(count):
        view = builder.view(b"DRACO\2\2\1\1\0\0" + rng.bytes(200))
        extension: dict[str, Any] = {name: {"bufferView": view, "attributes": {"POSITION": 0}}}
        position = builder.put("accessors", {"componentType": 5126, "count": vertices, "type": "VEC3"})
        indices = builder.put("accessors", {"componentType": 5125, "count": 300, "type": "SCALAR"})
        primitive = {"attributes": {"POSITION": position}, "indices": indices, "extensions": extension}
        builder.node(mesh=builder.put("meshes", {"primitives": [primitive]}))
    return builder


def showing(count: int, side: int, *, noise: bool = False) -> GltfBuilder:
    """`count` pictures of one block, repeated by Zstandard, 128 KiB in 4 bytes; or of noise."""
    name, rng = "KHR_texture_basisu", np.random.default_rng(1)
    builder = GltfBuilder(extensionsUsed=[name])
    size = (side // 4) ** 2 * 16
    runs = [min(1 << 17, size - at) for at in range(0, size, 1 << 17)]
    blocks = b"".join(
        struct.pack("<I", run << 3 | 2 | (k == len(runs) - 1))[:3] + b"\x17" for k, run in enumerate(runs)
    )
    frame = b"\x28\xb5\x2f\xfd\xa0" + struct.pack("<I", size & 0xFFFFFFFF) + blocks
    descriptor = struct.pack("<3I4B4B8BHBB3I", 44, 0, 40 << 16 | 2, 166, 1, 2, 0, 3, 3, 0, 0, 16, 0, 0, 0, 0,
                             0, 0, 0, 0, 127, 3, 0, 0, 0xFFFFFFFF)  # fmt: skip
    for k in range(count):
        stored = (
            rng.bytes(300) if noise else frame + struct.pack("<II", 0x184D2A50, 1) + bytes([k])
        )  # a frame to skip
        head = b"\xabKTX 20\xbb\r\n\x1a\n" + struct.pack("<9I", 0, 1, side, side, 0, 0, 1, 1, 2)
        head += struct.pack("<4I2Q", 104, len(descriptor), 0, 0, 0, 0) + struct.pack(
            "<3Q", 160, len(stored), size
        )
        picture = (head + descriptor).ljust(160, b"\0") + stored
        image = builder.put("images", {"bufferView": builder.view(picture), "mimeType": "image/ktx2"})
        texture = builder.put("textures", {"extensions": {name: {"source": image}}})
        slot = {"baseColorTexture": {"index": texture}}
        material = builder.put("materials", {"pbrMetallicRoughness": slot})
        uv = QUAD[:, :2].copy()
        builder.node(mesh=builder.mesh(more={"material": material}, POSITION=QUAD, TEXCOORD_0=uv))
    return builder
