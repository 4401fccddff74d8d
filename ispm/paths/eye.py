"""Eye paths: from pixels that show mirrors and glass on to the surfaces that are seen in them.

At the first surface both branches are followed, weighted by Fresnel's equations, and so they are where
light leaves the solid that it entered there; after that the stronger one is taken for both, which is exact
where both would find the same light. Rough glass is sampled instead.
Where a path meets a surface that photons may light it leaves an end; light that comes there straight from
the lights, and what glows, is added here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ispm.accel.intersect import STACK_WORDS
from ispm.accel.rays import HIT
from ispm.accel.surface import SurfaceTable, closest_surface, glow, hit_position, surface
from ispm.accel.world import World
from ispm.kernels.simd import address, alloca, atomic_add
from ispm.kernels.threads import run_threads
from ispm.lights.nee import direct_light, greatest, times
from ispm.optics.bsdf import has_finite, is_smooth, transmits
from ispm.optics.jit import jit
from ispm.optics.records import (
    MATERIAL_BLEND,
    MATERIAL_MASK,
    MATERIAL_THIN,
    MATERIAL_UNLIT,
    NO_HIT,
    RECEIVER,
)  # fmt: skip
from ispm.optics.vector import add, dot, scale, sub
from ispm.paths.facet import ROUGH_SAMPLES, facet_numbers, facet_split, go_on
from ispm.paths.vertices import BLACK, END, FIRST, store_end, store_first, store_point
from ispm.photons.walk import attenuated, depart, medium, nowhere
from ispm.scene.packed import Packed

f32, i64, u32 = np.float32, np.int64, np.uint32

EVENTS_MAX = 8  # mirrors and faces of glass that a path meets
_REFLECTED_EACH = 4  # of them so many reflect once
_PATHS_MAX = 3  # of a pixel that shows no rough glass: reflected, let through, and reflected within
_ENDS_MAX = 2  # of one path: behind a varnished floor goes on what it mirrors
_LEAST = f32(1e-3)  # weight below which a path is not followed
_STRONG = f32(0.02)  # and below which not from an end
_EVENTS_APART = 32  # numbers of the events of two paths that part
_CHUNK = 64  # pixels a thread takes at a time; results do not depend on it or on the threads
_BATCH = 1 << 15  # pixels whose ends lie in memory at their full number

_WHITE = f32(1), f32(1), f32(1)
_WEIGHT = 5  # and in a path, see `_leave`

END_AND_POINT = np.dtype([("end", END), ("point", RECEIVER)])  # where a path ends, and its first surface

REFLECTED, TRANSMITTED, SCATTERED = 0, 1, 2  # what the first surface did to a path


@dataclass(frozen=True)
class EyeRays:
    """Rays through the pixels whose paths are wanted.

    origins, directions  (n, 3) float32, unit
    distances  (n,) float32 m to what the pixel shows
    keys       (n,) uint32, of the random numbers
    width      m that a pixel covers at the origin, and more at each m of the path
    slack      shares of the distance: a ray starts so far before what its pixel shows, which lies not farther
               behind than so
    hits       (n,) HIT, what the pixels show; None: it is looked for
    """

    origins: np.ndarray
    directions: np.ndarray
    distances: np.ndarray
    keys: np.ndarray
    width: tuple[float, float]
    slack: tuple[float, float] = (1e-4, 1e-3)
    hits: np.ndarray | None = None


@dataclass(frozen=True)
class EyePaths:
    """What the paths found.

    direct, emission  (n, 3) float32 radiance that they bring to each ray
    through  (n, 3) float32 share of the background that each sees through glass; mirrors show none of it
    ends    (m,) END in the order of the rays; lane: REFLECTED or TRANSMITTED by a smooth surface;
            SCATTERED: by a rough one, or a path's second end
    points  (m,) RECEIVER, the same; footprint: of a pixel
    firsts  (n,) FIRST, instance NO_HIT where the ray met something else
    rays    traced
    """

    direct: np.ndarray
    emission: np.ndarray
    through: np.ndarray
    ends: np.ndarray
    points: np.ndarray
    firsts: np.ndarray
    rays: int


def trace_eye(
    packed: Packed,
    world: World,
    surfaces: SurfaceTable,
    rays: EyeRays,
    seed: int,
    pass_index: int,
    threads: int,
) -> EyePaths:
    """Follow eye paths to their ends; the same bytes for any number of threads.

    surfaces  its footprint is of no account: textures are averaged over a pixel's width
    """
    count = len(rays.origins)
    # parts of arrays in another order would be of another type, and kernels for it be compiled
    origins, directions = np.ascontiguousarray(rays.origins), np.ascontiguousarray(rays.directions)
    firsts = np.zeros(count, FIRST)
    direct, emission, through = np.zeros((3, count, 3), np.float32)
    hits = rays.hits
    if hits is None:
        hits = np.zeros(count, HIT)
        hits["instance"] = NO_HIT
    porous = bool((packed.materials["flags"] & (MATERIAL_MASK | MATERIAL_BLEND | MATERIAL_THIN)).any())
    scene = (
        packed.lights, porous, tuple(map(f32, rays.width)), u32(seed), u32(pass_index),
        tuple(map(f32, rays.slack)),
    )  # fmt: skip
    capacity = _CHUNK * _PATHS_MAX * _ENDS_MAX * _samples(packed)
    ends, points, traced = [np.zeros(0, END)], [np.zeros(0, RECEIVER)], 0
    for first in range(0, count, _BATCH):
        part = slice(first, min(first + _BATCH, count))
        chunks = -(-(part.stop - first) // _CHUNK)
        room = world.scratch(chunks * capacity, END_AND_POINT)
        counts = np.zeros((chunks, 2), np.int64)
        counter = np.zeros(8, np.int64)

        def work(_: int, part: slice = part, room: np.ndarray = room, counts: np.ndarray = counts,
                 counter: np.ndarray = counter) -> None:  # fmt: skip
            table, foot = surfaces.own_footprint()
            _follow_chunks(
                (address(world.table), table, surfaces.texels, surfaces.rows), scene, foot,
                (origins[part], directions[part], rays.distances[part], rays.keys[part],
                 hits[part]),
                i64(part.start), address(counter),
                (direct[part], emission[part], room, firsts[part], through[part]), counts,
            )  # fmt: skip

        run_threads(work, threads)
        for chunk, found in enumerate(counts[:, 0]):
            kept = room[chunk * capacity : chunk * capacity + found]
            ends.append(kept["end"].copy())
            points.append(kept["point"].copy())
        traced += int(counts[:, 1].sum())
    return EyePaths(direct, emission, through, np.concatenate(ends), np.concatenate(points), firsts, traced)


def join_paths(a: EyePaths, b: EyePaths) -> EyePaths:
    """Return what two calls found as if the rays of the second had come after those of the first."""
    ends = np.concatenate([a.ends, b.ends])
    ends["slot"][len(a.ends) :] += np.uint32(len(a.direct))
    names = ("direct", "emission", "through", "points", "firsts")
    rest = (np.concatenate([getattr(a, name), getattr(b, name)]) for name in names)
    direct, emission, through, points, firsts = rest
    return EyePaths(direct, emission, through, ends, points, firsts, a.rays + b.rays)


def _samples(packed: Packed) -> int:
    """Paths that a branch may need."""
    materials = packed.materials
    rough = (materials["transmission"] > 0.0) & (materials["roughness"] > 0.0)
    return ROUGH_SAMPLES if rough.any() else 1


@jit
def _follow_chunks(place, scene, foot, rays, first, counter, out, counts):
    room = out[2]
    capacity = i64(len(room) // len(counts))
    scratch = alloca(STACK_WORDS), alloca(2)
    while True:
        chunk = atomic_add(counter, i64(1))
        if chunk >= len(counts):
            return
        at = chunk * capacity, i64(0)
        for i in range(chunk * i64(_CHUNK), min((chunk + 1) * i64(_CHUNK), len(rays[0]))):
            at = _follow_pixel(place, scene, foot, scratch, rays, i, (first + i, i), out, at)
        counts[chunk, 0] = at[0] - chunk * capacity
        counts[chunk, 1] = at[1]


@jit
def _follow_pixel(place, scene, foot, scratch, rays, i, slot, out, at):
    """Follow all paths of ray `i`; `at`: the next free row of the ends, and the number of rays traced."""
    world, table, texels, rows = place
    start, d, key = _vector(rays[0], i), _vector(rays[1], i), rays[3][i]
    near, past = f32(0), False
    shown, length = rays[4][i], rays[2][i]
    hit = shown.instance, shown.primitive, shown.u, shown.v
    if shown.instance == u32(NO_HIT):
        near = length * (f32(1) - scene[5][0])
        start = add(start, scale(near, d))
        found, hit = closest_surface(world, table, texels, rows, start, d, f32(0), scratch[0], scratch[1])
        if not found:
            _add(out[4], slot[1], _WHITE, _WHITE)
            return at[0], at[1] + i64(1)
        length = near + _distance(table, hit, start)
        past = length > rays[2][i] * (f32(1) + scene[5][1])  # the edge of what the rasteriser drew
    foot[0] = _width(scene, length)
    _, ng, n, b, flags, entering = surface(table, texels, rows, hit, d)
    wo = scale(f32(-1), d)
    blurred = f32(0)
    for k in range(1 if past else _branches(b)):
        path = key, u32(0), SCATTERED, start, d, _WHITE, nowhere(), f32(1), near, True
        if not past:
            path = _branch(place, scene, key, k, hit, ng, n, b, wo, flags, entering, length)
        if greatest(path[_WEIGHT]) > _LEAST * f32(1.0 / ROUGH_SAMPLES):
            at, end = _follow_often(place, scene, foot, scratch, path, slot, out, at)
            blurred += (end - length) / end if k < ROUGH_SAMPLES else f32(0)
    angle = blurred * length / (f32(ROUGH_SAMPLES) * _width(scene, length))
    store_first(out[3][slot[1]], n, ng, b, u32(NO_HIT) if past else hit[0], angle)
    return at


@jit
def _branches(b):
    """Paths that go on from a pixel's surface."""
    if is_smooth(b):
        return 2
    return ROUGH_SAMPLES + ROUGH_SAMPLES // _REFLECTED_EACH if transmits(b) else 0


@jit
def _branch(place, scene, key, k, hit, ng, n, b, wo, flags, entering, length):
    """Path `k` of `_branches`: transmitted, or of the rest reflected; all as `_leave` returns them."""
    smooth = is_smooth(b)
    passes = k == 1 if smooth else k < ROUGH_SAMPLES
    sample = 0 if smooth else (k if passes else (k - ROUGH_SAMPLES) * _REFLECTED_EACH)
    u1, u2, _ = facet_numbers(key, u32(sample << 8), scene[4], scene[3])
    reflectance, transmittance, above, beyond, _ = facet_split(b, n, ng, wo, u1, u2)
    wi, weight, dimension = above, reflectance, u32(sample << 8 | 1)
    share = f32(1) if smooth else f32(_REFLECTED_EACH / ROUGH_SAMPLES)
    lane = REFLECTED if smooth else SCATTERED
    if passes:
        wi, weight, dimension = beyond, transmittance, u32(sample << 8 | 128)
        share = f32(1) if smooth else f32(1.0 / ROUGH_SAMPLES)
        lane = TRANSMITTED if smooth else SCATTERED
    way = key, dimension, lane, wi, scale(share, weight), True
    return _leave(place, hit, ng, b, flags, entering, nowhere(), f32(1), length, way)


@jit
def _leave(place, hit, ng, b, flags, entering, inside, focus, length, way):
    """A path that goes on from a hit; way: its key, dimension, lane, direction, weight and `clear`.

    key, dimension  of its random numbers
    lane            of its first end
    start, d        of its next ray
    weight          of the radiance that comes back along it
    inside, focus   the hit at which it entered what it is in, see `medium`; what that makes of radiance
    length          m from the eye to `start`
    clear           whether it went through glass alone, so that it sees the background
    """
    key, dimension, lane, wi, weight, clear = way
    start, inside = depart(place[0], place[1], hit, flags, entering, inside, ng, wi)
    passes, solid = dot(wi, ng) < f32(0), b.thin == f32(0)
    if passes and solid:
        focus = f32(1) / (b.eta * b.eta) if entering else f32(1)
    clear = clear and (passes or (solid and transmits(b) and not entering))
    return key, dimension, lane, start, wi, weight, inside, focus, length, clear


@jit
def _follow_often(place, scene, foot, scratch, path, slot, out, at):
    """Follow one path and the other where it parts; where it is its pixel's first to meet rough glass, others
    beside it.

    -> `at`, and the length of the last in m
    """
    first, i = at[0], slot[1]
    direct, emission, through = _vector(out[0], i), _vector(out[1], i), _vector(out[4], i)
    key, dimension, lane, start, d, weight, inside, focus, length, clear = path
    share, k, count, rough = f32(1), 0, 1, False
    end = length
    while k < count:
        at, met, end, parted, path = _follow(place, scene, foot, scratch, path, slot, out, at)
        rough = rough or met
        if parted:
            continue
        if rough and k == 0 and lane != SCATTERED:
            share, count, lane = f32(1.0 / ROUGH_SAMPLES), ROUGH_SAMPLES, SCATTERED
            for c in range(3):
                out[0][i, c] = direct[c] + share * (out[0][i, c] - direct[c])
                out[1][i, c] = emission[c] + share * (out[1][i, c] - emission[c])
                out[4][i, c] = through[c] + share * (out[4][i, c] - through[c])
                for row in range(first, at[0]):
                    out[2][row].end.weight[c] *= share
        k += 1
        path = (
            key, u32(dimension + u32(k << 8)), lane, start, d, scale(share, weight), inside, focus, length,
            clear,
        )  # fmt: skip
    return at, end


@jit
def _follow(place, scene, foot, scratch, path, slot, out, at):
    """Follow one path to its end or ends.

    -> `at`, whether it met rough glass, its length in m, whether it parted, and if so the other path
    """
    world, table, texels, rows = place
    lights, porous, _, _, _, _ = scene
    row, traced = at
    key, dimension, lane, start, d, weight, inside, focus, length, clear = path
    stored, rough, parted, other = 0, False, False, path
    for _ in range(EVENTS_MAX + 1):
        u1, u2, u0 = facet_numbers(key, dimension, scene[4], scene[3])
        traced += i64(1)
        found, hit = closest_surface(world, table, texels, rows, start, d, u0, scratch[0], scratch[1])
        if not found:
            if clear:
                _add(out[4], slot[1], _WHITE, weight)
            length = f32(1e30)
            break
        length += _distance(table, hit, start)
        foot[0] = _width(scene, length)
        position, ng, n, b, flags, entering = surface(table, texels, rows, hit, d)
        inside = medium(inside, hit, flags, entering)
        if inside[0] != u32(NO_HIT):
            weight = attenuated(table, inside, start, position, weight)
        seen = scale(focus, weight)
        _add(out[1], slot[1], glow(table, texels, rows, hit), seen)
        unlit = flags & u32(MATERIAL_UNLIT) != u32(0)
        wo = scale(f32(-1), d)
        if not unlit and (has_finite(b) or not is_smooth(b)):
            light, shadows = direct_light(
                place, lights, porous, hit, position, ng, n, b, wo, u0, scratch, f32(np.inf)
            )  # fmt: skip
            _add(out[0], slot[1], light, seen)
            traced += shadows
        if has_finite(b) or unlit:
            if unlit:
                b = BLACK
            store_end(out[2][row].end, slot[0], lane, seen, b, hit[0])
            store_point(out[2][row].point, position, ng, n, wo, b, foot[0])
            row, stored, lane = row + i64(1), stored + 1, SCATTERED
        if unlit:
            break
        rough = rough or (transmits(b) and not is_smooth(b))
        may_part = lane == TRANSMITTED and not parted
        alive, wi, factor, parts, above, kept = go_on(b, n, ng, wo, entering, u1, u2, may_part)
        for turn in range(2 if parts else 1):  # the last is the one to go on with
            if turn < parts:
                path = key, u32(dimension + u32(_EVENTS_APART)), SCATTERED, above, times(weight, kept), clear
            else:
                path = key, u32(dimension + u32(1)), lane, wi, times(weight, factor), clear
            left = _leave(place, hit, ng, b, flags, entering, inside, focus, length, path)
            if turn < parts:
                parted, other = True, left
        weight = left[_WEIGHT]
        if not alive or stored == _ENDS_MAX or greatest(weight) < (_STRONG if stored > 0 else _LEAST):
            break
        key, dimension, lane, start, d, weight, inside, focus, length, clear = left
    return (row, traced), rough, length, parted, other


@jit
def _distance(table, hit, start):
    way = sub(hit_position(table, hit), start)
    return f32(math.sqrt(dot(way, way)))


@jit
def _width(scene, length):
    """What a pixel covers after `length` m of its path, were all mirrors flat."""
    wide, spread = scene[2]
    return wide + spread * length


@jit
def _vector(rows, i):
    return rows[i, 0], rows[i, 1], rows[i, 2]


@jit
def _add(sums, i, value, weight):
    sums[i, 0] += value[0] * weight[0]
    sums[i, 1] += value[1] * weight[1]
    sums[i, 2] += value[2] * weight[2]
