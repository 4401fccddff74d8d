"""The light that eye paths through mirrors and glass bring to their pixels."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ispm.settings import Settings
from ispm.stages.camera import CameraView
from ispm.stages.filter import WEIGHT, filter_estimate, filter_points
from ispm.tracer.ends import image_of_ends, reflect_light, smooth_frost, spread_light
from ispm.tracer.eye import REFLECTED, SCATTERED, TRANSMITTED, EyePaths, EyeRays
from ispm.tracer.grid import PhotonGrid

_FINER = 2  # blocks of ends are this much smaller than the picture's: curved mirrors show much in few pixels


def eye_rays(seen: np.ndarray, view: CameraView) -> EyeRays:
    """Return the rays through (n,) SEEN pixels."""
    origins, directions, distances = view.pixel_rays(seen["pixel"], seen["depth"])
    wide = (view.footprint, 0.0) if view.ymag is not None else (0.0, view.footprint)
    f4 = np.float32
    return EyeRays(
        origins.astype(f4), directions.astype(f4), distances.astype(f4), seen["pixel"].astype(np.uint32), wide
    )


def light_ends(
    paths: EyePaths,
    pixels: np.ndarray,
    photons: Callable[[], PhotonGrid],
    caustics: PhotonGrid,
    view: CameraView,
    settings: Settings,
    diagonal: float,
    threads: int,
) -> np.ndarray:
    """Return direct light, indirect light and emission of the pixels, (n, 9) float32.

    pixels    (n,) numbers of the rays' pixels
    photons   those that scattered before, and so light gently: a few ends are estimated and filtered
    caustics  those that did not: every end is estimated
    """
    light = np.zeros((len(paths.ends), 16), np.float32)
    if len(paths.ends):
        for lane in (REFLECTED, TRANSMITTED):
            rows = np.flatnonzero(paths.ends["lane"] == lane)
            shown = pixels[paths.ends["slot"][rows]]
            light[rows] = _light_lane(paths.points[rows], shown, photons, view, settings, diagonal, threads)
        rows = np.flatnonzero(paths.ends["lane"] == SCATTERED)
        if len(rows):
            light[rows] = photons().estimate(paths.points[rows], threads)
        light += caustics.estimate(paths.points, threads)
    indirect = reflect_light(paths.ends, light, len(pixels))
    brought = np.concatenate([paths.direct, indirect, paths.emission], axis=1)
    smooth_frost(brought, pixels, view.size[0], paths.frost, threads)
    return brought


def _light_lane(
    points: np.ndarray, pixels: np.ndarray, photons: Callable[[], PhotonGrid], view: CameraView,
    settings: Settings, diagonal: float, threads: int,
) -> np.ndarray:  # fmt: skip
    """Light at ends that one kind of path found, (m, 16): from an image of few of them."""
    if not len(points):
        return np.zeros((0, 16), np.float32)
    block = max(settings.subsampling // _FINER, 1)
    size = (-(-view.size[0] // block), -(-view.size[1] // block))
    x, y = pixels % view.size[0], pixels // view.size[0]
    cells = (y // block).astype(np.int64) * size[0] + x // block
    image = image_of_ends(points, cells, size, block)
    raw = photons().estimate(image, threads)
    filtered = filter_estimate(image, raw, size, diagonal, settings.smoothing, threads)
    places = np.stack([(x + 0.5) / block - 0.5, (y + 0.5) / block - 0.5], axis=1).astype(np.float32)
    light, found = spread_light(points, places, image, filtered, size, threads)
    lost = np.flatnonzero(~found)
    if len(lost):
        light[lost] = light_points(
            points[lost], cells[lost], image, raw, size, diagonal, settings.smoothing, photons, threads
        )
    return light


def light_points(
    points: np.ndarray, cells: np.ndarray, receivers: np.ndarray, estimate: np.ndarray,
    size: tuple[int, int], diagonal: float, smoothing: float, photons: Callable[[], PhotonGrid], threads: int,
) -> np.ndarray:  # fmt: skip
    """Return light at (n,) RECEIVER points, (n, 16): by the filter of the image, else by the photons near.

    cells  (n,) the receiver of the image in whose place each point lies
    """
    light = filter_points(points, cells, receivers, estimate, size, diagonal, smoothing, threads)
    alone = light[:, WEIGHT] == 0.0
    if alone.any():
        light[alone] = photons().estimate(points[alone], threads)
    return light
