"""The sheen of what pixels show: what it makes of the lights, and what it hides."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import literal_unroll

from ispm.accel.intersect import STACK_WORDS
from ispm.accel.layers import sheen_point
from ispm.accel.records import Hit, Scratch
from ispm.accel.surface import SurfaceTable, scene_tables, surface
from ispm.accel.world import World
from ispm.kernels.share import run_shared, shared_rows
from ispm.kernels.simd import alloca
from ispm.lights.nee import BY_NOTHING, area_light, punctual_light
from ispm.optics.jit import jit
from ispm.optics.rng import random4
from ispm.optics.vector import scale, vec3
from ispm.paths.ends import denoise_rough_transmission
from ispm.paths.eye_paths import EyeRays, RayArrays, ray_arrays
from ispm.paths.far import FarSide
from ispm.paths.vertices import FIRST_VERTEX
from ispm.scene.packed import Packed

f32, u32 = np.float32, np.uint32

_DIMENSION = (1 << 23) + 1  # of the random numbers
_SAMPLES = 4  # points of lamps with a surface, and directions of the environment
_REACH = 4.0  # pixels to each side over which their light is averaged, in the first pass
_ALIKE = f32(1)  # twice how far apart the ends of normals are whose pixels are not averaged
_LEAST_ALBEDO = f32(1e-6)
_CHUNK = 64  # pixels a thread takes at a time; results do not depend on it or on the threads


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
    """Return the sheen of what rays show, whose hits are given; the same bytes for any number of threads.

    surfaces  its footprint is not used: textures are averaged over a pixel's width
    """
    assert rays.hits is not None
    count = len(rays.keys)
    direct, areas, albedo = np.zeros((3, count, 3), np.float32)
    out = PixelSheen(direct, areas, albedo, np.zeros(count, np.float32), np.zeros(count, FIRST_VERTEX))
    tables, arrays = scene_tables(packed, world, surfaces), ray_arrays(rays)
    width, spread = (f32(each) for each in rays.width)

    def work(counter: np.uint64) -> None:
        own, footprint = surfaces.own_footprint()
        numbers = _Numbers(width, spread, footprint, u32(pass_index), u32(seed))
        _light(tables._replace(surfaces=own), arrays, numbers, counter, out)

    run_shared(work, world.threads)
    return out


def filtered_light(
    sheen: PixelSheen | FarSide, pixels: np.ndarray, columns: int, smoothing: float, threads: int
) -> np.ndarray:
    """Return the direct light of sheen, or of far sides, (n, 3) cd/m2: that of lamps and of the environment
    averaged over neighbors.

    pixels     (n,) numbers y columns + x, sorted
    smoothing  factor on how far they reach
    """
    sheen.firsts["blur"] = _REACH * smoothing
    denoise_rough_transmission(sheen.areas, pixels, columns, sheen.firsts, threads)
    return np.asarray(sheen.direct + sheen.albedo * sheen.areas)


class _Numbers(NamedTuple):
    """A pixel's width at the eye, m, and more for each m; the (1,) float32 that is a thread's footprint; and
    which random numbers are taken."""

    width: np.float32
    spread: np.float32
    footprint: np.ndarray
    pass_index: np.uint32
    seed: np.uint32


@jit
def _light(tables, rays: RayArrays, numbers, counter, out):
    """Fill a PixelSheen for as many of RayArrays as a thread gets."""
    scratch = Scratch(alloca(STACK_WORDS), alloca(2))
    for i in shared_rows(counter, _CHUNK, len(rays.keys)):
        shown, d = rays.hits[i], vec3(rays.directions[i])
        numbers.footprint[:] = numbers.width + numbers.spread * rays.distances[i]
        x = surface(tables, Hit(shown.instance, shown.primitive, shown.u, shown.v), d)
        wo, layer = scale(f32(-1), d), sheen_point(x)
        u, _, _, _ = random4(rays.keys[i], u32(_DIMENSION), numbers.pass_index, numbers.seed)
        points, _ = punctual_light(tables, layer, wo, scratch, f32(np.inf))
        areas, _ = area_light(tables, layer, wo, u, scratch, f32(np.inf), BY_NOTHING, _SAMPLES)
        first = out.firsts[i]
        for c in literal_unroll((0, 1, 2)):
            albedo = x.sheen.color[c] * x.sheen.albedo
            out.direct[i, c], out.albedo[i, c] = points[c], albedo
            out.areas[i, c] = areas[c] / max(albedo, _LEAST_ALBEDO)
            first.n[c], first.ng[c] = x.n[c], x.ng[c]
        out.hidden[i] = f32(1) - x.sheen.shown
        first.instance, first.alpha = shown.instance, _ALIKE
