"""Which photons take which way to the picture: filtered, at low resolution, or drawn sharp."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ispm.optics.records import CAUSTIC, take
from ispm.photons.apriori import class_radii, hint_radii
from ispm.photons.cells import SMALLEST, sort_by_cell
from ispm.photons.coverage import Draws, keep_light
from ispm.photons.density import (
    CAUSTIC_NEIGHBORS,
    FOCUSED_NEIGHBORS,
    Pixels,
    is_crowded,
    measure_caustic_radii,
)
from ispm.photons.even import room_to_widen
from ispm.photons.footprint import overlap_of, shape_kernels
from ispm.photons.grid import PhotonGrid
from ispm.photons.images import with_images
from ispm.photons.walk import Walk
from ispm.photons.walls import end_at_walls
from ispm.renderer.one_pass import Pass
from ispm.scene.packed import Packed
from ispm.settings import Settings
from ispm.stages.camera import CameraView

_SHARP = 3.0  # low-resolution pixels: kernels that are wider to each side lose nothing at low resolution


@dataclass(frozen=True, eq=False)
class Caustics:
    """The photons of caustics, each with a kernel of its own.

    photons  (C,) PHOTON;  kernels  (C,) CAUSTIC
    wide     how many of them, the first ones, are estimated at low resolution, but not filtered; the others
             are sharp, and drawn at full resolution
    """

    photons: np.ndarray
    kernels: np.ndarray
    wide: int

    @property
    def sharp_kernels(self) -> np.ndarray:
        """CAUSTIC, of the sharp ones and of their images."""
        return with_images(self.kernels[self.wide :])[0]

    def seen_in(self, view: CameraView, settings: Settings) -> Caustics:
        """Return the same as another view sees them: close to the eye, what was sharp is wide."""
        is_wide = _is_wide(self.kernels, view, settings)
        order = np.concatenate([np.flatnonzero(is_wide), np.flatnonzero(~is_wide)])
        return Caustics(take(self.photons, order), take(self.kernels, order), int(is_wide.sum()))

    def grid(self) -> PhotonGrid:
        """Return all of them for points anywhere."""
        return _grid(self.photons, self.kernels)

    def wide_grid(self) -> PhotonGrid:
        """Return the wide ones."""
        return _grid(self.photons[: self.wide], self.kernels[: self.wide])

    def each(self, receiver: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return those that light a point, (m,) rows, and what each brings, as of `PhotonGrid.each`."""
        _, images = with_images(self.kernels)
        found, brought = self.grid().each(receiver)
        rows, places = np.unique(
            np.concatenate([np.arange(len(self.kernels)), images])[found], return_inverse=True
        )
        both = np.zeros((len(rows), 3), np.float32)
        np.add.at(both, places, brought)
        return rows, both


def _grid(photons: np.ndarray, kernels: np.ndarray) -> PhotonGrid:
    """A grid of (n,) PHOTON with (n,) CAUSTIC, and of their images."""
    kernels, images = with_images(kernels)
    photons = np.concatenate([photons, take(photons, images)])
    photons["position"] = kernels["position"]
    return PhotonGrid(photons, kernels)


def _is_wide(kernels: np.ndarray, view: CameraView, settings: Settings) -> np.ndarray:
    """(C,) bool, whether a view sees (C,) CAUSTIC so wide that they lose nothing at low resolution."""
    *slope, offset = _SHARP * settings.subsampling * view.footprint * view.clip_from_world[3]
    wide = np.linalg.norm(kernels["v"], axis=1) > kernels["position"] @ slope + offset
    return np.asarray(wide)


@dataclass(frozen=True, eq=False)
class PhotonClasses:
    """The photons, and views of their parts.

    photons  (M,) PHOTON, smooth ones first, then those of caustics
    smooth   to be estimated and filtered at low resolution; their kernels are not measured yet
    not_gathered  (len(smooth),) bool, whether gather rays do not find their light
    keys      (M,) uint32 of the photons, see `Walk`
    """

    photons: np.ndarray
    smooth: np.ndarray
    caustics: Caustics
    not_gathered: np.ndarray
    keys: np.ndarray

    def scattered(self, bounces: int) -> tuple[np.ndarray, np.ndarray]:
        """Return copies of those that have scattered, but less than `bounces` times, and their keys."""
        count = self.photons["bounce"]
        rows = np.flatnonzero((count > 0) & (count < bounces))
        return take(self.photons, rows), self.keys[rows]


def classify_photons(this: Pass, path: Walk) -> PhotonClasses:
    """Find the caustics among a walk's photons, and measure their kernels.

    Light that has scattered before it was focused makes a caustic where its photons crowd; elsewhere, as in
    a plane mirror's reflection of a room, it is as smooth as before.
    Plain kernels (`Settings.is_plain`) are sized by the path, caustics included: all photons count as smooth.
    """
    packed, view, settings, threads = this.packed, this.view, this.settings, this.threads
    photons, not_gathered = path.photons, path.not_gathered
    if settings.is_plain:
        _measure_plain(path, packed, settings)
        none = Caustics(photons[:0], np.zeros(0, CAUSTIC), 0)
        return PhotonClasses(photons, photons, none, not_gathered, path.keys)
    first = photons["bounce"] == 0
    later = np.flatnonzero(path.focused & ~first)
    later = later[is_crowded(take(photons, later), packed.diagonal, threads)]
    pixels = Pixels(sample_width(view), view.eye_or_direction)

    def measured(part: np.ndarray, neighbors: int) -> np.ndarray:
        sizes = packed.diagonal, settings.smoothing, pixels, packed.widths
        measure_caustic_radii(part, *sizes, neighbors, threads, clear=part["radius"].copy())
        return part

    caustic = np.concatenate(
        [measured(photons[first], CAUSTIC_NEIGHBORS), measured(photons[later], FOCUSED_NEIGHBORS)]
    )
    is_smooth = ~first
    is_smooth[later] = False
    beams, clear = path.beams, photons["radius"][first]  # until measured, the room before the plane they left
    if settings.kernel == "measured":
        beams, clear = beams[:0], clear[:0]
    of_area = path.of_area[first][: len(beams)]  # they lie at random, and have wide beams
    room = room_to_widen(caustic[: len(beams)], beams, ~of_area, packed.diagonal, this.index, threads)
    sizes = packed.diagonal, settings.smoothing, pixels
    kernels = shape_kernels(caustic, beams, clear, *sizes, room, overlap_of(of_area, this.index))
    # Lobes that leave scattered light to eye paths leave that of lamps to them, too, which such paths meet.
    kernels["bounce"][: np.count_nonzero(first)] = path.of_area[first]
    keys = np.concatenate([path.keys[first], path.keys[later]])
    is_wide = _is_wide(kernels, view, settings)
    end_at_walls(kernels, this.world, this.surfaces)
    keep_light(kernels, Draws(keys, this.photon_seed, this.index), this.world, this.surfaces)
    kernels = np.concatenate([kernels[is_wide], kernels[~is_wide]])
    low, _ = packed.bounds
    _, order = sort_by_cell(photons, low, SMALLEST * packed.diagonal)
    order = order[is_smooth[order]]
    keys = np.concatenate([path.keys[order], keys[is_wide], keys[~is_wide]])
    photons = np.concatenate([take(photons, order), caustic[is_wide], caustic[~is_wide]])
    smooth, caustic = np.split(photons, [len(order)])
    caustics = Caustics(caustic, kernels, int(np.count_nonzero(is_wide)))
    return PhotonClasses(photons, smooth, caustics, not_gathered[order], keys)


def _measure_plain(path: Walk, packed: Packed, settings: Settings) -> None:
    """Write the kernels that paths alone tell."""
    if settings.kernel == "hint":
        hint_radii(path.photons, packed.diagonal, settings.photons, settings.smoothing)
    else:
        class_radii(path.photons, path.beams, packed.surface_area(), packed.diagonal, settings.smoothing)


def sample_width(view: CameraView) -> np.ndarray:
    """Return the (4,) plane whose value at (x, y, z, 1) is how far apart in m the samples of a picture are.

    One pass: a pixel; those of n passes lie sqrt(n) times as close. Light of narrower kernels falls between.
    """
    return np.asarray(view.footprint * view.clip_from_world[3] / math.sqrt(1 + view.pass_index))
