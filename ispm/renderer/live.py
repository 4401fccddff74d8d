"""The live frame: light that goes on from the frame before, docs/method.md, Live.

A frame gathers at a quarter of the receivers, and at those whose light is new or has changed; the others keep
the mean of the frames before, which moves with what they show. Few photons do, for their noise does not last.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace

import numpy as np

from ispm.estimators import Estimator
from ispm.frame import Receivers
from ispm.lights.environment_emission import environment_flux
from ispm.lights.openings import Openings
from ispm.lights.plan import plan_maps
from ispm.lights.surface_emission import emissive_flux
from ispm.live.blend import HISTORY, blend, effective_frames, light_of, no_history, words
from ispm.live.cache import CELL, WorldCache
from ispm.live.change import AT_ONCE, SIDE, changed_share, coarse, taken_at_once
from ispm.live.reproject import Seen, moves, reproject, seen
from ispm.optics.incident import channels, no_light
from ispm.optics.records import take
from ispm.optics.rng import pcg4d
from ispm.photons.density import Pixels, measure_radii
from ispm.photons.grid import PhotonGrid
from ispm.renderer.caustics import Caustics, PhotonClasses, classify_photons, sample_width
from ispm.renderer.converge import shrunk
from ispm.renderer.gather import Ends, PhotonLight, filter_radii, rays_worth
from ispm.renderer.light import EmissionPlan, Traced, aims_by_view, trace_photons
from ispm.renderer.one_pass import Pass
from ispm.scene.packed_instance import Placed
from ispm.settings import Settings
from ispm.stages.camera import CameraView
from ispm.stages.lattice import DENSITY, set_reach

_PROBES = 3000  # photons that tell where light changes; of 1000 few find a way through a door
_PROBES_LEAST = 16  # of a light
_PROBE_SEED = 7  # any, as long as it stays
_PROBE_SMOOTHING = 2.0  # factor on the width of their kernels
_PATTERN = 4  # receivers on a side of the blocks that are gathered in turn
_TURNS = (0, 3, 1, 2)  # in which the four blocks of a square are
_FEW = 4.0  # frames, of fewer receivers are gathered each time
_MORE, _NEW = 4, 1 / 8  # times as many rays from receivers of which nothing is known, if few of all are new
_SERVED = 4  # frames that photons serve while only the camera moves, until all receivers had their turn
_CHANGED = 0.15  # share of light that has changed, above which they are
_SUDDEN = 3.0  # times the share that changed lately: light that changes so changes all at once
_LATELY = 0.2  # of what changed lately, the last frame's part
_FORGET = 3.0  # share of what the world's cache knows that is forgotten, over the mean share that has changed
_NARROWEST = 16.0  # frames, of more the filter that hides their noise gets no narrower
_STORED = 24_000  # photons that a frame emits enough for; of 16,000 a third more error, of 40,000 slower
_EMITTED_LEAST = 1000
_BATCHES = 8  # frames whose caustics are shown together while nothing but the camera moves
_CAUSTIC_PHOTONS = 40_000  # of all of these, if more than one
_END_CELLS = 1.0  # reach of the filter over what mirrors show, in cells of the cache


@dataclass(frozen=True, eq=False)
class _Before:
    """The frame before: its instances, and its receivers with their HISTORY."""

    placed: Placed
    seen: Seen


class History:
    """What live frames hand on to the next.

    number  of the frame, from 0; with the seed it selects the random numbers
    draws   of random numbers by caches so far
    traced  photons of a frame before that light the next one too; None: it traces its own
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget all: the next frame is as a renderer's first."""
        self.number, self.draws = -1, 0
        self.traced: Traced | None = None
        self._light: LiveLight | None = None
        self._served = 0
        self._before: _Before | None = None
        self._probes: np.ndarray | None = None
        self._caches: tuple[WorldCache, ...] = ()
        self._changes = False
        self._usual = 0.0  # share of the light that changes from frame to frame
        self._caustics: list[Caustics] = []
        self._photons: int | None = None  # to be emitted
        self._most = 0

    def begin(self, this: Pass, changes: bool, antialias: bool) -> Pass:
        """Return the pass with the random numbers of the next frame.

        changes    whether anything but the camera may have changed since the frame before
        antialias  whether its edges are supersampled
        """
        self.number += 1
        width = CELL * this.packed.diagonal
        if not self._caches or not 0.5 < self._caches[0].width / width < 2.0:
            self._caches = WorldCache(width), WorldCache(width)
        self._changes, self._most = changes, this.settings.photons
        if changes:
            self._caustics = []
        if changes or self._served == _SERVED or aims_by_view(this.packed):
            self.traced = self._light = None
        settings = this.settings.replace(photons=self._photons or this.settings.photons, antialias=antialias)
        key, _, _, _ = pcg4d(
            np.uint32(self.number), np.uint32(0), np.uint32(0), np.uint32(this.settings.seed)
        )
        return replace(this, settings=settings, photon_seed=int(key) if self.number else this.photon_seed)

    def light(self, this: Pass, traced: Traced) -> LiveLight:
        """Return what lights the frame: its photons, and what is kept."""
        path = traced.path
        if self._light and traced is self.traced:
            self._served += 1
            self._light = self._light.seen_in(this)
            return self._light
        self.traced, self._served = traced, 1
        if len(path.photons):
            wanted = path.photon_count * _STORED / len(path.photons)
            self._photons = int(np.clip(wanted, min(_EMITTED_LEAST, self._most), self._most))
        # Kernels of caustics get narrower as those of passes do, since the frames' mean is shown.
        smoothing = this.settings.smoothing * shrunk(len(self._caustics))
        narrow = replace(this, settings=this.settings.replace(smoothing=smoothing))
        parts, openings = classify_photons(narrow, path), traced.plan.openings
        self._light = LiveLight(this, parts, openings, self, *self._caches)
        return self._light

    def caustics(self, this: Pass, new: Caustics) -> Caustics:
        """Return those of the frames since the world last changed, whose mean is shown."""
        self._caustics = [*self._caustics, new][-_BATCHES:]
        while (
            len(self._caustics) > 1 and sum(len(each.kernels) for each in self._caustics) > _CAUSTIC_PHOTONS
        ):
            del self._caustics[0]
        return _mean_caustics(self._caustics, this.view, this.settings)

    def recall(self, this: Pass, image: Receivers) -> np.ndarray:
        """Return what is known of light at the receivers, (n,) HISTORY."""
        if self._before is None:
            return no_history(len(image.points))
        moved = moves(this.packed.placed, self._before.placed)
        found = reproject(image.points, moved, self._before.seen, this.threads)
        return np.asarray(found.view(HISTORY)[:, 0])

    def remember(self, this: Pass, image: Receivers, history: np.ndarray) -> None:
        """Keep what is known at the receivers for the next frame."""
        block = this.settings.subsampling
        self._before = _Before(this.packed.placed, seen(image, this.view, block, words(history)))

    def changed(self, this: Pass, image: Receivers) -> np.ndarray:
        """Return the share of light at the receivers that is not what it was, (n,) float32 in [0, 1]."""
        none = np.zeros(len(image.points), np.float32)
        if not self._changes:
            return none
        before, self._probes = self._probes, _trace_probes(this)
        if before is None:
            return none
        few = coarse(image)
        old, new = (_probe_light(this, few, photons) for photons in (before, self._probes))
        changed = changed_share(old, new, few.size, image.size)
        valid = image.points["valid"] > 0
        much = float(changed[valid].mean()) if valid.any() else 1.0
        is_sudden = much > _SUDDEN * self._usual
        self._usual += _LATELY * (much - self._usual)
        if is_sudden:
            changed, much = taken_at_once(changed), float(AT_ONCE) * much
        for cache in self._caches:
            cache.change(min(_FORGET * much, 1.0))
        return changed

    def sampled(self, image: Receivers, history: np.ndarray, changed: np.ndarray) -> np.ndarray:
        """Return the receivers that gather in this frame, (m,) rows."""
        width, height = image.size
        x, y = np.arange(width) // _PATTERN, np.arange(height)[:, None] // _PATTERN
        turn = (x % 2 + 2 * (y % 2) == _TURNS[self.number % len(_TURNS)]).reshape(-1)
        wanted = turn | (history["frames"] < _FEW) | (changed > _CHANGED)
        return np.flatnonzero(wanted & (image.points["valid"] > 0))


class LiveLight(PhotonLight):
    """The light of a live frame: at its receivers with what is known of frames before, elsewhere from caches.

    ends   of what lights the ends of gather rays, without what these find themselves
    whole  of all smooth photons, for what mirrors and glass show
    """

    def __init__(
        self,
        this: Pass,
        parts: PhotonClasses,
        openings: Openings,
        history: History,
        ends: WorldCache,
        whole: WorldCache,
    ) -> None:
        super().__init__(this, parts, openings)
        self._history, self._ends, self._whole = history, ends, whole
        self._batch = history.number
        self.caustics = history.caustics(this, parts.caustics)

    def seen_in(self, this: Pass) -> LiveLight:
        """Return the light of the same photons in another frame."""
        other = copy(self)
        other.__dict__.pop("wide", None)  # a cached property, of the caustics that the other view saw
        other._this, other.caustics = this, self.caustics.seen_in(this.view, this.settings)
        return other

    def at(self, receivers: Receivers, estimator: Estimator | None = None) -> np.ndarray:
        if not len(self.parts.smooth) and estimator is None:
            return no_light(len(receivers.points))
        return self._cached(receivers) if estimator is None else self._accumulated(receivers)

    def at_missed(self, receivers: Receivers) -> np.ndarray:
        points = receivers.points
        if not len(self.parts.smooth):
            return no_light(len(points))
        if not self._this.settings.gather_rays:
            return self.sum_at(points, self.photons)
        others = self.not_gathered_at(points)
        return self._gathered(receivers, others, self._at_ends)

    def _accumulated(self, image: Receivers) -> np.ndarray:
        """Light at the picture's receivers, (n, 16)."""
        this, kept = self._this, self._history
        history = kept.recall(this, image)
        changed = kept.changed(this, image)
        rows = kept.sampled(image, history, changed)
        new = np.flatnonzero(history["frames"][rows] == 0.0)
        few = len(new) < _NEW * len(image.points)
        more = _MORE if few and self._this.settings.gather_rays and len(self.parts.smooth) else 1
        light, near = self._estimated(image, rows, new, more)
        worth = np.ones(len(rows), np.float32)
        worth[new] = more
        blend(history, rows, light, near, worth, changed)
        kept.remember(this, image, history)
        frames, light = effective_frames(history), light_of(history)
        if this.settings.gather_rays:
            rays, nearness = this.settings.gather_rays, np.ascontiguousarray(history["nearness"])
            passes = np.minimum(frames, _NARROWEST) * rays_worth(rays)
            reach = np.maximum(*filter_radii(image, nearness, rays * frames, passes, this.threads))
            set_reach(light, image.points, reach, this.packed.diagonal)
        else:
            light[:, DENSITY] *= frames
        return light

    def _estimated(
        self, image: Receivers, rows: np.ndarray, new: np.ndarray, more: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """This frame's light at some receivers, (m, 16), and the nearness of what is around them, (m,).

        new   those of the m that get `more` times as many rays
        """
        points = take(image.points, rows)
        if not len(self.parts.smooth):
            return no_light(len(rows)), np.zeros(len(rows), np.float32)
        if not self._this.settings.gather_rays:
            return self.sum_at(points, self.photons), np.zeros(len(rows), np.float32)
        light, others = no_light(len(rows)), self.not_gathered_at(points)
        nearness, rays = np.zeros(len(rows), np.float32), self._this.settings.gather_rays
        is_old = np.ones(len(rows), bool)
        is_old[new] = False
        for some, count in ((np.flatnonzero(is_old), rays), (new, more * rays)):
            found = self.gather(image, rows[some], count, self._at_ends)
            nearness[some] = found.nearness
            for name in ("irradiance", "fresnel", "gloss", "grazing"):
                channels(light)[name][some] = getattr(found, name) + channels(others)[name][some]
        return light, nearness

    def _at_ends(self, points: np.ndarray) -> np.ndarray:
        """Light where gather rays end."""
        return self._ask(self._ends, points, self.at_ends)

    def _cached(self, image: Receivers) -> np.ndarray:
        """Light at points that mirrors and glass show, (n, 16)."""
        points = image.points
        light = self._ask(self._whole, points, lambda some: self.sum_at(some, self.photons))
        reach = np.full(len(points), _END_CELLS * self._whole.width, np.float32)
        set_reach(light, points, reach, self._this.packed.diagonal)
        return light

    def _ask(self, cache: WorldCache, points: np.ndarray, estimate: Ends) -> np.ndarray:
        """Light at RECEIVER points by a cache, with random numbers that no other call has."""
        self._history.draws += 1
        return cache.light(points, estimate, self._batch, self._history.draws)


def _mean_caustics(batches: Sequence[Caustics], view: CameraView, settings: Settings) -> Caustics:
    """Return the photons of several frames as those of one that a view sees, each with its share of their
    flux."""
    photons = np.concatenate([each.photons for each in batches])
    kernels = np.concatenate([each.kernels for each in batches])
    for records in (photons, kernels):
        records["flux"] *= np.float32(1.0 / len(batches))
    return Caustics(photons, kernels, 0).seen_in(view, settings)


def _trace_probes(this: Pass) -> np.ndarray:
    """Return the probes' photons, PHOTON: of each light as many, whatever the others do. All surfaces that
    glow are as one light, and the environment is one."""
    packed, count = this.packed, len(this.packed.lights)
    glow, surround = emissive_flux(packed, this.surfaces) > 0.0, environment_flux(packed) > 0.0
    each = max(_PROBES >> max(count + glow + surround - 1, 0).bit_length(), _PROBES_LEAST)
    # None are aimed at what casts caustics: where that moves, all photons of such lights would differ.
    settings = this.settings.replace(gather=0, caustic_photons=0.0)
    maps = plan_maps(packed, np.full(count, each, np.int64), 0.0, _PROBE_SEED, 0)
    plan = EmissionPlan(maps, "rays", surfaces=each * glow, surround=each * surround)
    return trace_photons(replace(this, settings=settings, photon_seed=_PROBE_SEED), plan, []).path.photons


def _probe_light(this: Pass, image: Receivers, photons: np.ndarray) -> np.ndarray:
    """(n, 3) irradiance of probes at the receivers of a coarse image."""
    if not len(photons):
        return np.zeros((len(image.points), 3), np.float32)
    photons = photons.copy()
    pixels = Pixels(SIDE * this.settings.subsampling * sample_width(this.view), this.view.eye_or_direction)
    measure_radii(photons, this.packed.diagonal, _PROBE_SMOOTHING, pixels, threads=this.threads)
    return np.asarray(PhotonGrid(photons).estimate(image.points, this.threads)[:, :3])
