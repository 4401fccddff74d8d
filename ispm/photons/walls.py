"""Kernels of caustics end at walls: short rays along their axes look for what stands in their way.

Light falls on one side of a wall that stands on a floor; a kernel at its foot would also light the other.
"""

from __future__ import annotations

import math

import numpy as np

from ispm.accel.intersect import STACK_WORDS, closest, read_hit
from ispm.accel.mesh import hit_plane
from ispm.accel.normals import unit
from ispm.accel.records import Ray, Scratch
from ispm.accel.surface import SurfaceTable
from ispm.accel.world import World
from ispm.kernels.simd import address, alloca, atomic_add
from ispm.kernels.threads import run_threads
from ispm.optics.density import SAME_SURFACE
from ispm.optics.jit import jit
from ispm.optics.vector import add, cross, dot, scale, sub
from ispm.photons.footprint import U, V, axis_of, end_kernel

f32, i64 = np.float32, np.int64

_LIFT = f32(0.05)  # of a kernel's width, by which rays run above its surface
_CHUNK = 256  # kernels a thread takes at a time


def end_at_walls(kernels: np.ndarray, world: World, surfaces: SurfaceTable, threads: int) -> None:
    """End kernels at the nearest wall along their axes.

    kernels  (N,) CAUSTIC, changed in place
    """
    if not len(kernels):
        return
    words = kernels.view(np.float32).reshape(len(kernels), -1)
    counter = np.zeros(8, np.int64)

    def work(_: int) -> None:
        _look_around(address(world.table), surfaces.addresses, words, address(counter))

    run_threads(work, threads)


@jit
def _look_around(world, table, words, counter):
    scratch = Scratch(alloca(STACK_WORDS), alloca(2))
    while True:
        first = atomic_add(counter, i64(_CHUNK))
        if first >= len(words):
            return
        for i in range(first, min(first + i64(_CHUNK), len(words))):
            u, v = axis_of(words, i, U), axis_of(words, i, V)
            for k in range(4):
                way = u if k < 2 else v
                _look(world, table, words, i, scale(f32(1) if k % 2 else f32(-1), way), scratch)


@jit
def _look(world, table, words, i, way, scratch):
    """End kernel `i` at what is met within it along `way`, unless that is its own surface."""
    n = unit(cross(axis_of(words, i, U), axis_of(words, i, V)))
    at = (words[i, 0], words[i, 1], words[i, 2])
    length = math.sqrt(dot(way, way))
    start = add(at, scale(_LIFT * length, n))
    d = scale(f32(1) / length, way)
    t = closest(world, Ray(start, d, f32(length)), scratch)
    if not t < length:
        return
    hit = read_hit(scratch.found)
    position, front = hit_plane(table, hit)
    if dot(front, d) > f32(0):
        front = scale(f32(-1), front)
    if dot(front, n) < SAME_SURFACE:
        end_kernel(words, i, front, max(dot(sub(at, position), front), f32(0)))
