"""Kernels of caustics end at walls, which short rays along their axes find.

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
from ispm.kernels.share import run_shared, shared_rows
from ispm.kernels.simd import address, alloca
from ispm.optics.density import SAME_SURFACE
from ispm.optics.jit import jit
from ispm.optics.vector import add, cross, dot, scale, sub, vec3
from ispm.photons.footprint import U, V, axis_of, end_kernel

f32 = np.float32

_LIFT = f32(0.05)  # of a kernel's width, by which rays run above its surface
_CHUNK = 256  # kernels a thread takes at a time


def end_at_walls(kernels: np.ndarray, world: World, surfaces: SurfaceTable) -> None:
    """End kernels at the nearest wall along their axes.

    kernels  (N,) CAUSTIC, changed in place
    """
    if not len(kernels):
        return
    words = kernels.view(np.float32).reshape(len(kernels), -1)
    trees, tables = address(world.table), surfaces.addresses
    run_shared(lambda counter: _end_some(trees, tables, words, counter), world.threads)


@jit
def _end_some(world, table, words, counter):
    """End as many of the CAUSTIC kernels, (N, words) float32, as a thread gets.

    world  address of `World.table`;  table  addresses of a SurfaceTable
    """
    scratch = Scratch(alloca(STACK_WORDS), alloca(2))
    for i in shared_rows(counter, _CHUNK, len(words)):
        u, v = axis_of(words, i, U), axis_of(words, i, V)
        for k in range(4):
            axis = u if k < 2 else v
            _end_along(world, table, words, i, scale(f32(1) if k % 2 else f32(-1), axis), scratch)


@jit
def _end_along(world, table, words, i, axis, scratch):
    """End kernel `i` at what a ray from its center along `axis`, m, meets within it, unless that is its own
    surface."""
    n = unit(cross(axis_of(words, i, U), axis_of(words, i, V)))
    center = vec3(words[i])
    length = math.sqrt(dot(axis, axis))
    start = add(center, scale(_LIFT * length, n))
    d = scale(f32(1) / length, axis)
    t = closest(world, Ray(start, d, f32(length)), scratch)
    if not t < length:
        return
    hit = read_hit(scratch.found)
    position, front = hit_plane(table, hit)
    if dot(front, d) > f32(0):
        front = scale(f32(-1), front)
    if dot(front, n) < SAME_SURFACE:
        end_kernel(words, i, front, max(dot(sub(center, position), front), f32(0)))
