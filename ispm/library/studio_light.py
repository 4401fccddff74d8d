"""A photographer's studio as light from all around: softboxes in a pale room, for things without a light.

It is neutral, so that colors are the things' own. Its front is where scenes without a camera are seen from.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

FRONT = math.atan2(0.45, -1.0)
"""Radians from -Z, to +X: where the one stands for whom the studio is set up."""

_HEIGHT = 128  # rows of the image
_EDGE = 0.06  # of tangents: over which a softbox fades, 3 degrees
# cd/m2 of the room, from straight down to straight up, at even steps of the direction's height.
_ROOM = (73.0, 89.0, 125.0, 235.0, 329.0, 387.0, 408.0)


class _Softbox(NamedTuple):
    """A bright rectangle that faces the middle, upright.

    side, elevation  degrees: from the front, to the right as one sees it from there; above the horizon
    width, height    degrees across
    radiance         cd/m2
    """

    side: float
    elevation: float
    width: float
    height: float
    radiance: float


_SOFTBOXES = (
    _Softbox(side=-50.0, elevation=40.0, width=56.0, height=46.0, radiance=3_760.0),  # key
    _Softbox(side=62.0, elevation=18.0, width=44.0, height=62.0, radiance=890.0),  # fill
    _Softbox(side=-142.0, elevation=24.0, width=14.0, height=64.0, radiance=2_300.0),  # rims, behind
    _Softbox(side=145.0, elevation=24.0, width=14.0, height=64.0, radiance=2_300.0),
    _Softbox(side=175.0, elevation=70.0, width=46.0, height=30.0, radiance=940.0),  # overhead
)


def studio_radiance() -> np.ndarray:
    """Return the studio's radiance from all around, (128, 256, 3) float32 cd/m2, all channels alike.

    A surface that faces up gets 3 klx. The image's center column lies along -Z, right of it +X, row 0 on top.
    """
    theta = math.pi * (np.arange(_HEIGHT) + 0.5) / _HEIGHT
    azimuth = math.pi * ((np.arange(2 * _HEIGHT) + 0.5) / _HEIGHT - 1.0)
    x, z = np.outer(np.sin(theta), np.sin(azimuth)), np.outer(np.sin(theta), -np.cos(azimuth))
    directions = np.stack([x, np.broadcast_to(np.cos(theta)[:, None], x.shape), z], axis=-1)
    heights = np.linspace(-1.0, 1.0, len(_ROOM))
    luminance = np.interp(directions[..., 1], heights, _ROOM)
    for softbox in _SOFTBOXES:
        cover = _cover(softbox, directions)
        luminance = luminance * (1.0 - cover) + softbox.radiance * cover
    return np.repeat(luminance[..., None], 3, axis=-1).astype(np.float32)


def _cover(softbox: _Softbox, directions: np.ndarray) -> np.ndarray:
    """(...,) how much of a softbox is seen in (..., 3) directions, 0 to 1; it is less bright at its rim."""
    side, elevation = FRONT - math.radians(softbox.side), math.radians(softbox.elevation)
    flat = math.cos(elevation)
    middle = np.array([flat * math.sin(side), math.sin(elevation), -flat * math.cos(side)])
    right = np.array([math.cos(side), 0.0, math.sin(side)])
    up = np.cross(right, middle) * np.sign(np.cross(right, middle)[1])
    ahead = directions @ middle
    cover = np.where(ahead > 0.0, 1.0, 0.0)
    for axis, across in ((right, softbox.width), (up, softbox.height)):
        half = math.tan(math.radians(across) / 2.0)
        place = np.abs(directions @ axis) / np.maximum(ahead, 1e-6)
        cover = (
            cover * _smooth((half - place) / _EDGE + 0.5) * (1.0 - 0.3 * np.minimum(place / half, 1.0) ** 2)
        )
    return np.asarray(cover)


def _smooth(t: np.ndarray) -> np.ndarray:
    """0 below 0, 1 above 1, and in between without an edge."""
    t = np.clip(t, 0.0, 1.0)
    return np.asarray(t * t * (3.0 - 2.0 * t))
