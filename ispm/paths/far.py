"""The far side of translucent sheets: the light that falls on it, and leaves on the side that is seen.

Eye paths end on both sides of a sheet. Where a pixel shows one, the near side is lit as all surfaces are. The
far side is an end of a path, too: lights without a surface are asked here, by shadow rays; all others, and
photons, light it through images of such ends.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import literal_unroll

from ispm.accel.intersect import STACK_WORDS
from ispm.accel.layers import far_side, has_sheen, is_translucent, sheen_point
from ispm.accel.records import Scratch
from ispm.accel.surface import SurfaceTable
from ispm.accel.world import World
from ispm.kernels.share import shared_rows
from ispm.kernels.simd import alloca
from ispm.lights.nee import BY_NOTHING, direct_light, punctual_light
from ispm.lights.ratio import area_light_by_ratio
from ispm.optics.bsdf import NARROW_ALPHA
from ispm.optics.jit import jit
from ispm.optics.records import MATERIAL_TRANSLUCENT, RECEIVER
from ispm.optics.vector import add
from ispm.paths.branch import REFLECTED, SCATTERED, TRANSMITTED
from ispm.paths.eye_paths import EyeRays, RayArrays
from ispm.paths.pixel_layers import CHUNK, light_layers, shown_surface
from ispm.paths.vertices import PATH_END, store_end, store_point
from ispm.scene.packed import Packed

f32, i64, u32 = np.float32, np.int64, np.uint32

FAR = 4  # added to the lane of a path that has not scattered, of its end on the far side
LANES = REFLECTED, TRANSMITTED, REFLECTED + FAR, TRANSMITTED + FAR  # of ends that neighboring pixels share

_WHITE = f32(1), f32(1), f32(1)


def sides_most(packed: Packed) -> int:
    """Return how many sides of a surface a path may end on at once."""
    return 2 if (packed.materials["flags"] & MATERIAL_TRANSLUCENT != 0).any() else 1


@jit
def layers_light(tables, x, wo, u, scratch, count, pass_index, openings):
    """Return the radiance along wo, cd/m2, of light straight from the lights to the sheen of a SurfacePoint
    and to its far side, if it is translucent, and the rays traced.

    u  random in [0, 1);  count  draws of lamps with a surface and of the environment for the far side
    openings  which guide these, see `guided_surround`
    """
    total, traced = (f32(0), f32(0), f32(0)), i64(0)
    if has_sheen(x):
        total, traced = direct_light(tables, sheen_point(x), wo, u, scratch, f32(np.inf))
    if is_translucent(x):
        far, through = far_side(x, wo)
        points, rays = punctual_light(tables, far, through, scratch, f32(np.inf))
        told = BY_NOTHING, count, pass_index, openings
        areas, others = area_light_by_ratio(tables, far, through, u, scratch, *told)
        total, traced = add(total, add(points, areas)), traced + rays + others
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
    ends    (n,) PATH_END, `by_image`;  points  (n,) RECEIVER, the same
    """

    direct: np.ndarray
    ends: np.ndarray
    points: np.ndarray


def light_far_sides(
    packed: Packed, world: World, surfaces: SurfaceTable, rays: EyeRays, seed: int, pass_index: int
) -> FarSide:
    """Return the FarSide of what rays show, whose hits are given; the same for any number of threads."""
    count = len(rays.keys)
    out = FarSide(np.zeros((count, 3), np.float32), np.zeros(count, PATH_END), np.zeros(count, RECEIVER))
    light_layers(_light, packed, world, surfaces, rays, seed, pass_index, out)
    return out


@jit
def _light(tables, rays: RayArrays, numbers, counter, out):
    """Fill a FarSide for as many of RayArrays as a thread gets."""
    scratch = Scratch(alloca(STACK_WORDS), alloca(2))
    for i in shared_rows(counter, CHUNK, len(rays.keys)):
        x, wo, width = shown_surface(tables, rays, numbers, i)
        far, through = far_side(x, wo)
        points, _ = punctual_light(tables, far, through, scratch, f32(np.inf))
        store_end(out.ends[i], i, TRANSMITTED, _WHITE, far.bsdf, x.hit.instance, True)
        store_point(out.points[i], far, through, far.bsdf, width, NARROW_ALPHA)
        for c in literal_unroll((0, 1, 2)):
            out.direct[i, c] = points[c]
