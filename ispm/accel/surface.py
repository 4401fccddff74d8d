"""The surface at a hit: position, normals and BSDF from instance, primitive and barycentrics.

The twin of what the G-buffer shader does from interpolated vertices. Vectors are tuples of float32. In
kernels `tables` is a Tables, `table` its `surfaces`; `instance`, `material` and `corners` are words, see
`accel.mesh`; `use` is the word of a TEXTURE_USE in MATERIAL.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ispm.accel.edges import is_on_edge, is_same_surface
from ispm.accel.emitters import EMITTER, NO_EMITTERS, Emitters, emitter_hit, make_emitters, parts_of
from ispm.accel.glow import beam_cone, face_radiance
from ispm.accel.intersect import HIT_INSTANCE, HIT_PRIMITIVE, closest_after, instance_scale, read_hit
from ispm.accel.leave import leave_triangle
from ispm.accel.lobes import (
    NORMAL_SCALE,
    anisotropic,
    bsdf_at,
    coat_at,
    mapped_normal,
    sheen_at,
    translucence_at,
)
from ispm.accel.mesh import (
    FOOTPRINT,
    INSTANCES,
    MATERIALS,
    NORMAL,
    TO_WORLD,
    WIDEST,
    edges_at,
    hit_plane,
    interpolated,
    is_flat,
    rows_times,
    triangle_at,
    word_of,
    world_normal,
    world_point,
)
from ispm.accel.normals import bend
from ispm.accel.records import NO_TREES, Hit, Ray, Trees
from ispm.accel.texturing import (
    NORMAL_MAP,
    TextureContext,
    base_color,
    has_texture,
    texture_row,
    uv_footprint,
)
from ispm.accel.world import World
from ispm.kernels.simd import address, ldf, ldu, stu
from ispm.optics.bsdf import Bsdf
from ispm.optics.coat import NO_COAT, Coat, covered, with_diffuse
from ispm.optics.environment import EnvironmentTable
from ispm.optics.jit import jit
from ispm.optics.records import (
    INNER,
    INSTANCE_MIRRORED,
    MATERIAL,
    MATERIAL_ANISOTROPIC,
    MATERIAL_BLEND,
    MATERIAL_COATED,
    MATERIAL_DOUBLE_SIDED,
    MATERIAL_HAS_INNER,
    MATERIAL_MASK,
    MATERIAL_SHEEN,
    MATERIAL_SPECULAR_MAPPED,
    MATERIAL_THIN,
    MATERIAL_TRANSLUCENT,
    MATERIAL_TRANSMITS,
    MATERIAL_UNLIT,
    NO_HIT,
)
from ispm.optics.sheen import NO_SHEEN, Sheen
from ispm.optics.texture import TextureTable
from ispm.optics.vector import Vector, add, cross, dot, scale
from ispm.scene.packed import Packed, to_world

f32, i64, u32 = np.float32, np.int64, np.uint32


_CUTOFF, _FLAGS = word_of(MATERIAL, "alpha_cutoff"), word_of(MATERIAL, "flags")

# may have textures of their own
_MAPPED = MATERIAL_COATED | MATERIAL_SHEEN | MATERIAL_SPECULAR_MAPPED | MATERIAL_ANISOTROPIC
_MAPPED |= MATERIAL_TRANSLUCENT
_GLOW_SIDE = 8  # points along a side of a triangle, for the mean of its texture
_GLOW_FLOOR = 0.02  # of a texture's greatest radiance, that triangles are drawn by at least
_PARTS_SIDE, _PARTS_MOST = 8, 8192  # along a side of a triangle with a texture; of all triangles together
_PART_SIDE = 4  # points along a part's side, at least, for its mean
LAYERS_MAX = 64  # surfaces with holes, or blended ones, that one ray passes


class SurfaceTable:
    """A packed scene's arrays as kernels read them; keeps them alive.

    footprint  metres on a surface over which a photon sees textures averaged
    part       of an instance's diagonal, over which at most
    addresses  (8,) uint64, in the order of `accel.mesh`;  texels, rows  a TextureTable's
    """

    def __init__(
        self, packed: Packed, textures: TextureTable, footprint: float, part: float = math.inf
    ) -> None:
        arrays = packed.geometry.vertices, packed.geometry.indices, packed.instances, packed.materials
        low, high = packed.boxes[:, 0], packed.boxes[:, 1]
        widest = (part * np.maximum(np.linalg.norm(high - low, axis=1), 1e-30)).astype(np.float32)
        self._kept = [*map(np.ascontiguousarray, arrays), np.array([footprint], np.float32), widest]
        self._unbound = np.full(len(widest), np.inf, np.float32)
        self.addresses = np.array([*map(address, self._kept), 0, 0], np.uint64)
        self.texels, self.rows = textures.texels, textures.rows
        self.emitters: Emitters | None = None  # found when they are first asked for

    def own_footprint(self) -> tuple[np.ndarray, np.ndarray]:
        """Return addresses whose footprint is the caller's to set, and the (1,) float32 that holds it."""
        footprint = np.array(self._kept[FOOTPRINT])
        addresses = self.addresses.copy()
        addresses[FOOTPRINT], addresses[WIDEST] = address(footprint), address(self._unbound)
        return addresses, footprint


class Tables(NamedTuple):
    """What kernels are handed of a scene, see `scene_tables`.

    trees         of a World; empty for kernels that trace no rays
    surfaces      (8,) uint64, the addresses of a SurfaceTable
    texels, rows  a TextureTable's
    lights        (L,) LIGHT
    porous        whether any material may let shadow rays pass
    clear         whether the environment may shine through solids, see `lights.refracted`
    emitters      the triangles that emit light
    environment   the light from all around
    """

    trees: Trees
    surfaces: np.ndarray
    texels: np.ndarray
    rows: np.ndarray
    lights: np.ndarray
    porous: bool
    clear: bool
    emitters: Emitters
    environment: EnvironmentTable


def scene_tables(packed: Packed, world: World | None, surfaces: SurfaceTable) -> Tables:
    """Return the Tables that kernels are handed of a scene; they do not keep all arrays alive.

    world  None for kernels that trace no rays
    """
    flags = packed.materials["flags"]
    porous = bool((flags & (MATERIAL_MASK | MATERIAL_BLEND | MATERIAL_THIN)).any())
    solids = flags & (MATERIAL_TRANSMITS | MATERIAL_THIN) == MATERIAL_TRANSMITS
    clear = bool(solids.any()) and len(packed.environment.rows) > 0
    trees = NO_TREES if world is None else world.trees
    arrays = surfaces.addresses, surfaces.texels, surfaces.rows
    tables = Tables(trees, *arrays, packed.lights, porous, clear, NO_EMITTERS, packed.environment)
    if surfaces.emitters is None:
        surfaces.emitters = _find_emitters(packed, tables)
    return tables._replace(emitters=surfaces.emitters)


def _find_emitters(packed: Packed, tables: Tables) -> Emitters:
    """The emissive triangles of a scene."""
    materials = packed.materials
    shines = materials["emission"].any(axis=1) & (materials["flags"] & MATERIAL_UNLIT == 0)
    batches, glowing = [], np.flatnonzero(shines[packed.instances["material"]])
    textured = materials["emission_texture"]["texture"][packed.instances["material"][glowing]] >= 0
    count = max(int(packed.instances["triangle_count"][glowing[textured]].sum()), 1)
    sides = min(max(math.isqrt(_PARTS_MOST // count), 1), _PARTS_SIDE)
    for number in glowing:
        instance = packed.instances[number]
        material, count = materials[instance["material"]], int(instance["triangle_count"])
        first = int(instance["first_index"])
        indices = packed.geometry.indices[first : first + 3 * count].reshape(-1, 3)
        matrix = to_world(instance).astype(np.float64)
        corners = packed.geometry.vertices["position"][indices] @ matrix[:, :3].T + matrix[:, 3]
        rows = np.zeros(count, EMITTER)
        edges = corners[:, 1:] - corners[:, :1]
        across = np.cross(edges[:, 0], edges[:, 1])
        doubled = np.linalg.norm(across, axis=1)
        side = -1.0 if instance["flags"] & INSTANCE_MIRRORED else 1.0
        rows["corner"], rows["edge1"], rows["edge2"] = corners[:, 0], edges[:, 0], edges[:, 1]
        rows["normal"] = side * across / np.maximum(doubled, 1e-300)[:, None]
        rows["area"], rows["radiance"], rows["instance"] = doubled / 2.0, material["emission"], number
        rows["primitive"], rows["textured"] = np.arange(count), material["emission_texture"]["texture"] >= 0
        rows["two_sided"] = bool(material["flags"] & MATERIAL_DOUBLE_SIDED)
        rows["part"] = 0.0, 0.0, 1.0
        if rows["textured"].any():
            rows = parts_of(rows, sides)
            floor = np.float32(_GLOW_FLOOR / math.sqrt(sides))
            _average_glow(tables, rows, max(_GLOW_SIDE // sides, _PART_SIDE), floor)
        rows["axis"], rows["cone"], mean = beam_cone(material["beam"], matrix[:, 2])
        rows["radiance"] *= np.float32(mean)
        batches.append(rows)
    return make_emitters(np.concatenate(batches), len(packed.instances)) if batches else NO_EMITTERS


@jit
def _average_glow(tables, emitters, side, floor):
    """Set the radiance of (n,) EMITTER, which is the greatest, to the mean over their textures, at so many
    points to a side, but to no less than a share of the greatest, so that each point that shines can be
    drawn."""
    for k in range(len(emitters)):
        row = emitters[k]
        total = (f32(0), f32(0), f32(0))
        for i in range(side):
            for j in range(side):  # the midpoints of equal triangles
                flip = i + j >= side
                a, b = (f32(i) + f32(1 / 3)) / f32(side), (f32(j) + f32(1 / 3)) / f32(side)
                if flip:
                    a, b = f32(1) - a, f32(1) - b
                total = add(total, face_radiance(tables, emitter_hit(row, a, b)))
        for c in range(3):
            row.radiance[c] = max(total[c] / f32(side * side), floor * row.radiance[c])


NO_LIGHT = f32(0), f32(0), f32(0)


class SurfacePoint(NamedTuple):
    """A surface where a ray meets it; world space.

    position  m
    ng, n     geometric and shading normal, unit, both turned against the ray
    flags     of the material
    entering  whether the ray met the front, the outside of a solid
    bsdf      of what is under the coat and sheen, if there are any, as much as they show of that
    coat, sheen   whose light adds to it, see `accel.layers`
    translucence  albedo, RGB, of the Lambert lobe by which light from the other side leaves on this, as much
                  as coat and sheen show of it
    """

    hit: Hit
    position: Vector
    ng: Vector
    n: Vector
    bsdf: Bsdf
    flags: np.uint32
    entering: bool
    coat: Coat
    sheen: Sheen
    translucence: Vector


@jit
def surface(tables, hit, d):
    """Return the SurfacePoint at a Hit of a ray along d, unit."""
    table = tables.surfaces
    instance, material, corners = triangle_at(table, hit)
    u, v = hit.u, hit.v
    p0, e1, e2 = edges_at(table, corners)
    position = world_point(table[INSTANCES], instance, add(p0, add(scale(u, e1), scale(v, e2))))
    ng = world_normal(table[INSTANCES], instance, cross(e1, e2))
    flags = ldu(table[MATERIALS], material + _FLAGS)
    coated = flags & u32(MATERIAL_COATED) != u32(0)
    own = ng
    if not is_flat(table, corners):
        own = world_normal(table[INSTANCES], instance, interpolated(table, corners, NORMAL, u, v))
    uv_area = f32(0)
    # what passes glass is the product of two textures, whose mean is not that of their means
    is_mapped = flags & u32(_MAPPED) != u32(0) or has_texture(table, material)
    if is_mapped and flags & u32(MATERIAL_TRANSMITS) == u32(0):
        uv_area = uv_footprint(table, instance, corners, e1, e2)
    context = TextureContext(instance, material, corners, u, v, uv_area)
    entering = dot(ng, d) <= f32(0)
    if not entering:
        ng = scale(f32(-1), ng)
    side, wo, n = f32(-1) if dot(own, ng) < f32(0) else f32(1), scale(f32(-1), d), own
    if texture_row(table, material, NORMAL_MAP) >= i64(0):
        n = mapped_normal(tables, context, own, NORMAL_MAP, NORMAL_SCALE)
    n = bend(bend(scale(side, n), ng), wo)
    b, coat, sheen, through = bsdf_at(tables, context, flags, entering), NO_COAT, NO_SHEEN, NO_LIGHT
    if flags & u32(MATERIAL_TRANSLUCENT):
        share, through = translucence_at(tables, context)
        b = with_diffuse(b, scale(f32(1) - share, b.diffuse))
    if flags & u32(MATERIAL_ANISOTROPIC):
        b = anisotropic(tables, context, own, b)
    if coated:
        coat = coat_at(tables, context, own, side, ng, wo)
        b, through = covered(b, coat.shown), scale(coat.shown, through)
    if flags & u32(MATERIAL_SHEEN):
        sheen = sheen_at(tables, context, dot(n, wo), coat.shown)
        b, through = covered(b, sheen.shown), scale(sheen.shown, through)
    return SurfacePoint(hit, position, ng, n, b, flags, entering, coat, sheen, through)


@jit
def inner_side(x):
    """Return INNER, uint32, of a SurfacePoint that is the back of what lets light through; else 0."""
    has_inner = x.flags & u32(MATERIAL_HAS_INNER) != u32(0)
    return u32(INNER) if has_inner and not x.entering else u32(0)


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
    return _closest(tables, origin, d, u, Hit(u32(NO_HIT), u32(0), f32(0), f32(0)), scratch)


@jit
def closest_behind(tables, origin, d, veil, scratch):
    """Return (found, Hit) of the nearest surface from `origin`, m, along d that has any opacity, but for the
    Hit `veil`: of others that lie in the same place, as decals on walls, too."""
    return _closest(tables, origin, d, f32(0), veil, scratch)


@jit
def _closest(tables, origin, d, u, veil, scratch):
    """`closest_surface` of all triangles but that of the Hit `veil`, instance NO_HIT: of all."""
    t, last = f32(0), Hit(u32(NO_HIT), u32(0), f32(0), f32(0))
    ray, words = Ray(origin, d, f32(np.inf)), scratch.found
    stu(words, HIT_INSTANCE, u32(NO_HIT))
    stu(words, HIT_PRIMITIVE, u32(NO_HIT))
    for _ in range(LAYERS_MAX):
        t = closest_after(tables.trees, ray, t, scratch)
        hit = read_hit(words)
        if t == f32(np.inf):
            return False, hit
        joins = hit.instance == last.instance and is_on_edge(hit)
        if joins and is_same_surface(tables, d, last, hit):
            continue
        last = hit
        if hit.instance == veil.instance and hit.primitive == veil.primitive:
            continue
        share = opacity(tables, hit)
        if u < share:
            return True, hit
        u = (u - share) / (f32(1) - share)  # uniform again, whatever lies behind
    return False, Hit(u32(0), u32(0), f32(0), f32(0))


@jit
def opacity(tables, hit):
    """Return the opacity at a Hit, 0 to 1; cheap where the material is opaque."""
    table = tables.surfaces
    instance, material, corners = triangle_at(table, hit)
    flags = ldu(table[MATERIALS], material + _FLAGS)
    if flags & u32(MATERIAL_MASK | MATERIAL_BLEND) == u32(0):
        return f32(1)
    _, alpha = base_color(tables, TextureContext(instance, material, corners, hit.u, hit.v, f32(0)))
    if flags & u32(MATERIAL_MASK):
        cutoff = ldf(table[MATERIALS], material + _CUTOFF)
        return f32(1) if alpha >= cutoff else f32(0)
    return alpha


@jit
def opacity_seen(tables, hit):
    """Return the opacity, 0 to 1, of a surface that is met at a Hit, in the mean over the SurfaceTable's
    footprint: 1 but for blended ones."""
    table = tables.surfaces
    instance, material, corners = triangle_at(table, hit)
    if ldu(table[MATERIALS], material + _FLAGS) & u32(MATERIAL_BLEND) == u32(0):
        return f32(1)
    _, e1, e2 = edges_at(table, corners)
    area = uv_footprint(table, instance, corners, e1, e2)
    _, alpha = base_color(tables, TextureContext(instance, material, corners, hit.u, hit.v, area))
    return min(max(alpha, f32(0)), f32(1))
