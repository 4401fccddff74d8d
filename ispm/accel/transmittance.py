"""How much light passes what lies on a shadow ray: holes, blended surfaces, thin sheets."""

from __future__ import annotations

import math

import numpy as np

from ispm.accel.edges import is_on_edge, is_same_surface
from ispm.accel.intersect import HIT_INSTANCE, HIT_PRIMITIVE, any_hit, closest_after, read_hit
from ispm.accel.records import Hit, Ray
from ispm.accel.shaft import is_stopped
from ispm.accel.surface import LAYERS_MAX, material_flags, opacity, surface
from ispm.kernels.simd import stu
from ispm.optics.bsdf import smooth_split, transmits
from ispm.optics.jit import jit
from ispm.optics.records import MATERIAL_THIN, NO_HIT
from ispm.optics.vector import dot, scale, sub

f32, u32 = np.float32, np.uint32

BEFORE = f32(1e-4)  # of the distance that a shadow ray ends before a light, which may hang on a wall


@jit
def shadow_transmittance(tables, start, d, distance, scratch):
    """Return the share of light, RGB, that comes to `start` from a light that is `distance` m away along d.

    scratch  a Scratch
    Masked surfaces let light through their holes, blended ones the share that they do not cover, thin smooth
    sheets their transmittance; all else blocks. It is their product, without chance.
    """
    ray = Ray(start, d, distance * (f32(1) - BEFORE))
    return let_through(tables, ray, any_hit(tables.trees, ray, scratch.stack), scratch)


@jit
def ray_between(start, end):
    """Return the direction, unit, and the length, m, of a shadow ray from one point to another."""
    segment = sub(end, start)
    distance = f32(math.sqrt(dot(segment, segment)))
    return scale(f32(1) / max(distance, f32(1e-30)), segment), distance


@jit
def listed_transmittance(tables, start, d, distance, refs, count, scratch):
    """Return likewise the share that comes from a light by which `list_met` has listed `count` subtrees."""
    ray = Ray(start, d, distance * (f32(1) - BEFORE))
    stopped = is_stopped(tables.trees, ray, refs, count, scratch.stack)
    return let_through(tables, ray, stopped, scratch)


@jit
def let_through(tables, ray, stopped, scratch):
    """Return the share of light, RGB, that passes what lies on a Ray; stopped: whether anything does."""
    if not stopped:
        return f32(1), f32(1), f32(1)
    if not tables.porous:
        return f32(0), f32(0), f32(0)
    return _through_layers(tables, ray, scratch)


@jit
def _through_layers(tables, ray, scratch):
    """The product of what all surfaces on a Ray let through, RGB."""
    share, t = (f32(1), f32(1), f32(1)), f32(0)
    last = Hit(u32(NO_HIT), u32(0), f32(0), f32(0))
    stu(scratch.found, HIT_INSTANCE, u32(NO_HIT))
    stu(scratch.found, HIT_PRIMITIVE, u32(NO_HIT))
    for _ in range(LAYERS_MAX):
        t = closest_after(tables.trees, ray, t, scratch)
        if t >= ray.t_max:
            return share
        hit = read_hit(scratch.found)
        joins = hit.instance == last.instance and is_on_edge(hit)
        if joins and is_same_surface(tables, ray.direction, last, hit):
            continue
        last = hit
        passed = passed_straight(tables, hit, ray.direction)
        share = share[0] * passed[0], share[1] * passed[1], share[2] * passed[2]
        if max(share[0], max(share[1], share[2])) <= f32(0):
            return share
    return f32(0), f32(0), f32(0)


@jit
def passed_straight(tables, hit, d):
    """Return the share of light, RGB, that the surface at a Hit of a ray along d, unit, lets straight on."""
    covered = min(max(opacity(tables, hit), f32(0)), f32(1))
    open_share = f32(1) - covered
    share = open_share, open_share, open_share
    if covered <= f32(0) or material_flags(tables.surfaces, hit) & u32(MATERIAL_THIN) == u32(0):
        return share
    x = surface(tables, hit, d)
    if x.bsdf.alpha > f32(0) or not transmits(x.bsdf):
        return share
    _, sheet, _, _, _ = smooth_split(x.bsdf, x.n, x.ng, scale(f32(-1), d))
    return share[0] + covered * sheet[0], share[1] + covered * sheet[1], share[2] + covered * sheet[2]
