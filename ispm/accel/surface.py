"""The surface at a hit: position, normals and BSDF from instance, primitive and barycentrics.

The twin of what the G-buffer shader does from interpolated vertices. Vectors are tuples of float32. In
kernels `tables` is a Tables, `table` its `surfaces`; `instance`, `material` and `corners` are words, see
`accel.mesh`; `use` is the word of a TEXTURE_USE in MATERIAL.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ispm.accel.emitters import NO_EMITTERS, Emitters
from ispm.accel.intersect import HIT_INSTANCE, HIT_PRIMITIVE, closest_after, instance_scale, read_hit
from ispm.accel.leave import leave_triangle
from ispm.accel.mesh import (
    FOOTPRINT,
    INSTANCES,
    MATERIALS,
    NORMAL,
    TO_WORLD,
    VERTICES,
    edges_at,
    hit_plane,
    interpolated,
    rows_times,
    triangle_at,
    vector_at,
    word_of,
    world_normal,
    world_point,
)
from ispm.accel.normals import bend, unit
from ispm.accel.records import NO_TREES, Hit, Ray, Trees
from ispm.accel.world import World
from ispm.kernels.simd import address, ldf, ldu, stu
from ispm.optics.bsdf import Bsdf, Dielectric, surface_bsdf
from ispm.optics.environment import EnvironmentTable
from ispm.optics.jit import jit
from ispm.optics.records import (
    INSTANCE,
    INSTANCE_MIRRORED,
    MATERIAL,
    MATERIAL_BLEND,
    MATERIAL_DOUBLE_SIDED,
    MATERIAL_MASK,
    MATERIAL_THIN,
    MATERIAL_TRANSMITS,
    MATERIAL_UNLIT,
    NO_HIT,
    TEXTURE_USE,
    VERTEX,
)
from ispm.optics.texture import HEIGHT, WIDTH, TextureTable, sample_texture
from ispm.optics.vector import Vector, add, cross, dot, scale, sub
from ispm.scene.packed import Packed

f32, i64, u32 = np.float32, np.int64, np.uint32


_COLOR, _TANGENT = word_of(VERTEX, "color"), word_of(VERTEX, "tangent")
_UV0, _UV1 = word_of(VERTEX, "uv0"), word_of(VERTEX, "uv1")
_INSTANCE_FLAGS = word_of(INSTANCE, "flags")
_METALLIC, _ROUGHNESS = word_of(MATERIAL, "metallic"), word_of(MATERIAL, "roughness")
_SPECULAR, _SPECULAR_COLOR = word_of(MATERIAL, "specular"), word_of(MATERIAL, "specular_color")
_F0, _CUTOFF, _FLAGS = (word_of(MATERIAL, n) for n in ("f0", "alpha_cutoff", "flags"))
_NORMAL_SCALE = word_of(MATERIAL, "normal_scale")
_TRANSMISSION, _IOR = (word_of(MATERIAL, n) for n in ("transmission", "ior"))
_BASE_MAP = word_of(MATERIAL, "base_color_texture")
_ROUGHNESS_MAP = word_of(MATERIAL, "metallic_roughness_texture")
_NORMAL_MAP = word_of(MATERIAL, "normal_texture")
_EMISSION, _EMISSION_MAP = word_of(MATERIAL, "emission"), word_of(MATERIAL, "emission_texture")
_TRANSMISSION_MAP = word_of(MATERIAL, "transmission_texture")
_TEXTURE, _UV_SET, _ROW1 = (word_of(TEXTURE_USE, n) for n in ("texture", "uv_set", "row1"))

_HOLES_MAX = 64  # layers of a masked material that one ray passes


class SurfaceTable:
    """A packed scene's arrays as kernels read them; keeps them alive.

    footprint  metres on a surface over which a photon sees textures averaged
    addresses  (8,) uint64, in the order of `accel.mesh`;  texels, rows  a TextureTable's
    """

    def __init__(self, packed: Packed, textures: TextureTable, footprint: float) -> None:
        arrays = packed.geometry.vertices, packed.geometry.indices, packed.instances, packed.materials
        self._kept = [*map(np.ascontiguousarray, arrays), np.array([footprint], np.float32)]
        self.addresses = np.array([*map(address, self._kept), 0, 0, 0], np.uint64)
        self.texels, self.rows = textures.texels, textures.rows
        self.emitters = NO_EMITTERS

    def own_footprint(self) -> tuple[np.ndarray, np.ndarray]:
        """Return addresses whose footprint is the caller's to set, and the (1,) float32 that holds it."""
        footprint = np.array(self._kept[FOOTPRINT])
        addresses = self.addresses.copy()
        addresses[FOOTPRINT] = address(footprint)
        return addresses, footprint


class Tables(NamedTuple):
    """What kernels are handed of a scene, see `scene_tables`.

    trees         of a World; empty for kernels that trace no rays
    surfaces      (8,) uint64, the addresses of a SurfaceTable
    texels, rows  a TextureTable's
    lights        (L,) LIGHT
    porous        whether any material may let shadow rays pass
    emitters      the triangles that emit light
    environment   the light from all around
    """

    trees: Trees
    surfaces: np.ndarray
    texels: np.ndarray
    rows: np.ndarray
    lights: np.ndarray
    porous: bool
    emitters: Emitters
    environment: EnvironmentTable


def scene_tables(packed: Packed, world: World | None, surfaces: SurfaceTable) -> Tables:
    """Return the Tables that kernels are handed of a scene; they do not keep all arrays alive.

    world  None for kernels that trace no rays
    """
    porous = bool((packed.materials["flags"] & (MATERIAL_MASK | MATERIAL_BLEND | MATERIAL_THIN)).any())
    trees = NO_TREES if world is None else world.trees
    arrays = surfaces.addresses, surfaces.texels, surfaces.rows
    return Tables(trees, *arrays, packed.lights, porous, surfaces.emitters, packed.environment)


class SurfacePoint(NamedTuple):
    """A surface where a ray meets it; world space.

    position  m
    ng, n     geometric and shading normal, unit, both turned against the ray
    flags     of the material
    entering  whether the ray met the front, the outside of a solid
    """

    hit: Hit
    position: Vector
    ng: Vector
    n: Vector
    bsdf: Bsdf
    flags: np.uint32
    entering: bool


class _TextureContext(NamedTuple):
    """Where textures are read: words of the instance, the material and the triangle's corners, barycentrics,
    and the area in texture space, of which the whole texture has 1, over which is averaged."""

    instance: np.int64
    material: np.int64
    corners: tuple[np.int64, np.int64, np.int64]
    u: np.float32
    v: np.float32
    uv_area: np.float32


@jit
def surface(tables, hit, d):
    """Return the SurfacePoint at a Hit of a ray along d, unit."""
    table = tables.surfaces
    instance, material, corners = triangle_at(table, hit)
    u, v = hit.u, hit.v
    p0, e1, e2 = edges_at(table, corners)
    position = world_point(table[INSTANCES], instance, add(p0, add(scale(u, e1), scale(v, e2))))
    ng = world_normal(table[INSTANCES], instance, cross(e1, e2))
    n = world_normal(table[INSTANCES], instance, interpolated(table, corners, NORMAL, u, v))
    uv_area = f32(0)
    if _has_texture(table, material):
        uv_area = _footprint(table, instance, corners, e1, e2)
    context = _TextureContext(instance, material, corners, u, v, uv_area)
    entering = dot(ng, d) <= f32(0)
    if not entering:
        ng = scale(f32(-1), ng)
    side = f32(-1) if dot(n, ng) < f32(0) else f32(1)
    if _texture(table, material, _NORMAL_MAP) >= i64(0):
        n = _mapped_normal(tables, context, n)
    n = bend(bend(scale(side, n), ng), scale(f32(-1), d))
    flags = ldu(table[MATERIALS], material + _FLAGS)
    return SurfacePoint(hit, position, ng, n, _bsdf(tables, context, flags, entering), flags, entering)


@jit
def glow(tables, hit, d):
    """Return the radiance, cd/m2 RGB, that a Hit sends against d, unit: emission, of materials that are not
    double-sided from the front alone, or the base color of unlit materials, from both faces."""
    table = tables.surfaces
    instance, material, corners = triangle_at(table, hit)
    materials = table[MATERIALS]
    flags = ldu(materials, material + _FLAGS)
    unlit, one_sided = flags & u32(MATERIAL_UNLIT) != u32(0), flags & u32(MATERIAL_DOUBLE_SIDED) == u32(0)
    emission = vector_at(materials, material + _EMISSION)
    if not unlit and emission[0] + emission[1] + emission[2] == f32(0):
        return emission
    _, e1, e2 = edges_at(table, corners)
    if not unlit and one_sided and dot(world_normal(table[INSTANCES], instance, cross(e1, e2)), d) > f32(0):
        return f32(0), f32(0), f32(0)
    if not unlit and _texture(table, material, _EMISSION_MAP) < i64(0):
        return emission
    area = _footprint(table, instance, corners, e1, e2)
    context = _TextureContext(instance, material, corners, hit.u, hit.v, area)
    if unlit:
        color, _ = _base_color(tables, context)
        return color
    r, g, b, _ = _sample(tables, context, _EMISSION_MAP)
    return emission[0] * r, emission[1] * g, emission[2] * b


@jit
def material_flags(table, hit):
    """Return the MATERIAL_* flags, uint32, of a Hit's material."""
    _, material, _ = triangle_at(table, hit)
    return ldu(table[MATERIALS], material + _FLAGS)


@jit
def hit_position(table, hit):
    """Return the position of a Hit in world space, m."""
    position, _ = hit_plane(table, hit)
    return position


@jit
def leave_surface(tables, hit, ng):
    """Return where a ray starts, m, that leaves a Hit on the side of the geometric normal `ng`, unit."""
    table = tables.surfaces
    instance, _, corners = triangle_at(table, hit)
    p0, e1, e2 = edges_at(table, corners)
    matrix = instance + TO_WORLD
    corner = world_point(table[INSTANCES], instance, p0)
    e1, e2 = rows_times(table[INSTANCES], matrix, e1), rows_times(table[INSTANCES], matrix, e2)
    return leave_triangle(corner, e1, e2, hit.u, hit.v, ng, instance_scale(tables.trees, hit.instance))


@jit
def closest_surface(tables, origin, d, u, scratch):
    """Return (found, Hit) of the nearest surface from `origin`, m, along d that is no hole of its material.

    u  random in [0, 1): a blended surface is met where u is below its opacity;  scratch  a Scratch
    """
    t, edge = f32(0), False
    ray, words = Ray(origin, d, f32(np.inf)), scratch.found
    stu(words, HIT_INSTANCE, u32(NO_HIT))
    stu(words, HIT_PRIMITIVE, u32(NO_HIT))
    for _ in range(_HOLES_MAX):
        before = t
        t = closest_after(tables.trees, ray, before, scratch)
        hit = read_hit(words)
        if t == f32(np.inf):
            return False, hit
        edge = (edge and t == before) or min(hit.u, min(hit.v, f32(1) - hit.u - hit.v)) <= f32(0)
        if edge and t == before:  # two triangles of one surface, met at the edge they share
            continue
        opacity = _opacity(tables, hit)
        if u < opacity:
            return True, hit
        u = (u - opacity) / (f32(1) - opacity)  # uniform again, whatever lies behind
    return False, Hit(u32(0), u32(0), f32(0), f32(0))


@jit
def _opacity(tables, hit):
    """Opacity at a Hit as a probability, 0 to 1; cheap where the material is opaque."""
    table = tables.surfaces
    instance, material, corners = triangle_at(table, hit)
    flags = ldu(table[MATERIALS], material + _FLAGS)
    if flags & u32(MATERIAL_MASK | MATERIAL_BLEND) == u32(0):
        return f32(1)
    _, alpha = _base_color(tables, _TextureContext(instance, material, corners, hit.u, hit.v, f32(0)))
    if flags & u32(MATERIAL_MASK):
        cutoff = ldf(table[MATERIALS], material + _CUTOFF)
        return f32(1) if alpha >= cutoff else f32(0)
    return alpha


@jit
def _texture(table, material, use):
    """The row, int64, of a material's texture in the texture table, -1: none."""
    return i64(np.int32(ldu(table[MATERIALS], material + use + _TEXTURE)))


@jit
def _has_texture(table, material):
    """Whether the MATERIAL has any texture but one for emission."""
    base, rough = _texture(table, material, _BASE_MAP), _texture(table, material, _ROUGHNESS_MAP)
    normal, clear = _texture(table, material, _NORMAL_MAP), _texture(table, material, _TRANSMISSION_MAP)
    return max(max(base, rough), max(normal, clear)) >= i64(0)


@jit
def _uv(table, corners, field, k):
    """The float32 texture coordinates of corner k from the set at the word `field` of VERTEX."""
    word = corners[k] + field
    return ldf(table[VERTICES], word), ldf(table[VERTICES], word + i64(1))


@jit
def _footprint(table, instance, corners, e1, e2):
    """The footprint of a SurfaceTable, squared, as an area of the triangle's first uv set, float32; edges in
    object space."""
    m = instance + TO_WORLD
    area = cross(rows_times(table[INSTANCES], m, e1), rows_times(table[INSTANCES], m, e2))
    (au, av), (bu, bv) = _uv(table, corners, _UV0, 0), _uv(table, corners, _UV0, 1)
    cu, cv = _uv(table, corners, _UV0, 2)
    uv_area = abs((bu - au) * (cv - av) - (cu - au) * (bv - av))
    footprint = ldf(table[FOOTPRINT], i64(0))
    return uv_area / max(math.sqrt(dot(area, area)), f32(1e-30)) * footprint * footprint


@jit
def _sample(tables, context, use):
    """RGBA, linear, of the texture in slot `use` of a _TextureContext's material."""
    table, rows, corners = tables.surfaces, tables.rows, context.corners
    u, v = context.u, context.v
    materials = table[MATERIALS]
    slot = context.material + use
    field = _UV1 if ldu(materials, slot + _UV_SET) == u32(1) else _UV0
    (au, av), (bu, bv) = _uv(table, corners, field, 0), _uv(table, corners, field, 1)
    cu, cv = _uv(table, corners, field, 2)
    w = f32(1) - u - v
    uv = (w * au + u * bu + v * cu, w * av + u * bv + v * cv, f32(1))
    texture = _texture(table, context.material, use)
    texel_count = context.uv_area * f32(rows[texture, WIDTH]) * f32(rows[texture, HEIGHT])
    level = f32(0.5) * math.log2(texel_count) if texel_count > f32(1) else f32(0)
    s, t = dot(vector_at(materials, slot), uv), dot(vector_at(materials, slot + _ROW1), uv)
    return sample_texture(tables.texels, rows, texture, s, t, level)


@jit
def _base_color(tables, context):
    """Base color, linear RGB, and opacity at a _TextureContext: factor times texture times vertex color."""
    table, material, corners = tables.surfaces, context.material, context.corners
    u, v = context.u, context.v
    color = vector_at(table[MATERIALS], material)
    alpha = ldf(table[MATERIALS], material + i64(3))
    if _texture(table, material, _BASE_MAP) >= i64(0):
        r, g, b, a = _sample(tables, context, _BASE_MAP)
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


@jit
def _bsdf(tables, context, flags, entering):
    """The Bsdf at a _TextureContext; flags: MATERIAL_* of the material;  entering  as of SurfacePoint."""
    table, material = tables.surfaces, context.material
    materials = table[MATERIALS]
    color, _ = _base_color(tables, context)
    metallic = ldf(materials, material + _METALLIC)
    roughness = ldf(materials, material + _ROUGHNESS)
    if _texture(table, material, _ROUGHNESS_MAP) >= i64(0):
        _, g, b, _ = _sample(tables, context, _ROUGHNESS_MAP)
        roughness, metallic = roughness * g, metallic * b
    transmission = f32(0)
    if flags & u32(MATERIAL_TRANSMITS):
        transmission = ldf(materials, material + _TRANSMISSION)
        if _texture(table, material, _TRANSMISSION_MAP) >= i64(0):
            r, _, _, _ = _sample(tables, context, _TRANSMISSION_MAP)
            transmission *= r
    dielectric = Dielectric(
        ldf(materials, material + _F0),
        vector_at(materials, material + _SPECULAR_COLOR),
        ldf(materials, material + _SPECULAR),
        ldf(materials, material + _IOR),
        flags & u32(MATERIAL_THIN) != u32(0),
    )
    return surface_bsdf(color, metallic, roughness, transmission, dielectric, entering)


@jit
def _mapped_normal(tables, context, n):
    """The normal map's normal at a _TextureContext, unit, world space; `n` where the mesh has no tangents."""
    table, instance, material, corners = tables.surfaces, context.instance, context.material, context.corners
    first, _, _ = corners
    side = ldf(table[VERTICES], first + _TANGENT + i64(3))
    tangent = interpolated(table, corners, _TANGENT, context.u, context.v)
    if side == f32(0) or dot(tangent, tangent) < f32(1e-12):
        return n
    if ldu(table[INSTANCES], instance + _INSTANCE_FLAGS) & u32(INSTANCE_MIRRORED):
        side = -side
    t = rows_times(table[INSTANCES], instance + TO_WORLD, tangent)
    t = unit(sub(t, scale(dot(t, n), n)))
    b = scale(side, cross(n, t))
    r, g, blue, _ = _sample(tables, context, _NORMAL_MAP)
    s = ldf(table[MATERIALS], material + _NORMAL_SCALE)
    x, y, z = (f32(2) * r - f32(1)) * s, (f32(2) * g - f32(1)) * s, f32(2) * blue - f32(1)
    return unit(add(add(scale(x, t), scale(y, b)), scale(z, n)))
