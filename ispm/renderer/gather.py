"""The final gather: light at the receivers by rays, and by those photons that rays do not find."""

from __future__ import annotations

import math

import numpy as np

from ispm.estimators import Estimator
from ispm.renderer.caustics import PhotonParts
from ispm.scene.packed import Packed
from ispm.settings import Settings
from ispm.stages.camera import CameraView
from ispm.stages.filter import DENSITY, filter_estimate
from ispm.tracer.density import measure_radii
from ispm.tracer.ends import reflect_light
from ispm.tracer.gather import gather_rays
from ispm.tracer.grid import PhotonGrid
from ispm.tracer.surface import SurfaceTable
from ispm.tracer.world import World

_BRIGHT = 6.0  # times the mean, from where light goes by photons
_NARROW = np.float32(0.7)  # of their radius, kernels of photons at the rays' ends
_CLEAR = 2e-5  # of the distance to the eye, by which rays start above the surface: that far depth may err
_BATCH = 1 << 17  # rays whose ends lie in memory at once
_R2 = np.array([0.7548776662466927, 0.5698402909980532])  # Roberts 2018: evenly spread points
_C = 1.0
_REACH = 1.0
_MIN = 0.01
_WIN = 2
SHIFT = "r2"


def bright_limit(packed: Packed, settings: Settings) -> float:
    """Return the limit of bright spots, lx: so many times what the lights bring to the scene's bounds."""
    if not settings.gather_rays:
        return math.inf
    power = packed.lights["intensity"].max(axis=1) @ np.array([map.measure for map in packed.maps])
    x, y, z = packed.bounds[1] - packed.bounds[0]
    return float(_BRIGHT * power / max(2.0 * (x * y + y * z + z * x), 1e-30))


def shifts(size: tuple[int, int], seed: int, pass_index: int) -> np.ndarray:
    """Return (h w, 2) float32 in [0, 1), evenly spread over any neighbourhood of pixels."""
    x, y = np.arange(size[0]), np.arange(size[1])[:, None]
    code = np.zeros((size[1], size[0]), np.int64)
    for bit in range(14):
        code |= (x >> bit & 1) << 2 * bit | (y >> bit & 1) << 2 * bit + 1
    if SHIFT == "random":
        return np.random.default_rng(seed).random((x.size * y.size, 2), np.float32)
    rank = np.empty(code.size, np.int64)
    rank[np.argsort(code, axis=None)] = np.arange(code.size)
    start = np.random.default_rng((seed, pass_index)).random(2)
    return ((start + rank[:, None] * _R2) % 1.0).astype(np.float32)


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
    shift = shifts(size, settings.seed, pass_index)
    near = np.empty(len(points), np.float32)
    found = parts.scattered(settings.bounces)
    found["radius"] *= _NARROW
    found["height"] *= _NARROW
    grid = PhotonGrid(found)
    limit = bright_limit(packed, settings)
    batch = max(_BATCH // rays, 1)
    for first in range(0, len(points), batch):
        part = slice(first, first + batch)
        gathered = gather_rays(
            packed, world, surfaces, points[part], (clear[part], keys[part], shift[part]), math.isqrt(rays), limit,
            settings.seed, pass_index, threads,
        )  # fmt: skip
        radiance = reflect_light(gathered.ends, grid.estimate(gathered.points, threads), len(gathered.ends))
        radiance += gathered.radiance
        light[part, 0:3] = math.pi * radiance.reshape(-1, rays, 3).mean(axis=1)
        radiance *= gathered.fresnel[:, None]
        light[part, 4:7] = math.pi * radiance.reshape(-1, rays, 3).mean(axis=1)
        near[part] = np.minimum(gathered.nearness, 1/(_MIN*packed.diagonal)).reshape(-1, rays).mean(axis=1)
    straight = parts.smooth[parts.straight]
    if len(straight):
        pixel = settings.subsampling * view.footprint * view.clip_from_world[3]
        measure_radii(
            straight, packed.diagonal, settings.smoothing, pixel, packed.widths, view.eye_or_direction
        )
        seen = estimator(points, straight, view.clip_from_world, size)
        light[:, 0:3] += seen[:, 0:3]
        light[:, 4:7] += seen[:, 4:7]
    if _C:
        a = near.reshape(size[1], size[0])
        ng = points["ng"].reshape(size[1], size[0], 3)
        num=np.zeros_like(a); den=np.zeros_like(a)
        W=_WIN
        P=np.pad(a,W); Q=np.pad(ng,((W,W),(W,W),(0,0)))
        for dy in range(2*W+1):
            for dx in range(2*W+1):
                w=((Q[dy:dy+a.shape[0],dx:dx+a.shape[1]]*ng).sum(2)>.9)
                num+=w*P[dy:dy+a.shape[0],dx:dx+a.shape[1]]; den+=w
        h = _C*np.maximum(den,1)/np.maximum(num,1e-9)
        h = np.clip(h, .01*packed.diagonal, .075*_REACH*packed.diagonal)
        light[:,DENSITY] = (1600/np.pi/h**2).reshape(-1)
        global LAST; LAST=h
    return filter_estimate(points, light, size, packed.diagonal, settings.smoothing*max(_REACH,1), threads)
