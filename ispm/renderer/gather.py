"""The final gather: light at the receivers by rays, and by those photons that rays do not find."""

from __future__ import annotations

import math

import numpy as np

from ispm.estimators import Estimator
from ispm.renderer.caustics import PhotonParts
from ispm.scene.packed import Packed
from ispm.settings import Settings
from ispm.stages.camera import CameraView
from ispm.stages.filter import filter_estimate
from ispm.tracer.density import measure_radii
from ispm.tracer.ends import reflect_light
from ispm.tracer.gather import gather_rays
from ispm.tracer.grid import PhotonGrid
from ispm.tracer.surface import SurfaceTable
from ispm.tracer.world import World

_BRIGHT = 8.0  # times the mean, from where light goes by photons
_CLEAR = 2e-5  # of the distance to the eye, by which rays start above the surface: that far depth may err
_BATCH = 1 << 17  # rays whose ends lie in memory at once


def bright_limit(packed: Packed, settings: Settings) -> float:
    """Return the limit of bright spots, lx: so many times what the lights bring to the scene's bounds."""
    if not settings.gather_rays:
        return math.inf
    power = packed.lights["intensity"].max(axis=1) @ np.array([map.measure for map in packed.maps])
    x, y, z = packed.bounds[1] - packed.bounds[0]
    return _BRIGHT * float(power) / max(2.0 * (x * y + y * z + z * x), 1e-30)


def gather_light(
    packed: Packed,
    world: World,
    surfaces: SurfaceTable,
    points: np.ndarray,
    parts: PhotonParts,
    estimate: np.ndarray,
    estimator: Estimator,
    view: CameraView,
    size: tuple[int, int],
    settings: Settings,
    pass_index: int,
    threads: int,
) -> np.ndarray:
    """Return the filtered light at receivers, (n, 16): gloss as photons have it, the rest gathered.

    points    (n,) RECEIVER, row by row, of `size`
    estimate  (n, 16) of all smooth photons, whose kernels are measured
    """
    light = estimate.copy()
    rays = settings.gather_rays
    away = points["position"] - view.eye
    clear = (_CLEAR * np.linalg.norm(away, axis=1)).astype(np.float32)
    keys = np.arange(len(points), dtype=np.uint32)
    found = parts.scattered(settings.bounces)
    grid = PhotonGrid(found)
    limit = bright_limit(packed, settings)
    batch = max(_BATCH // rays, 1)
    for first in range(0, len(points), batch):
        part = slice(first, first + batch)
        gathered = gather_rays(
            packed, world, surfaces, points[part], (keys[part], clear[part]), math.isqrt(rays), limit,
            settings.seed, pass_index, threads,
        )  # fmt: skip
        radiance = reflect_light(gathered.ends, grid.estimate(gathered.points, threads), len(gathered.ends))
        radiance += gathered.radiance
        light[part, 0:3] = math.pi * radiance.reshape(-1, rays, 3).mean(axis=1)
        radiance *= gathered.fresnel[:, None]
        light[part, 4:7] = math.pi * radiance.reshape(-1, rays, 3).mean(axis=1)
    straight = parts.smooth[parts.straight]
    if len(straight):
        pixel = settings.subsampling * view.footprint * view.clip_from_world[3]
        measure_radii(
            straight, packed.diagonal, settings.smoothing, pixel, packed.widths, view.eye_or_direction
        )
        seen = estimator(points, straight, view.clip_from_world, size)
        light[:, 0:3] += seen[:, 0:3]
        light[:, 4:7] += seen[:, 4:7]
    return filter_estimate(points, light, size, packed.diagonal, settings.smoothing, threads)
