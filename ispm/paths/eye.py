"""Eye paths: from pixels that show mirrors and glass to the surfaces that are seen in them.

At the first surface both branches are followed, weighted by Fresnel's equations, and again where a path
leaves the solid that it entered there; after that the stronger one is followed with the weight of both, which
is exact where both would find the same light. Rough glass is sampled instead.
Where a path meets a surface that photons may light it leaves an end; direct light there, and emission, is
added here.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ispm.accel.intersect import STACK_WORDS
from ispm.accel.medium import attenuated, medium, no_medium, spawn_ray
from ispm.accel.records import Hit, Scratch
from ispm.accel.surface import (
    SurfaceTable,
    Tables,
    closest_surface,
    glow,
    hit_position,
    scene_tables,
    surface,
)
from ispm.accel.world import World
from ispm.kernels.share import run_shared, shared_rows
from ispm.kernels.simd import alloca
from ispm.lights.nee import direct_light, greatest, times
from ispm.optics.bsdf import has_finite, is_smooth, transmits
from ispm.optics.environment import environment_radiance, has_environment
from ispm.optics.jit import jit
from ispm.optics.records import MATERIAL_UNLIT, NO_HIT, RECEIVER
from ispm.optics.vector import Vector, add, dot, scale, sub, vec3
from ispm.paths.eye_paths import EyePaths, EyeRays, RayArrays, ray_arrays
from ispm.paths.facet import ROUGH_SAMPLES, facet_numbers, facet_split, sample_specular_lobe
from ispm.paths.vertices import (
    BLACK,
    FIRST_VERTEX,
    PATH_END,
    PATH_END_AND_POINT,
    add_light,
    store_end,
    store_first,
    store_point,
)
from ispm.scene.packed import Packed

f32, i64, u32 = np.float32, np.int64, np.uint32

EVENTS_MAX = 8  # mirrors and faces of glass that a path meets
_REFLECTED_EACH = 4  # of them so many reflect once
_PATHS_MAX = 3  # of a pixel that shows no rough glass: reflected, let through, and reflected within
_ENDS_MAX = 2  # of one path: behind a varnished floor goes on what it mirrors
_MIN_WEIGHT = f32(1e-3)  # weight below which a path is not followed
_MIN_WEIGHT_AFTER_END = f32(0.02)  # and below which not from an end
_EVENTS_APART = 32  # numbers of the events of two paths that part
_CHUNK = 64  # pixels a thread takes at a time; results do not depend on it or on the threads
_BATCH = 1 << 15  # pixels whose ends lie in memory at their full number

_WHITE = f32(1), f32(1), f32(1)

REFLECTED, TRANSMITTED, SCATTERED = 0, 1, 2  # what the first surface did to a path


def trace_eye(
    packed: Packed, world: World, surfaces: SurfaceTable, rays: EyeRays, seed: int, pass_index: int
) -> EyePaths:
    """Follow eye paths to their ends; the same bytes for any number of threads.

    surfaces  its footprint is not used: textures are averaged over a pixel's width
    """
    count = len(rays.origins)
    firsts = np.zeros(count, FIRST_VERTEX)
    direct, emission, through = np.zeros((3, count, 3), np.float32)
    arrays = ray_arrays(rays)
    tables = scene_tables(packed, world, surfaces)
    (width, spread), (near, past) = rays.width, rays.slack
    numbers = u32(pass_index), u32(seed), rays.shows_environment
    view = _View(f32(width), f32(spread), f32(near), f32(past), *numbers)
    capacity = _CHUNK * _PATHS_MAX * _ENDS_MAX * _samples(packed)
    ends, points, traced = [np.zeros(0, PATH_END)], [np.zeros(0, RECEIVER)], 0
    for first in range(0, count, _BATCH):
        part = slice(first, min(first + _BATCH, count))
        chunks = -(-(part.stop - first) // _CHUNK)
        room = world.scratch(chunks * capacity, PATH_END_AND_POINT)
        counts = np.zeros((chunks, 2), np.int64)
        out = _Out(direct[part], emission[part], through[part], firsts[part], room, counts)
        batch = RayArrays(*(each[part] for each in arrays))
        _follow_batch(tables, surfaces, view, batch, first, out, world.threads)
        for chunk, found in enumerate(counts[:, 0]):
            kept = room[chunk * capacity : chunk * capacity + found]
            ends.append(kept["end"].copy())
            points.append(kept["point"].copy())
        traced += int(counts[:, 1].sum())
    return EyePaths(direct, emission, through, np.concatenate(ends), np.concatenate(points), firsts, traced)


def _follow_batch(
    tables: Tables, surfaces: SurfaceTable, view: _View, rays: RayArrays, first: int, out: _Out, threads: int
) -> None:
    """Follow the paths of some rays, the first of which is row `first` of all."""

    def work(counter: np.uint64) -> None:
        own, footprint = surfaces.own_footprint()
        _follow_chunks(tables._replace(surfaces=own), view, footprint, rays, i64(first), counter, out)

    run_shared(work, threads)


def _samples(packed: Packed) -> int:
    """The most paths that a branch at a pixel's surface may become."""
    materials = packed.materials
    rough = (materials["transmission"] > 0.0) & (materials["roughness"] > 0.0)
    return ROUGH_SAMPLES if rough.any() else 1


class _View(NamedTuple):
    """What holds for all rays: width, spread, near and past are `EyeRays.width` and `slack`, and the last is
    theirs too."""

    width: np.float32
    spread: np.float32
    near: np.float32
    past: np.float32
    pass_index: np.uint32
    seed: np.uint32
    shows_environment: bool


class _Out(NamedTuple):
    """What kernels write: arrays of EyePaths, and by chunks

    ends    (m,) PATH_END_AND_POINT, of which each chunk has an equal part
    counts  (chunks, 2) int64, ends and rays
    """

    direct: np.ndarray
    emission: np.ndarray
    through: np.ndarray
    firsts: np.ndarray
    ends: np.ndarray
    counts: np.ndarray


class _Thread(NamedTuple):
    """What one thread works with: Scratch, and the (1,) float32 that is its surfaces' footprint, see
    `SurfaceTable.own_footprint`."""

    scratch: Scratch
    footprint: np.ndarray


class _Done(NamedTuple):
    """How far a chunk is: the next free row of the ends, and the number of rays traced."""

    row: np.int64
    traced: np.int64


class _Branch(NamedTuple):
    """How a path continues from a surface; fields as those of a `_Path` there."""

    key: np.uint32
    dimension: np.uint32
    lane: np.int64
    d: Vector
    weight: Vector
    sees_background: bool


class _Path(NamedTuple):
    """A path that is being followed.

    key, dimension  of its random numbers
    lane            of its first end
    start, d        of its next ray
    weight          of the radiance that comes back along it
    inside, focus   the hit at which it entered the solid that it is in, see `medium`; and what radiance from
                    there is multiplied by, 1 / eta^2, outside 1
    length          m from the eye to `start`
    sees_background           whether it went through glass alone, so that it sees the background
    """

    key: np.uint32
    dimension: np.uint32
    lane: np.int64
    start: Vector
    d: Vector
    weight: Vector
    inside: Hit
    focus: np.float32
    length: np.float32
    sees_background: bool


@jit
def _follow_chunks(tables, view, footprint, rays, first, counter, out):
    """Follow the paths of as many chunks of RayArrays as a thread gets, filling an _Out.

    footprint  (1,) float32 m, of the thread;  first  row of the first ray among all
    """
    counts = out.counts
    capacity = i64(len(out.ends) // len(counts))
    thread = _Thread(Scratch(alloca(STACK_WORDS), alloca(2)), footprint)
    for chunk in shared_rows(counter, 1, len(counts)):
        done = _Done(chunk * capacity, i64(0))
        for i in range(chunk * i64(_CHUNK), min((chunk + 1) * i64(_CHUNK), len(rays.origins))):
            done = _follow_pixel(tables, view, thread, rays, i, first + i, out, done)
        counts[chunk, 0] = done.row - chunk * capacity
        counts[chunk, 1] = done.traced


@jit
def _follow_pixel(tables, view, thread, rays, i, slot, out, done):
    """Follow all paths of row `i` of RayArrays, whose ends have `slot`, int64; write an _Out, return the
    _Done."""
    start, d, key = vec3(rays.origins[i]), vec3(rays.directions[i]), rays.keys[i]
    near, past = f32(0), False
    shown, length = rays.hits[i], rays.distances[i]
    hit = Hit(shown.instance, shown.primitive, shown.u, shown.v)
    if shown.instance == u32(NO_HIT):
        near = length * (f32(1) - view.near)
        start = add(start, scale(near, d))
        found, hit = closest_surface(tables, start, d, f32(0), thread.scratch)
        if not found:
            if view.shows_environment:
                add_light(out.emission, i, environment_radiance(tables.environment, d), _WHITE)
            else:
                add_light(out.through, i, _WHITE, _WHITE)
            return _Done(done.row, done.traced + i64(1))
        length = near + _distance(tables, hit, start)
        past = length > rays.distances[i] * (f32(1) + view.past)  # the edge of what the rasteriser drew
    thread.footprint[:] = _width(view, length)
    x = surface(tables, hit, d)
    wo = scale(f32(-1), d)
    blurred = f32(0)
    for k in range(1 if past else _branches(x.bsdf)):
        path = _Path(key, u32(0), i64(SCATTERED), start, d, _WHITE, no_medium(), f32(1), near, True)
        if not past:
            path = _branch(tables, view, x, wo, key, k, length)
        if greatest(path.weight) > _MIN_WEIGHT * f32(1.0 / ROUGH_SAMPLES):
            done, end = _follow_often(tables, view, thread, path, i, slot, out, done)
            blurred += (end - length) / end if k < ROUGH_SAMPLES else f32(0)
    angle = blurred * length / (f32(ROUGH_SAMPLES) * _width(view, length))
    store_first(out.firsts[i], x, u32(NO_HIT) if past else hit.instance, angle)
    return done


@jit
def _branches(b):
    """Number of paths that start from a pixel's surface, whose Bsdf is b."""
    if is_smooth(b):
        return 2
    return ROUGH_SAMPLES + ROUGH_SAMPLES // _REFLECTED_EACH if transmits(b) else 0


@jit
def _branch(tables, view, x, wo, key, k, length):
    """Return _Path `k` of `_branches`, transmitted or, of the rest, reflected, from a SurfacePoint that is
    seen along wo from `length` m away."""
    smooth = is_smooth(x.bsdf)
    passes = k == 1 if smooth else k < ROUGH_SAMPLES
    sample = 0 if smooth else (k if passes else (k - ROUGH_SAMPLES) * _REFLECTED_EACH)
    u1, u2, _ = facet_numbers(key, u32(sample << 8), view.pass_index, view.seed)
    reflectance, transmittance, above, beyond, _ = facet_split(x, wo, u1, u2)
    wi, weight, dimension = above, reflectance, u32(sample << 8 | 1)
    share = f32(1) if smooth else f32(_REFLECTED_EACH / ROUGH_SAMPLES)
    lane = REFLECTED if smooth else SCATTERED
    if passes:
        wi, weight, dimension = beyond, transmittance, u32(sample << 8 | 128)
        share = f32(1) if smooth else f32(1.0 / ROUGH_SAMPLES)
        lane = TRANSMITTED if smooth else SCATTERED
    branch = _Branch(key, dimension, i64(lane), wi, scale(share, weight), True)
    return _leave(tables, x, no_medium(), f32(1), length, branch)


@jit
def _leave(tables, x, inside, focus, length, branch):
    """Return the _Path that continues from a SurfacePoint by a _Branch.

    inside, focus  as of a _Path;  length  m, from the eye
    """
    key, dimension, lane, d, weight, sees_background = branch
    start, inside = spawn_ray(tables, x, inside, d)
    passes, solid = dot(d, x.ng) < f32(0), x.bsdf.thin == f32(0)
    if passes and solid:
        focus = f32(1) / (x.bsdf.eta * x.bsdf.eta) if x.entering else f32(1)
    sees_background = sees_background and (passes or (solid and transmits(x.bsdf) and not x.entering))
    return _Path(key, dimension, lane, start, d, weight, inside, focus, length, sees_background)


@jit
def _follow_often(tables, view, thread, path, i, slot, out, done):
    """Follow a path of ray `i`, and the second one if it parts. Where it is its pixel's first to meet rough
    glass, it becomes one of ROUGH_SAMPLES, whose mean counts.

    -> the _Done, and the length of the last path, m
    """
    first, (key, dimension, lane, start, d, weight, inside, focus, length, sees_background) = done.row, path
    direct, emission, through = vec3(out.direct[i]), vec3(out.emission[i]), vec3(out.through[i])
    share, k, count, rough = f32(1), 0, 1, False
    end = length
    while k < count:
        done, met, end, parted, path = _follow(tables, view, thread, path, i, slot, out, done)
        rough = rough or met
        if parted:
            continue
        if rough and k == 0 and lane != SCATTERED:
            share, count, lane = f32(1.0 / ROUGH_SAMPLES), ROUGH_SAMPLES, i64(SCATTERED)
            for c in range(3):
                out.direct[i, c] = direct[c] + share * (out.direct[i, c] - direct[c])
                out.emission[i, c] = emission[c] + share * (out.emission[i, c] - emission[c])
                out.through[i, c] = through[c] + share * (out.through[i, c] - through[c])
                for row in range(first, done.row):
                    out.ends[row].end.weight[c] *= share
        k += 1
        sample, part = u32(dimension + u32(k << 8)), scale(share, weight)
        path = _Path(key, sample, lane, start, d, part, inside, focus, length, sees_background)
    return done, end


@jit
def _follow(tables, view, thread, path, i, slot, out, done):
    """Follow one path of ray `i` to its end or ends.

    -> the _Done, whether it met rough glass, its length in m, whether it parted, and if so the other path
    """
    row, traced = done.row, done.traced
    key, dimension, lane, start, d, weight, inside, focus, length, sees_background = path
    stored, rough, parted, other = 0, False, False, path
    for _ in range(EVENTS_MAX + 1):
        u1, u2, u0 = facet_numbers(key, dimension, view.pass_index, view.seed)
        traced += i64(1)
        found, hit = closest_surface(tables, start, d, u0, thread.scratch)
        if not found:
            if has_environment(tables.environment):
                light = environment_radiance(tables.environment, d)
                add_light(out.emission, i, light, scale(focus, weight))
            elif sees_background:
                add_light(out.through, i, _WHITE, weight)
            length = f32(1e30)
            break
        length += _distance(tables, hit, start)
        width = _width(view, length)
        thread.footprint[:] = width
        x = surface(tables, hit, d)
        b = x.bsdf
        inside = medium(inside, x)
        if inside.instance != u32(NO_HIT):
            weight = attenuated(tables, inside, start, x.position, weight)
        seen = scale(focus, weight)
        add_light(out.emission, i, glow(tables, hit, d), seen)
        unlit = x.flags & u32(MATERIAL_UNLIT) != u32(0)
        wo = scale(f32(-1), d)
        if not unlit and (has_finite(b) or not is_smooth(b)):
            light, shadows = direct_light(tables, x, wo, u0, thread.scratch, f32(np.inf))
            add_light(out.direct, i, light, seen)
            traced += shadows
        if has_finite(b) or unlit:
            if unlit:
                b = BLACK
            store_end(out.ends[row].end, slot, lane, seen, b, hit.instance)
            store_point(out.ends[row].point, x, wo, b, width)
            row, stored, lane = row + i64(1), stored + 1, i64(SCATTERED)
        if unlit:
            break
        rough = rough or (transmits(b) and not is_smooth(b))
        may_part = lane == TRANSMITTED and not parted
        alive, wi, factor, parts, above, kept = sample_specular_lobe(x, wo, u1, u2, may_part)
        branch = _Branch(key, u32(dimension + u32(1)), lane, wi, times(weight, factor), sees_background)
        if parts:
            apart = u32(dimension + u32(_EVENTS_APART))
            second = _Branch(key, apart, i64(SCATTERED), above, times(weight, kept), sees_background)
            parted, other = True, _leave(tables, x, inside, focus, length, second)
        left = _leave(tables, x, inside, focus, length, branch)
        weight = left.weight
        least = _MIN_WEIGHT_AFTER_END if stored > 0 else _MIN_WEIGHT
        if not alive or stored == _ENDS_MAX or greatest(weight) < least:
            break
        key, dimension, lane, start, d, weight, inside, focus, length, sees_background = left
    return _Done(row, traced), rough, length, parted, other


@jit
def _distance(tables, hit, start):
    """Distance in m from `start` to a Hit."""
    segment = sub(hit_position(tables.surfaces, hit), start)
    return f32(math.sqrt(dot(segment, segment)))


@jit
def _width(view, length):
    """Width in m that a pixel covers after `length` m of its path, were all mirrors flat."""
    return view.width + view.spread * length
