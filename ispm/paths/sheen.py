"""The sheen of what pixels show: what it makes of the lights, and what it hides."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import literal_unroll

from ispm.accel.intersect import STACK_WORDS
from ispm.accel.layers import sheen_point
from ispm.accel.records import Scratch
from ispm.accel.surface import SurfaceTable
from ispm.accel.world import World
from ispm.kernels.share import shared_rows
from ispm.kernels.simd import alloca
from ispm.lights.area_parts import first_turn, numbers_of
from ispm.lights.nee import BY_NOTHING, drawn_area_light, punctual_light
from ispm.optics.jit import jit
from ispm.optics.rng import random4
from ispm.optics.vector import add, scale
from ispm.paths.denoise import denoise
from ispm.paths.eye_paths import EyeRays, RayArrays
from ispm.paths.pixel_layers import CHUNK, light_layers, shown_surface
from ispm.paths.vertices import FIRST_VERTEX
from ispm.scene.packed import Packed

f32, i64, u32 = np.float32, np.int64, np.uint32

_DIMENSION = (1 << 23) + 1  # of the random numbers
_SAMPLES = 4  # points of lamps with a surface, and directions of the environment
_ALIKE = f32(1)  # twice how far apart the ends of normals are whose pixels are not averaged
_LEAST_ALBEDO = f32(1e-6)
_REACH = 4.0  # pixels to each side over which the light of these is averaged, in the first pass
_LAST_TURN = 15  # less what is under it takes: both are not to draw from the same part


class PixelSheen(NamedTuple):
    """The sheen of n pixels, float32.

    direct  (n, 3) radiance along wo of light straight from lights without a surface, cd/m2
    areas   (n, 3) what `direct` would be of lamps with a surface and the environment if its albedo were 1:
            noisy
    albedo  (n, 3) share of light from all around that it reflects along wo
    hidden  (n,) share of what is under it that it hides
    firsts  (n,) FIRST_VERTEX of the surfaces, `blur` not set
    """

    direct: np.ndarray
    areas: np.ndarray
    albedo: np.ndarray
    hidden: np.ndarray
    firsts: np.ndarray


def sheen_light(
    packed: Packed, world: World, surfaces: SurfaceTable, rays: EyeRays, seed: int, pass_index: int
) -> PixelSheen:
    """Return the sheen of what rays show, whose hits are given; the same bytes for any number of threads."""
    count = len(rays.keys)
    direct, areas, albedo = np.zeros((3, count, 3), np.float32)
    out = PixelSheen(direct, areas, albedo, np.zeros(count, np.float32), np.zeros(count, FIRST_VERTEX))
    light_layers(_light, packed, world, surfaces, rays, seed, pass_index, out)
    return out


def filtered_light(
    sheen: PixelSheen, pixels: np.ndarray, columns: int, smoothing: float, threads: int
) -> np.ndarray:
    """Return the direct light of sheen, (n, 3) cd/m2: that of lamps and of the environment averaged over
    neighbors, in place.

    pixels     (n,) numbers y columns + x, sorted
    smoothing  factor on how far they reach
    """
    sheen.firsts["blur"] = _REACH
    denoise(sheen.areas, pixels, columns, sheen.firsts, smoothing, threads)
    return np.asarray(sheen.direct + sheen.albedo * sheen.areas)


@jit
def _light(tables, rays: RayArrays, numbers, counter, out):
    """Fill a PixelSheen for as many of RayArrays as a thread gets."""
    scratch, turn = Scratch(alloca(STACK_WORDS), alloca(2)), _LAST_TURN - first_turn(numbers)
    for i in shared_rows(counter, CHUNK, len(rays.keys)):
        x, wo, _ = shown_surface(tables, rays, numbers, i)
        layer = sheen_point(x)
        points, _ = punctual_light(tables, layer, wo, scratch, f32(np.inf))
        areas = _drawn(tables, layer, wo, numbers, rays.keys[i], turn, scratch)
        first = out.firsts[i]
        for c in literal_unroll((0, 1, 2)):
            albedo = x.sheen.color[c] * x.sheen.albedo
            out.direct[i, c], out.albedo[i, c] = points[c], albedo
            out.areas[i, c] = areas[c] / max(albedo, _LEAST_ALBEDO)
            first.n[c], first.ng[c] = x.n[c], x.ng[c]
        out.hidden[i] = f32(1) - x.sheen.shown
        first.instance, first.alpha = x.hit.instance, _ALIKE


@jit
def _drawn(tables, layer, wo, numbers, pixel, turn, scratch):
    """The mean radiance, cd/m2, that a pixel's layer sends along wo by draws of lamps with a surface and of
    the environment: from parts that are even among the pixels of a square."""
    total = f32(0), f32(0), f32(0)
    pick, _, _, _ = random4(pixel, u32(_DIMENSION), numbers.pass_index, numbers.seed)
    for k in range(_SAMPLES):
        one, two, three = numbers_of(numbers, i64(pixel), i64(k), turn)
        drawn = one, two, three, pick
        light, _ = drawn_area_light(tables, layer, wo, drawn, scratch, f32(np.inf), BY_NOTHING, True, True)
        total = add(total, scale(f32(1 / _SAMPLES), light))
    return total
