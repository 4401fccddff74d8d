"""Direct light of lights without a surface at the eye's pixels by shadow rays, where maps would take longer.

It runs on the CPU, where the trees are. The lights that bring a pixel most have a ray each, so that shadows
that show have sharp edges; of the others one is drawn, see `lights/few.py`. In the first pass what the
neighbors of a pixel see of those that they draw tells how much of the others' light it gets, a ratio of means
as in `stages/area_light.py`; what a surface reflects of them, but for its Lambert lobe, is their mean. Later
passes take what they draw as it is, so that their mean converges.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ispm.accel.intersect import STACK_WORDS
from ispm.accel.records import Scratch
from ispm.accel.surface import SurfaceTable, scene_tables
from ispm.accel.transmittance import shadow_transmittance
from ispm.accel.world import World
from ispm.kernels.share import run_shared, shared_rows
from ispm.kernels.simd import alloca
from ispm.lights.few import choose
from ispm.lights.nee import greatest, side_of, times
from ispm.optics.bsdf import eval_bsdf
from ispm.optics.jit import jit
from ispm.optics.light import FAR, light_arriving, reaches
from ispm.optics.rng import random4
from ispm.optics.vector import add, dot, scale, sub, vec3
from ispm.scene.packed import Packed
from ispm.settings import Settings
from ispm.stages.pixels import Pixels, PixelView, is_alike, is_lit, lift, plane_at, shown_at

f32, i64, u32 = np.float32, np.int64, np.uint32

_DIMENSION = 6 << 20  # of the random numbers
_SIDE = 4  # pixels of a square that draws from each part of the others once
_REACH = 2  # pixels to each side that tell what a pixel sees of the others
_CHUNK = 64  # pixels a thread takes at a time
_NONE = f32(0), f32(0), f32(0)
_DRAW_NS = 270.0  # of a processor, that a software adapter takes to draw a triangle for one light
_TRACE_NS = 900.0  # likewise, about, that the rays of a pixel take


class _Lights(NamedTuple):
    """What a thread writes of each light for a pixel, float32: the radiance along wo that it makes but for
    shadows, `brought`, (n, 3) cd/m2, where there is any, and the sum of its channels, `values`, (n,)."""

    values: np.ndarray
    brought: np.ndarray


class _Samples(NamedTuple):
    """What shadow rays found at n pixels, float32.

    sure    (n, 3) light of those lights that have rays of their own, cd/m2
    others  (n, 3) likewise of the others, but for their shadows
    weight  (n,) what the one drawn stands for, sum of channels; 0: `others` has its shadows
    passed  (n, 3) and as much of it as passes what is between
    """

    sure: np.ndarray
    others: np.ndarray
    weight: np.ndarray
    passed: np.ndarray


def takes_rays(packed: Packed, settings: Settings, software: bool) -> bool:
    """Return whether lights without a surface have rays in place of shadow maps.

    software  the adapter is a program on the CPU: where the settings leave the choice, rays are taken if it
              takes longer to draw all triangles for each light
    """
    if settings.shadows != "auto":
        return settings.shadows == "rays" and len(packed.lights) > 0
    pixels = math.prod(settings.size)
    return software and packed.triangle_count * len(packed.lights) * _DRAW_NS > pixels * _TRACE_NS


def point_light(
    pixels: Pixels, view: PixelView, packed: Packed, world: World, surfaces: SurfaceTable
) -> np.ndarray:
    """Return the direct light of lights without a surface, (n, 4) float32 cd/m2 of the n pixels; of an
    opacity of 1."""
    count = len(pixels.points)
    tables = scene_tables(packed, world, surfaces)
    sure, others, passed = np.zeros((3, count, 3), np.float32)
    samples = _Samples(sure, others, np.zeros(count, np.float32), passed)
    out = np.ones((count, 4), np.float32)

    def sample(counter: np.uint64) -> None:
        own = _Lights(np.empty(len(packed.lights), np.float32), np.empty((len(packed.lights), 3), np.float32))
        _sample_pixels(tables, pixels, view, own, counter, samples)

    run_shared(sample, world.threads)
    run_shared(lambda counter: _filter(pixels, view, samples, counter, out), world.threads)
    return out


@jit
def _sample_pixels(tables, pixels, view, own, counter, samples):
    """Trace the rays of as many of the Pixels as a thread gets, whose _Lights are its own."""
    scratch = Scratch(alloca(STACK_WORDS), alloca(2))
    for i in shared_rows(counter, _CHUNK, len(pixels.points)):
        if not is_lit(tables, pixels, i):
            continue
        shown = shown_at(tables, pixels, view, i)
        r0, _, _, _ = random4(u32(i), u32(_DIMENSION), view.pass_index, view.seed)
        shift, _, _, _ = random4(u32(0), u32(_DIMENSION + 1), view.pass_index, view.seed)
        column, row = i % view.columns % _SIDE, i // view.columns % _SIDE
        pick = (f32((row * _SIDE + column) * 7 % (_SIDE * _SIDE)) + r0) * f32(1 / (_SIDE * _SIDE)) + shift
        pick -= f32(math.floor(pick))
        _sample(tables, shown, pick, view.pass_index == u32(0), scratch, own, samples, i)


@jit
def _sample(tables, shown, pick, first, scratch, own, samples, i):
    """Write row i of the _Samples.

    pick   random in [0, 1): draws a light
    first  whether the others' shadows are left to the filter
    """
    lights, x, wo, away = tables.lights, shown.x, shown.wo, lift(shown)
    unshadowed = _NONE
    for k in range(len(lights)):
        brought = _brought(lights[k], x, wo)
        own.values[k] = _sum(brought)
        if own.values[k] > f32(0):
            unshadowed = add(unshadowed, brought)
            for c in range(3):
                own.brought[k, c] = brought[c]
    few = choose(own.values, pick)
    for row in (few.best, few.second):
        if row >= i64(0):
            brought = vec3(own.brought[row])
            unshadowed = sub(unshadowed, brought)
            passed = _passed(tables, lights[row], x, away, scratch)
            for c in range(3):
                samples.sure[i, c] += brought[c] * passed[c]
    if few.drawn < i64(0):
        return
    passed = _passed(tables, lights[few.drawn], x, away, scratch)
    light = scale(few.weight, times(passed, vec3(own.brought[few.drawn])))
    if first and few.weight > f32(1):  # of one there is no doubt which to draw
        light = max(unshadowed[0], f32(0)), max(unshadowed[1], f32(0)), max(unshadowed[2], f32(0))
        samples.weight[i] = few.weight * own.values[few.drawn]
    for c in range(3):
        samples.others[i, c] = light[c]
        samples.passed[i, c] = samples.weight[i] * passed[c]


@jit
def _brought(light, x, wo):
    """The radiance along wo that a LIGHT makes at a SurfacePoint but for shadows, cd/m2; black where the
    surface hides it itself."""
    if not reaches(light, x.position):
        return _NONE
    irradiance, _, wi = light_arriving(light, x.position)
    along, above = dot(x.n, wi), dot(x.ng, wi) > f32(0)
    lit = (above and along > f32(0)) or (x.bsdf.thin > f32(0) and not above)
    if not lit or greatest(irradiance) <= f32(0):
        return _NONE
    return scale(abs(along), times(irradiance, eval_bsdf(x.bsdf, x.n, x.ng, wo, wi)))


@jit
def _passed(tables, light, x, away, scratch):
    """The share of a LIGHT that passes what is between it and a SurfacePoint, RGB.

    away  m, that the ray starts above the surface
    """
    _, distance, wi = light_arriving(light, x.position)
    start, toward = add(x.position, scale(away, side_of(x.ng, wi))), wi
    if distance < FAR:
        segment = sub(add(x.position, scale(distance, wi)), start)
        distance = f32(math.sqrt(dot(segment, segment)))
        toward = scale(f32(1) / max(distance, f32(1e-30)), segment)
    return shadow_transmittance(tables, start, toward, distance, scratch)


@jit
def _filter(pixels, view, samples, counter, out):
    """Write the light of as many of the Pixels as a thread gets to (n, 4) float32."""
    columns, rows = view.columns, i64(len(pixels.points)) // view.columns
    for i in shared_rows(counter, _CHUNK, len(pixels.points)):
        share = f32(1), f32(1), f32(1)
        if samples.weight[i] > f32(0):
            row, column, plane = i // columns, i % columns, plane_at(pixels, view, i)
            weight, passed = f32(0), _NONE
            for y in range(max(row - _REACH, 0), min(row + _REACH, rows - 1) + 1):
                for x in range(max(column - _REACH, 0), min(column + _REACH, columns - 1) + 1):
                    k = y * columns + x
                    if samples.weight[k] > f32(0) and (k == i or is_alike(pixels, plane, i, k)):
                        # Those at the ends count half: each part that is drawn from has the same weight.
                        half = f32(0.5) if abs(y - row) == _REACH else f32(1)
                        half *= f32(0.5) if abs(x - column) == _REACH else f32(1)
                        weight += half * samples.weight[k]
                        passed = add(passed, scale(half, vec3(samples.passed[k])))
            share = scale(f32(1) / weight, passed)
        light = add(vec3(samples.sure[i]), times(share, vec3(samples.others[i])))
        for c in range(3):
            out[i, c] = light[c]


@jit
def _sum(a):
    """The sum of linear RGB's channels."""
    return a[0] + a[1] + a[2]
