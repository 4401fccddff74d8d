"""Photons as they leave the lights: their first hits, from bounce maps or from rays.

Both ways draw the same photons in expectation; a test compares the flux they store per object. Where
several maps of a light see a direction, each sends its photons there, and all of these have the flux
I / sum of the maps' densities (the balance heuristic of Veach 1997, section 9.2.2), so that their sum is
right and they are alike.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import groupby
from typing import Any

import numpy as np

from ispm.accel.intersect import STACK_WORDS
from ispm.accel.meet import meet_texels
from ispm.accel.records import Scratch
from ispm.accel.surface import SurfaceTable, closest_surface, scene_tables
from ispm.accel.world import World
from ispm.kernels.simd import alloca
from ispm.kernels.threads import run_threads
from ispm.lights.lightmap import LightMap, cone_measure, texel_measures, texel_rays
from ispm.lights.plan import PlannedMap
from ispm.optics.jit import jit
from ispm.optics.light import cone_falloff
from ispm.optics.records import EMITTED, LIGHT_SPOT, NO_HIT
from ispm.optics.rng import random4
from ispm.optics.sampling import LATTICE, equal_area_octahedral, to_world
from ispm.scene.packed import Packed

f32, f64, i64, u32 = np.float32, np.float64, np.int64, np.uint32

_DIMENSION = (1 << 20) - 1  # of the random numbers of a ray

# What a map sees: all that its light sends, a square or a parallel view.
_WHOLE, _SQUARE, _PARALLEL = range(3)

# A face of a map as kernels read it: origin from that of the light's own map, axes as in LightMap, and the
# photons that the map sends per sr and falloff, per m^2, or, as a square of rays, per tangent squared.
_VIEW = np.dtype(
    [("origin", f64, 3), ("s", f64, 3), ("t", f64, 3), ("axis", f64, 3), ("density", f64), ("kind", i64)]
)


def emit_texels(
    packed: Packed, surfaces: SurfaceTable, plan: Sequence[PlannedMap], texels: Sequence[np.ndarray]
) -> np.ndarray:
    """Thin bounce maps to photons, in order of map and texel.

    texels  of each planned map, (F, W, W, 2) uint32: instance and primitive
    ->      (N,) EMITTED; of each map `photons` in expectation

    A texel of the part dF of its map's measure F emits N dF / F photons, N the map's: mostly one or none.
    They are spread evenly by comparing against a lattice (the plastic number's, Roberts 2018) shifted at
    random, so that the expectation is exact and the count nearly constant.
    """
    batches = [np.zeros(0, EMITTED)]
    content = iter(texels)
    first_key = 0
    for index, maps in _by_light(plan):
        light = packed.lights[index]
        origin = maps[0].map.origin
        views = _views(light, maps, [each.photons / each.map.measure for each in maps])
        for own, each in enumerate(maps):
            expected = texel_measures(each.map, light, each.width, each.shift)
            expected *= each.photons / each.map.measure
            most = np.ceil(expected)
            out = np.empty(int(most.sum()), EMITTED)
            held = next(content)
            count = _thin(
                expected, _faces(each.map, origin), views, i64(own),
                light["intensity"], f64(each.shift[0]), f64(each.shift[1]), f64(each.offset), u32(index),
                u32(first_key), out,
            )  # fmt: skip
            out = out[:count]
            numbers = (out["key"].astype(np.int64) - first_key) % expected.size
            place_photons(surfaces, each, held, out, numbers)
            batches.append(out)
            first_key += expected.size * int(most.max(initial=0.0))
    return np.concatenate(batches)


def place_photons(
    surfaces: SurfaceTable, planned: PlannedMap, content: np.ndarray, rows: np.ndarray, texels: np.ndarray
) -> None:
    """Find what the rays of texels meet, and where; beyond the light's range is nothing. In place.

    content  (F, W, W, 2) uint32 of the map;  rows  (n,) EMITTED;  texels  (n,) numbers in the map
    """
    map = planned.map
    origins, directions = texel_rays(map, planned.width, planned.shift, texels)
    found, places, along = meet_texels(surfaces, content, texels, origins, directions, map.orthographic)
    beyond = along * np.linalg.norm(directions, axis=1) > map.range
    rows["instance"], rows["primitive"] = np.where(beyond, NO_HIT, found[:, 0]), found[:, 1]
    rows["u"], rows["v"] = places.T


def emit_rays(
    packed: Packed,
    world: World,
    surfaces: SurfaceTable,
    plan: Sequence[PlannedMap],
    seed: int,
    pass_index: int,
    threads: int,
) -> np.ndarray:
    """Draw photons by tracing rays from the lights, at the points of a lattice (the plastic number's, Roberts
    2018) that is shifted at random in a square, which is mapped to the directions or places that a map sees.

    ->  (N,) EMITTED, in order of map and ray; of each map its `photons`, less those outside a spot's cone

    All that a point light or a spot sends is met with photons of equal flux; a square view with the density
    of its texels before they are thinned.
    """
    batches = [np.zeros(0, EMITTED)]
    first_key = 0
    tables = scene_tables(packed, world, surfaces)
    for index, maps in _by_light(plan):
        light = packed.lights[index : index + 1]
        views = _views(light[0], maps, [_density_of_rays(light[0], each) for each in maps])
        for own, each in enumerate(maps):
            rows = np.zeros(each.photons, EMITTED)
            rows["light"] = index
            rows["key"] = np.arange(first_key, first_key + len(rows), dtype=np.uint32)
            first_key += len(rows)
            kernel = partial(
                _emit_rays, tables, light, maps[0].map.origin, views, i64(own), f64(each.shift[0]),
                f64(each.shift[1]), u32(seed), u32(pass_index),
            )  # fmt: skip
            _fill(kernel, rows, threads)
            batches.append(rows[rows["flux"].any(axis=1)])
    return np.concatenate(batches)


def _fill(kernel: Callable[[np.ndarray, Any], Any], rows: np.ndarray, threads: int) -> None:
    """Call kernel(part, first) for as many parts of `rows` as there are threads, at the same time."""
    edges = np.linspace(0, len(rows), threads + 1).astype(np.int64)
    run_threads(lambda k: kernel(rows[edges[k] : edges[k + 1]], edges[k]), threads)


def _by_light(plan: Sequence[PlannedMap]) -> Iterator[tuple[int, list[PlannedMap]]]:
    """Each light's row with its maps."""
    for light, maps in groupby(plan, key=lambda each: each.map.light):
        yield light, list(maps)


def _views(light: np.void, maps: Sequence[PlannedMap], densities: Sequence[float]) -> np.ndarray:
    """(K,) _VIEW of the maps of one light."""
    views = np.concatenate([_faces(each.map, maps[0].map.origin)[:1] for each in maps])
    for view, each in zip(views, maps, strict=True):
        view["kind"] = _PARALLEL if each.map.orthographic else _WHOLE if _is_whole(light, each) else _SQUARE
    views["density"] = densities
    return views


def _faces(map: LightMap, origin: np.ndarray) -> np.ndarray:
    """(F,) _VIEW of a map's faces, without density and kind."""
    faces = np.zeros(len(map.axes), _VIEW)
    faces["origin"] = map.origin - origin
    faces["s"], faces["t"], faces["axis"] = np.moveaxis(map.axes, 1, 0)
    return faces


def _is_whole(light: np.void, each: PlannedMap) -> bool:
    return len(each.map.axes) == 6 or bool(
        light["kind"] == LIGHT_SPOT and each.map.measure == cone_measure(light)
    )


def _density_of_rays(light: np.void, each: PlannedMap) -> float:
    if each.map.orthographic or _is_whole(light, each):
        return each.photons / each.map.measure
    return each.photons / (4.0 * each.map.spread**2)


@jit
def _thin(
    expected, faces, views, own, intensity, shift_x, shift_y, offset, light, first_key, out
):  # fmt: skip
    count = i64(0)
    width = expected.shape[1]
    for face in range(len(faces)):
        for y in range(width):
            t = f64(2) * (y + 0.5 + shift_y) / width - f64(1)
            for x in range(width):
                lattice = offset + x * LATTICE[0] + (y + face * width) * LATTICE[1]
                threshold = lattice - math.floor(lattice)
                if threshold >= expected[face, y, x]:
                    continue
                s = f64(2) * (x + 0.5 + shift_x) / width - f64(1)
                density = _density(views, own, _place(faces[face], s, t))
                texel = (face * width + y) * width + x
                key = i64(first_key) + texel
                while threshold < expected[face, y, x]:
                    row = out[count]
                    for c in range(3):
                        row.flux[c] = f32(f64(intensity[c]) / density)
                    row.key = u32(key)
                    row.light = light
                    key += expected.size
                    threshold += f64(1)
                    count += 1
    return count


@jit
def _emit_rays(
    tables, lights, origin, views, own, shift_x, shift_y, seed,
    pass_index, rows, first,
):  # fmt: skip
    light = lights[0]
    scratch = Scratch(alloca(STACK_WORDS), alloca(2))
    for i in range(len(rows)):
        x, y = _lattice(first + i, shift_x, shift_y)
        start, d, place = _ray(light, views[own], origin, x, y)
        density = _ray_density(light, views, own, d, place)
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
def _lattice(k, shift_x, shift_y):
    """Point `k` of the lattice in [0, 1)^2."""
    x, y = shift_x + f64(k) * LATTICE[0], shift_y + f64(k) * LATTICE[1]
    return x - math.floor(x), y - math.floor(y)


@jit
def _ray(light, view, origin, x, y):
    """(start, direction, place) of the ray at (x, y) of [0, 1]^2 of a map; `place` as `_place` returns it."""
    s, t = f64(2) * x - f64(1), f64(2) * y - f64(1)
    if view.kind == i64(_PARALLEL):
        place = _place(view, s, t)
        back = f64(1) + f64(1) / _square(view.axis)  # to the near plane, a unit of `_place` included
        start = (
            f32(origin[0] + place[0] - back * view.axis[0]),
            f32(origin[1] + place[1] - back * view.axis[1]),
            f32(origin[2] + place[2] - back * view.axis[2]),
        )
        return start, (light.direction[0], light.direction[1], light.direction[2]), place
    if view.kind == i64(_SQUARE):
        place = _place(view, s, t)
        inv = f64(1) / math.sqrt(place[0] * place[0] + place[1] * place[1] + place[2] * place[2])
        d = (f32(inv * place[0]), f32(inv * place[1]), f32(inv * place[2]))
    elif light.kind == u32(LIGHT_SPOT):
        d = _cone_direction(light, x, y)
    else:
        d = equal_area_octahedral(f32(s), f32(t))
    start = (light.position[0], light.position[1], light.position[2])
    return start, d, (f64(d[0]), f64(d[1]), f64(d[2]))


@jit
def _cone_direction(light, x, y):
    """Direction of a spot with a pdf in proportion to its falloff: the inverse of the falloff's integral."""
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
    return to_world(local, (light.direction[0], light.direction[1], light.direction[2]))


@jit
def _ray_density(light, views, own, d, place):
    """Rays of all maps per sr and falloff, or per m^2, there."""
    even, uneven = f64(0), f64(0)
    for k in range(len(views)):
        if k == own or _covers(views[k], place):
            if views[k].kind == i64(_SQUARE):
                axis = views[k].axis
                cosine = f64(d[0]) * axis[0] + f64(d[1]) * axis[1] + f64(d[2]) * axis[2]
                uneven += views[k].density / (cosine * cosine * cosine)
            else:
                even += views[k].density
    return even + uneven / f64(cone_falloff(light, d)) if uneven > f64(0) else even  # may be infinite


@jit
def _density(views, own, place):
    """Photons of all maps per sr and falloff, or per m^2, there."""
    total = f64(0)
    for k in range(len(views)):
        if k == own or _covers(views[k], place):
            total += views[k].density
    return total


@jit
def _covers(view, place):
    """Whether a map sees a place, relative to the origin of the light's own map."""
    if view.kind == i64(_WHOLE):
        return True
    p = (place[0] - view.origin[0], place[1] - view.origin[1], place[2] - view.origin[2])
    edge = f64(1) if view.kind == i64(_PARALLEL) else _dot(view.axis, p)
    return abs(_dot(view.s, p)) <= edge and abs(_dot(view.t, p)) <= edge


@jit
def _place(view, s, t):
    """A point of a map at (s, t) of [-1, 1]^2 of a face, relative to the origin of the light's own map.

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
    return a[0] * a[0] + a[1] * a[1] + a[2] * a[2]


@jit
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
