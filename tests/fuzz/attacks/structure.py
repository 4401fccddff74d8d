"""The JSON of glTF files: wrong numbers, deep and wide trees, long texts."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

from gltf_builder import GltfBuilder

from fuzz.attacks.files import NINES, Attack, built, gltf, text
from fuzz.seeds import furnished


def numbers() -> Iterator[Attack]:
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


def nodes() -> Iterator[Attack]:
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
