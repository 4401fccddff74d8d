"""Eye paths: from pixels that show mirrors and glass to the surfaces that are seen in them.

At the first surface both branches are followed, weighted by Fresnel's equations, and again where a path
leaves the solid that it entered there; after that the stronger one is followed with the weight of both, which
is exact where both would find the same light. Rough glass is sampled instead, and so are the lobes of opaque
surfaces that are too narrow for photons.
Where photons may light what a path meets it leaves an end; direct light there and emission are added here.
"""

from __future__ import annotations

import numpy as np

from ispm.accel.edges import clear_of_edges
from ispm.accel.intersect import STACK_WORDS
from ispm.accel.layers import coat_point, end_bsdf, has_sheen, is_coated, is_translucent, with_matte_sheen
from ispm.accel.medium import attenuated, medium, no_medium, passed_sheet
from ispm.accel.records import Hit, Scratch
from ispm.accel.surface import (
    SurfaceTable,
    Tables,
    closest_behind,
    closest_surface,
    glow,
    hit_position,
    leave_surface,
    opacity_seen,
    scene_tables,
    surface,
)
from ispm.accel.world import World
from ispm.kernels.share import run_shared, shared_rows
from ispm.kernels.simd import alloca
from ispm.lights.few import light_of_few
from ispm.lights.nee import (
    BY_FACETS,
    BY_NOTHING,
    greatest,
    lamp_weight,
    punctual_light,
    surround_weight,
    times,
)
from ispm.lights.ratio import area_light_by_ratio
from ispm.optics.bsdf import NARROW_ALPHA, has_finite, is_narrow, is_smooth, transmits
from ispm.optics.environment import environment_radiance, has_environment
from ispm.optics.facets import is_anisotropic
from ispm.optics.jit import jit
from ispm.optics.records import MATERIAL_UNLIT, NO_HIT, RECEIVER
from ispm.optics.rng import random4
from ispm.optics.vector import add, scale, sub, vec3
from ispm.paths.branch import (
    GLOSS_SAMPLES,
    SCATTERED,
    STRONG,
    TRANSMITTED,
    Branch,
    Path,
    View,
    branches,
    distance_to,
    first_path,
    leave,
    pixel_width,
)
from ispm.paths.coat import draw_coat, facet_light, own_light, sample_coat
from ispm.paths.eye_paths import Done, EyeOut, EyePaths, EyeRays, EyeThread, RayArrays, no_paths, ray_arrays
from ispm.paths.facet import (
    ROUGH_SAMPLES,
    facet_numbers,
    lobe_width,
    mean_reflectance,
    sample_lobe,
    sample_specular_lobe,
    samples_most,
    widened,
)
from ispm.paths.far import layers_light, sides_most, store_far
from ispm.paths.vertices import (
    BLACK,
    DIRECT,
    EMISSION,
    PATH_END,
    PATH_END_AND_POINT,
    THROUGH,
    add_light,
    light_at,
    scale_since,
    store_clear,
    store_end,
    store_first,
    store_gloss,
    store_own,
    store_point,
)
from ispm.scene.packed import Packed

f32, i64, u32 = np.float32, np.int64, np.uint32

EVENTS_MAX = 8  # mirrors and faces of glass that a path meets
_PATHS_MAX = GLOSS_SAMPLES  # of a pixel that shows no rough glass; of those that do not scatter 3
_ENDS_MAX = 2  # of one path: behind a varnished floor goes on what it mirrors
_MIN_WEIGHT = f32(1e-3)  # weight below which a path is not followed
_MIN_WEIGHT_AFTER_END = f32(0.02)  # and below which not from an end
_CONTACT = f32(1e-3)  # of a path, the least length of what reflects it to where it ends, for its blur
_EVENTS_APART = 32  # numbers of the events of two paths that part
_DIMENSION = 7 << 20  # of the random numbers that draw lights
_LAMP_SAMPLES = 4  # points of lamps with a surface that an end is lit by, where a pixel has one path
_SAMPLES_BEHIND = 16  # likewise behind what is blended: as many as what stands beside it has by its filter
_CHUNK = 64  # pixels a thread takes at a time; results do not depend on it or on the threads
_BATCH = 1 << 13  # pixels whose ends lie in memory at their full number

_WHITE = f32(1), f32(1), f32(1)


def trace_eye(
    packed: Packed,
    world: World,
    surfaces: SurfaceTable,
    rays: EyeRays,
    seed: int,
    pass_index: int,
    into: EyePaths | None = None,
) -> EyePaths:
    """Follow eye paths to their ends; the same bytes for any number of threads.

    surfaces  its footprint is not used: textures are averaged over a pixel's width
    into      zeros to be filled; None: new ones
    """
    count = len(rays.origins)
    into = into or no_paths(count)
    light, firsts = into.light, into.firsts
    arrays = ray_arrays(rays)
    tables = scene_tables(packed, world, surfaces)
    (width, spread), (near, past) = rays.width, rays.slack
    numbers = u32(pass_index), u32(seed), u32(rays.columns), i64(rays.most), f32(rays.widening)
    told = rays.shows_environment, rays.of_coats, rays.behind
    view = View(f32(width), f32(spread), f32(near), f32(past), *numbers, *told)
    capacity = _CHUNK * _PATHS_MAX * _ENDS_MAX * samples_most(packed) * sides_most(packed)
    words, cut = PATH_END_AND_POINT.itemsize // 4, PATH_END.itemsize // 4
    ends, points, traced = [np.zeros((0, cut), np.uint32)], [np.zeros((0, words - cut), np.uint32)], 0
    for first in range(0, count, _BATCH):
        part = slice(first, min(first + _BATCH, count))
        chunks = -(-(part.stop - first) // _CHUNK)
        room = world.scratch(chunks * capacity, PATH_END_AND_POINT)
        counts = np.zeros((chunks, 2), np.int64)
        out = EyeOut(light[part], firsts[part], room, counts)
        batch = RayArrays(*(each[part] for each in arrays))
        _follow_batch(tables, surfaces, view, batch, first, out, world.threads)
        raw = room.view(np.uint32).reshape(-1, words)  # records are copied field by field, which is slow
        met = [raw[k * capacity :][:found] for k, found in enumerate(counts[:, 0])]
        ends.append(np.concatenate([part[:, :cut] for part in met]))
        points.append(np.concatenate([part[:, cut:] for part in met]))
        traced += int(counts[:, 1].sum())
    stored = np.concatenate(ends).view(PATH_END)[:, 0], np.concatenate(points).view(RECEIVER)[:, 0]
    return EyePaths(light, firsts, *stored, traced)


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
                add_light(out.light, i, EMISSION, environment_radiance(tables.environment, d), _WHITE)
            else:
                add_light(out.light, i, THROUGH, _WHITE, _WHITE)
            return Done(done.row, done.traced + i64(1))
        length = near + distance_to(tables, start, hit)
        past = length > rays.distances[i] * (f32(1) + view.past)  # the edge of what the rasteriser drew
    thread.footprint[:] = pixel_width(view, length)
    x = surface(tables, hit, d)
    wo = scale(f32(-1), d)
    if view.of_coats or (is_anisotropic(x.bsdf) and not (past or view.behind)):
        own, more, shadows = own_light(tables, x, wo, key, view, thread.scratch, _LAMP_SAMPLES)
        store_own(out.firsts[i], own, f32(1) - x.coat.shown if view.of_coats else f32(0))
        add_light(out.light, i, DIRECT, more, _WHITE)
        x, done = coat_point(x) if view.of_coats else x, Done(done.row, done.traced + shadows)
    if view.behind and not past:
        return _follow_behind(tables, view, thread, x, d, key, length, i, slot, out, done)
    blurred, near_by, followed = f32(0), f32(0), f32(0)
    count = i64(1) if past else branches(view, x, wo, key)
    for k in range(count):
        place = f32(0), d, d, no_medium(), f32(1)
        path = Path(key, u32(0), i64(SCATTERED), start, d, _WHITE, *place, near, True)
        if not past:
            path = first_path(tables, view, x, wo, key, k, length)
        if greatest(path.weight) > _MIN_WEIGHT * f32(1.0 / ROUGH_SAMPLES):
            done, end = _follow_often(tables, view, thread, path, no_medium(), i, slot, out, done)
            blurred += (end - length) / end if k < ROUGH_SAMPLES else f32(0)
            near_by, followed = near_by + end / max(end - length, _CONTACT * end), followed + f32(1)
    angle = length / pixel_width(view, length)
    instance = u32(NO_HIT) if past else hit.instance
    if past or is_smooth(x.bsdf) or transmits(x.bsdf):
        store_first(out.firsts[i], x, instance, angle * blurred * f32(1.0 / ROUGH_SAMPLES))
    else:
        unknown = f32(-1) if is_anisotropic(x.bsdf) else f32(0)  # of which many paths lead below the surface
        near_by = followed / near_by if followed > f32(0) else unknown
        store_gloss(out.firsts[i], x, instance, angle * near_by, mean_reflectance(x, wo), count)
    return done


@jit
def _follow_behind(tables, view, thread, x, d, key, length, i, slot, out, done):
    """Follow the path of ray `i` behind a blended SurfacePoint, `length` m away along d; return the Done."""
    clear = f32(1) - opacity_seen(tables, x.hit)
    store_clear(out.firsts[i], x, clear)
    if clear < _MIN_WEIGHT:
        return done
    before, within = length * view.near, clear_of_edges(tables, x.hit, d)
    start, weight = sub(hit_position(tables.surfaces, within), scale(before, d)), (clear, clear, clear)
    place = start, d, weight, f32(0), d, d, no_medium(), f32(1)
    path = Path(key, u32(0), i64(TRANSMITTED), *place, length - before, True)
    done, _ = _follow_often(tables, view, thread, path, x.hit, i, slot, out, done)
    return done


@jit
def _follow_often(tables, view, thread, path, veil, i, slot, out, done):
    """Follow a path of ray `i`, and the second one if it parts. Where it is its pixel's first to meet rough
    glass, it becomes one of ROUGH_SAMPLES, whose mean counts.

    veil  as of `_follow`
    -> the Done, and the length of the last path, m
    """
    first = done.row
    key, dimension, lane, start, d, weight, pdf, side, origin, inside, focus, length, sees_background = path
    before = light_at(out.light, i)
    share, k, count, rough = f32(1), 0, 1, False
    end, skipped = length, veil
    while k < count:
        done, met, end, parted, path = _follow(tables, view, thread, path, skipped, i, slot, out, done)
        rough, skipped = rough or met, no_medium() if parted else veil
        if parted:
            continue
        if rough and k == 0 and lane != SCATTERED and pdf == f32(0):
            share, count, lane = f32(1.0 / ROUGH_SAMPLES), ROUGH_SAMPLES, i64(SCATTERED)
            scale_since(out.light, i, before, share)
            for row in range(first, done.row):
                for c in range(3):
                    out.ends[row].end.weight[c] *= share
        k += 1
        sample, part = u32(dimension + u32(k << 8)), scale(share, weight)
        place = inside, focus, length
        path = Path(key, sample, lane, start, d, part, pdf, side, origin, *place, sees_background)
    return done, end


@jit
def _follow(tables, view, thread, path, veil, i, slot, out, done):
    """Follow one path of ray `i` to its end or ends.

    veil  Hit on the blended surface that the path starts behind, instance NO_HIT: on none. Others behind it
          end it by as much as they are opaque, as long as there is room for two ends more; then by chance
    -> the Done, whether it met rough glass or a strong lobe, its length in m, of one that a lobe began to
       where it first ends or meets a lobe, whether it parted, and if so the other path
    """
    row, traced = done.row, done.traced
    key, dimension, lane, start, d, weight, pdf, side, origin, inside, focus, length, sees_background = path
    stored, rough, parted, other = 0, False, False, path
    from_lobe, far, sharp = pdf > f32(0), f32(1e30), True
    behind = veil.instance != u32(NO_HIT)
    for event in range(EVENTS_MAX + 1):
        u1, u2, u0 = facet_numbers(key, dimension, view.pass_index, view.seed)
        traced += i64(1)
        if behind and event == 0:
            found, hit = closest_behind(tables, start, d, veil, thread.scratch)
        else:
            found, hit = closest_surface(tables, start, d, f32(0) if behind else u0, thread.scratch)
        if not found:
            if has_environment(tables.environment) and (view.shows_environment or not behind):
                share = surround_weight(tables, pdf, d)
                light = scale(share, environment_radiance(tables.environment, d))
                add_light(out.light, i, EMISSION, light, scale(focus, weight))
            elif sees_background:
                add_light(out.light, i, THROUGH, _WHITE, weight)
            length = f32(1e30)
            break
        length += distance_to(tables, start, hit)
        width = pixel_width(view, length)
        thread.footprint[:] = width
        x = surface(tables, hit, d)
        b = x.bsdf
        inside = medium(inside, x)
        if inside.instance != u32(NO_HIT):
            weight = attenuated(tables, inside, start, x.position, weight)
        shown = f32(1)
        if behind:
            shown = opacity_seen(tables, hit)
            if stored == _ENDS_MAX - 1:
                shown = f32(1) if u0 < shown else f32(0)
            behind = shown < f32(1)
        seen = scale(focus * shown, weight)
        share = lamp_weight(tables, origin, side, pdf, hit, d)
        add_light(out.light, i, EMISSION, scale(share, glow(tables, hit, d)), seen)
        unlit = x.flags & u32(MATERIAL_UNLIT) != u32(0)
        wo = scale(f32(-1), d)
        widest = view.widening * lobe_width(pdf)
        far = length if sharp else far
        sharp = sharp and (not from_lobe or (is_smooth(b) and not has_finite(b)))
        end = with_matte_sheen(x).bsdf
        has_diffuse = end.diffuse[0] + end.diffuse[1] + end.diffuse[2] > f32(0)
        ends = stored + (1 if has_diffuse else 0)
        mean = greatest(times(weight, mean_reflectance(x, wo)))
        goes_on = is_narrow(b) and not (unlit or behind) and event < EVENTS_MAX and ends < _ENDS_MAX
        goes_on = goes_on and mean >= (_MIN_WEIGHT_AFTER_END if ends > 0 else _MIN_WEIGHT)
        count = 1 if from_lobe or rough else _LAMP_SAMPLES
        count = _SAMPLES_BEHIND if view.behind and sees_background else count
        if not unlit and (has_finite(b) or not is_smooth(b)):
            lit, goes_on_by = widened(x, widest), BY_FACETS if goes_on else BY_NOTHING
            if from_lobe:
                pick, _, _, _ = random4(key, dimension + u32(_DIMENSION), view.pass_index, view.seed)
                light, shadows = light_of_few(tables, lit, wo, pick, thread.scratch, thread.values)
            else:
                light, shadows = punctual_light(tables, lit, wo, thread.scratch, f32(np.inf))
            told = goes_on_by, count, view.pass_index
            more, others = area_light_by_ratio(tables, x, wo, u0, thread.scratch, *told)
            add_light(out.light, i, DIRECT, add(light, more), seen)
            traced += shadows + others
        if has_sheen(x) or is_translucent(x):
            light, shadows = layers_light(tables, x, wo, u0, thread.scratch, count, view.pass_index)
            add_light(out.light, i, DIRECT, light, seen)
            traced += shadows
        by_coat = is_coated(x) and not unlit and event < EVENTS_MAX and ends < _ENDS_MAX
        if by_coat:
            light, more, shadows = facet_light(tables, coat_point(x), wo, u0, thread.scratch, widest, 1)
            add_light(out.light, i, DIRECT, add(light, more), seen)
            traced += shadows
        row = store_far(out.ends, row, slot, lane, seen, x, wo, width)
        if unlit or has_diffuse or (has_finite(b) and not goes_on):
            end = BLACK if unlit else end_bsdf(end, goes_on)
            store_end(out.ends[row].end, slot, lane, seen, end, hit.instance)
            store_point(out.ends[row].point, x, wo, end, width, widest if goes_on else NARROW_ALPHA)
            row, stored, lane = row + i64(1), stored + 1, i64(SCATTERED)
        if behind:
            start, weight = leave_surface(tables, hit, scale(f32(-1), x.ng)), scale(f32(1) - shown, weight)
            if greatest(weight) < _MIN_WEIGHT:
                break
            continue
        if unlit:
            break
        rough = rough or (transmits(b) and not is_smooth(b)) or (goes_on and mean >= STRONG)
        may_part = lane == TRANSMITTED and not parted
        alive, wi, factor, parts, above, kept = False, wo, wo, False, wo, wo
        drawn, passed = f32(0), False
        chance = f32(1)
        if by_coat:
            by_coat, u1, chance = draw_coat(x, wo, u1, goes_on or is_smooth(b))
        if by_coat:
            alive, wi, factor, drawn = sample_coat(x, wo, u1, u2)
        elif goes_on:
            alive, wi, factor, drawn = sample_lobe(x, wo, u1, u2)
        elif is_smooth(b) or transmits(b):
            alive, wi, factor, parts, above, kept = sample_specular_lobe(x, wo, u1, u2, may_part)
            passed = is_smooth(b) and passed_sheet(x, wi)  # as shadow rays do, so that lobes draw beyond
        drawn = pdf if passed else drawn
        factor = scale(f32(1) / chance, factor)
        branch = Branch(key, u32(dimension + u32(1)), lane, wi, times(weight, factor), drawn, sees_background)
        if parts:
            apart = u32(dimension + u32(_EVENTS_APART))
            second = Branch(key, apart, i64(SCATTERED), above, times(weight, kept), f32(0), sees_background)
            parted, other = True, leave(tables, x, inside, focus, length, second)
        left = leave(tables, x, inside, focus, length, branch)
        weight = left.weight
        least = _MIN_WEIGHT_AFTER_END if stored > 0 else _MIN_WEIGHT
        if not alive or stored == _ENDS_MAX or greatest(weight) < least:
            break
        sides = (side, origin) if passed else (left.side, left.origin)
        key, dimension, lane, start, d, weight, pdf, _, _, inside, focus, length, sees_background = left
        side, origin = sides
    return Done(row, traced), rough, far if from_lobe else length, parted, other
