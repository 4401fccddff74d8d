"""The final gather: light at the receivers by rays, and by those photons that rays do not find.

Which light goes which way: `paths/gather.py`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cached_property, partial

import numpy as np

from ispm.accel.surface import SurfaceTable
from ispm.estimators import Estimator
from ispm.frame import Receivers
from ispm.lights.lightmap import mean_irradiance
from ispm.lights.openings import Openings
from ispm.lights.surface_emission import emissive_flux
from ispm.optics.bsdf import NARROW_ALPHA
from ispm.optics.environment_table import environment_power
from ispm.optics.incident import FilteredLight, channels, no_light
from ispm.optics.records import copied, take
from ispm.optics.rng import random4
from ispm.optics.sampling import LATTICE
from ispm.paths.gather import Gather, RayPlan, average_rays, gather_rays, join_light
from ispm.paths.guide import Guide, square_blocks
from ispm.photons.coverage import Draws, keep_light
from ispm.photons.density import WIDTH_SHARE, Pixels, measure_radii
from ispm.photons.footprint import disc_kernels
from ispm.photons.grid import PhotonGrid
from ispm.photons.sheets import part_sheets
from ispm.photons.walls import end_at_walls
from ispm.renderer.caustics import PhotonClasses, sample_width
from ispm.renderer.narrow import LEAST_PHOTONS, mean_flux, narrow_radius
from ispm.renderer.one_pass import Pass
from ispm.scene.packed import Packed
from ispm.settings import Settings
from ispm.stages.filter import filter_estimate
from ispm.stages.lattice import radius_of, set_reach
from ispm.stages.mean import mean_around, ratio_around
from ispm.stages.upsample import UNUSED

# To the mean irradiance: brighter first bounces are left to photons; 4.5 and 18 have 10 % more error.
_BRIGHT_RATIO = 9.0
_END_KERNEL_SCALE = np.float32(0.7)  # of kernels at the rays' ends: rays average over many of them
_END_KERNEL_MOST = 4.0  # widths of an object, that one of these is wide at most
_CLEARANCE = 2e-5  # offset of a ray's start, share of the distance to the eye, by which depth may err,
_ROUNDED = 1e-6  # and of the coordinates
_REACH = 0.4  # of the harmonic mean of rays' lengths: the filter's radius, as light changes over such lengths
_NARROWER = -0.25  # exponent of the number of passes in that radius, beside that of all kernels; measured
_RAYS_USUAL = 4  # of a receiver, to which the radius belongs
_RAYS_WITHIN = 800.0  # least rays within the filter's radius, over all passes: fewer leave specks in corners
# Where the filter's least radius is so many times the one within which light changes little, there are more
# rays: from this share of all receivers at most, and so many times as many to a side of the hemisphere.
_TIGHT, _TIGHTEST, _MORE_ACROSS = 1.5, 1 / 6, 1.5
_RAYS_NOISE = 2.0 / _RAYS_WITHIN  # relative variance of their filtered light, about
_SHORTEST = 0.01, 8.0  # of the scene's diagonal and of receivers' distance, for which shorter rays count
_BATCH = 1 << 17  # rays whose ends lie in memory at once
_GRAZING_ALPHA = 0.5  # least of lobes that grazing eyes see, in the first pass
_SHARPER = -1 / 6  # exponent of the number of passes in it
_GRAZING, _STEEP = 0.2, 0.4  # cosines at the eye's side between which it comes in
_SERIES = 8  # of photons that alone light receivers; at the ends of rays and of eye paths more gain nothing
_DIMENSION = 1 << 21  # of the random numbers that shift whole pictures of rays


def bright_limit(packed: Packed, surfaces: SurfaceTable, settings: Settings) -> float:
    """Return the limit of bright first bounces, lx."""
    if not settings.gather_rays:
        return math.inf
    of_surfaces = emissive_flux(packed, surfaces) / (math.pi * packed.diagonal**2)
    of_environment = environment_power(packed.environment) / 4.0
    return _BRIGHT_RATIO * (mean_irradiance(packed) + of_surfaces + of_environment)


Ends = Callable[[np.ndarray], np.ndarray]


def filter_radii(
    image: Receivers,
    nearness: np.ndarray,
    rays: float | np.ndarray,
    passes: float | np.ndarray,
    threads: int,
) -> tuple[np.ndarray, np.ndarray]:
    """Return two radii for the filter at the receivers of an image, (n,) float32 m each, of which it takes
    the larger: within which light changes little, and within which there are rays enough.

    nearness  (n,) 1/m, mean inverse length of gather rays that met something
    rays      from each receiver, over all passes whose mean the light is
    """
    points = image.points
    # A disc of radius r holds pi r^2 / (footprint^2 slant) receivers, each of so many rays.
    within = np.asarray(_RAYS_WITHIN / (math.pi * rays), np.float32)
    least = points["footprint"] * np.sqrt(points["slant"] * within)
    widest = _REACH * passes**_NARROWER
    around = mean_around(points, nearness, image.size, threads)
    return np.asarray(widest / around), np.asarray(least)


def rays_worth(rays: int) -> float:
    """Return how many passes of the usual count of rays one of so many is worth to the filter: more rays free
    the picture of their own noise, not of the photons'."""
    return math.sqrt(rays / _RAYS_USUAL)


class PhotonLight:
    """The light that the photons of a pass bring to points, by gather rays where the settings have them.

    Measures the kernels of the smooth photons, in place.
    """

    def __init__(self, this: Pass, parts: PhotonClasses, openings: Openings) -> None:
        self._this, self.parts = this, parts
        self.openings = openings
        self.caustics = parts.caustics
        if this.settings.gather_rays:
            low, _ = this.packed.bounds
            self._guide = Guide(parts.smooth, ~parts.not_gathered, low, this.packed.diagonal)
        if not this.settings.is_plain:
            packed = this.packed
            self._measure(parts.smooth, _end_widths(packed) if this.settings.gather_rays else packed.widths)

    def at_receivers(self, receivers: Receivers, estimator: Estimator) -> tuple[np.ndarray, FilteredLight]:
        """Return the light at the picture's receivers, (h w, 16): as estimated or gathered, and filtered for
        the picture with that of the wide caustics.

        Receivers that are alone on their surface have a density of UNUSED: their pixels count as missed.
        """
        raw = self.at(receivers, estimator)
        filtered = self._filtered(receivers, raw)
        if self.caustics.wide:
            wide = self.wide.estimate(receivers.points, self._this.threads)
            filtered = filtered._replace(light=filtered.light + wide)
        return raw, filtered

    def at(self, receivers: Receivers, estimator: Estimator | None = None) -> np.ndarray:
        """Return the light at points, (n, 16), to be filtered: by photons, or by gather rays and the photons
        that these leave out.

        estimator  sums the photons where the points are the picture's receivers; None: they lie anywhere
        """
        this, points = self._this, receivers.points
        if not len(self.parts.smooth):
            return no_light(len(points))
        lobes = with_grazing_lobes(points, this.index)

        def summed(photons: PhotonGrid) -> np.ndarray:
            if estimator is None:
                return photons.estimate(lobes, this.threads)
            return estimator(lobes, photons.photons, this.view.clip_from_world, receivers.size)

        rays = this.settings.gather_rays
        if rays:
            whole, ended = self._not_gathered
            flux = np.concatenate([whole.photons["flux"], ended.photons["flux"]])
            of_photons = summed(whole) + ended.estimate(lobes, this.threads)
            light = self._gathered(receivers, of_photons, self.at_ends)
        else:
            flux, light = self.photons.photons["flux"], summed(self.photons)
            of_photons = light
        enough = len(flux) >= LEAST_PHOTONS
        if enough and estimator is not None and not this.settings.is_plain:
            narrow_radius(
                light, of_photons, mean_flux(flux), points, receivers.size, this.packed.diagonal,
                this.settings.smoothing, this.threads, others=_RAYS_NOISE if rays else 0.0,
                passes=1 + this.index,
            )  # fmt: skip
        return light

    def sum_at(self, points: np.ndarray, photons: PhotonGrid) -> np.ndarray:
        """Return the light that photons bring to (n,) RECEIVER points, (n, 16)."""
        return photons.estimate(with_grazing_lobes(points, self._this.index), self._this.threads)

    def not_gathered_at(self, points: np.ndarray) -> np.ndarray:
        """Return the light of photons that gather rays leave out at (n,) RECEIVER points, (n, 16)."""
        lobes = with_grazing_lobes(points, self._this.index)
        whole, ended = (photons.estimate(lobes, self._this.threads) for photons in self._not_gathered)
        return np.asarray(whole + ended)

    def at_missed(self, receivers: Receivers) -> np.ndarray:
        """Return likewise the light at points of the picture that its receivers miss."""
        return self.at(receivers)

    def _filtered(self, receivers: Receivers, raw: np.ndarray) -> FilteredLight:
        """Such light without its noise; plain kernels are wide enough to have little."""
        this = self._this
        if this.settings.is_plain or not len(self.parts.smooth):
            return FilteredLight(raw, None)
        filtered = filter_estimate(
            receivers.points, raw, receivers.size, this.packed.diagonal, this.settings.smoothing, this.threads
        )
        light = channels(filtered.light)
        light["density"][light["met"] < 1.0] = UNUSED
        light["reach"] = radius_of(raw, receivers.points, this.packed.diagonal, this.settings.smoothing)
        return filtered

    @cached_property
    def wide(self) -> PhotonGrid:
        """Caustic photons that are estimated at low resolution, not filtered."""
        return self.caustics.wide_grid()

    @cached_property
    def focused(self) -> PhotonGrid:
        """All caustic photons."""
        return self.caustics.grid()

    @cached_property
    def photons(self) -> PhotonGrid:
        """The smooth photons, which bring all their light to surfaces."""
        if self._this.settings.is_plain:
            return PhotonGrid(self.parts.smooth)
        smooth, keys = copied(self.parts.smooth), self.parts.keys[: len(self.parts.smooth)]
        keep_all_light(self._this, keys, smooth, series=series_of(self._this.settings))
        return PhotonGrid(smooth)

    @cached_property
    def _scattered(self) -> PhotonGrid:
        """What lights the ends of gather rays."""
        scattered, keys = self.parts.scattered(self._this.settings.bounces)
        scattered["radius"] *= _END_KERNEL_SCALE
        scattered["height"] *= _END_KERNEL_SCALE
        return PhotonGrid(scattered, disc_kernels(scattered), partial(finish_at_ends, self._this, keys))

    @cached_property
    def _not_gathered(self) -> tuple[PhotonGrid, PhotonGrid]:
        """Photons whose light gather rays leave out, their kernels measured among them alone: those whose
        kernels are whole, and those whose kernels end at walls."""
        this, rows = self._this, np.flatnonzero(self.parts.not_gathered)
        photons, keys = take(self.parts.smooth, rows), self.parts.keys[rows]
        self._measure(photons, this.packed.widths)
        kernels = disc_kernels(photons)
        end_at_walls(kernels, this.world, this.surfaces)
        at_wall = kernels["front"].any(axis=1)
        whole, ended = (take(photons, np.flatnonzero(some)) for some in (~at_wall, at_wall))
        kernels = kernels[at_wall]
        keep_all_light(this, keys[~at_wall], whole, series=_SERIES)
        keep_all_light(this, keys[at_wall], kernels, series=_SERIES)
        return PhotonGrid(whole), PhotonGrid(ended, kernels)

    def _measure(self, photons: np.ndarray, widths: np.ndarray) -> None:
        """Give kernels of the low resolution their size; widths: as of `measure_radii`."""
        packed, view, settings = self._this.packed, self._this.view, self._this.settings
        pixels = Pixels(settings.subsampling * sample_width(view), view.eye_or_direction)
        measure_radii(photons, packed.diagonal, settings.smoothing, pixels, widths, self._this.threads)
        part_sheets(photons, packed, self._this.world)

    def _gathered(
        self,
        image: Receivers,
        not_gathered: np.ndarray,
        ends: Ends,
    ) -> np.ndarray:
        """Light at points, (n, 16): by rays, and of photons not gathered.

        not_gathered     (n, 16) light of those not gathered
        ends             as of `gather`
        """
        this, points = self._this, image.points
        light, used = no_light(len(points)), np.flatnonzero(points["valid"])  # which may be few
        found = self.gather(image, used, this.settings.gather_rays, ends)
        nearness, covered = np.zeros((2, len(points)), np.float32)
        nearness[used], covered[used] = found.nearness, found.covered
        # Of the rays that met something.
        nearness = ratio_around(points, nearness, covered, image.size, this.threads)
        passes = 1 + this.index
        rays = this.settings.gather_rays
        worth = passes * rays_worth(rays)
        alike, least = filter_radii(image, nearness, rays * passes, worth, this.threads)
        tight = _tightest(least[used] / alike[used])
        times = np.ones(len(points), np.float32)
        if len(tight):
            more = math.ceil(_MORE_ACROSS * math.isqrt(rays)) ** 2
            for mean, new in zip(found, self.gather(image, used[tight], more, ends), strict=True):
                mean[tight] += (new - mean[tight]) * np.float32(more / (rays + more))
            times[used[tight]] += more / rays
        join_light(channels(light), channels(not_gathered), found, used)
        reach = np.maximum(alike * np.sqrt(times) ** _NARROWER, least / np.sqrt(times))
        set_reach(light, points, reach, this.packed.diagonal)
        return light

    def gather(self, image: Receivers, rows: np.ndarray, rays: int, ends: Ends) -> Gather:
        """Return what so many gather rays from each of the receivers `rows`, (m,), of an image find.

        ends  returns the light of RECEIVER points where rays end, (k, 16)
        """
        this, size = self._this, image.size
        packed, settings, threads = this.packed, this.settings, this.threads
        limit = bright_limit(packed, self._this.surfaces, settings)
        found = Gather(
            *(np.zeros((len(rows), *shape), np.float32) for shape in ((3,), (3,), (3,), (3,), (), ()))
        )
        receivers = with_grazing_lobes(take(image.points, rows), this.index)
        densities, guide_rows = self._guide.densities(receivers, square_blocks(size)[rows], threads)
        lifts, keys = clearance(receivers["position"], this.view.eye), rows.astype(np.uint32)
        shifts = even_numbers(size, this.photon_seed, this.index)[rows]
        plan = RayPlan(densities, guide_rows, lifts, keys, shifts, math.isqrt(rays))
        for first in range(0, len(rows), _BATCH // rays):
            some = slice(first, first + _BATCH // rays)
            told = receivers[some], plan.of(some), limit, this.photon_seed, this.index, self.openings
            met = gather_rays(packed, this.world, this.surfaces, *told)
            part = Gather(*(each[some] for each in found))
            shortest = np.minimum(_SHORTEST[0] * packed.diagonal, _SHORTEST[1] * told[0]["footprint"])
            average_rays(met, ends(met.points), shortest, threads, part)
        return found

    def at_ends(self, points: np.ndarray) -> np.ndarray:
        """Return the light of scattered photons where gather rays end, (n, 16); points: (n,) RECEIVER."""
        return self._scattered.estimate(points, self._this.threads)


def _tightest(tightness: np.ndarray) -> np.ndarray:
    """Return which of (n,) receivers get more rays, (m,) rows in order; tightness: the ratio of the filter's
    least radius to the one within which light changes little."""
    tight = np.flatnonzero(tightness > _TIGHT)
    worst = np.argsort(-tightness[tight], kind="stable")[: math.ceil(_TIGHTEST * len(tightness))]
    return np.sort(tight[worst])


def with_grazing_lobes(points: np.ndarray, pass_index: int) -> np.ndarray:
    """Return (n,) RECEIVER as gloss is gathered and summed at, in pass `pass_index`: where the eye's rays
    graze, lobes that gather rays and photons find.

    There a lobe is high and narrow, and reflects most: the few of them in it are specks a hundred times as
    bright as what is around. The lobes shrink to their own width with the passes (Kaplanyan and Dachsbacher,
    Path Space Regularization for Holistic and Robust Light Transport, EG 2013).
    """
    alpha = points["alpha"]
    least = _GRAZING_ALPHA * (1 + pass_index) ** _SHARPER
    cosines = np.einsum("nk,nk->n", points["n"], points["wo"])
    share = np.clip((_STEEP - cosines) / (_STEEP - _GRAZING), 0.0, 1.0)
    wider = (alpha >= NARROW_ALPHA) & (alpha < least) & (share > 0.0)
    if not wider.any():
        return points
    points = copied(points)
    points["alpha"][wider] += share[wider] * (least - alpha[wider])
    return points


def finish_at_ends(this: Pass, keys: np.ndarray, kernels: np.ndarray, rows: np.ndarray) -> None:
    """End kernels of photons that light rays' ends at walls, and give them back what they lose past edges.

    keys     (N,) uint32, of the photons' random numbers
    kernels  (N,) CAUSTIC, those at (n,) uint32 `rows` changed in place
    """
    end_at_walls(kernels, this.world, this.surfaces, rows)
    keep_all_light(this, keys, kernels, rows, solids=True)


def _end_widths(packed: Packed) -> np.ndarray:
    """(I,) float32 m, of instances: as wide as kernels at rays' ends may count them.

    So wide that a sixth of one is on a strip or a square as wide as the object; what falls past its edges is
    given back. Light that rays average may be blurred, and few photons on thin things, each under a small
    kernel, would be fireflies.
    """
    widest = np.minimum(_END_KERNEL_MOST * packed.widths, np.sqrt(packed.widths * packed.lengths))
    return np.asarray(widest / WIDTH_SHARE)


def series_of(settings: Settings) -> int:
    """Return how many series keep the light of smooth photons, see `Draws`: where rays gather, they light
    ends of eye paths alone."""
    return 1 if settings.gather_rays else _SERIES


def keep_all_light(
    this: Pass,
    keys: np.ndarray,
    photons: np.ndarray,
    rows: np.ndarray | None = None,
    *,
    series: int = 1,
    solids: bool = False,
) -> None:
    """Give photons back, in place, what their kernels lose past edges, and within solids; arguments as of
    `keep_light` and `Draws`."""
    draws = Draws(keys, this.photon_seed, this.index, series)
    keep_light(photons, draws, this.world, this.surfaces, solids=solids, rows=rows)


def even_numbers(size: tuple[int, int], seed: int, pass_index: int) -> np.ndarray:
    """Return (h w, 2) float32 in [0, 1), row by row: evenly spread over the pixels of any neighbourhood.

    A lattice along the Morton curve, on which each aligned square is one stretch.
    """
    bits, places = range(max(size).bit_length()), np.arange(max(size))
    spread = np.sum([(places >> bit & 1) << 2 * bit for bit in bits], axis=0)
    along = spread[: size[0]] | spread[: size[1], None] << 1
    start = random4(np.uint32(0), np.uint32(_DIMENSION), np.uint32(pass_index), np.uint32(seed))[:2]
    numbers = np.reshape(along, (-1, 1)) * LATTICE + start
    numbers -= np.floor(numbers)
    return np.asarray(np.minimum(numbers, 1.0 - 2.0**-24), np.float32)


def clearance(position: np.ndarray, eye: np.ndarray) -> np.ndarray:
    """(n,) float32 m by which rays from (n, 3) places start above their surfaces."""
    away, (x, y, z) = position - eye, np.abs(position).T
    distance = np.sqrt(np.einsum("nk,nk->n", away, away))
    return np.asarray(_CLEARANCE * distance + _ROUNDED * np.maximum(np.maximum(x, y), z), np.float32)
