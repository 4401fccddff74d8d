"""Eye paths: from pixels that show mirrors and glass to the surfaces that are seen in them.

At the first surface both branches are followed, weighted by Fresnel's equations, and again where a path
leaves the solid that it entered there; after that one is followed: in the first pass the stronger one, while
the last branch that parted takes over some of the others' weight, else one that is drawn. Rough glass is
sampled instead, and so are the lobes of opaque surfaces that are too narrow for photons.
Where photons may light what a path meets it leaves an end; direct light there and emission are added here.
"""

from __future__ import annotations

import numpy as np

from ispm.accel.bands import in_band, is_dispersive
from ispm.accel.edges import clear_of_edges
from ispm.accel.emitter_tree import NO_LOBE
from ispm.accel.intersect import STACK_WORDS
from ispm.accel.layers import coat_point
from ispm.accel.medium import no_medium
from ispm.accel.records import Hit, Scratch
from ispm.accel.surface import (
    SurfaceTable,
    Tables,
    closest_surface,
    hit_position,
    opacity_seen,
    scene_tables,
    surface,
)
from ispm.accel.world import World
from ispm.kernels.share import run_shared, shared_rows
from ispm.kernels.simd import alloca
from ispm.lights.nee import greatest
from ispm.lights.openings import NO_OPENINGS, Openings
from ispm.optics.bsdf import is_smooth, transmits
from ispm.optics.dispersion import ALL_BANDS, BANDS
from ispm.optics.environment import seen_radiance
from ispm.optics.facets import is_anisotropic
from ispm.optics.jit import jit
from ispm.optics.records import NO_HIT, RECEIVER
from ispm.optics.vector import add, scale, sub, vec3
from ispm.paths.branch import (
    PARTINGS,
    SCATTERED,
    TRANSMITTED,
    Path,
    View,
    branches,
    distance_to,
    first_path,
    nothing_waits,
    path_in_band,
    pixel_width,
    without_next,
)
from ispm.paths.coat import own_light
from ispm.paths.eye_paths import (
    Done,
    EyeOut,
    EyePaths,
    EyeRays,
    EyeThread,
    RayArrays,
    Reach,
    no_paths,
    ray_arrays,
)
from ispm.paths.facet import ROUGH_SAMPLES, bands_most, mean_reflectance, samples_most
from ispm.paths.far import sides_most
from ispm.paths.follow import ENDS_MAX, MIN_WEIGHT, follow
from ispm.paths.vertices import (
    DIRECT,
    EMISSION,
    PATH_END,
    PATH_END_AND_POINT,
    SEVERAL,
    THROUGH,
    add_light,
    light_at,
    scale_since,
    store_clear,
    store_first,
    store_gloss,
    store_own,
)
from ispm.scene.packed import Packed

f32, i64, u32 = np.float32, np.int64, np.uint32

_PATHS_MAX = 2 * (1 + PARTINGS)  # of a pixel that shows no rough glass; of those of a lobe GLOSS_SAMPLES
_CONTACT = f32(1e-3)  # of a path, the least length of what reflects it to where it ends, for its blur
_CHUNK = 64  # pixels a thread takes at a time; results do not depend on it or on the threads
_BATCH = 1 << 12  # pixels whose ends lie in memory at their full number, for up to four threads

_WHITE = f32(1), f32(1), f32(1)


def trace_eye(
    packed: Packed,
    world: World,
    surfaces: SurfaceTable,
    rays: EyeRays,
    seed: int,
    pass_index: int,
    into: EyePaths | None = None,
    openings: Openings = NO_OPENINGS,
) -> EyePaths:
    """Follow eye paths to their ends; the same bytes for any number of threads.

    surfaces  its footprint is not used: textures are averaged over a pixel's width
    into      zeros to be filled; None: new ones
    openings  that let in the environment's light where paths end
    """
    count = len(rays.origins)
    into = into or no_paths(count)
    light, firsts = into.light, into.firsts
    arrays = ray_arrays(rays)
    tables = scene_tables(packed, world, surfaces)
    (width, spread), (near, past) = rays.width, rays.slack
    numbers = u32(pass_index), u32(seed), u32(rays.columns), i64(rays.most), i64(rays.draws)
    told = rays.shows_environment, rays.of_coats, rays.behind, rays.by_image
    view = View(
        f32(width),
        f32(spread),
        f32(near),
        f32(past),
        *numbers,
        f32(rays.widening),
        *told,
        u32(rays.within),
        openings,
    )
    capacity = _CHUNK * _PATHS_MAX * ENDS_MAX * samples_most(packed) * sides_most(packed) * bands_most(packed)
    words, cut = PATH_END_AND_POINT.itemsize // 4, PATH_END.itemsize // 4
    ends, points, traced = [np.zeros((0, cut), np.uint32)], [np.zeros((0, words - cut), np.uint32)], 0
    batch_size = _BATCH * -(-world.threads // 4)  # else some threads wait for the last
    for first in range(0, count, batch_size):
        part = slice(first, min(first + batch_size, count))
        chunks = -(-(part.stop - first) // _CHUNK)
        room = world.scratch(chunks * capacity, PATH_END_AND_POINT)
        counts = np.zeros((chunks, 2), np.int64)
        out = EyeOut(light[part], firsts[part], room, counts)
        batch = RayArrays(*(each[part] for each in arrays))
        _follow_batch(tables, surfaces, view, batch, first, out, world.threads)
        raw = room.view(np.uint32).reshape(-1, words)  # records are copied field by field, which is slow
        _collect_ends(raw, np.ascontiguousarray(counts[:, 0]), ends, points, cut, world.threads)
        traced += int(counts[:, 1].sum())
    stored = np.concatenate(ends).view(PATH_END)[:, 0], np.concatenate(points).view(RECEIVER)[:, 0]
    return EyePaths(light, firsts, *stored, traced)


def _collect_ends(
    room: np.ndarray,
    counts: np.ndarray,
    ends: list[np.ndarray],
    points: list[np.ndarray],
    cut: int,
    threads: int,
) -> None:
    """Append the ends and points of a batch to what there is, as words.

    room    words of PATH_END_AND_POINT, chunk by chunk;  cut  words of a PATH_END
    counts  (chunks,) int64, records of each
    """
    starts = np.cumsum(counts) - counts
    total, words = int(counts.sum()), room.shape[1]
    ends.append(np.empty((total, cut), np.uint32))
    points.append(np.empty((total, words - cut), np.uint32))
    told = room, counts, starts
    run_shared(lambda counter: _copy_chunks(*told, counter, ends[-1], points[-1]), threads)


@jit
def _copy_chunks(room, counts, starts, counter, ends, points):
    """Copy as many chunks' records as a thread gets to the rows from where they start."""
    capacity, cut = len(room) // len(counts), ends.shape[1]
    for chunk in shared_rows(counter, 1, len(counts)):
        for k in range(counts[chunk]):
            record, row = chunk * capacity + k, starts[chunk] + k
            for word in range(cut):
                ends[row, word] = room[record, word]
            for word in range(points.shape[1]):
                points[row, word] = room[record, cut + word]


def _follow_batch(
    tables: Tables, surfaces: SurfaceTable, view: View, rays: RayArrays, first: int, out: EyeOut, threads: int
) -> None:
    """Follow the paths of some rays, the first of which is row `first` of all."""

    def work(counter: np.uint64) -> None:
        own, footprint = surfaces.own_footprint()
        own_tables, values = tables._replace(surfaces=own), np.empty(len(tables.lights), np.float32)
        _follow_chunks(own_tables, view, footprint, values, rays, i64(first), counter, out)

    run_shared(work, threads)


@jit
def _follow_chunks(tables, view, footprint, values, rays, first, counter, out):
    """Follow the paths of as many chunks of RayArrays as a thread gets, filling an EyeOut.

    footprint, values  of the thread's EyeThread;  first  row of the first ray among all
    """
    counts = out.counts
    capacity = i64(len(out.ends) // len(counts))
    thread = EyeThread(Scratch(alloca(STACK_WORDS), alloca(2)), footprint, values)
    for chunk in shared_rows(counter, 1, len(counts)):
        done = Done(chunk * capacity, i64(0))
        for i in range(chunk * i64(_CHUNK), min((chunk + 1) * i64(_CHUNK), len(rays.origins))):
            done = _follow_pixel(tables, view, thread, rays, i, first + i, out, done)
        counts[chunk, 0] = done.row - chunk * capacity
        counts[chunk, 1] = done.traced


@jit
def _follow_pixel(tables, view, thread, rays, i, slot, out, done):
    """Follow all paths of row `i` of RayArrays, whose ends have `slot`, int64; write an EyeOut, return the
    Done."""
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
                add_light(out.light, i, EMISSION, seen_radiance(tables.environment, d, True), _WHITE)
            else:
                add_light(out.light, i, THROUGH, _WHITE, _WHITE)
            return Done(done.row, done.traced + i64(1))
        length = near + distance_to(tables, start, hit)
        past = length > rays.distances[i] * (f32(1) + view.past)  # the edge of what the rasteriser drew
    thread.footprint[:] = pixel_width(view, length)
    x = surface(tables, hit, d)
    wo = scale(f32(-1), d)
    if view.of_coats or (is_anisotropic(x.bsdf) and not (past or view.behind)):
        own, more, shadows = own_light(tables, x, wo, key, view, thread.scratch, view.draws)
        store_own(out.firsts[i], own, f32(1) - x.coat.shown if view.of_coats else f32(0))
        add_light(out.light, i, DIRECT, more, _WHITE)
        x, done = coat_point(x) if view.of_coats else x, Done(done.row, done.traced + shadows)
    if view.behind and not past:
        return _follow_behind(tables, view, thread, x, d, key, length, i, slot, out, done)
    blurred, near_by, beyond, followed, met = f32(0), f32(0), f32(0), f32(0), u32(NO_HIT)
    bands = i64(BANDS) if is_dispersive(x) and not past else i64(1)
    count = i64(1) if past else branches(view, x, wo, key)
    for number in range(count * bands):
        k, band, y = number // bands, ALL_BANDS, x
        if bands > i64(1):
            band = number % bands
            y = in_band(tables, x, band)
        place = f32(0), f32(0), d, d, NO_LOBE, no_medium(), f32(1)
        path = Path(key, u32(0), i64(SCATTERED), start, d, _WHITE, *place, near, True, ALL_BANDS, True)
        if not past:
            path = first_path(tables, view, y, wo, key, k, length, band)
        if greatest(path.weight) > MIN_WEIGHT * f32(1.0 / ROUGH_SAMPLES):
            done, reach = _follow_bands(tables, view, thread, path, no_medium(), i, slot, out, done)
            blurred += _share_of(reach.end, length) if k < ROUGH_SAMPLES else f32(0)
            near_by += f32(1) / max(_share_of(reach.near, length), _CONTACT)
            beyond += f32(1) / max(_share_of(reach.end, length), _CONTACT)
            met = reach.met if followed == f32(0) or reach.met == met else u32(SEVERAL)
            followed += f32(1)
    angle = length / pixel_width(view, length)
    instance = u32(NO_HIT) if past else hit.instance
    if past or is_smooth(x.bsdf) or transmits(x.bsdf):
        blur = angle * blurred * f32(1.0 / ROUGH_SAMPLES) / f32(bands)
        store_first(out.firsts[i], x, instance, blur)
    else:
        unknown = f32(-1) if is_anisotropic(x.bsdf) else f32(0)  # of which many paths lead below the surface
        near_by = followed / near_by if followed > f32(0) else unknown
        beyond = followed / beyond if followed > f32(0) else f32(0)
        angles = angle * near_by, angle * beyond
        store_gloss(out.firsts[i], x, instance, angles, met, mean_reflectance(x, wo), count)
    return done


@jit
def _share_of(end, length):
    """How much of a path, float32, is behind the surface that its pixel shows; end, length: m to both."""
    return (end - length) / end


@jit
def _follow_behind(tables, view, thread, x, d, key, length, i, slot, out, done):
    """Follow the path of ray `i` behind a blended SurfacePoint, `length` m away along d; return the Done."""
    clear = f32(1) - opacity_seen(tables, x.hit)
    store_clear(out.firsts[i], x, clear)
    if clear < MIN_WEIGHT:
        return done
    before, within = length * view.near, clear_of_edges(tables, x.hit, d)
    start, weight = sub(hit_position(tables.surfaces, within), scale(before, d)), (clear, clear, clear)
    place = start, d, weight, f32(0), f32(0), d, d, NO_LOBE, no_medium(), f32(1)
    path = Path(key, u32(0), i64(TRANSMITTED), *place, length - before, True, ALL_BANDS, True)
    done, _ = _follow_bands(tables, view, thread, path, x.hit, i, slot, out, done)
    return done


@jit
def _follow_bands(tables, view, thread, path, veil, i, slot, out, done):
    """Follow a path of ray `i` as `_follow_often` does; where it meets what disperses its light, one of each
    band in its place.

    -> the Done, and the Reach of the last path
    """
    before = light_at(out.light, i)
    followed, reach, disperses = _follow_often(tables, view, thread, path, veil, i, slot, out, done)
    if not disperses:
        return followed, reach
    scale_since(out.light, i, before, f32(0))
    done = Done(done.row, followed.traced)
    for band in range(BANDS):
        part = path_in_band(path, i64(band))
        done, reach, _ = _follow_often(tables, view, thread, part, veil, i, slot, out, done)
    return done, reach


@jit
def _follow_often(tables, view, thread, path, veil, i, slot, out, done):
    """Follow a path of ray `i`, and those that part from it. Where it is its pixel's first to meet rough
    glass, it becomes one of ROUGH_SAMPLES, whose mean counts.

    veil  as of `follow`
    -> the Done, the Reach of the last path, and whether it ended as its light disperses, see `follow`
    """
    first = done.row
    key, dimension, lane, start, d, weight, pdf, blur = path[:8]
    side, origin, lobe, inside, focus, length, sees, band, clear = path[8:]
    before = light_at(out.light, i)
    share, k, count, rough = f32(1), 0, 1, False
    reach, skipped, waiting = Reach(length, length, u32(NO_HIT)), veil, nothing_waits(path, lane != SCATTERED)
    while k < count:
        found = follow(tables, view, thread, path, skipped, waiting, i, slot, out, done)
        done, met, reach, waiting, disperses = found
        if disperses:
            return done, reach, True
        rough = rough or met
        if waiting.size > i64(0):
            path, skipped, waiting = waiting.paths[0], no_medium(), without_next(waiting)
            continue
        if rough and k == 0 and lane != SCATTERED and pdf == f32(0):
            share, count, lane = f32(1.0 / ROUGH_SAMPLES), ROUGH_SAMPLES, i64(SCATTERED)
            scale_since(out.light, i, before, share)
            for row in range(first, done.row):
                for c in range(3):
                    out.ends[row].end.weight[c] *= share
        k, skipped, waiting = k + 1, veil, nothing_waits(path, False)
        sample, part = u32(dimension + u32(k << 8)), scale(share, weight)
        place = side, origin, lobe, inside, focus, length
        path = Path(key, sample, lane, start, d, part, pdf, blur, *place, sees, band, clear)
    return done, reach, False
