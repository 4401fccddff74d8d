"""Which photons take which way to the picture: filtered, at low resolution, or drawn sharp."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ispm.scene.packed import Packed
from ispm.settings import Settings
from ispm.stages.camera import CameraView
from ispm.tracer.density import CAUSTIC_NEIGHBORS, FOCUSED_NEIGHBORS, is_crowded, measure_caustic_radii

_SHARP = 3.0  # low-resolution pixels: kernels of a larger radius lose nothing at low resolution


@dataclass(frozen=True, eq=False)
class PhotonParts:
    """The photons, and views of their parts.

    photons  (M,) PHOTON, smooth ones first, then the rest
    smooth   to be estimated and filtered at low resolution; their kernels are not measured yet
    wide     of caustics, to be estimated at low resolution, but not filtered
    sharp    of caustics, to be drawn at full resolution
    straight  (len(smooth),) bool, whether gather rays do not find their light
    """

    photons: np.ndarray
    smooth: np.ndarray
    wide: np.ndarray
    sharp: np.ndarray
    straight: np.ndarray

    def scattered(self, bounces: int) -> np.ndarray:
        """Return copies of those that have scattered, but less than `bounces` times."""
        count = self.photons["bounce"]
        return self.photons[(count > 0) & (count < bounces)]

    @property
    def caustic(self) -> np.ndarray:
        """The wide and the sharp ones."""
        return self.photons[len(self.smooth) :]


def part_photons(
    photons: np.ndarray,
    focused: np.ndarray,
    straight: np.ndarray,
    packed: Packed,
    view: CameraView,
    settings: Settings,
    threads: int,
) -> PhotonParts:
    """Find the caustics among photons, and measure their kernels.

    focused, straight  (M,) as in a Walk
    Light that has scattered before it was focused makes a caustic where its photons crowd; elsewhere, as in
    a plane mirror's reflection of a room, it is as smooth as before.
    The hint's kernels are as narrow as caustics need: with them all photons are smooth.
    """
    if settings.kernel == "hint":
        return PhotonParts(photons, photons, photons[:0], photons[:0], straight)
    first = photons["bounce"] == 0
    later = np.flatnonzero(focused & ~first)
    later = later[is_crowded(photons[later], packed.diagonal)]  # of copies: radii stay as they are
    pixel = sample_width(view)

    def measured(part: np.ndarray, neighbors: int) -> np.ndarray:
        measure_caustic_radii(
            part, packed.diagonal, settings.smoothing, pixel, packed.widths, view.eye_or_direction,
            neighbors, threads, part["radius"].copy(),
        )  # fmt: skip
        return part

    caustic = np.concatenate(
        [measured(photons[first], CAUSTIC_NEIGHBORS), measured(photons[later], FOCUSED_NEIGHBORS)]
    )
    least = _SHARP * settings.subsampling * view.footprint * view.clip_from_world[3]
    wide = caustic["radius"] > caustic["position"] @ least[:3] + least[3]
    smooth = ~first
    smooth[later] = False
    return _joined(photons[smooth], caustic[wide], caustic[~wide], straight[smooth])


def sample_width(view: CameraView) -> np.ndarray:
    """Return the (4,) plane whose value at (x, y, z, 1) is how far apart in m the samples of a picture are.

    One pass: a pixel; those of n passes lie sqrt(n) times as close. Light of narrower kernels falls between.
    """
    return np.asarray(view.footprint * view.clip_from_world[3] / math.sqrt(1 + view.pass_index))


def _joined(smooth: np.ndarray, wide: np.ndarray, sharp: np.ndarray, straight: np.ndarray) -> PhotonParts:
    photons = np.concatenate([smooth, wide, sharp])
    smooth, wide, sharp = np.split(photons, [len(smooth), len(smooth) + len(wide)])
    return PhotonParts(photons, smooth, wide, sharp, straight)
