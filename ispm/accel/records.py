"""What traversal hands on: rays, hits, and meshes and boxes as rays meet them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ispm.optics.vector import Vector


class Hit(NamedTuple):
    """What a ray meets: a triangle of an instance. u, v: barycentrics of its second and third corner."""

    instance: np.uint32
    primitive: np.uint32
    u: np.float32
    v: np.float32


class Ray(NamedTuple):
    """A ray; its direction need not be unit, and t_max, where it ends, counts in lengths of it."""

    origin: Vector
    direction: Vector
    t_max: np.float32


class Scratch(NamedTuple):
    """Addresses of memory that one thread's rays use: a stack of STACK_WORDS uint64, and the four words of a
    hit, see HIT_PRIMITIVE."""

    stack: np.uint64
    found: np.uint64


class Mesh(NamedTuple):
    """A mesh's tree: addresses of all nodes and blocks, its root, and the largest coordinate of its box."""

    nodes: np.uint64
    blocks: np.uint64
    root: np.uint32
    reach: np.float32


class Slab(NamedTuple):
    """A ray along one axis, or the same in eight lanes: 1/d, finite at 0, the word of a node where the planes
    begin that it meets first, and -o/d for these and the others, with a margin for rounding."""

    rate: np.float32
    word: np.int64
    near: np.float32
    far: np.float32


class Slabs(NamedTuple):
    """A ray against boxes."""

    x: Slab
    y: Slab
    z: Slab
