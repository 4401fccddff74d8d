"""What traversal hands on: rays, hits, and meshes and boxes as rays meet them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ispm.optics.vector import Vector


class Hit(NamedTuple):
    """What a ray meets. u, v: barycentrics of the triangle's second and third corner."""

    instance: np.uint32
    primitive: np.uint32
    u: np.float32
    v: np.float32


class Ray(NamedTuple):
    """Where a ray starts, its direction, which need not be unit, and the end in units of that."""

    origin: Vector
    direction: Vector
    t_max: np.float32


class Scratch(NamedTuple):
    """Addresses that one thread's rays work in: a stack of STACK_WORDS words, and the words of a hit."""

    stack: np.uint64
    found: np.uint64


class Mesh(NamedTuple):
    """A mesh's tree: addresses of all nodes and blocks, its root, and the largest coordinate of its box."""

    nodes: np.uint64
    blocks: np.uint64
    root: np.uint32
    reach: np.float32


class Slab(NamedTuple):
    """A ray along one axis, or the same in eight lanes: 1/d, finite at 0, the word of the near planes, and
    -o/d for near and far planes."""

    rate: np.float32
    word: np.int64
    near: np.float32
    far: np.float32


class Slabs(NamedTuple):
    """A ray against boxes."""

    x: Slab
    y: Slab
    z: Slab
