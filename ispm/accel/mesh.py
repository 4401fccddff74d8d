"""A packed scene's triangles as kernels read them: by address, in words of four bytes.

`table` is a SurfaceTable's (8,) uint64 addresses. A record in one of its arrays is given by its first word,
int64, as `triangle_at` returns it: `instance`, `material` and `corners`, three vertices. Vectors are tuples
of float32.
"""

from __future__ import annotations

import math

import numpy as np

from ispm.accel.normals import unit
from ispm.kernels.simd import ldf, ldu
from ispm.optics.jit import jit
from ispm.optics.records import INSTANCE, MATERIAL, VERTEX
from ispm.optics.sampling import orthonormal_basis
from ispm.optics.vector import add, cross, dot, scale, sub

f32, i64, u32 = np.float32, np.int64, np.uint32


def word_of(dtype: np.dtype, name: str) -> np.int64:
    """Return the word, int64, at which a field begins in its record."""
    assert dtype.fields is not None
    return i64(dtype.fields[name][1] // 4)


# Which address of a SurfaceTable is whose.
VERTICES, INDICES, INSTANCES, MATERIALS, FOOTPRINT, WIDEST = range(6)

NORMAL = word_of(VERTEX, "normal")
TO_WORLD, COFACTORS = word_of(INSTANCE, "world0"), word_of(INSTANCE, "normal0")
_VERTEX, _INSTANCE, _MATERIAL = (i64(d.itemsize // 4) for d in (VERTEX, INSTANCE, MATERIAL))
MATERIAL_WORDS = _MATERIAL
_FIRST_INDEX, _INSTANCE_MATERIAL = word_of(INSTANCE, "first_index"), word_of(INSTANCE, "material")


@jit
def instance_row(instance):
    """Return which instance, int64, begins at a word."""
    return instance // _INSTANCE


@jit
def triangle_at(table, hit):
    """Return the words, int64, at which a Hit's instance, material and three vertices begin."""
    instance = i64(hit.instance) * _INSTANCE
    material = i64(ldu(table[INSTANCES], instance + _INSTANCE_MATERIAL)) * _MATERIAL
    first = i64(ldu(table[INSTANCES], instance + _FIRST_INDEX)) + i64(3) * i64(hit.primitive)
    corners = (
        i64(ldu(table[INDICES], first)) * _VERTEX,
        i64(ldu(table[INDICES], first + i64(1))) * _VERTEX,
        i64(ldu(table[INDICES], first + i64(2))) * _VERTEX,
    )
    return instance, material, corners


@jit
def vector_at(base, word):
    """Return the three float32 from a word on, int64, of the array at the address `base`."""
    return ldf(base, word), ldf(base, word + i64(1)), ldf(base, word + i64(2))


@jit
def interpolated(table, corners, field, u, v):
    """Return a vector attribute, float32, at barycentrics u, v; field: its word in VERTEX."""
    a = scale(f32(1) - u - v, vector_at(table[VERTICES], corners[0] + field))
    b = scale(u, vector_at(table[VERTICES], corners[1] + field))
    return add(a, add(b, scale(v, vector_at(table[VERTICES], corners[2] + field))))


@jit
def is_flat(table, corners):
    """Return whether a triangle's vertices have no normal, so that its own is theirs."""
    n = vector_at(table[VERTICES], corners[0] + NORMAL)
    return n[0] == f32(0) and n[1] == f32(0) and n[2] == f32(0)


@jit
def rows_times(instances, matrix, x):
    """Return the left 3x3 of a matrix, whose first word in INSTANCE records is `matrix`, times a vector."""
    return (
        dot(vector_at(instances, matrix), x),
        dot(vector_at(instances, matrix + i64(4)), x),
        dot(vector_at(instances, matrix + i64(8)), x),
    )


@jit
def world_point(instances, instance, x):
    """Return a point of an instance's object space in world space, m; instances: their address."""
    m = instance + TO_WORLD
    moved = (ldf(instances, m + i64(3)), ldf(instances, m + i64(7)), ldf(instances, m + i64(11)))
    return add(rows_times(instances, m, x), moved)


@jit
def world_normal(instances, instance, x):
    """Return a normal of an instance's object space in world space, unit; instances: their address."""
    return unit(rows_times(instances, instance + COFACTORS, x))


@jit
def edges_at(table, corners):
    """Return the first corner of a triangle and the edges to the second and third, object space, float32."""
    p0 = vector_at(table[VERTICES], corners[0])
    e1 = sub(vector_at(table[VERTICES], corners[1]), p0)
    e2 = sub(vector_at(table[VERTICES], corners[2]), p0)
    return p0, e1, e2


@jit
def hit_plane(table, hit):
    """Return a Hit's position, m, and its triangle's normal, on the front, unit; world space."""
    instance, _, corners = triangle_at(table, hit)
    p0, e1, e2 = edges_at(table, corners)
    offset = add(scale(hit.u, e1), scale(hit.v, e2))
    position = world_point(table[INSTANCES], instance, add(p0, offset))
    return position, world_normal(table[INSTANCES], instance, cross(e1, e2))


@jit
def normal_change(table, hit, n, dx):
    """Return how much the interpolated normal changes along dx, m, a small step in a Hit's triangle.

    n  the normal there, unit, or its opposite; world space, as dx and the result
    Source: Igehy 1999, section 3.2, with cofactors in place of object space.
    """
    instance, _, corners = triangle_at(table, hit)
    _, e1, e2 = edges_at(table, corners)
    e1 = rows_times(table[INSTANCES], instance + TO_WORLD, e1)
    e2 = rows_times(table[INSTANCES], instance + TO_WORLD, e2)
    area = cross(e1, e2)
    square = max(dot(area, area), f32(1e-30))
    du, dv = dot(cross(dx, e2), area) / square, dot(cross(e1, dx), area) / square
    n0 = vector_at(table[VERTICES], corners[0] + NORMAL)
    n1 = vector_at(table[VERTICES], corners[1] + NORMAL)
    n2 = vector_at(table[VERTICES], corners[2] + NORMAL)
    there = add(n0, add(scale(hit.u, sub(n1, n0)), scale(hit.v, sub(n2, n0))))
    change = add(scale(du, sub(n1, n0)), scale(dv, sub(n2, n0)))
    there = rows_times(table[INSTANCES], instance + COFACTORS, there)
    change = rows_times(table[INSTANCES], instance + COFACTORS, change)
    along = dot(there, n)
    if along == f32(0):
        return f32(0), f32(0), f32(0)
    return scale(f32(1) / along, sub(change, scale(dot(change, n), n)))


@jit
def curvature(table, hit, n):
    """Return how much the interpolated normal turns along a Hit's triangle, 1/m, float32, about the most;
    n: as of `normal_change`."""
    t, b = orthonormal_basis(n)
    along, across = normal_change(table, hit, n, t), normal_change(table, hit, n, b)
    return f32(math.sqrt(max(dot(along, along), dot(across, across))))
