"""What covers a surface: BSDF, anisotropy, clear coat and the normals of maps, by material and textures.

In kernels `tables` is a Tables, `table` its `surfaces`; `material` is a word, see `accel.mesh`; `use` is the
word of a TEXTURE_USE in MATERIAL.
"""

from __future__ import annotations

import numpy as np

from ispm.accel.mesh import (
    INSTANCES,
    MATERIALS,
    TO_WORLD,
    VERTICES,
    interpolated,
    rows_times,
    vector_at,
    word_of,
)
from ispm.accel.normals import bend, unit
from ispm.accel.texturing import (
    ANISOTROPY_MAP,
    COAT_MAP,
    COAT_NORMAL_MAP,
    COAT_ROUGHNESS_MAP,
    ROUGHNESS_MAP,
    SHEEN_COLOR_MAP,
    SHEEN_ROUGHNESS_MAP,
    SPECULAR_COLOR_MAP,
    SPECULAR_MAP,
    THROUGH_COLOR_MAP,
    TRANSMISSION_MAP,
    base_color,
    sample_slot,
    texture_row,
)
from ispm.kernels.simd import ldf, ldu
from ispm.optics.bsdf import MIN_ALPHA, Bsdf, Dielectric, surface_bsdf
from ispm.optics.coat import make_coat
from ispm.optics.facets import Anisotropy
from ispm.optics.jit import jit
from ispm.optics.records import (
    INSTANCE,
    INSTANCE_MIRRORED,
    MATERIAL,
    MATERIAL_SPECULAR_MAPPED,
    MATERIAL_THIN,
    MATERIAL_TRANSMITS,
    VERTEX,
)
from ispm.optics.sampling import orthonormal_basis
from ispm.optics.sheen import make_sheen
from ispm.optics.vector import add, cross, dot, scale, sub

f32, i64, u32 = np.float32, np.int64, np.uint32

NORMAL_SCALE = word_of(MATERIAL, "normal_scale")
_TANGENT = word_of(VERTEX, "tangent")
_INSTANCE_FLAGS = word_of(INSTANCE, "flags")
_METALLIC, _ROUGHNESS = word_of(MATERIAL, "metallic"), word_of(MATERIAL, "roughness")
_SPECULAR, _SPECULAR_COLOR = word_of(MATERIAL, "specular"), word_of(MATERIAL, "specular_color")
_F0, _FLAGS = word_of(MATERIAL, "f0"), word_of(MATERIAL, "flags")
_TRANSMISSION, _IOR = word_of(MATERIAL, "transmission"), word_of(MATERIAL, "ior")
_COAT, _COAT_ROUGHNESS = word_of(MATERIAL, "clearcoat"), word_of(MATERIAL, "clearcoat_roughness")
_COAT_NORMAL_SCALE = word_of(MATERIAL, "clearcoat_normal_scale")
_SHEEN_COLOR, _SHEEN_ROUGHNESS = word_of(MATERIAL, "sheen_color"), word_of(MATERIAL, "sheen_roughness")
_ANISOTROPY, _DIRECTION = word_of(MATERIAL, "anisotropy"), word_of(MATERIAL, "anisotropy_direction")
_THROUGH_COLOR = word_of(MATERIAL, "diffuse_transmission_color")
_ALONG_AXIS = f32(1e-6)  # sine^2 of the angle between normal and axis, below which nothing goes around
_NO_DIRECTION = f32(1 / 255)  # of a texel from the middle value
_WHITE, _Y = (f32(1), f32(1), f32(1)), (f32(0), f32(1), f32(0))


@jit
def bsdf_at(tables, context, flags, entering):
    """Return the Bsdf at a TextureContext, without a coat.

    flags  MATERIAL_* of the material;  entering  as of SurfacePoint
    """
    table, material = tables.surfaces, context.material
    materials = table[MATERIALS]
    color, _ = base_color(tables, context)
    metallic = ldf(materials, material + _METALLIC)
    roughness = ldf(materials, material + _ROUGHNESS)
    if texture_row(table, material, ROUGHNESS_MAP) >= i64(0):
        _, g, b, _ = sample_slot(tables, context, ROUGHNESS_MAP)
        roughness, metallic = roughness * g, metallic * b
    transmission = f32(0)
    if flags & u32(MATERIAL_TRANSMITS):
        transmission = ldf(materials, material + _TRANSMISSION)
        if texture_row(table, material, TRANSMISSION_MAP) >= i64(0):
            r, _, _, _ = sample_slot(tables, context, TRANSMISSION_MAP)
            transmission *= r
    color_map, specular_map = _WHITE, f32(1)
    if flags & u32(MATERIAL_SPECULAR_MAPPED):
        color_map, specular_map = _specular_maps(tables, context)
    dielectric = dielectric_at(table, material, color_map, specular_map)
    return surface_bsdf(color, metallic, roughness, transmission, dielectric, entering)


@jit
def _specular_maps(tables, context):
    """What textures make of specular color, RGB, and factor at a TextureContext."""
    table, color, factor = tables.surfaces, _WHITE, f32(1)
    if texture_row(table, context.material, SPECULAR_COLOR_MAP) >= i64(0):
        r, g, b, _ = sample_slot(tables, context, SPECULAR_COLOR_MAP)
        color = r, g, b
    if texture_row(table, context.material, SPECULAR_MAP) >= i64(0):
        _, _, _, factor = sample_slot(tables, context, SPECULAR_MAP)
    return color, factor


@jit
def dielectric_at(table, material, color_map, specular_map):
    """Return the Dielectric of the MATERIAL that begins at a word; the last two: what textures make of its
    specular color, RGB, and factor."""
    materials = table[MATERIALS]
    r, g, b = vector_at(materials, material + _SPECULAR_COLOR)
    return Dielectric(
        ldf(materials, material + _F0),
        (r * color_map[0], g * color_map[1], b * color_map[2]),
        ldf(materials, material + _SPECULAR) * specular_map,
        ldf(materials, material + _IOR),
        ldu(materials, material + _FLAGS) & u32(MATERIAL_THIN) != u32(0),
    )


@jit
def mapped_normal(tables, context, n, use, strength):
    """Return the normal of the map in slot `use` at a TextureContext, unit, world space; `n`, the mesh's own,
    where the mesh has no tangents.

    strength  word of the factor on the map's x and y
    """
    known, t, b = _tangents(tables, context, n)
    if not known:
        return n
    table, material = tables.surfaces, context.material
    r, g, blue, _ = sample_slot(tables, context, use)
    s = ldf(table[MATERIALS], material + strength)
    x, y, z = (f32(2) * r - f32(1)) * s, (f32(2) * g - f32(1)) * s, f32(2) * blue - f32(1)
    return unit(add(add(scale(x, t), scale(y, b)), scale(z, n)))


@jit
def _tangents(tables, context, n):
    """Whether the mesh has tangents at a TextureContext, and tangent and bitangent there, unit, world space,
    at right angles to its normal `n`."""
    table, instance, corners = tables.surfaces, context.instance, context.corners
    first, _, _ = corners
    side = ldf(table[VERTICES], first + _TANGENT + i64(3))
    tangent = interpolated(table, corners, _TANGENT, context.u, context.v)
    if side == f32(0) or dot(tangent, tangent) < f32(1e-12):
        return False, n, n
    if ldu(table[INSTANCES], instance + _INSTANCE_FLAGS) & u32(INSTANCE_MIRRORED):
        side = -side
    t = rows_times(table[INSTANCES], instance + TO_WORLD, tangent)
    t = unit(sub(t, scale(dot(t, n), n)))
    return True, t, scale(side, cross(n, t))


@jit
def anisotropic(tables, context, n, b):
    """Return a Bsdf with the facets of a MATERIAL_ANISOTROPIC at a TextureContext; `n`: the mesh's normal.

    Without tangents the first direction goes around the mesh's Y axis, as what a lathe leaves.
    """
    table, material = tables.surfaces, context.material
    known, t, across = _tangents(tables, context, n)
    if not known:
        axis = unit(rows_times(table[INSTANCES], context.instance + TO_WORLD, _Y))
        t = cross(axis, n)
        if dot(t, t) < _ALONG_AXIS:
            t, _ = orthonormal_basis(n)
        t = unit(t)
        across = cross(n, t)
    strength = ldf(table[MATERIALS], material + _ANISOTROPY)
    x, y = f32(1), f32(0)
    if texture_row(table, material, ANISOTROPY_MAP) >= i64(0):
        r, g, blue, _ = sample_slot(tables, context, ANISOTROPY_MAP)
        strength *= blue
        if max(abs(r - f32(0.5)), abs(g - f32(0.5))) > _NO_DIRECTION:
            x, y = f32(2) * r - f32(1), f32(2) * g - f32(1)
    c = ldf(table[MATERIALS], material + _DIRECTION)
    s = ldf(table[MATERIALS], material + _DIRECTION + i64(1))
    tangent = unit(add(scale(c * x - s * y, t), scale(s * x + c * y, across)))
    alpha = max(b.alpha, MIN_ALPHA)
    widest = alpha + (f32(1) - alpha) * strength * strength
    kept = b.dielectric_f0, b.dielectric_f90, b.tint, b.eta, b.thin, b.sheen
    return Bsdf(b.diffuse, b.f0, b.f90, alpha, *kept, Anisotropy(widest, tangent))


@jit
def translucence_at(tables, context):
    """Return the share of diffuse light, float32, that a MATERIAL_TRANSLUCENT sends out on its other side
    at a TextureContext, and the albedo of the lobe there, RGB."""
    table, material = tables.surfaces, context.material
    share = ldf(table[MATERIALS], material + _TRANSMISSION)
    if texture_row(table, material, TRANSMISSION_MAP) >= i64(0):
        _, _, _, a = sample_slot(tables, context, TRANSMISSION_MAP)
        share *= a
    color = vector_at(table[MATERIALS], material + _THROUGH_COLOR)
    if texture_row(table, material, THROUGH_COLOR_MAP) >= i64(0):
        r, g, b, _ = sample_slot(tables, context, THROUGH_COLOR_MAP)
        color = color[0] * r, color[1] * g, color[2] * b
    metallic = ldf(table[MATERIALS], material + _METALLIC)
    if texture_row(table, material, ROUGHNESS_MAP) >= i64(0):
        _, _, b, _ = sample_slot(tables, context, ROUGHNESS_MAP)
        metallic *= b
    return share, scale(share * (f32(1) - metallic), color)


@jit
def coat_at(tables, context, n, side, ng, wo):
    """Return the Coat at a TextureContext of a MATERIAL_COATED.

    n         the mesh's normal;  side  1 or -1, which turns it to the side of ng, the geometric one
    ng, wo    unit; where the coat is seen from
    """
    table, material = tables.surfaces, context.material
    weight = ldf(table[MATERIALS], material + _COAT)
    roughness = ldf(table[MATERIALS], material + _COAT_ROUGHNESS)
    if texture_row(table, material, COAT_MAP) >= i64(0):
        r, _, _, _ = sample_slot(tables, context, COAT_MAP)
        weight *= r
    if texture_row(table, material, COAT_ROUGHNESS_MAP) >= i64(0):
        _, g, _, _ = sample_slot(tables, context, COAT_ROUGHNESS_MAP)
        roughness *= g
    if texture_row(table, material, COAT_NORMAL_MAP) >= i64(0):
        n = mapped_normal(tables, context, n, COAT_NORMAL_MAP, _COAT_NORMAL_SCALE)
    n = bend(bend(scale(side, n), ng), wo)
    return make_coat(weight, roughness, n, dot(n, wo))


@jit
def sheen_at(tables, context, cosine, uncovered):
    """Return the Sheen at a TextureContext of a MATERIAL_SHEEN; cosine and uncovered as of `make_sheen`."""
    table, material = tables.surfaces, context.material
    color = vector_at(table[MATERIALS], material + _SHEEN_COLOR)
    roughness = ldf(table[MATERIALS], material + _SHEEN_ROUGHNESS)
    if texture_row(table, material, SHEEN_COLOR_MAP) >= i64(0):
        r, g, b, _ = sample_slot(tables, context, SHEEN_COLOR_MAP)
        color = color[0] * r, color[1] * g, color[2] * b
    if texture_row(table, material, SHEEN_ROUGHNESS_MAP) >= i64(0):
        _, _, _, a = sample_slot(tables, context, SHEEN_ROUGHNESS_MAP)
        roughness *= a
    return make_sheen(color, roughness, cosine, uncovered)
