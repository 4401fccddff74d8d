"""Temporal accumulation: this frame's estimate joins the mean of those before."""

from __future__ import annotations

import numpy as np

from ispm.optics.incident import CHANNELS, INCIDENT

# Light that is not filtered, as accumulated; what follows tells how good it is.
HISTORY = np.dtype(
    [
        *((name, *INCIDENT.fields[name][:1]) for name in INCIDENT.names),  # type: ignore[union-attr,index]  # of a record
        ("nearness", np.float32),  # 1/m, mean inverse length of gather rays
        ("frames", np.float32),  # whose mean it is; 0: nothing is known
        ("variance", np.float32),  # of the mean, that of one frame's estimate being 1
        ("spare", np.float32),
    ]
)
WORDS = HISTORY.itemsize // 4
_LEAST_SHARE = np.float32(0.05)  # of a new estimate; .03 lags behind what moves, .1 has more noise
_MOST_FRAMES = 64.0  # that a mean can be worth: neighbors' noise is not independent


def no_history(count: int) -> np.ndarray:
    """Return (count,) HISTORY of which nothing is known."""
    return np.zeros(count, HISTORY)


def words(history: np.ndarray) -> np.ndarray:
    """Return (n,) HISTORY as (n, 20) float32, the same memory."""
    return history.view(np.float32).reshape(-1, WORDS)


def light_of(history: np.ndarray) -> np.ndarray:
    """Return its (n, 16) light, a copy, as estimators give it."""
    return np.ascontiguousarray(words(history)[:, :CHANNELS])


def blend(
    history: np.ndarray,
    rows: np.ndarray,
    light: np.ndarray,
    nearness: np.ndarray,
    worth: np.ndarray,
    changed: np.ndarray,
) -> None:
    """Add new estimates to (n,) HISTORY, in place.

    rows      (m,) those that have one;  light, nearness  (m, 16) and (m,) of these
    worth     (m,) frames' estimates that each is worth
    changed   (n,) share of the light that is not what it was, in [0, 1]
    With the share a of a new estimate in the mean of n frames, max(w / (n + w), .05) or more where light
    changed, n becomes w / a and the variance (1 - a)^2 v + a^2 / w. Those without one only forget.
    """
    known = history["frames"] > 0.0
    frames = np.maximum(history["frames"], np.float32(1e-6))
    history["frames"] = np.where(known, 1.0 / np.maximum(1.0 / frames, changed), 0.0)
    share = np.maximum(worth / (frames[rows] + worth), _LEAST_SHARE)
    share += changed[rows] * (1.0 - share)
    share = np.where(known[rows], share, np.float32(1.0)).astype(np.float32)
    some = history[rows]
    values, new = words(some), np.concatenate([light, nearness[:, None]], axis=1)
    values[:, : CHANNELS + 1] += share[:, None] * (new - values[:, : CHANNELS + 1])
    some["variance"] = np.where(known[rows], (1.0 - share) ** 2 * some["variance"], 0.0)
    some["variance"] += share**2 / worth
    some["frames"] = worth / share
    history[rows] = some


def effective_frames(history: np.ndarray) -> np.ndarray:
    """Return how many frames' estimates each mean is worth, (n,) float32, from 1."""
    least = np.float32(1.0 / _MOST_FRAMES)
    return np.asarray(1.0 / np.clip(history["variance"], least, 1.0), np.float32)
