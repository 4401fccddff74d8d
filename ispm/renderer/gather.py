"""The final gather: light at the receivers by rays, and by those photons that rays do not find.

Which light goes which way: `tracer/gather.py`.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from ispm.optics.rng import random4
from ispm.renderer.caustics import PhotonParts, sample_width
from ispm.scene.packed import Packed
from ispm.settings import Settings
from ispm.stages.camera import CameraView
from ispm.stages.filter import filter_estimate, set_reach
from ispm.tracer.density import measure_radii
from ispm.tracer.ends import reflect_light
from ispm.tracer.gather import gather_rays
from ispm.tracer.grid import PhotonGrid
from ispm.tracer.hint import hint_radii
from ispm.tracer.surface import SurfaceTable
from ispm.tracer.world import World

_BRIGHT = 6.0  # times the mean, from where light goes by photons; 3 to 12 differ by under 10 % in error
_NARROW = np.float32(0.7)  # of their own size, kernels at the rays' ends: rays average over many of them
_CLEAR = 2e-5  # of the distance to the eye, by which rays start above the surface: so far depth may err,
_ROUNDED = 1e-6  # and of the coordinates
_REACH = 0.4  # of the harmonic mean of rays' lengths: the filter's radius, as light changes over such lengths
_RAYS_WITHIN = 800.0  # that radius, at least: fewer leave specks in corners
_NEAREST = 0.01  # of the scene's diagonal, for which shorter rays count there
_AROUND = 2  # low-resolution pixels on each side, over which that mean is taken
_SAME_WAY = 0.9  # cosine of normals, above which they belong together
_BATCH = 1 << 17  # rays whose ends lie in memory at once
_DIMENSION = 1 << 21  # of the random numbers that shift whole pictures of rays
_R2 = np.array([0.7548776662466927, 0.5698402909980532])  # Roberts 2018: evenly spread points


def bright_limit(packed: Packed, settings: Settings) -> float:
    """Return the limit of bright spots, lx: `_BRIGHT` times what the lights bring to the scene's bounds."""
    if not settings.gather_rays:
        return math.inf
    power = packed.lights["intensity"].max(axis=1) @ np.array([map.measure for map in packed.maps])
    x, y, z = packed.bounds[1] - packed.bounds[0]
    return float(_BRIGHT * power / max(2.0 * (x * y + y * z + z * x), 1e-30))


def light_receivers(
    packed: Packed,
    world: World,
    surfaces: SurfaceTable,
    points: np.ndarray,
    parts: PhotonParts,
    estimator: Callable[[np.ndarray], np.ndarray],
    view: CameraView,
    size: tuple[int, int],
    settings: Settings,
    threads: int,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the light at receivers, (n, 16): as estimated or gathered, and filtered for the picture.

    points     (n,) RECEIVER, row by row, of `size`
    estimator  of light at the points from (m,) PHOTON
    """
    photons = parts.smooth
    if not len(photons):
        dark = np.zeros((len(points), 16), np.float32)
        return dark, dark
    if settings.kernel == "hint":
        hint_radii(photons, packed.diagonal, settings.photons, settings.smoothing)
        estimate = estimator(photons)
        return estimate, estimate
    _measure(photons, packed, view, settings)
    estimate = estimator(photons)
    if not settings.gather_rays:
        light = filter_estimate(points, estimate, size, packed.diagonal, settings.smoothing, threads)
        return estimate, light
    light = gather_light(
        packed, world, surfaces, points, parts, estimate, estimator, view, size, settings, view.pass_index,
        threads,
    )  # fmt: skip
    return light, filter_estimate(points, light, size, packed.diagonal, settings.smoothing, threads)


def light_elsewhere(
    packed: Packed,
    world: World,
    surfaces: SurfaceTable,
    points: np.ndarray,
    size: tuple[int, int],
    parts: PhotonParts,
    photons: PhotonGrid,
    view: CameraView,
    settings: Settings,
    threads: int,
) -> np.ndarray:
    """Return the light at points that are not the picture's receivers, (n, 16), to be filtered.

    points   (n,) RECEIVER, row by row, of `size`
    photons  the smooth ones, whose kernels are measured
    """
    estimate = photons.estimate(points, threads)
    if not settings.gather_rays:
        return estimate
    return gather_light(
        packed, world, surfaces, points, parts, estimate,
        lambda photons: PhotonGrid(photons).estimate(points, threads), view, size, settings,
        view.pass_index, threads,
    )  # fmt: skip


def _measure(photons: np.ndarray, packed: Packed, view: CameraView, settings: Settings) -> None:
    """Give kernels of the low resolution their size."""
    pixel = settings.subsampling * sample_width(view)
    measure_radii(photons, packed.diagonal, settings.smoothing, pixel, packed.widths, view.eye_or_direction)


def gather_light(
    packed: Packed,
    world: World,
    surfaces: SurfaceTable,
    points: np.ndarray,
    parts: PhotonParts,
    estimate: np.ndarray,
    estimator: Callable[[np.ndarray], np.ndarray],
    view: CameraView,
    size: tuple[int, int],
    settings: Settings,
    pass_index: int,
    threads: int,
) -> np.ndarray:
    """Return the light at receivers, (n, 16), to be filtered: gloss as photons have it, the rest gathered.

    points     (n,) RECEIVER, row by row, of `size`
    estimate   (n, 16) of all smooth photons, whose kernels are measured
    estimator  of light at the points from (m,) PHOTON
    """
    light, nearness = estimate.copy(), np.empty(len(points), np.float32)
    rays, grid = settings.gather_rays, PhotonGrid(_narrowed(parts.scattered(settings.bounces)))
    numbers = (
        _clearance(points["position"], view.eye),
        np.arange(len(points), dtype=np.uint32),
        even_numbers(size, settings.seed, pass_index),
    )
    limit, most = bright_limit(packed, settings), np.float32(1.0 / (_NEAREST * packed.diagonal))
    for first in range(0, len(points), _BATCH // rays):
        part = slice(first, first + _BATCH // rays)
        found = gather_rays(
            packed, world, surfaces, points[part], tuple(each[part] for each in numbers), math.isqrt(rays),
            limit, settings.seed, pass_index, threads,
        )  # fmt: skip
        radiance = reflect_light(found.ends, grid.estimate(found.points, threads), len(found.ends))
        radiance += found.radiance
        light[part, 0:3] = math.pi * _mean(radiance, rays)
        light[part, 4:7] = math.pi * _mean(found.fresnel[:, None] * radiance, rays)
        nearness[part] = _mean(np.minimum(found.nearness, most), rays)
    straight = parts.smooth[parts.straight]
    if len(straight):
        _measure(straight, packed, view, settings)
        brought = estimator(straight)
        light[:, 0:3] += brought[:, 0:3]
        light[:, 4:7] += brought[:, 4:7]
    least = points["footprint"] * np.sqrt(points["slant"] * np.float32(_RAYS_WITHIN / (math.pi * rays)))
    reach = np.maximum(_REACH / _mean_around(points, nearness, size), least)
    set_reach(light, points, reach, packed.diagonal)
    return light


def even_numbers(size: tuple[int, int], seed: int, pass_index: int) -> np.ndarray:
    """Return (h w, 2) float32 in [0, 1), row by row: evenly spread over the pixels of any neighbourhood.

    A lattice along the Morton curve, on which each aligned square is one stretch.
    """
    x, y = np.arange(size[0]), np.arange(size[1])[:, None]
    bits = range(max(size).bit_length())
    along = sum(((x >> bit & 1) << 2 * bit | (y >> bit & 1) << 2 * bit + 1 for bit in bits), np.int64(0))
    start = random4(np.uint32(0), np.uint32(_DIMENSION), np.uint32(pass_index), np.uint32(seed))[:2]
    numbers = (np.reshape(along, (-1, 1)) * _R2 + start) % 1.0
    return np.asarray(np.minimum(numbers, 1.0 - 2.0**-24), np.float32)


def _clearance(position: np.ndarray, eye: np.ndarray) -> np.ndarray:
    """(n,) float32 m by which rays from (n, 3) places start above their surfaces."""
    away = _CLEAR * np.linalg.norm(position - eye, axis=1)
    return np.asarray(away + _ROUNDED * np.abs(position).max(axis=1), np.float32)


def _narrowed(photons: np.ndarray) -> np.ndarray:
    photons["radius"] *= _NARROW
    photons["height"] *= _NARROW
    return photons


def _mean(values: np.ndarray, rays: int) -> np.ndarray:
    """Means over each receiver's rays."""
    return np.asarray(values.reshape(-1, rays, *values.shape[1:]).mean(axis=1))


def _mean_around(points: np.ndarray, values: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """(n,) means over the receivers around each that face as it does; above 0."""
    shape, pad = (size[1], size[0]), (_AROUND, _AROUND)
    ng = points["ng"].reshape(*shape, 3)
    wide_ng, wide = np.pad(ng, (pad, pad, (0, 0))), np.pad(values.reshape(shape), (pad, pad))
    total, count = np.zeros(shape, np.float32), np.zeros(shape, np.float32)
    for y in range(2 * _AROUND + 1):
        for x in range(2 * _AROUND + 1):
            there = slice(y, y + shape[0]), slice(x, x + shape[1])
            alike = np.einsum("yxk,yxk->yx", ng, wide_ng[there]) > _SAME_WAY
            total += alike * wide[there]
            count += alike
    return np.maximum(total / np.maximum(count, 1.0), np.float32(1e-12)).reshape(-1)
