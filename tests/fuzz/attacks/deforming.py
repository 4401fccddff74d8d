"""glTF files whose skins and morph targets ask for more than their bytes hold, many times over."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np
from gltf_builder import QUAD, GltfBuilder

from fuzz.attacks.files import Attack, built

ZEROS = {"componentType": 5126, "count": 1_000_000, "type": "VEC3"}


def deforming() -> Iterator[Attack]:
    def bent(count: int, vertices: int) -> GltfBuilder:
        """So many nodes with one mesh and one skin."""
        builder = GltfBuilder()
        points = builder.put("accessors", {**ZEROS, "count": vertices})
        joints = builder.put("accessors", {"componentType": 5121, "count": vertices, "type": "VEC4"})
        weights = builder.put("accessors", {**ZEROS, "count": vertices, "type": "VEC4"})
        attributes = {"POSITION": points, "JOINTS_0": joints, "WEIGHTS_0": weights}
        mesh = builder.put("meshes", {"primitives": [{"attributes": attributes}]})
        builder.put("skins", {"joints": [0]})
        for _ in range(count):
            builder.node(mesh=mesh, skin=0)
        return builder

    def targets(count: int, *, sparse: bool) -> GltfBuilder:
        """So many morph targets of a mesh of a million vertices, all by one accessor."""
        builder = GltfBuilder()
        points, delta = builder.put("accessors", ZEROS), dict(ZEROS)
        if sparse:
            at, value = builder.view(np.uint32([5]).tobytes()), builder.view(QUAD[:1].tobytes())
            indices = {"bufferView": at, "componentType": 5125}
            delta["sparse"] = {"count": 1, "indices": indices, "values": {"bufferView": value}}
        moves = builder.put("accessors", delta)
        primitive = {"attributes": {"POSITION": points}, "targets": [{"POSITION": moves}] * count}
        mesh = builder.put("meshes", {"primitives": [primitive], "weights": [1.0] * count})
        builder.node(mesh=mesh)
        return builder

    def skins(count: int, joints: int) -> GltfBuilder:
        """So many skins that share their joints and their matrices."""
        builder = GltfBuilder()
        numbers, shares = np.zeros((4, 4), np.uint8), np.ones((4, 4), np.float32)
        mesh = builder.mesh(POSITION=QUAD, JOINTS_0=numbers, WEIGHTS_0=shares)
        bind = builder.accessor(np.tile(np.eye(4, dtype=np.float32).reshape(1, 16), (joints, 1)))
        for k in range(count):
            builder.put("skins", {"joints": [0] * joints, "inverseBindMatrices": bind})
            builder.node(mesh=mesh, skin=k)
        return builder

    for count, vertices in ((1, 1_000_000), (100, 900_000), (50_000, 3000), (1000, 10**9)):
        yield f"{count} nodes that bend {vertices} vertices", built(partial(bent, count, vertices))
    for count in (3, 300, 100_000):
        for sparse in (True, False):
            what = "a sparse accessor" if sparse else "nothing"
            yield f"{count} morph targets over {what}", built(partial(targets, count, sparse=sparse))
    for count, joints in ((1, 100_000), (20_000, 100), (300, 10_000)):
        yield f"{count} skins of {joints} joints", built(partial(skins, count, joints))
