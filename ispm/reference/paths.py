"""What pixels see, slowly and without bias: paths from the eye, lit by shadow rays where they scatter.

For scenes without caustics: light that mirrors or glass bring from a light to a surface is not found by such
paths where the light is a point; lamps with a surface they meet by chance.
Source: Kajiya, The Rendering Equation, SIGGRAPH 1986; next-event estimation.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ispm.accel.bands import in_band, is_dispersive
from ispm.accel.glow import glow
from ispm.accel.intersect import STACK_WORDS
from ispm.accel.layers import (
    coat_point,
    drawn_layer,
    far_side,
    has_sheen,
    is_coated,
    is_translucent,
    sheen_point,
)
from ispm.accel.medium import attenuated, medium, no_medium, passed_sheet, spawn_ray
from ispm.accel.records import Scratch
from ispm.accel.surface import Tables, closest_surface, surface
from ispm.kernels.simd import address, alloca, atomic_add
from ispm.kernels.threads import run_threads
from ispm.lights.area import lit_side
from ispm.lights.nee import BY_BSDF, direct_light, lamp_weight, surround_weight, times
from ispm.optics.bsdf_sampling import pdf_bsdf, sample_bsdf
from ispm.optics.dispersion import ALL_BANDS, BANDS, of_band
from ispm.optics.environment import has_environment, seen_radiance
from ispm.optics.jit import jit
from ispm.optics.records import MATERIAL_THIN, MATERIAL_UNLIT, NO_HIT
from ispm.optics.rng import random4
from ispm.optics.vector import Vector, add, scale, vec3

f32, i64, u32 = np.float32, np.int64, np.uint32

_EVENTS_MAX = 256
_CHUNK = 256  # rays a thread takes at a time
_BAND_DIMENSION = 1 << 16  # of the random numbers that draw bands


class _Task(NamedTuple):
    """What holds for all paths: first to last sample, the last not counted, RGB background in cd/m2, scatters
    at most, seed."""

    first: np.int64
    last: np.int64
    background: Vector
    bounces: np.int64
    seed: np.uint32


def path_light(
    tables: Tables,
    origins: np.ndarray,
    directions: np.ndarray,
    *,
    samples: range,
    bounces: int,
    background: tuple[float, float, float] = (0.0, 0.0, 0.0),
    seed: int = 0,
    threads: int = 1,
) -> np.ndarray:
    """Return the mean radiance along rays, (n, 3) float64 cd/m2; the same for any number of threads.

    tables               `scene_tables` of what the caller keeps alive; its environment is seen, also in
                         mirrors, in place of the background
    origins, directions  (n, 3), world space, unit
    samples              numbers, one after another, of the paths of each ray: others are independent
    bounces              scatters of light at most before what the eye sees, as of photons; mirrors and clear
                         glass do not count; 0: direct light only
    """
    light, counter = np.zeros((len(origins), 3)), np.zeros(8, np.int64)
    r, g, b = map(f32, background)
    task = _Task(i64(samples.start), i64(samples.stop), (r, g, b), i64(bounces), u32(seed))
    rays = np.ascontiguousarray(origins, np.float32), np.ascontiguousarray(directions, np.float32)
    run_threads(lambda _: _trace(tables, task, *rays, address(counter), light), threads)
    return light / len(samples)


@jit
def _trace(tables, task, origins, directions, counter, light):
    """Add the radiance of all paths of each ray to (n, 3) float64 `light`; threads share the int64 at the
    address `counter`."""
    scratch = Scratch(alloca(STACK_WORDS), alloca(2))
    while True:
        first = atomic_add(counter, i64(_CHUNK))
        if first >= len(light):
            return
        for i in range(first, min(first + i64(_CHUNK), len(light))):
            start, d = vec3(origins[i]), vec3(directions[i])
            for sample in range(task.first, task.last):
                found = _path(tables, task, start, d, u32(i), u32(sample), scratch)
                for c in range(3):
                    light[i, c] += np.float64(found[c])


@jit
def _path(tables, task, start, d, key, sample, scratch):
    """The radiance, cd/m2 RGB, that one path brings along d to `start`, m; key: the ray's number."""
    total, weight, inside = (f32(0), f32(0), f32(0)), (f32(1), f32(1), f32(1)), no_medium()
    scatters, pdf, start_of, band = i64(0), f32(0), (start, start), ALL_BANDS
    for event in range(_EVENTS_MAX):
        u1, u2, u3, u4 = random4(key, u32(event), sample, task.seed)
        found, hit = closest_surface(tables, start, d, u4, scratch)
        if not found:
            if has_environment(tables.environment):
                share = surround_weight(tables, pdf, d)
                behind = scale(share, seen_radiance(tables.environment, d, scatters == i64(0)))
                return add(total, times(weight, behind))
            return add(total, times(weight, task.background)) if scatters == i64(0) else total
        x = surface(tables, hit, d)
        if is_dispersive(x):
            band, weight = one_band(band, weight, key, sample, task.seed)
            x = in_band(tables, x, band)
        inside = medium(inside, x)
        if inside.instance != u32(NO_HIT):
            weight = attenuated(tables, inside, start, x.position, weight)
        unlit = x.flags & u32(MATERIAL_UNLIT) != u32(0)
        if not unlit or scatters == i64(0):  # what is unlit does not light
            share = lamp_weight(tables, start_of[0], start_of[1], pdf, hit, d)
            total = add(total, scale(share, times(weight, glow(tables, hit, d))))
        last = scatters > task.bounces
        if unlit or (last and task.bounces == i64(0) and x.flags & u32(MATERIAL_THIN) == u32(0)):
            return total
        wo = scale(f32(-1), d)
        if not last:
            lit, _ = direct_light(tables, x, wo, u4, scratch, f32(np.inf), BY_BSDF)
            total = add(total, times(weight, lit))
            if is_coated(x):
                lit, _ = direct_light(tables, coat_point(x), wo, u4, scratch, f32(np.inf), BY_BSDF)
                total = add(total, times(weight, lit))
            if has_sheen(x):
                lit, _ = direct_light(tables, sheen_point(x), wo, u4, scratch, f32(np.inf), BY_BSDF)
                total = add(total, times(weight, lit))
            if is_translucent(x):
                far, through = far_side(x, wo)
                lit, _ = direct_light(tables, far, through, u4, scratch, f32(np.inf), BY_BSDF)
                total = add(total, times(weight, lit))
        x, wo, u3, chance = drawn_layer(x, wo, u3)
        alive, wi, factor, specular = sample_bsdf(x.bsdf, x.n, x.ng, wo, u1, u2, u3, True)
        passed = specular and passed_sheet(x, wi)  # as shadow rays do: what is drawn from stays the same
        scatters += i64(not specular)
        # After the last scatter a lamp is still met by way of mirrors and glass, as photons come from there.
        if not alive or (last and not (passed or (specular and task.bounces > i64(0)))):
            return total
        weight = times(weight, scale(f32(1) / chance, factor))
        if not passed:
            pdf = f32(0) if specular else pdf_bsdf(x.bsdf, x.n, wo, wi)
            start_of = x.position, lit_side(x)
        start, inside = spawn_ray(tables, x, inside, wi)
        d = wi
    return total


@jit
def one_band(band, weight, key, sample, seed):
    """Return the band with which a path goes on from what disperses light, and its weight, RGB: of
    `ALL_BANDS` one drawn by chance; key, sample, seed: of its random numbers."""
    if band != ALL_BANDS:
        return band, weight
    u, _, _, _ = random4(key, u32(_BAND_DIMENSION), sample, seed)
    band = min(i64(u * f32(BANDS)), i64(BANDS - 1))
    return band, scale(f32(BANDS), of_band(band, weight))
