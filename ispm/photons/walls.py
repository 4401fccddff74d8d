"""Kernels end at walls, which short rays along their axes find.

Light falls on one side of a wall that stands on a floor; a kernel at its foot would also light the other, and
a dark room beside a bright one would be lit through the wall.
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
from ispm.kernels.simd import alloca
from ispm.optics.jit import jit
from ispm.optics.vector import add, cross, dot, scale, sub, vec3
from ispm.photons.footprint import end_kernel

f32 = np.float32

_LIFT = f32(0.05)  # of a kernel's width, by which rays run above its surface
# Cosine of two normals above which both are of one hollow surface: rays meet one of radius R from a kernel of
# radius r where it has turned by 1 - cos = .05 r / R, so kernels up to 3 R wide do not end at their own.
_OWN = f32(0.85)
_CHUNK = 256  # kernels a thread takes at a time


def end_at_walls(
    kernels: np.ndarray, world: World, surfaces: SurfaceTable, rows: np.ndarray | None = None
) -> None:
    """End kernels at the nearest wall along their axes.

    kernels  (N,) CAUSTIC, changed in place
    rows     (n,) uint32, the kernels to end; None: all
    """
    rows = np.arange(len(kernels), dtype=np.uint32) if rows is None else rows
    if not len(rows):
        return
    trees, tables = world.trees, surfaces.addresses
    run_shared(lambda counter: _end_some(trees, tables, kernels, rows, counter), world.threads)


@jit
def _end_some(trees, table, kernels, rows, counter):
    """End as many of the (N,) CAUSTIC at (n,) uint32 rows as a thread gets.

    trees  of a World;  table  addresses of a SurfaceTable
    """
    scratch = Scratch(alloca(STACK_WORDS), alloca(2))
    for i in shared_rows(counter, _CHUNK, len(rows)):
        kernel = kernels[rows[i]]
        for axis in (vec3(kernel.u), vec3(kernel.v)):
            for side in (f32(-1), f32(1)):
                _end_along(trees, table, kernel, scale(side, axis), scratch)


@jit
def _end_along(trees, table, kernel, axis, scratch):
    """End a CAUSTIC at what a ray from its center along `axis`, m, meets within it, unless that is its own
    surface."""
    n, center = unit(cross(vec3(kernel.u), vec3(kernel.v))), vec3(kernel.position)
    length = math.sqrt(dot(axis, axis))
    start = add(center, scale(_LIFT * length, n))
    d = scale(f32(1) / length, axis)
    t = closest(trees, Ray(start, d, f32(length)), scratch)
    if not t < length:
        return
    hit = read_hit(scratch.found)
    position, front = hit_plane(table, hit)
    if dot(front, d) > f32(0):
        front = scale(f32(-1), front)
    if dot(front, n) < _OWN:
        end_kernel(kernel, front, max(dot(sub(center, position), front), f32(0)))
