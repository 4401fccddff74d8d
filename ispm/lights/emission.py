"""Photons as they leave the lights: their first hits, from bounce maps or from rays.

Both draw the same photons in expectation; a test compares the flux they store per object. Where several maps
of a light see a direction, each sends its photons there, and all of these have the flux I / sum of the maps'
densities (the balance heuristic of Veach 1997, section 9.2.2), so that their sum is unbiased.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import groupby
from typing import NamedTuple

import numpy as np

from ispm.accel.intersect import STACK_WORDS
from ispm.accel.meet import Rays, meet_texels
from ispm.accel.records import Scratch
from ispm.accel.surface import SurfaceTable, Tables, closest_surface, scene_tables
from ispm.accel.world import World
from ispm.kernels.share import run_shared, shared_rows
from ispm.kernels.simd import alloca
from ispm.lights.lightmap import LightMap, cone_measure, texel_measures, texel_rays
from ispm.lights.plan import PlannedMap
from ispm.optics.jit import jit
from ispm.optics.light import cone_falloff
from ispm.optics.records import EMITTED, LIGHT_SPOT, NO_HIT
from ispm.optics.rng import random4
from ispm.optics.sampling import LATTICE, equal_area_octahedral, to_world
from ispm.optics.vector import vec3
from ispm.scene.packed import Packed

f32, f64, i64, u32 = np.float32, np.float64, np.int64, np.uint32

_DIMENSION = (1 << 20) - 1  # of the random numbers of a ray
_CHUNK = 1024  # rays a thread takes at a time

# What a map sees: all that its light sends, a square or a parallel view.
_WHOLE, _SQUARE, _PARALLEL = range(3)

# A face of a map as kernels read it: origin from that of the light's own map, axes as in LightMap, and the
# photons that the map sends per sr and falloff, per m^2, or, as a square of rays, per tangent squared.
_VIEW = np.dtype(
    [("origin", f64, 3), ("s", f64, 3), ("t", f64, 3), ("axis", f64, 3), ("density", f64), ("kind", i64)]
)


class _Source(NamedTuple):
    """A map of a light that emits photons.

    light             row of the lights
    origin            (3,) float64 m, of the light's own map, world space
    views             (K,) _VIEW, the first face of each map of the light (a cube's sees all); own: which
    shift_x, shift_y  and offset, of its samples, see `PlannedMap`
    """

    light: np.int64
    origin: np.ndarray
    views: np.ndarray
    own: np.int64
    shift_x: np.float64
    shift_y: np.float64
    offset: np.float64


def emit_texels(
    lights: np.ndarray,
    surfaces: SurfaceTable,
    plan: Sequence[PlannedMap],
    texels: Sequence[np.ndarray],
    first_key: int = 0,
) -> np.ndarray:
    """Thin bounce maps to photons, in order of map and texel.

    lights     (L,) LIGHT, those of the maps;  first_key  of the photons' keys
    texels     of each planned map, (F, W, W, 2) uint32: instance and primitive
    ->         (N,) EMITTED; of each map `photons` in expectation

    A texel of the part dF of its map's measure F emits N dF / F photons, N the map's: mostly one or none.
    They are spread evenly by comparing against a lattice (the plastic number's, Roberts 2018) shifted at
    random, so that the expectation is exact and the count nearly constant.
    """
    batches = [np.zeros(0, EMITTED)]
    content = iter(texels)
    for light, maps in _by_light(lights, plan):
        densities = [each.density for each in maps]
        for each, source in zip(maps, _sources(light, maps, densities), strict=True):
            expected = texel_measures(each.map, light, each.width, each.shift)
            expected *= each.density
            most = np.ceil(expected)
            out = np.empty(int(most.sum()), EMITTED)
            faces = _faces(each.map, source.origin)
            out = out[: _thin(lights, source, faces, expected, u32(first_key), out)]
            texel = (out["key"].astype(np.int64) - first_key) % expected.size
            place_photons(surfaces, each, next(content), out, texel)
            batches.append(out)
            first_key += expected.size * int(most.max(initial=0.0))
    return np.concatenate(batches)


def place_photons(
    surfaces: SurfaceTable, planned: PlannedMap, content: np.ndarray, rows: np.ndarray, texels: np.ndarray
) -> None:
    """Write the hits of the rays of texels to (n,) EMITTED rows; none beyond the light's range.

    content  (F, W, W, 2) uint32 of the map;  texels  (n,) numbers in the map
    """
    map = planned.map
    origins, directions = texel_rays(map, planned.width, planned.shift, texels)
    rays = Rays(origins, directions, map.orthographic)
    found, barycentrics, distances = meet_texels(surfaces, content, texels, rays)
    beyond = distances * np.linalg.norm(directions, axis=1) > map.range
    rows["instance"], rows["primitive"] = np.where(beyond, NO_HIT, found[:, 0]), found[:, 1]
    rows["u"], rows["v"] = barycentrics.T


def emit_rays(
    packed: Packed,
    world: World,
    surfaces: SurfaceTable,
    plan: Sequence[PlannedMap],
    seed: int,
    pass_index: int,
) -> np.ndarray:
    """Draw photons by tracing rays from the lights, at the points of a lattice (the plastic number's, Roberts
    2018) that is shifted at random in a square, which is mapped to the directions or points that a map sees.

    ->  (N,) EMITTED, in order of map and ray; of each map its `photons`, less those outside a spot's cone

    Where a map sees all that a point light or a spot sends, its photons have equal flux; a square view sends
    them with the density of its texels before they are thinned.
    """
    batches = [np.zeros(0, EMITTED)]
    first_key = 0
    tables = scene_tables(packed, world, surfaces)
    for light, maps in _by_light(packed.lights, plan):
        densities = [_density_of_rays(light, each) for each in maps]
        for each, source in zip(maps, _sources(light, maps, densities), strict=True):
            rows = np.zeros(each.photons, EMITTED)
            rows["light"] = each.map.light
            rows["key"] = np.arange(first_key, first_key + len(rows), dtype=np.uint32)
            first_key += len(rows)
            _emit_shared(tables, source, u32(pass_index), u32(seed), rows, world.threads)
            batches.append(rows[rows["flux"].any(axis=1)])
    return np.concatenate(batches)


def _emit_shared(
    tables: Tables, source: _Source, pass_index: np.uint32, seed: np.uint32, rows: np.ndarray, threads: int
) -> None:
    """Trace a ray for each of (n,) EMITTED rows."""
    run_shared(lambda counter: _emit_rays(tables, source, pass_index, seed, counter, rows), threads)


def _by_light(lights: np.ndarray, plan: Sequence[PlannedMap]) -> Iterator[tuple[np.void, list[PlannedMap]]]:
    """Each LIGHT with its maps."""
    for row, maps in groupby(plan, key=lambda each: each.map.light):
        yield lights[row], list(maps)


def _sources(light: np.void, maps: Sequence[PlannedMap], densities: Sequence[float]) -> list[_Source]:
    """What the maps of one light emit; densities: those of their _VIEW."""
    origin = next(iter(maps)).map.origin
    views = np.concatenate([_faces(each.map, origin)[:1] for each in maps])
    for view, each in zip(views, maps, strict=True):
        view["kind"] = _PARALLEL if each.map.orthographic else _WHOLE if _is_whole(light, each) else _SQUARE
    views["density"] = densities
    return [
        _Source(i64(each.map.light), origin, views, i64(own), *map(f64, (*each.shift, each.offset)))
        for own, each in enumerate(maps)
    ]


def _faces(map: LightMap, origin: np.ndarray) -> np.ndarray:
    """(F,) _VIEW of a map's faces, without density and kind."""
    faces = np.zeros(len(map.axes), _VIEW)
    faces["origin"] = map.origin - origin
    faces["s"], faces["t"], faces["axis"] = np.moveaxis(map.axes, 1, 0)
    return faces


def _is_whole(light: np.void, each: PlannedMap) -> bool:
    """Whether a map sees all that its light sends."""
    return len(each.map.axes) > 1 or bool(
        light["kind"] == LIGHT_SPOT and each.map.measure == cone_measure(light)
    )


def _density_of_rays(light: np.void, each: PlannedMap) -> float:
    """The density of a map's rays, in the units of a _VIEW."""
    if each.map.orthographic or _is_whole(light, each):
        return each.density
    return each.photons / (4.0 * each.map.spread**2)


@jit
def _thin(lights, source, faces, expected, first_key, out):
    """Write the EMITTED photons of a _Source, but for their hits; return how many.

    lights    (L,) LIGHT;  faces  (F,) _VIEW of the map;  first_key  uint32, of the map's first texel
    expected  (F, W, W) float64, photons of each texel
    """
    light, count, width = lights[source.light], i64(0), expected.shape[1]
    rate_x, rate_y = LATTICE
    for face in range(len(faces)):
        for y in range(width):
            t = f64(2) * (y + 0.5 + source.shift_y) / width - f64(1)
            for x in range(width):
                lattice = source.offset + x * rate_x + (y + face * width) * rate_y
                threshold = lattice - math.floor(lattice)
                if threshold >= expected[face, y, x]:
                    continue
                s = f64(2) * (x + 0.5 + source.shift_x) / width - f64(1)
                density = _density(source, _map_point(faces[face], s, t))
                key = i64(first_key) + (face * width + y) * width + x
                while threshold < expected[face, y, x]:
                    row = out[count]
                    for c in range(3):
                        row.flux[c] = f32(f64(light.intensity[c]) / density)
                    row.key = u32(key)
                    row.light = u32(source.light)
                    key += expected.size
                    threshold += f64(1)
                    count += 1
    return count


@jit
def _emit_rays(tables, source, pass_index, seed, counter, rows):
    """Trace the rays of a _Source for as many of the (n,) EMITTED rows as a thread gets; those outside a
    spot's cone keep a flux of 0."""
    light = tables.lights[source.light]
    scratch = Scratch(alloca(STACK_WORDS), alloca(2))
    for i in shared_rows(counter, _CHUNK, len(rows)):
        x, y = _lattice(i, source)
        start, d, point = _ray(light, source, x, y)
        density = _ray_density(light, source, d, point)
        for c in range(3):
            rows[i].flux[c] = f32(f64(light.intensity[c]) / density)
        if density == f64(np.inf):
            continue  # outside a spot's cone
        u, _, _, _ = random4(rows[i].key, u32(_DIMENSION), pass_index, seed)
        found, hit = closest_surface(tables, start, d, u, scratch)
        rows[i].instance = hit.instance if found else u32(NO_HIT)
        rows[i].primitive = hit.primitive
        rows[i].u = hit.u
        rows[i].v = hit.v


@jit
def _lattice(k, source):
    """Point `k` of the lattice in [0, 1)^2, float64."""
    rate_x, rate_y = LATTICE
    x, y = source.shift_x + f64(k) * rate_x, source.shift_y + f64(k) * rate_y
    return x - math.floor(x), y - math.floor(y)


@jit
def _ray(light, source, x, y):
    """Return start (m) and direction, float32, of the ray at (x, y) of [0, 1]^2 of a _Source, and its point,
    see `_map_point`."""
    view, origin = source.views[source.own], source.origin
    s, t = f64(2) * x - f64(1), f64(2) * y - f64(1)
    if view.kind == i64(_PARALLEL):
        point = _map_point(view, s, t)
        back = f64(1) + f64(1) / _square(
            view.axis
        )  # `_map_point` adds the axis once; to the near plane it is axis / axis^2
        start = (
            f32(origin[0] + point[0] - back * view.axis[0]),
            f32(origin[1] + point[1] - back * view.axis[1]),
            f32(origin[2] + point[2] - back * view.axis[2]),
        )
        return start, vec3(light.direction), point
    if view.kind == i64(_SQUARE):
        point = _map_point(view, s, t)
        inv = f64(1) / math.sqrt(_square(point))
        d = (f32(inv * point[0]), f32(inv * point[1]), f32(inv * point[2]))
    elif light.kind == u32(LIGHT_SPOT):
        d = _cone_direction(light, x, y)
    else:
        d = equal_area_octahedral(f32(s), f32(t))
    return vec3(light.position), d, (f64(d[0]), f64(d[1]), f64(d[2]))


@jit
def _cone_direction(light, x, y):
    """Direction of a spot's LIGHT, float32, by (x, y) of [0, 1]^2, with a pdf in proportion to its falloff:
    by the inverse of the falloff's integral."""
    scale, offset = f64(light.cone_scale), f64(light.cone_offset)
    inner = min((f64(1) - offset) / scale, f64(1))
    top = inner * scale + offset
    fade = top * top * top / (f64(3) * scale)
    part = x * (fade + f64(1) - inner)
    cosine = inner + part - fade
    if part < fade:
        cosine = ((f64(3) * scale * part) ** f64(1 / 3) - offset) / scale
    sine = math.sqrt(max(f64(1) - cosine * cosine, f64(0)))
    phi = f64(2 * math.pi) * y
    local = (f32(sine * math.cos(phi)), f32(sine * math.sin(phi)), f32(cosine))
    return to_world(local, vec3(light.direction))


@jit
def _ray_density(light, source, d, point):
    """Rays of all maps of a light, per sr and falloff or per m2, along d and at a point; may be infinite."""
    views, even, uneven = source.views, f64(0), f64(0)
    for k in range(len(views)):
        if k == source.own or _covers(views[k], point):
            if views[k].kind == i64(_SQUARE):
                cosine = _dot((f64(d[0]), f64(d[1]), f64(d[2])), views[k].axis)
                uneven += views[k].density / (cosine * cosine * cosine)
            else:
                even += views[k].density
    return even + uneven / f64(cone_falloff(light, d)) if uneven > f64(0) else even


@jit
def _density(source, point):
    """Photons of all maps of a light, per sr and falloff or per m2, at a point."""
    views, total = source.views, f64(0)
    for k in range(len(views)):
        if k == source.own or _covers(views[k], point):
            total += views[k].density
    return total


@jit
def _covers(view, point):
    """Whether a map, by its _VIEW, sees a point, float64 m from the origin of the light's own map."""
    if view.kind == i64(_WHOLE):
        return True
    p = (point[0] - view.origin[0], point[1] - view.origin[1], point[2] - view.origin[2])
    edge = f64(1) if view.kind == i64(_PARALLEL) else _dot(view.axis, p)
    return abs(_dot(view.s, p)) <= edge and abs(_dot(view.t, p)) <= edge


@jit
def _map_point(view, s, t):
    """The point at (s, t) of [-1, 1]^2 of a face, by its _VIEW: a point, float64 m from the origin of the
    light's own map.

    Of a light at a point it is a unit ahead of it; of a parallel view it may be anywhere along the ray.
    """
    ss, tt = s / _square(view.s), t / _square(view.t)
    return (
        view.origin[0] + ss * view.s[0] + tt * view.t[0] + view.axis[0],
        view.origin[1] + ss * view.s[1] + tt * view.t[1] + view.axis[1],
        view.origin[2] + ss * view.s[2] + tt * view.t[2] + view.axis[2],
    )


@jit
def _square(a):
    """a . a, float64."""
    return a[0] * a[0] + a[1] * a[1] + a[2] * a[2]


@jit
def _dot(a, b):
    """a . b, float64."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
