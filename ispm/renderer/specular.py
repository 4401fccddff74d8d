"""The light that eye paths by mirrors, glass and narrow lobes bring to their pixels."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ispm.accel.meet import Rays, meet_many
from ispm.accel.rays import HIT
from ispm.accel.surface import SurfaceTable
from ispm.frame import Receivers
from ispm.optics.incident import channels, no_light
from ispm.optics.records import take
from ispm.paths.branch import GLOSS_SAMPLES, SCATTERED
from ispm.paths.edges import edge_rows
from ispm.paths.ends import denoise_rough_transmission, image_of_ends, reflect_light, spread_light
from ispm.paths.eye import trace_eye
from ispm.paths.eye_paths import EyePaths, EyeRays, join_paths
from ispm.paths.far import LANES, light_far_sides
from ispm.paths.pixel_layers import filtered_light
from ispm.paths.resolve import Shown, lonely_rows, resolve_lobes, shown
from ispm.paths.sheen import sheen_light
from ispm.renderer.backdrop import background_color, shows_environment
from ispm.renderer.gather import PhotonLight
from ispm.renderer.one_pass import Pass
from ispm.stages.camera import CameraView
from ispm.stages.filter import filter_estimate, filter_points
from ispm.stages.specular import LAYER_BASE, LAYER_BEHIND, LAYER_COAT, LAYER_FAR, LAYER_SHEEN

_MISSED_SHARE = 1 / 64  # receivers of missed pixels to those of the picture, while blocks can grow; measured
_BAND = 1 << 18  # rays whose ends lie in memory at a time
_GAP = 4  # unused rows between used ones of an image, at most: those on its sides never mix by interpolation
_FINER = 2  # blocks of ends are this much smaller than the picture's: curved mirrors show much in few pixels
SAMPLES = np.array([(-1, -3), (3, -1), (-3, 1), (1, 3)]) / 8.0  # pixels from the centre, as antialiasing's
_EDGES_FEW = 1 / 16  # of the picture's pixels
_PAIR = SAMPLES[[0, 3]]  # in their place where edges are many: opposite, so that their mean is the centre
# Start before, and search behind, of the distance, which is that to the plane at the center.
_FINE_SLACK = 5e-3, 2e-2


def specular_light(this: Pass, seen: np.ndarray, light: PhotonLight) -> np.ndarray:
    """Return direct light, indirect light and emission that such paths bring to SEEN pixels, (n,), the share
    that these show of a colored background, the share of irradiance, over pi, that sheen reflects, that which
    is hidden of emission, as much as a blended surface is clear, and that of the direct and indirect light of
    what is under a clear coat or sheen, or blended: (n, 17) float32.

    A coat, sheen and what is under them are surfaces whose light adds; what lies behind a blended surface
    adds by as much as that is clear.
    """
    found = np.zeros((len(seen), 17), np.float32)
    for layer in (LAYER_BASE, LAYER_COAT):
        rows = np.flatnonzero(seen["layers"] & layer)
        if len(rows) == len(seen) > 0:
            found += _light_of_layer(this, seen, light, layer)
        elif len(rows):
            found[rows] += _light_of_layer(this, take(seen, rows), light, layer)
    rows = np.flatnonzero(seen["layers"] & LAYER_SHEEN)
    if len(rows):
        rays = eye_rays(take(seen, rows), this.surfaces, this.view, this.threads)
        sheen = sheen_light(this.packed, this.world, this.surfaces, rays, this.settings.seed, this.index)
        across, smoothing = this.view.size[0], this.settings.smoothing
        found[rows, :3] += filtered_light(sheen, rays.keys, across, smoothing, this.threads)
        found[rows, 12:15] = sheen.albedo
        found[rows, 16] = 1.0 - (1.0 - found[rows, 16]) * (1.0 - sheen.hidden)
    rows = np.flatnonzero(seen["layers"] & LAYER_FAR)
    if len(rows):
        found[rows, :6] += _light_of_far_sides(this, take(seen, rows), light)
    rows = np.flatnonzero(seen["layers"] & LAYER_BEHIND)
    if len(rows):
        behind = _light_of_layer(this, take(seen, rows), light, LAYER_BEHIND)
        opacity = 1.0 - behind[:, 16:]
        found[rows, :15] = opacity * found[rows, :15] + behind[:, :15]
        found[rows, 15:] = 1.0 - opacity * (1.0 - found[rows, 15:])
    return found


def _light_of_far_sides(this: Pass, seen: np.ndarray, light: PhotonLight) -> np.ndarray:
    """Return direct and indirect light, (n, 6), from the far sides of the sheets that SEEN pixels show."""
    settings = this.settings
    rays = eye_rays(seen, this.surfaces, this.view, this.threads)
    far = light_far_sides(this.packed, this.world, this.surfaces, rays, settings.seed, this.index)
    direct = filtered_light(far, rays.keys, this.view.size[0], settings.smoothing, this.threads)
    found = light_by_image(this, far.points, rays.keys, settings.subsampling, light.at)
    found += light.focused.estimate(far.points, this.threads)
    return np.concatenate([direct, reflect_light(far.ends, found, len(seen))], axis=1)


def _light_of_layer(this: Pass, seen: np.ndarray, light: PhotonLight, layer: int) -> np.ndarray:
    """`specular_light` of SEEN pixels by their coats alone, by what is under these, or by what lies behind.

    Pixels on edges of what is seen in a mirror or glass are sampled four times; where these are many, as on
    waves, twice.
    """
    settings, view, count = this.settings, this.view, len(seen)
    rays = eye_rays(seen, this.surfaces, view, this.threads, settings.smoothing)
    of_coats, behind = layer == LAYER_COAT, layer == LAYER_BEHIND
    rays = replace(rays, shows_environment=shows_environment(this), of_coats=of_coats, behind=behind)
    paths, given, lonely, edges = _paths_of(this, rays, light)
    total = count + len(lonely)
    samples = max((len(paths.direct) - total) // max(len(edges), 1), 1)
    pixels = np.concatenate([rays.keys, rays.keys[lonely], np.repeat(rays.keys[edges], samples)])
    found, firsts = light_ends(this, paths, pixels, light), given.firsts
    through = paths.through if background_color(settings) is not None else np.zeros_like(paths.through)
    del paths  # their ends take more memory than the picture
    for brought in (found, through):
        brought[lonely] = brought[count:total]
        brought[edges] = brought[total:].reshape(len(edges), samples, brought.shape[1]).mean(axis=1)
        denoise_rough_transmission(brought[:count], rays.keys, view.size[0], firsts, this.threads)
    resolve_lobes(found[:count], given, settings.smoothing, this.threads)
    found[:count, :3] += firsts["own"]
    none, hidden = np.zeros((count, 4), np.float32), firsts["hidden"][:, None]
    return np.concatenate([found[:count], through[:count], none, hidden], axis=1)


def _paths_of(
    this: Pass, rays: EyeRays, light: PhotonLight
) -> tuple[EyePaths, Shown, np.ndarray, np.ndarray]:
    """Return the eye paths of n rays and, behind them, of the rows that no path serves, and of samples of the
    rows on edges; what the n rays show; and both of these rows, sorted."""
    view = this.view
    paths = follow(this, rays, light)
    edges = edge_rows(paths, rays.keys, view.size[0]) if this.settings.antialias else np.zeros(0, np.int64)
    places = rays.origins + rays.distances[:, None] * rays.directions
    given = shown(rays.keys, view.size[0], paths.firsts, places, view.pixel_widths(places))
    lonely = lonely_rows(given)
    parts = [paths]
    if len(lonely):
        parts.append(follow(this, rows_of(rays, lonely), light))
        paths.firsts[lonely] = parts[-1].firsts
    samples = SAMPLES if len(edges) <= _EDGES_FEW * view.size[0] * view.size[1] else _PAIR
    if len(edges):
        parts.append(follow(this, fine_rays(rays, paths, edges, view, samples), light))
    return join_paths(parts), given, lonely, edges


def eye_rays(
    seen: np.ndarray, surfaces: SurfaceTable, view: CameraView, threads: int, widening: float = 1.0
) -> EyeRays:
    """Return the rays through (n,) SEEN pixels, and where they meet the triangles there."""
    origins, directions = view.pixel_rays(seen["pixel"].astype(np.int64))
    parallel = view.ymag is not None
    wide = (view.footprint, 0.0) if parallel else (0.0, view.footprint)
    hits = np.zeros(len(seen), HIT)
    hits["instance"], hits["primitive"] = seen["instance"], seen["primitive"]
    rays = Rays(origins, directions, parallel)
    barycentrics, hits["t"] = meet_many(surfaces, seen["instance"], seen["primitive"], rays, threads)
    hits["u"], hits["v"] = barycentrics.T
    f4 = np.float32
    keys, distances = seen["pixel"].astype(np.uint32), hits["t"].copy()
    across, high = view.size
    most = min(across * high // (2 * max(len(seen), 1)), GLOSS_SAMPLES)
    return EyeRays(
        origins.astype(f4),
        directions.astype(f4),
        distances,
        keys,
        wide,
        hits=hits,
        columns=across,
        most=most,
        widening=widening,
    )


def stretch_of(rays: EyeRays, rows: slice) -> EyeRays:
    """Return the rays of some rows."""
    names = ("origins", "directions", "distances", "keys")
    hits = None if rays.hits is None else rays.hits[rows]
    return replace(rays, **{name: getattr(rays, name)[rows] for name in names}, hits=hits)


def rows_of(rays: EyeRays, rows: np.ndarray) -> EyeRays:
    """Return some of the rays, from each of whose lobes a path goes out."""
    names = ("origins", "directions", "distances", "keys")
    hits = None if rays.hits is None else take(rays.hits, rows)
    return replace(rays, **{name: getattr(rays, name)[rows] for name in names}, hits=hits, columns=0)


def fine_rays(
    rays: EyeRays, paths: EyePaths, rows: np.ndarray, view: CameraView, samples: np.ndarray = SAMPLES
) -> EyeRays:
    """Return the rays through samples of some pixels, one pixel's after the other's.

    samples  (k, 2) pixels right of and below the centre
    """
    pixels = rays.keys[rows].astype(np.int64)[:, None]
    x = pixels % view.size[0] + 0.5 + samples[:, 0]
    y = pixels // view.size[0] + 0.5 + samples[:, 1]
    origins, directions = (a.reshape(-1, 3) for a in view.rays_through(x, y))
    center = rays.origins[rows] + rays.distances[rows, None] * rays.directions[rows]
    center, ng, expected = (
        np.repeat(a, len(samples), axis=0) for a in (center, paths.firsts["ng"][rows], rays.distances[rows])
    )
    slope = np.einsum("ij,ij->i", directions, ng)
    away = np.einsum("ij,ij->i", center - origins, ng) / np.where(np.abs(slope) > 1e-3, slope, np.inf)
    distances = np.where(np.abs(away / expected - 1.0) < 0.2, away, expected)  # beyond, it is another surface
    keys = (pixels + len(samples) * (1 + np.arange(len(samples))) * 0x9E3779B1).astype(np.uint32)
    f4 = np.float32
    return replace(
        rays,
        origins=origins.astype(f4),
        directions=directions.astype(f4),
        distances=distances.astype(f4),
        keys=keys.reshape(-1),
        slack=_FINE_SLACK,
        hits=None,
        columns=0,
    )


def follow(this: Pass, rays: EyeRays, light: PhotonLight) -> EyePaths:
    """Follow eye paths to their ends; those of paths that scattered are lit as they are found and dropped."""
    parts = []
    for first in range(0, max(len(rays.keys), 1), _BAND):
        band = stretch_of(rays, slice(first, first + _BAND))
        paths = trace_eye(this.packed, this.world, this.surfaces, band, this.settings.seed, this.index)
        scattered = paths.ends["lane"] == SCATTERED
        ends, points = (take(each, np.flatnonzero(scattered)) for each in (paths.ends, paths.points))
        paths.indirect[:] = light_each(ends, points, light, len(band.keys), this.threads)
        rows = np.flatnonzero(~scattered)
        parts.append(replace(paths, ends=take(paths.ends, rows), points=take(paths.points, rows)))
    return join_paths(parts)


def light_each(
    ends: np.ndarray, points: np.ndarray, light: PhotonLight, count: int, threads: int
) -> np.ndarray:
    """Return the radiance, (n, 3), that photons bring to `count` rays by each of their (m,) PATH_END, at (m,)
    RECEIVER points."""
    if not len(ends):
        return np.zeros((count, 3), np.float32)
    found = light.sum_at(points, light.photons)
    found += light.focused.estimate(points, threads)
    return reflect_light(ends, found, count)


def light_ends(this: Pass, paths: EyePaths, pixels: np.ndarray, light: PhotonLight) -> np.ndarray:
    """Return direct light, indirect light and emission of the rays, (n, 9) float32.

    pixels  (n,) numbers of the rays' pixels
    Photons that scattered before light gently: a few ends are lit and filtered. Those of caustics are
    estimated at every end.
    """
    points, lanes, slots = paths.points, paths.ends["lane"], paths.ends["slot"]
    found, finer = no_light(len(points)), max(this.settings.subsampling // _FINER, 1)
    if len(points):
        for lane in LANES:
            rows = np.flatnonzero(lanes == lane)
            shown = pixels[slots[rows]]
            found[rows] = light_by_image(this, take(points, rows), shown, finer, light.at)
        found += light.focused.estimate(points, this.threads)
    indirect = paths.indirect + reflect_light(paths.ends, found, len(pixels))
    return np.concatenate([paths.direct, indirect, paths.emission], axis=1)


def light_by_image(
    this: Pass,
    points: np.ndarray,
    pixels: np.ndarray,
    block: int,
    light_at: Callable[[Receivers], np.ndarray],
) -> np.ndarray:
    """Return light at (m,) RECEIVER points that some pixels show, (m, 16): from an image of few of them.

    pixels    (m,) their numbers
    block     pixels to a side of one of the image's
    light_at  returns the light at an image's points, (n, 16), not filtered
    The image leaves out the rows and columns of the picture that show none.
    """
    if not len(points):
        return no_light(0)
    diagonal, smoothing, threads = this.packed.diagonal, this.settings.smoothing, this.threads
    width = this.view.size[0]
    x, y = pixels % width, pixels // width
    column, row = _without_gaps(x // block), _without_gaps(y // block)
    size = (int(column.max()) + 1, int(row.max()) + 1)
    cells = row * size[0] + column
    image = image_of_ends(points, cells, size, block, this.index)
    raw = light_at(Receivers(image, size))
    filtered = filter_estimate(image, raw, size, diagonal, smoothing, threads)
    within = (np.stack([x % block, y % block], axis=1) + 0.5) / block - 0.5
    places = (np.stack([column, row], axis=1) + within).astype(np.float32)
    spread, found = spread_light(points, places, image, filtered, size, block, threads)
    lost = np.flatnonzero(~found)
    if len(lost):
        spread[lost] = filter_points(
            take(points, lost), cells[lost], image, raw, size, diagonal, smoothing, threads
        )
        alone = lost[channels(spread)["met"][lost] == 0.0]
        if len(alone):
            spread[alone] = light_at(Receivers(take(points, alone), (len(alone), 1)))
    return spread


def _without_gaps(cells: np.ndarray) -> np.ndarray:
    """(n,) int numbers of rows or columns, with all but `_GAP` of each run of unused ones left out."""
    used, rank = np.unique(cells, return_inverse=True)
    return np.cumsum(np.minimum(np.diff(used, prepend=used[0]), _GAP + 1))[rank]


def light_missed(
    this: Pass,
    points: np.ndarray,
    missed: np.ndarray,
    receivers: Receivers,
    raw: np.ndarray,
    light: PhotonLight,
) -> np.ndarray:
    """Return light at (n,) RECEIVER points that a picture's receivers missed, (n, 16): by their filter, and
    the more by an image of these points the fewer of them that finds.

    missed  (n,) MISSED, their pixels and the receivers in whose place they lie
    raw     (h w, 16) of light at the receivers, not filtered
    """
    settings = this.settings
    found = filter_points(
        points,
        missed["low"],
        receivers.points,
        raw,
        receivers.size,
        this.packed.diagonal,
        settings.smoothing,
        this.threads,
    )
    met = channels(found)["met"]
    alone = np.flatnonzero(met < 1.0)
    lone = take(points, alone)
    lone["footprint"] /= settings.subsampling  # a pixel's, as an image wants
    share = len(lone) / (_MISSED_SHARE * len(receivers.points))
    block = min(max(math.ceil(share), 1), settings.subsampling)
    image = light_by_image(this, lone, missed["pixel"][alone], block, light.at_missed)
    found[alone] = image + met[alone, None] * (found[alone] - image)
    return found
