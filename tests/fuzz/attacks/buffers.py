"""glTF accessors that ask for more than their buffers hold, many times over."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from gltf_builder import QUAD, GltfBuilder

from fuzz.attacks.files import Attack, built, gltf


def accessors() -> Iterator[Attack]:
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
