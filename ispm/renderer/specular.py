"""The light that eye paths by mirrors, glass and narrow lobes bring to their pixels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ispm.accel.surface import SurfaceTable
from ispm.lights.surface_emission import has_area_light
from ispm.optics.incident import no_light
from ispm.optics.records import take
from ispm.paths.branch import GLOSS_SAMPLES, SCATTERED, STRONG
from ispm.paths.denoise import denoise
from ispm.paths.edges import edge_rows
from ispm.paths.ends import reflect_light
from ispm.paths.eye import trace_eye
from ispm.paths.eye_paths import LAMP_SAMPLES, EyePaths, EyeRays, join_ends, no_paths
from ispm.paths.far import LANES, FarSide, light_far_sides
from ispm.paths.pixel_rays import rays_to_seen
from ispm.paths.resolve import resolve_lobes
from ispm.paths.sheen import filtered_light, sheen_light
from ispm.paths.shown import Shown, contact_rows, lonely_rows, shown
from ispm.paths.vertices import COLUMNS, INDIRECT, THROUGH
from ispm.renderer.backdrop import background_color, shows_environment
from ispm.renderer.by_image import light_by_image
from ispm.renderer.gather import PhotonLight
from ispm.renderer.heap import give_back
from ispm.renderer.one_pass import Pass
from ispm.scene.within import solid_about
from ispm.stages.camera import CameraView
from ispm.stages.end_light import add_area_light
from ispm.stages.pixels import pixel_view
from ispm.stages.specular import LAYER_BASE, LAYER_BEHIND, LAYER_COAT, LAYER_FAR, LAYER_SHEEN

_BAND = 1 << 18  # rays whose ends lie in memory at a time
_FINER = 2  # blocks of ends are this much smaller than the picture's: curved mirrors show much in few pixels
SAMPLES = np.array([(-1, -3), (3, -1), (-3, 1), (1, 3)]) / 8.0  # pixels from the centre, as antialiasing's
_METAL = 0.5  # reflectance of metals that counts where strong lobes are too many
_FEW = 1 / 16  # of the picture's pixels: edges that are sampled four times, and paths of strong lobes
_MORE = 1 / 2  # paths per pixel of the picture, for pixels at contacts and lobes that no neighbor is like
_PAIR = SAMPLES[[0, 3]]  # in their place where edges are many: opposite, so that their mean is the centre
# Start before, and search behind, of the distance, which is that to the plane at the center.
_FINE_SLACK = 5e-3, 2e-2


def specular_light(this: Pass, seen: np.ndarray, photons: PhotonLight) -> np.ndarray:
    """Return direct light, indirect light and emission that such paths bring to SEEN pixels, (n,), the share
    that these show of a colored background, the share of irradiance, over pi, that sheen reflects, that which
    is hidden of emission, as much as a blended surface is clear, and that of the direct and indirect light of
    what is under a clear coat or sheen, or blended: (n, 17) float32.

    A coat, sheen and what is under them are surfaces whose light adds; what lies behind a blended surface
    adds by as much as that is clear.
    """
    if len(seen) > _BAND:
        give_back()  # now a frame takes most memory
    found = np.zeros((len(seen), 17), np.float32)
    for layer in (LAYER_BASE, LAYER_COAT):
        rows = np.flatnonzero(seen["layers"] & layer)
        if len(rows):
            every = len(rows) == len(seen)
            light, hidden = _light_of_layer(this, seen if every else take(seen, rows), photons, layer)
            chosen = slice(None) if every else rows
            found[chosen, :COLUMNS] += light
            found[chosen, 16] += hidden
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
        found[rows, :6] += _light_of_far_sides(this, take(seen, rows), photons)
    rows = np.flatnonzero(seen["layers"] & LAYER_BEHIND)
    if len(rows):
        behind, hidden = _light_of_layer(this, take(seen, rows), photons, LAYER_BEHIND)
        opacity = 1.0 - hidden[:, None]
        found[rows, :15] *= opacity
        found[rows, :COLUMNS] += behind
        found[rows, 15:] = 1.0 - opacity * (1.0 - found[rows, 15:])
    return found


def _light_of_far_sides(this: Pass, seen: np.ndarray, photons: PhotonLight) -> np.ndarray:
    """Return direct and indirect light, (n, 6), from the far sides of the sheets that SEEN pixels show."""
    settings = this.settings
    rays = eye_rays(seen, this.surfaces, this.view, this.threads)
    far = light_far_sides(this.packed, this.world, this.surfaces, rays, settings.seed, this.index)
    direct = far.direct
    if has_area_light(this.packed, this.surfaces):
        _add_area_light(this, far, direct, rays.keys, photons)
    found = light_by_image(this, far.points, rays.keys, settings.subsampling, photons.at)
    found += photons.focused.estimate(far.points, this.threads)
    return np.concatenate([direct, reflect_light(far.ends, found, len(seen))], axis=1)


def _add_area_light(
    this: Pass, found: EyePaths | FarSide, light: np.ndarray, pixels: np.ndarray, photons: PhotonLight
) -> None:
    """Add to light, whose first columns are direct, what lamps with a surface and the environment bring to
    the ends that were found."""
    told = pixel_view(this.view, this.settings.seed), this.packed, this.world, this.surfaces, photons.openings
    add_area_light(light, found.ends, found.points, pixels, *told, this.settings.smoothing)


def _light_of_layer(
    this: Pass, seen: np.ndarray, photons: PhotonLight, layer: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return what is brought to SEEN pixels by their coats alone, by what is under these, or by what lies
    behind: light as EyePaths have it, and what that hides of emission and of what is under it, (n,).

    Pixels on edges of what is seen in a mirror or glass are sampled four times more; where these are many, as
    on waves, twice.
    """
    settings, view = this.settings, this.view
    rays = eye_rays(seen, this.surfaces, view, this.threads, settings.smoothing)
    of_coats, behind = layer == LAYER_COAT, layer == LAYER_BEHIND
    within = solid_about(this.packed, view.eye_or_direction)
    shown = shows_environment(this)
    rays = replace(rays, shows_environment=shown, of_coats=of_coats, behind=behind, within=within)
    paths, again, given = _paths_of(this, rays, photons)
    pixels = [keys := rays.keys]
    del rays  # which take more memory than the picture
    for rows, found, _ in again:
        pixels.append(np.repeat(keys[rows], len(found.light) // len(rows)))
    light_ends(this, [paths, *(found for _, found, _ in again)], np.concatenate(pixels), photons)
    light, firsts = paths.light, given.firsts
    del paths, pixels  # ends take as much
    for rows, found, more in again:
        samples = found.light.reshape(len(rows), -1, COLUMNS)
        light[rows] = (samples.sum(axis=1) + more * light[rows]) / (samples.shape[1] + more)
    if background_color(settings) is None:
        light[:, THROUGH:] = 0.0
    for brought in (light[:, :THROUGH], light[:, THROUGH:]):
        denoise(brought, keys, view.size[0], firsts, settings.smoothing, this.threads)
    resolve_lobes(light, given, settings.smoothing, this.threads)
    light[:, :INDIRECT] += firsts["own"]
    return light, firsts["hidden"].copy()


def _paths_of(
    this: Pass, rays: EyeRays, photons: PhotonLight
) -> tuple[EyePaths, list[tuple[np.ndarray, EyePaths, int]], Shown]:
    """Return the eye paths of n rays; those that stand in for some of them, with sorted rows, each of which
    has as many, and how many of the pixels' own count beside them: of rows that no path serves, and through
    samples of pixels on edges, which are marked by what their own paths met; and what the n rays show."""
    view = this.view
    side_by_side = replace(rays, by_image=has_area_light(this.packed, this.surfaces))
    paths = follow(this, side_by_side, photons)
    places = rays.origins + rays.distances[:, None] * rays.directions
    widths = view.pixel_widths(places)
    told = paths.firsts, places, rays.directions, widths, this.threads
    given = shown(rays.keys, view.screen(), *told)
    lonely, again, edges = lonely_rows(given), [], np.zeros(0, np.int64)
    few = _FEW * view.size[0] * view.size[1]
    paths_most = _MORE * view.size[0] * view.size[1]
    close = contact_rows(given, paths_most / 2, this.threads)
    if this.settings.antialias:
        edges = edge_rows(paths, lonely, rays.keys, view.size[0])

    def follow_again(rows: np.ndarray, own: EyeRays) -> None:
        again.append((rows, follow(this, own, photons), 0))
        paths.firsts[rows] = again[-1][1].firsts

    if len(close):
        edges, lonely = (np.setdiff1d(rows, close, assume_unique=True) for rows in (edges, lonely))
        most = min(int(paths_most / len(close)), GLOSS_SAMPLES)
        follow_again(close, replace(rows_of(side_by_side, close), most=most))
    strong, most = _strong_rows(given, few, rays.most)
    for others in (edges, *(rows for rows, _, _ in again)):
        strong = np.setdiff1d(strong, others, assume_unique=True)
    if len(strong):
        follow_again(strong, replace(rows_of(side_by_side, strong), most=most, columns=rays.columns))
        lonely = np.setdiff1d(lonely, strong, assume_unique=True)
    if len(lonely):
        follow_again(lonely, rows_of(rays, lonely))
    if len(edges):
        samples = SAMPLES if len(edges) <= few else _PAIR
        again.append((edges, follow(this, fine_rays(rays, paths, edges, view, samples), photons), 1))
    return paths, again, given


def _strong_rows(given: Shown, few: float, less: int) -> tuple[np.ndarray, int]:
    """Return the rows, sorted, of strong lobes that are to have more paths than `less`, and how many each: of
    metals, where weak lobes or glass fill most of the picture; `few` paths at most for all together."""
    reflectance = given.firsts["reflectance"].max(axis=1)
    for least in (STRONG, _METAL):
        rows = np.flatnonzero(reflectance >= least)
        most = min(int(few / max(len(rows), 1)), GLOSS_SAMPLES)
        if most > less:
            return rows, most
    return np.zeros(0, np.int64), 0


def eye_rays(
    seen: np.ndarray, surfaces: SurfaceTable, view: CameraView, threads: int, widening: float = 1.0
) -> EyeRays:
    """Return the rays through (n,) SEEN pixels, and where they meet the triangles there."""
    parallel = view.ymag is not None
    wide = (view.footprint, 0.0) if parallel else (0.0, view.footprint)
    across, high = view.size
    most = min(across * high // (2 * max(len(seen), 1)), GLOSS_SAMPLES)
    rays, keys = rays_to_seen(seen, view.screen(), surfaces, threads), seen["pixel"].astype(np.uint32)
    return EyeRays(
        rays.origins,
        rays.directions,
        rays.distances,
        keys,
        wide,
        hits=rays.hits,
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
        draws=max(LAMP_SAMPLES // len(samples), 1),
    )


def follow(this: Pass, rays: EyeRays, photons: PhotonLight) -> EyePaths:
    """Follow eye paths to their ends, to which light of lamps with a surface and of the environment is added;
    those of paths that scattered are lit by photons, too, as they are found, and dropped."""
    whole, parts = no_paths(len(rays.keys)), []
    for first in range(0, max(len(rays.keys), 1), _BAND):
        rows = slice(first, first + _BAND)
        band, into = (
            stretch_of(rays, rows),
            replace(whole, light=whole.light[rows], firsts=whole.firsts[rows]),
        )
        told = this.packed, this.world, this.surfaces, band, this.settings.seed, this.index, into
        paths = trace_eye(*told, photons.openings)
        if rays.by_image:
            _add_area_light(this, paths, paths.light, band.keys, photons)
        scattered = paths.ends["lane"] == SCATTERED
        ends, points = (take(each, np.flatnonzero(scattered)) for each in (paths.ends, paths.points))
        paths.indirect[:] = light_each(ends, points, photons, len(band.keys), this.threads)
        if len(ends):
            kept = np.flatnonzero(~scattered)
            paths = replace(paths, ends=take(paths.ends, kept), points=take(paths.points, kept))
        parts.append(paths)
    ends, points = join_ends(parts)
    return replace(whole, ends=ends, points=points, rays=sum(part.rays for part in parts))


def light_each(
    ends: np.ndarray, points: np.ndarray, photons: PhotonLight, count: int, threads: int
) -> np.ndarray:
    """Return the radiance, (n, 3), that photons bring to `count` rays by each of their (m,) PATH_END, at (m,)
    RECEIVER points."""
    if not len(ends):
        return np.zeros((count, 3), np.float32)
    found = photons.sum_at(points, photons.photons)
    found += photons.focused.estimate(points, threads)
    return reflect_light(ends, found, count)


def light_ends(this: Pass, parts: Sequence[EyePaths], pixels: np.ndarray, photons: PhotonLight) -> None:
    """Add the light of ends to the indirect light of the rays.

    pixels  (n,) numbers of the pixels of the rays of all parts
    Photons that scattered before light gently: a few ends are lit and filtered. Those of caustics are
    estimated at every end.
    """
    ends, points = join_ends(parts)
    if not len(ends):
        return
    lanes, slots = ends["lane"], ends["slot"]
    found, finer = no_light(len(points)), max(this.settings.subsampling // _FINER, 1)
    for lane in LANES:
        rows = np.flatnonzero(lanes == lane)
        shown = pixels[slots[rows]]
        found[rows] = light_by_image(this, take(points, rows), shown, finer, photons.at)
    found += photons.focused.estimate(points, this.threads)
    indirect, row = reflect_light(ends, found, len(pixels)), 0
    for part in parts:
        part.indirect[:] += indirect[row : row + len(part.light)]
        row += len(part.light)
