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


class Trees(NamedTuple):
    """All trees of a World as `accel.collapse` lays them out. What they hold of each other are indices, so
    that these bytes mean the same wherever they lie.

    top     (64 t,) float32, nodes of the tree over instances, whose leaves are rows
    rows    (16 i,) float32, of instances, see ROW_WORDS
    nodes   (64 n,) float32, of all meshes;  blocks  (40 b,) float32, their triangles
    reach   m, largest coordinate of all instances' boxes
    """

    top: np.ndarray
    rows: np.ndarray
    nodes: np.ndarray
    blocks: np.ndarray
    reach: np.float32


_NOTHING = np.zeros(0, np.float32)
NO_TREES = Trees(_NOTHING, _NOTHING, _NOTHING, _NOTHING, np.float32(0))


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
