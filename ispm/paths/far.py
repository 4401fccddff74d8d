"""The far side of translucent sheets: the light that falls on it, and leaves on the side that is seen.

Eye paths end on both sides of a sheet. Where a pixel shows one, the near side is lit as all surfaces are; the
far side is lit here, by shadow rays from it, and by photons as the pixels' own surfaces are: through an image
of few points of it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import literal_unroll

from ispm.accel.intersect import STACK_WORDS
from ispm.accel.layers import far_side, has_sheen, is_translucent, sheen_point
from ispm.accel.records import Hit, Scratch
from ispm.accel.surface import SurfaceTable, scene_tables, surface
from ispm.accel.world import World
from ispm.kernels.share import run_shared, shared_rows
from ispm.kernels.simd import alloca
from ispm.lights.nee import BY_NOTHING, direct_light, punctual_light
from ispm.lights.ratio import area_light_by_ratio
from ispm.optics.bsdf import NARROW_ALPHA
from ispm.optics.jit import jit
from ispm.optics.records import MATERIAL_TRANSLUCENT, RECEIVER
from ispm.optics.rng import random4
from ispm.optics.vector import add, scale, vec3
from ispm.paths.branch import REFLECTED, SCATTERED, TRANSMITTED
from ispm.paths.eye_paths import EyeRays, RayArrays, ray_arrays
from ispm.paths.vertices import FIRST_VERTEX, PATH_END, store_end, store_point
from ispm.scene.packed import Packed

f32, i64, u32 = np.float32, np.int64, np.uint32

FAR = 4  # added to the lane of a path that has not scattered, of its end on the far side
LANES = REFLECTED, TRANSMITTED, REFLECTED + FAR, TRANSMITTED + FAR  # of ends that neighboring pixels share

_DIMENSION = (1 << 23) + 2  # of the random numbers
_SAMPLES = 4  # points of lamps with a surface, and directions of the environment
_ALIKE = f32(1)  # as in `paths.sheen`
_LEAST_ALBEDO = f32(1e-6)
_WHITE = f32(1), f32(1), f32(1)
_CHUNK = 64  # pixels a thread takes at a time; results do not depend on it or on the threads


def sides_most(packed: Packed) -> int:
    """Return how many sides of a surface a path may end on at once."""
    return 2 if (packed.materials["flags"] & MATERIAL_TRANSLUCENT != 0).any() else 1


@jit
def far_light(tables, x, wo, u, scratch, count, pass_index):
    """Return the radiance along wo, cd/m2, of light straight from the lights to the far side of a translucent
    SurfacePoint, that of `count` draws of lamps with a surface and of the environment apart, and the rays.

    u  random in [0, 1)
    """
    far, through = far_side(x, wo)
    points, rays = punctual_light(tables, far, through, scratch, f32(np.inf))
    areas, others = area_light_by_ratio(tables, far, through, u, scratch, BY_NOTHING, count, pass_index)
    return points, areas, rays + others


@jit
def layers_light(tables, x, wo, u, scratch, count, pass_index):
    """Return the radiance along wo, cd/m2, of light straight from the lights to the sheen of a SurfacePoint
    and to its far side, if it is translucent, and the rays traced; arguments as of `far_light`."""
    total, traced = (f32(0), f32(0), f32(0)), i64(0)
    if has_sheen(x):
        total, traced = direct_light(tables, sheen_point(x), wo, u, scratch, f32(np.inf))
    if is_translucent(x):
        points, areas, rays = far_light(tables, x, wo, u, scratch, count, pass_index)
        total, traced = add(total, add(points, areas)), traced + rays
    return total, traced


@jit
def store_far(ends, row, slot, lane, weight, x, wo, width):
    """Write to a row the PATH_END_AND_POINT on the far side of a SurfacePoint that is seen along wo, if it is
    translucent; return the next row. Others as of `store_end` and `store_point`, lane: of the near side."""
    if not is_translucent(x):
        return row
    far, through = far_side(x, wo)
    lane = lane if lane == i64(SCATTERED) else lane + i64(FAR)
    store_end(ends[row].end, slot, lane, weight, far.bsdf, x.hit.instance)
    store_point(ends[row].point, far, through, far.bsdf, width, NARROW_ALPHA)
    return row + i64(1)


class FarSide(NamedTuple):
    """The far side of the sheets that n pixels show.

    direct  (n, 3) float32 cd/m2 along wo, of light straight from lights without a surface
    areas   (n, 3) likewise of other lights, over the albedo: noisy
    albedo  (n, 3) float32
    firsts  (n,) FIRST_VERTEX of the surfaces, `blur` not set
    ends    (n,) PATH_END;  points  (n,) RECEIVER, the same
    """

    direct: np.ndarray
    areas: np.ndarray
    albedo: np.ndarray
    firsts: np.ndarray
    ends: np.ndarray
    points: np.ndarray


def light_far_sides(
    packed: Packed, world: World, surfaces: SurfaceTable, rays: EyeRays, seed: int, pass_index: int
) -> FarSide:
    """Return the FarSide of what rays show, whose hits are given; the same bytes for any number of threads.

    surfaces  its footprint is not used: textures are averaged over a pixel's width
    """
    assert rays.hits is not None
    count = len(rays.keys)
    direct, areas, albedo = np.zeros((3, count, 3), np.float32)
    records = np.zeros(count, FIRST_VERTEX), np.zeros(count, PATH_END), np.zeros(count, RECEIVER)
    out = FarSide(direct, areas, albedo, *records)
    tables, arrays = scene_tables(packed, world, surfaces), ray_arrays(rays)
    width, spread = (f32(each) for each in rays.width)

    def work(counter: np.uint64) -> None:
        own, footprint = surfaces.own_footprint()
        numbers = _Numbers(width, spread, footprint, u32(pass_index), u32(seed))
        _light(tables._replace(surfaces=own), arrays, numbers, counter, out)

    run_shared(work, world.threads)
    return out


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
    """Fill a FarSide for as many of RayArrays as a thread gets."""
    scratch = Scratch(alloca(STACK_WORDS), alloca(2))
    for i in shared_rows(counter, _CHUNK, len(rays.keys)):
        shown, d = rays.hits[i], vec3(rays.directions[i])
        width = numbers.width + numbers.spread * rays.distances[i]
        numbers.footprint[:] = width
        x, wo = surface(tables, Hit(shown.instance, shown.primitive, shown.u, shown.v), d), scale(f32(-1), d)
        u, _, _, _ = random4(rays.keys[i], u32(_DIMENSION), numbers.pass_index, numbers.seed)
        points, areas, _ = far_light(tables, x, wo, u, scratch, _SAMPLES, numbers.pass_index)
        far, through = far_side(x, wo)
        store_end(out.ends[i], i, TRANSMITTED, _WHITE, far.bsdf, shown.instance)
        store_point(out.points[i], far, through, far.bsdf, width, NARROW_ALPHA)
        first = out.firsts[i]
        for c in literal_unroll((0, 1, 2)):
            out.direct[i, c], out.albedo[i, c] = points[c], x.translucence[c]
            out.areas[i, c] = areas[c] / max(x.translucence[c], _LEAST_ALBEDO)
            first.n[c], first.ng[c] = x.n[c], x.ng[c]
        first.instance, first.alpha = shown.instance, _ALIKE
