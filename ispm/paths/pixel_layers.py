"""What the layers of surfaces that pixels show have in common: sheen, and the far sides of sheets.

Both are lit on the CPU, by a shadow ray to each light without a surface.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ispm.accel.records import Hit
from ispm.accel.surface import SurfaceTable, scene_tables, surface
from ispm.accel.world import World
from ispm.kernels.share import run_shared
from ispm.optics.jit import jit
from ispm.optics.vector import scale, vec3
from ispm.paths.eye_paths import EyeRays, ray_arrays
from ispm.scene.packed import Packed

f32, i64, u32 = np.float32, np.int64, np.uint32

CHUNK = 64  # pixels a thread takes at a time; results do not depend on it or on the threads


class Numbers(NamedTuple):
    """A pixel's width at the eye, m, and more for each m; the (1,) float32 that is a thread's footprint;
    pixels in a row; and which random numbers are taken."""

    width: np.float32
    spread: np.float32
    footprint: np.ndarray
    columns: np.int64
    pass_index: np.uint32
    seed: np.uint32


def light_layers(
    kernel: Callable[..., None],
    packed: Packed,
    world: World,
    surfaces: SurfaceTable,
    rays: EyeRays,
    seed: int,
    pass_index: int,
    out: Any,
) -> None:
    """Have threads call a kernel for what rays show, whose hits are given, to fill `out`.

    kernel    of Tables, RayArrays, Numbers, the threads' counter and `out`
    surfaces  its footprint is not used: textures are averaged over a pixel's width
    """
    assert rays.hits is not None
    tables, arrays = scene_tables(packed, world, surfaces), ray_arrays(rays)
    width, spread = (f32(each) for each in rays.width)

    def work(counter: np.uint64) -> None:
        own, footprint = surfaces.own_footprint()
        numbers = Numbers(width, spread, footprint, i64(rays.columns), u32(pass_index), u32(seed))
        kernel(tables._replace(surfaces=own), arrays, numbers, counter, out)

    run_shared(work, world.threads)


@jit
def shown_surface(tables, rays, numbers, i):
    """Return what row i of RayArrays shows: a SurfacePoint, wo, and a pixel's width there, m."""
    shown, d = rays.hits[i], vec3(rays.directions[i])
    width = numbers.width + numbers.spread * rays.distances[i]
    numbers.footprint[:] = width
    hit = Hit(shown.instance, shown.primitive, shown.u, shown.v)
    return surface(tables, hit, d), scale(f32(-1), d), width
