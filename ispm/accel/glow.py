"""What surfaces emit: towards whom, and by which textures; and the cones of spots with a radius.

Arguments are as in `accel.surface`.
"""

from __future__ import annotations

import math

import numpy as np

from ispm.accel.mesh import (
    INSTANCES,
    MATERIALS,
    TO_WORLD,
    edges_at,
    triangle_at,
    vector_at,
    word_of,
    world_normal,
)
from ispm.accel.texturing import (
    EMISSION_MAP,
    TextureContext,
    base_color,
    sample_slot,
    texture_row,
    uv_footprint,
)
from ispm.kernels.simd import ldf, ldu
from ispm.optics.jit import jit
from ispm.optics.records import MATERIAL, MATERIAL_DOUBLE_SIDED, MATERIAL_UNLIT
from ispm.optics.vector import cross, dot, scale

f32, i64, u32 = np.float32, np.int64, np.uint32

_FLAGS, _EMISSION, _BEAM = (word_of(MATERIAL, name) for name in ("flags", "emission", "beam"))


@jit
def glow(tables, hit, d):
    """Return the radiance, cd/m2 RGB, that a Hit sends against d, unit: emission, of materials that are not
    double-sided from the front alone, or the base color of unlit materials, from both faces."""
    table = tables.surfaces
    instance, material, corners = triangle_at(table, hit)
    flags = ldu(table[MATERIALS], material + _FLAGS)
    if flags & u32(MATERIAL_UNLIT) != u32(0):
        _, e1, e2 = edges_at(table, corners)
        area = uv_footprint(table, instance, corners, e1, e2)
        color, _ = base_color(tables, TextureContext(instance, material, corners, hit.u, hit.v, area))
        return color
    emission = vector_at(table[MATERIALS], material + _EMISSION)
    if emission[0] + emission[1] + emission[2] == f32(0):
        return emission
    if flags & u32(MATERIAL_DOUBLE_SIDED) == u32(0):
        _, e1, e2 = edges_at(table, corners)
        if dot(world_normal(table[INSTANCES], instance, cross(e1, e2)), d) > f32(0):
            return f32(0), f32(0), f32(0)
    return emitted_radiance(tables, hit, d)


@jit
def emitted_radiance(tables, hit, d):
    """Return the radiance, cd/m2 RGB, that a Hit's material emits against d, unit, from the faces that do."""
    return scale(beam(tables.surfaces, hit, d), face_radiance(tables, hit))


@jit
def face_radiance(tables, hit):
    """Return the radiance, cd/m2 RGB, that a Hit's material emits; of a spot with a radius in its cone."""
    table = tables.surfaces
    instance, material, corners = triangle_at(table, hit)
    emission = vector_at(table[MATERIALS], material + _EMISSION)
    if texture_row(table, material, EMISSION_MAP) < i64(0):
        return emission
    _, e1, e2 = edges_at(table, corners)
    area = uv_footprint(table, instance, corners, e1, e2)
    context = TextureContext(instance, material, corners, hit.u, hit.v, area)
    r, g, b, _ = sample_slot(tables, context, EMISSION_MAP)
    return emission[0] * r, emission[1] * g, emission[2] * b


@jit
def beam(table, hit, d):
    """Return the share of its radiance, float32, that a Hit's lamp sends against d, unit: 1 but for spots.

    table  the addresses of a SurfaceTable
    """
    instance, material, _ = triangle_at(table, hit)
    slope, offset = ldf(table[MATERIALS], material + _BEAM), ldf(table[MATERIALS], material + _BEAM + i64(1))
    if slope == f32(0):
        return offset
    matrix = instance + i64(TO_WORLD)
    back = (
        ldf(table[INSTANCES], matrix + i64(2)),
        ldf(table[INSTANCES], matrix + i64(6)),
        ldf(table[INSTANCES], matrix + i64(10)),
    )
    cosine = dot(back, d) / f32(math.sqrt(max(dot(back, back), f32(1e-30))))
    edge = min(max(cosine * slope + offset, f32(0)), f32(1))
    return edge * edge


def beam_cone(given: np.ndarray, back: np.ndarray) -> tuple[np.ndarray, float, float]:
    """Return the axis, unit, of the cone that a lamp shines in, what the cosine of half its angle lacks of 1,
    which is 0 without a cone, and the mean of its `beam` over all directions.

    given  (2,) a MATERIAL's `beam`;  back  (3,) its instance's +Z
    """
    axis = -back / max(float(np.linalg.norm(back)), 1e-30)
    slope, offset = (float(value) for value in given)
    if slope == 0.0:
        return axis, 0.0, 1.0
    outer, inner = -offset / slope, min((1.0 - offset) / slope, 1.0)
    return axis, 1.0 - outer, 0.5 * (1.0 - inner) + (inner - outer) / 6.0
