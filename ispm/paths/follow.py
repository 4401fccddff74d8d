"""One eye path, from where it starts to the surfaces that photons may light, and the light that it brings."""

from __future__ import annotations

import numpy as np

from ispm.accel.bands import in_band, is_dispersive
from ispm.accel.emitter_tree import NO_LOBE
from ispm.accel.glow import glow
from ispm.accel.layers import (
    coat_point,
    end_bsdf,
    facet_point,
    has_sheen,
    is_coated,
    is_translucent,
    with_matte_sheen,
)
from ispm.accel.medium import attenuated, medium, passed_sheet
from ispm.accel.mesh import curvature
from ispm.accel.surface import closest_behind, closest_surface, leave_surface, opacity_seen, surface
from ispm.lights.few import light_of_few
from ispm.lights.nee import (
    BY_FACETS,
    BY_GLASS,
    BY_NOTHING,
    glass_pdf,
    greatest,
    lamp_weight,
    punctual_light,
    surround_weight,
    times,
)
from ispm.lights.ratio import area_light_by_ratio
from ispm.optics.bsdf import NARROW_ALPHA, has_finite, is_narrow, is_smooth, transmits
from ispm.optics.dispersion import ALL_BANDS
from ispm.optics.environment import has_environment, seen_radiance
from ispm.optics.jit import jit
from ispm.optics.records import MATERIAL_UNLIT, NO_HIT
from ispm.optics.rng import random4
from ispm.optics.vector import add, dot, scale
from ispm.paths.branch import (
    PARTINGS,
    SCATTERED,
    STRONG,
    TRANSMITTED,
    Branch,
    distance_to,
    leave,
    part,
    pixel_width,
    with_left_over,
)
from ispm.paths.coat import draw_coat, facet_light, sample_coat
from ispm.paths.eye_paths import Done, Images, Reach
from ispm.paths.facet import (
    as_wide,
    facet_numbers,
    lobe_blur,
    mean_reflectance,
    sample_lobe,
    sample_specular_lobe,
    widened,
)
from ispm.paths.far import layers_light, store_far
from ispm.paths.vertices import BLACK, DIRECT, EMISSION, THROUGH, add_light, store_end, store_point

f32, i64, u32 = np.float32, np.int64, np.uint32

EVENTS_MAX = 128  # mirrors and faces of glass that a path meets: light turns often within a cone
ENDS_MAX = 2  # of one path: behind a varnished floor goes on what it mirrors
MIN_WEIGHT = f32(1e-3)  # weight below which a path goes on by chance
_MIN_WEIGHT_AFTER_END = f32(0.02)  # and below which from an end
_PARTS = f32(0.03)  # weight of both branches from which a path parts at smooth glass
_LEFT_OVER = f32(0.08)  # weight of what paths leave at other faces, up to which it counts as seen nearby
_SOME = f32(1e-6)  # of what a face meets: less is rounding
_EVENTS_APART = 32  # numbers of the events of two paths that part
_DIMENSION = 7 << 20  # of the random numbers that draw lights
_PICKS = 13 << 20  # of those that draw one of two branches at glass, and whether a path goes on
_SAMPLES_BEHIND = (
    16  # points of lamps behind what is blended: as many as what stands beside it has by its filter
)
_WHITE = f32(1), f32(1), f32(1)


@jit
def follow(tables, view, thread, path, veil, waiting, i, slot, out, done):
    """Follow one path of ray `i` to its end or ends, or to what disperses it.

    veil  Hit on the blended surface that the path starts behind, instance NO_HIT: on none. Others behind it
          end it by as much as they are opaque, as long as there is room for two ends more; then by chance
    waiting  Waiting, to which it adds paths that part from it
    -> the Done, whether it met rough glass or a strong lobe, its Reach, the Waiting, and whether it had all
       bands as it met what disperses them, where it ends
    """
    row, traced = done.row, done.traced
    key, dimension, lane, start, d, weight, pdf, blur = path[:8]
    side, origin, lobe, inside, focus, length, sees, band, clear = path[8:]
    stored, rough, disperses = 0, False, False
    from_lobe, sharp = pdf > f32(0), True
    near, far, met, images = f32(1e30), f32(1e30), u32(NO_HIT), Images(f32(0), f32(0), f32(0))
    behind, left_over = veil.instance != u32(NO_HIT), f32(0)
    side_by_side = view.by_image and (lane != SCATTERED or lobe.square > f32(0))
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
                light = scale(share, seen_radiance(tables.environment, d, clear))
                add_light(out.light, i, EMISSION, light, scale(focus, weight))
            elif sees:
                add_light(out.light, i, THROUGH, _WHITE, weight)
            length = f32(1e30)
            far = _image_distance(images, length) if sharp else far
            break
        length += distance_to(tables, start, hit)
        width = pixel_width(view, length)
        thread.footprint[:] = width
        x = surface(tables, hit, d)
        if is_dispersive(x):
            if band == ALL_BANDS:
                disperses = True
                break
            x = in_band(tables, x, band)
        b = x.bsdf
        inside = medium(inside, x)
        if inside.instance != u32(NO_HIT):
            weight = attenuated(tables, inside, start, x.position, weight)
        shown = f32(1)
        if behind:
            shown = opacity_seen(tables, hit)
            if stored == ENDS_MAX - 1:
                shown = f32(1) if u0 < shown else f32(0)
            behind = shown < f32(1)
        seen = scale(focus * shown, weight)
        share = lamp_weight(tables, origin, side, pdf, hit, d, lobe)
        add_light(out.light, i, EMISSION, scale(share, glow(tables, hit, d)), seen)
        unlit = x.flags & u32(MATERIAL_UNLIT) != u32(0)
        wo = scale(f32(-1), d)
        widest = view.widening * blur
        far = _image_distance(images, length) if sharp else far
        if event == 0:
            near, met = length, hit.instance
        end = with_matte_sheen(x).bsdf
        has_diffuse = end.diffuse[0] + end.diffuse[1] + end.diffuse[2] > f32(0)
        ends = stored + (1 if has_diffuse else 0)
        mean = greatest(times(weight, mean_reflectance(x, wo)))
        goes_on = is_narrow(b) and not (unlit or behind) and event < EVENTS_MAX and ends < ENDS_MAX
        goes_on = goes_on and mean >= (_MIN_WEIGHT_AFTER_END if ends > 0 else MIN_WEIGHT)
        by_glass = transmits(b) and not is_smooth(b) and event < EVENTS_MAX
        only_mirrors = (goes_on and not has_diffuse) or (is_smooth(b) and not has_finite(b))
        sharp = sharp and (not from_lobe or only_mirrors)
        if from_lobe and sharp:
            images = Images(far, length, max(images.curvature, curvature(tables.surfaces, hit, x.n)))
        count = i64(1) if from_lobe or rough else view.draws
        count = i64(_SAMPLES_BEHIND) if view.behind and sees else count
        by_image = side_by_side and not rough and stored == 0 and has_diffuse and not (unlit or transmits(b))
        by_image = by_image and not (has_sheen(x) or is_translucent(x))
        if not unlit and (has_finite(b) or not is_smooth(b)):
            lit, goes_on_by = widened(x, wo, widest), BY_FACETS if goes_on else BY_NOTHING
            goes_on_by = BY_GLASS if by_glass else goes_on_by
            if from_lobe:
                pick, _, _, _ = random4(key, dimension + u32(_DIMENSION), view.pass_index, view.seed)
                light, shadows = light_of_few(tables, lit, wo, pick, thread.scratch, thread.values)
            else:
                light, shadows = punctual_light(tables, lit, wo, thread.scratch, f32(np.inf))
            add_light(out.light, i, DIRECT, light, seen)
            traced += shadows
            drawn_for = facet_point(x) if by_image else x
            if not by_image or not is_smooth(b):
                told = goes_on_by, count, view.pass_index, view.openings
                light, shadows = area_light_by_ratio(tables, drawn_for, wo, u0, thread.scratch, *told)
                add_light(out.light, i, DIRECT, light, seen)
                traced += shadows
        if has_sheen(x) or is_translucent(x):
            light, shadows = layers_light(
                tables, x, wo, u0, thread.scratch, count, view.pass_index, view.openings
            )
            add_light(out.light, i, DIRECT, light, seen)
            traced += shadows
        by_coat = is_coated(x) and not unlit and event < EVENTS_MAX and ends < ENDS_MAX
        if by_coat:
            light, more, shadows = facet_light(tables, coat_point(x), wo, u0, thread.scratch, widest, 1)
            add_light(out.light, i, DIRECT, add(light, more), seen)
            traced += shadows
        row = store_far(out.ends, row, slot, lane, seen, x, wo, width)
        pick, survives, ends_here, _ = random4(key, dimension + u32(_PICKS), view.pass_index, view.seed)
        is_end = unlit or has_diffuse or (has_finite(b) and not goes_on)
        if is_end and transmits(b) and stored == ENDS_MAX - 1 and not unlit:
            chance = _end_share(end)  # no room for an end and what is behind it
            is_end = ends_here < chance
            kept = f32(1) / (chance if is_end else f32(1) - chance)
            seen, weight = scale(kept, seen), scale(kept, weight)
        if is_end:
            least = widest if goes_on else NARROW_ALPHA
            end = BLACK if unlit else as_wide(end_bsdf(end, goes_on), dot(x.n, wo), least)
            store_end(out.ends[row].end, slot, lane, seen, end, hit.instance, by_image)
            store_point(out.ends[row].point, x, wo, end, width, least)
            row, stored, lane = row + i64(1), stored + 1, i64(SCATTERED)
        if behind:
            start, weight = leave_surface(tables, hit, scale(f32(-1), x.ng)), scale(f32(1) - shown, weight)
            if greatest(weight) < MIN_WEIGHT:
                break
            continue
        if unlit:
            break
        rough = rough or (transmits(b) and not is_smooth(b)) or (goes_on and mean >= STRONG)
        alive, wi, factor, parts, above, kept = False, wo, wo, False, wo, wo
        drawn, left_by, passed = f32(0), b, False
        chance = f32(1)
        if by_coat:
            by_coat, u1, chance = draw_coat(x, wo, u1, goes_on or is_smooth(b))
        if by_coat:
            alive, wi, factor, drawn = sample_coat(x, wo, u1, u2)
            left_by = coat_point(x).bsdf
        elif goes_on:
            alive, wi, factor, drawn = sample_lobe(x, wo, u1, u2)
        elif is_smooth(b) or transmits(b):
            may_part = waiting.may_part
            parted = lane == SCATTERED and waiting.room == i64(0)
            if view.pass_index == u32(0) and is_smooth(b) and may_part and not parted:
                pick = f32(-1) if left_over < _LEFT_OVER else pick  # for less noise
            parts = may_part and waiting.room > i64(0) and stored < ENDS_MAX
            parts = parts and not (from_lobe or rough)
            least = _least_part(x, weight, lane, waiting) if parts else f32(1e30)
            drawn_lobe = sample_specular_lobe(x, wo, u1, u2, least, pick)
            alive, wi, factor, parts, above, kept = drawn_lobe
            if not parts and greatest(kept) > f32(0):
                lost = times(weight, kept)
                left_over += greatest(lost)
                if waiting.size > i64(0):
                    waiting = with_left_over(waiting, lost)
                else:
                    factor = add(factor, kept)
            drawn = glass_pdf(b, x.n, wo, wi) if by_glass else f32(0)
            passed = is_smooth(b) and passed_sheet(x, wi)  # as shadow rays do, so that lobes draw beyond
        clear = clear and drawn == f32(0)
        if passed:
            drawn = pdf
        else:
            blur = lobe_blur(left_by, drawn)
        factor, rest = scale(f32(1) / chance, factor), (sees, band, clear)
        kept_lobe = lobe if passed else NO_LOBE
        onward, number = times(weight, factor), u32(dimension + u32(1))
        branch = Branch(key, number, lane, wi, onward, drawn, blur, kept_lobe, *rest)
        if parts:
            apart = u32(dimension + u32(_EVENTS_APART))
            mirrored = times(weight, kept), f32(0), f32(0), NO_LOBE
            second = Branch(key, apart, i64(SCATTERED), above, *mirrored, *rest)
            waiting = part(waiting, leave(tables, x, inside, focus, length, second))
        left = leave(tables, x, inside, focus, length, branch)
        weight = left.weight
        least, strongest = _MIN_WEIGHT_AFTER_END if stored > 0 else MIN_WEIGHT, greatest(weight)
        if not alive or stored == ENDS_MAX or strongest <= survives * least:
            break
        weight = scale(max(least / strongest, f32(1)), weight)
        sides = (side, origin) if passed else (left.side, left.origin)
        key, dimension, lane, start, d, _, pdf, blur, _, _, lobe, inside, focus, length, sees, _, _ = left
        side, origin = sides
    return Done(row, traced), rough, Reach(near, far if from_lobe else length, met), waiting, disperses


@jit
def _image_distance(images, length):
    """Return how far, float32 m from the eye, what a path meets after `length` m is shown by Images."""
    beyond = length - images.length
    return images.distance + beyond / (f32(1) + f32(2) * images.curvature * beyond)


@jit
def _least_part(x, weight, lane, waiting):
    """The reflectance and transmittance, float32, from which a path of this weight parts at smooth glass;
    any where it leaves the first solid that it went through."""
    if lane == TRANSMITTED and waiting.room == i64(PARTINGS) and not x.entering:
        return _SOME
    return _PARTS / greatest(weight)


@jit
def _end_share(b):
    """The chance, float32, that a path ends on a Bsdf's Lambert lobe rather than goes on by its facets."""
    matte, others = greatest(b.diffuse), greatest(b.tint) + max(greatest(b.f0), b.dielectric_f0)
    return matte / (matte + others)
