"""The ways of a few photons of a map, found again: the map does not keep them, and any walk repeats."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ispm.photons.steps import STEP
from ispm.photons.walk import EVENT_STEP, PART_BIT

_ROUNDED = 1e-5  # of coordinates: steps are written by other machine code, whose sums may round otherwise
_MOST_SPECULARS = 256  # events; roulette lets one photon in 10^11 live for more


def retrace(
    emitted: np.ndarray,
    photons: np.ndarray,
    keys: np.ndarray,
    follow: Callable[[np.ndarray], np.ndarray],
) -> list[np.ndarray]:
    """Return the way of each photon, (n,) STEP from the light to where it is stored; empty where it is not of
    such a walk.

    emitted  (N,) EMITTED, all that were followed
    photons  (m,) PHOTON that `walk` stored, and their keys, (m,) uint32
    follow   returns what some of the emitted ones meet: `all_steps` with what that walk was given
    """
    steps = follow(emitted[_parents(emitted["key"], photons["bounce"], keys)])
    return [_way(steps, photon, key) for photon, key in zip(photons, keys, strict=True)]


def _parents(emitted: np.ndarray, scatters: np.ndarray, keys: np.ndarray) -> np.ndarray:
    """Rows of the emitted photons, by their keys, that can have been stored after so many scatters under
    these keys: few more than there are keys."""
    events = scatters[:, None] + np.arange(_MOST_SPECULARS, dtype=np.uint32)
    own = (keys[:, None] - events * np.uint32(EVENT_STEP)) & np.uint32((1 << PART_BIT) - 1)
    return np.flatnonzero(np.isin(emitted, own))


def _way(steps: np.ndarray, photon: np.void, key: np.uint32) -> np.ndarray:
    """The steps, out of those of many photons, that end where one is stored."""
    stored = np.flatnonzero((steps["key"] == key) & (steps["number"] > 1))
    off = np.abs(steps["position"][stored] - photon["position"]).max(axis=1)
    if not len(stored) or off.min() > _ROUNDED * np.abs(photon["position"]).max():
        return np.zeros(0, STEP)
    last = stored[off.argmin()]
    return steps[last - steps["number"][last] : last + 1]
