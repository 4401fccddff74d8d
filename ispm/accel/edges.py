"""Hits on the edges of triangles, where a ray meets two of one surface at the same place."""

from __future__ import annotations

import numpy as np

from ispm.accel.intersect import instance_scale
from ispm.accel.leave import inside_margin, inwards
from ispm.accel.mesh import INSTANCES, TO_WORLD, VERTICES, edges_at, rows_times, triangle_at, vector_at
from ispm.accel.records import Hit
from ispm.optics.jit import jit
from ispm.optics.vector import cross, dot, sub

f32, i64, u32 = np.float32, np.int64, np.uint32

_ZERO = f32(2.0**-22)  # weights of a hit below it may be 0: the third is 1 less two that have been rounded
_LEAST_COSINE = f32(1 / 64)  # of the angle at which a ray meets a surface, by which errors along it grow


@jit
def is_on_edge(hit):
    """Return whether a Hit may lie on an edge of its triangle, a bool."""
    return min(hit.u, min(hit.v, f32(1) - hit.u - hit.v)) <= _ZERO


@jit
def is_same_surface(tables, d, a, b):
    """Return whether a ray along d meets two Hits of one instance where their triangles join, a bool.

    A ray on an edge meets both its triangles, as its weights there are exactly 0 in either. They are one
    surface if they lie on its two sides as the ray sees them; on one side they are layers, as two that share
    all corners. At a corner all triangles about it are one.
    """
    instance, _, corners = triangle_at(tables.surfaces, a)
    _, _, others = triangle_at(tables.surfaces, b)
    vertices = tables.surfaces[VERTICES]
    shared, apart, opposite = 0, i64(0), i64(0)
    first = second = vector_at(vertices, corners[0])
    for k in range(3):
        place, common = vector_at(vertices, corners[k]), False
        for j in range(3):
            common = common or vector_at(vertices, others[j]) == place
        if common:
            first, second = second if shared else place, place
            shared += 1
        else:
            apart = corners[k]
            if _weight(a, k) > _ZERO:
                return False
    if shared == 0 or shared == 3:
        return False
    for j in range(3):
        place, common = vector_at(vertices, others[j]), False
        for k in range(3):
            common = common or vector_at(vertices, corners[k]) == place
        if not common:
            opposite = others[j]
            if _weight(b, j) > _ZERO:
                return False
    if shared == 1:
        return True
    matrix, rows = instance + TO_WORLD, tables.surfaces[INSTANCES]
    across = cross(rows_times(rows, matrix, sub(second, first)), d)
    side = dot(across, rows_times(rows, matrix, sub(vector_at(vertices, apart), first)))
    other = dot(across, rows_times(rows, matrix, sub(vector_at(vertices, opposite), first)))
    return side * other < f32(0)


@jit
def _weight(hit, k):
    """Weight, float32, of corner `k` of a Hit's triangle."""
    return hit.u if k == 1 else (hit.v if k == 2 else f32(1) - hit.u - hit.v)


@jit
def clear_of_edges(tables, hit, d):
    """Return a Hit of a ray along d moved so far into its triangle that a parallel ray through it meets none
    of those beside it: by what rays' starts are moved by at edges, more where the surface is seen aslant."""
    table = tables.surfaces
    instance, _, corners = triangle_at(table, hit)
    _, e1, e2 = edges_at(table, corners)
    e1 = rows_times(table[INSTANCES], instance + TO_WORLD, e1)
    e2 = rows_times(table[INSTANCES], instance + TO_WORLD, e2)
    area = cross(e1, e2)
    cosine = abs(dot(area, d)) / max(np.sqrt(dot(area, area)), f32(1e-30))
    margin = inside_margin(instance_scale(tables.trees, hit.instance)) / max(cosine, _LEAST_COSINE)
    u, v = inwards(e1, e2, sub(e2, e1), hit.u, hit.v, margin)
    return Hit(hit.instance, hit.primitive, u, v)
