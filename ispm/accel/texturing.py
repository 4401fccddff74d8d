"""Textures of a packed scene's materials at points of its triangles, for kernels.

In kernels `tables` is a Tables, `table` its `surfaces`; `instance`, `material` and `corners` are words, see
`accel.mesh`; `use` is the word of a TEXTURE_USE in MATERIAL. Colors are linear.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ispm.accel.mesh import (
    FOOTPRINT,
    INSTANCES,
    MATERIALS,
    TO_WORLD,
    VERTICES,
    WIDEST,
    instance_row,
    rows_times,
    vector_at,
    word_of,
)
from ispm.kernels.simd import ldf, ldu
from ispm.optics.jit import jit
from ispm.optics.records import MATERIAL, TEXTURE_USE, VERTEX
from ispm.optics.texture import HEIGHT, WIDTH, sample_texture
from ispm.optics.vector import cross, dot

f32, i64, u32 = np.float32, np.int64, np.uint32

_COLOR = word_of(VERTEX, "color")
_UV0, _UV1 = word_of(VERTEX, "uv0"), word_of(VERTEX, "uv1")
BASE_MAP = word_of(MATERIAL, "base_color_texture")
ROUGHNESS_MAP = word_of(MATERIAL, "metallic_roughness_texture")
NORMAL_MAP = word_of(MATERIAL, "normal_texture")
EMISSION_MAP = word_of(MATERIAL, "emission_texture")
TRANSMISSION_MAP = word_of(MATERIAL, "transmission_texture")
COAT_MAP = word_of(MATERIAL, "clearcoat_texture")
COAT_ROUGHNESS_MAP = word_of(MATERIAL, "clearcoat_roughness_texture")
COAT_NORMAL_MAP = word_of(MATERIAL, "clearcoat_normal_texture")
SHEEN_COLOR_MAP = word_of(MATERIAL, "sheen_color_texture")
SHEEN_ROUGHNESS_MAP = word_of(MATERIAL, "sheen_roughness_texture")
ANISOTROPY_MAP = word_of(MATERIAL, "anisotropy_texture")
SPECULAR_MAP = word_of(MATERIAL, "specular_texture")
THROUGH_COLOR_MAP = word_of(MATERIAL, "diffuse_transmission_color_texture")
SPECULAR_COLOR_MAP = word_of(MATERIAL, "specular_color_texture")
_TEXTURE, _UV_SET, _ROW1 = (word_of(TEXTURE_USE, n) for n in ("texture", "uv_set", "row1"))


class TextureContext(NamedTuple):
    """Where textures are read: words of the instance, the material and the triangle's corners, barycentrics,
    and the area in texture space, of which the whole texture has 1, over which is averaged."""

    instance: np.int64
    material: np.int64
    corners: tuple[np.int64, np.int64, np.int64]
    u: np.float32
    v: np.float32
    uv_area: np.float32


@jit
def texture_row(table, material, use):
    """Return the row, int64, of a material's texture in the texture table, -1: none."""
    return i64(np.int32(ldu(table[MATERIALS], material + use + _TEXTURE)))


@jit
def has_texture(table, material):
    """Return whether the MATERIAL has any texture but one for emission, or for a coat, sheen, specular
    reflection, anisotropy or the color of diffuse transmission, of which its flags tell."""
    base, rough = texture_row(table, material, BASE_MAP), texture_row(table, material, ROUGHNESS_MAP)
    normal, clear = texture_row(table, material, NORMAL_MAP), texture_row(table, material, TRANSMISSION_MAP)
    return max(max(base, rough), max(normal, clear)) >= i64(0)


@jit
def _uv(table, corners, field, k):
    """The float32 texture coordinates of corner k from the set at the word `field` of VERTEX."""
    word = corners[k] + field
    return ldf(table[VERTICES], word), ldf(table[VERTICES], word + i64(1))


@jit
def uv_footprint(table, instance, corners, e1, e2):
    """Return the footprint of a SurfaceTable, squared, as an area of the triangle's first uv set, float32;
    edges in object space."""
    m = instance + TO_WORLD
    area = cross(rows_times(table[INSTANCES], m, e1), rows_times(table[INSTANCES], m, e2))
    (au, av), (bu, bv) = _uv(table, corners, _UV0, 0), _uv(table, corners, _UV0, 1)
    cu, cv = _uv(table, corners, _UV0, 2)
    uv_area = abs((bu - au) * (cv - av) - (cu - au) * (bv - av))
    footprint = min(ldf(table[FOOTPRINT], i64(0)), ldf(table[WIDEST], instance_row(instance)))
    return uv_area / max(math.sqrt(dot(area, area)), f32(1e-30)) * footprint * footprint


@jit
def sample_slot(tables, context, use):
    """Return RGBA, linear, of the texture in slot `use` of a TextureContext's material."""
    table, rows, corners = tables.surfaces, tables.rows, context.corners
    u, v = context.u, context.v
    materials = table[MATERIALS]
    slot = context.material + use
    field = _UV1 if ldu(materials, slot + _UV_SET) == u32(1) else _UV0
    (au, av), (bu, bv) = _uv(table, corners, field, 0), _uv(table, corners, field, 1)
    cu, cv = _uv(table, corners, field, 2)
    w = f32(1) - u - v
    uv = (w * au + u * bu + v * cu, w * av + u * bv + v * cv, f32(1))
    texture = texture_row(table, context.material, use)
    texel_count = context.uv_area * f32(rows[texture, WIDTH]) * f32(rows[texture, HEIGHT])
    level = f32(0.5) * math.log2(texel_count) if texel_count > f32(1) else f32(0)
    s, t = dot(vector_at(materials, slot), uv), dot(vector_at(materials, slot + _ROW1), uv)
    return sample_texture(tables.texels, rows, texture, s, t, level)


@jit
def base_color(tables, context):
    """Return base color, linear RGB, and opacity at a TextureContext: factor, texture, vertex color."""
    table, material, corners = tables.surfaces, context.material, context.corners
    u, v = context.u, context.v
    color = vector_at(table[MATERIALS], material)
    alpha = ldf(table[MATERIALS], material + i64(3))
    if texture_row(table, material, BASE_MAP) >= i64(0):
        r, g, b, a = sample_slot(tables, context, BASE_MAP)
        color, alpha = (color[0] * r, color[1] * g, color[2] * b), alpha * a
    c0 = ldu(table[VERTICES], corners[0] + _COLOR)
    c1 = ldu(table[VERTICES], corners[1] + _COLOR)
    c2 = ldu(table[VERTICES], corners[2] + _COLOR)
    if c0 & c1 & c2 != u32(0xFFFFFFFF):
        color = (
            color[0] * _mix_channel(c0, c1, c2, u32(0), u, v),
            color[1] * _mix_channel(c0, c1, c2, u32(8), u, v),
            color[2] * _mix_channel(c0, c1, c2, u32(16), u, v),
        )
        alpha *= _mix_channel(c0, c1, c2, u32(24), u, v)
    return color, alpha


@jit
def _mix_channel(c0, c1, c2, shift, u, v):
    """The channel at bit `shift` of three packed uint32 colors, interpolated, 0 to 1."""
    a, b, c = f32((c0 >> shift) & u32(255)), f32((c1 >> shift) & u32(255)), f32((c2 >> shift) & u32(255))
    return ((f32(1) - u - v) * a + u * b + v * c) * f32(1 / 255)
