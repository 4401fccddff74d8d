"""Where light changes: a few photons of fixed random numbers, traced before and after.

Where nothing changed, both sets are the same to the bit, and their noise with them.
"""

from __future__ import annotations

import numpy as np

from ispm.frame import Receivers
from ispm.optics.records import RECEIVER

SIDE = 3  # receivers on a side of a block that one stands for
_GAIN = 2.0  # of the share; noise of the probes makes it too small where light moves by little
_ANYWHERE = 0.05  # share of the mean over the picture
AT_ONCE = np.float32(5.0)  # of the share, where light changes all at once, and
_AT_ONCE_MOST = np.float32(0.5)  # the most that it is made by this


def coarse(image: Receivers) -> Receivers:
    """Return an image of one receiver in SIDE x SIDE: that in the middle, or another if it sees nothing."""
    width, height = image.size
    columns, rows = -(-width // SIDE), -(-height // SIDE)
    numbers = np.full((rows * SIDE, columns * SIDE), -1)
    numbers[:height, :width] = np.arange(width * height).reshape(height, width)
    blocks = numbers.reshape(rows, SIDE, columns, SIDE).swapaxes(1, 2).reshape(rows * columns, SIDE * SIDE)
    middle = SIDE * SIDE // 2
    blocks = np.roll(blocks, -middle, axis=1)
    points = np.zeros(blocks.shape, RECEIVER)
    points[blocks >= 0] = image.points[blocks[blocks >= 0]]
    chosen = points[np.arange(len(points)), (points["valid"] > 0).argmax(axis=1)]
    chosen["footprint"] *= SIDE
    return Receivers(chosen, (columns, rows))


def changed_share(
    before: np.ndarray, now: np.ndarray, size: tuple[int, int], fine: tuple[int, int]
) -> np.ndarray:
    """Return the share of light in [0, 1] that is not what it was, at the receivers of an image, (h w,).

    before, now  (n, 3) irradiance at the receivers of the `coarse` image of `size`; fine: the image's
    Both are averaged over 3 x 3 of them, and with a little of what they are everywhere, which counts where no
    probe came; the channel that changes most counts.
    """
    width, height = size
    change = np.abs(now - before).max(axis=1).reshape(height, width)
    most = np.maximum(now, before).max(axis=1).reshape(height, width)
    changes = _blurred(change) + _ANYWHERE * change.mean()
    lights = _blurred(most) + _ANYWHERE * most.mean()
    share = np.clip(_GAIN * changes / np.maximum(lights, 1e-30), 0.0, 1.0).astype(np.float32)
    spread = share.repeat(SIDE, axis=0).repeat(SIDE, axis=1)
    return np.ascontiguousarray(spread[: fine[1], : fine[0]]).reshape(-1)


def taken_at_once(changed: np.ndarray) -> np.ndarray:
    """Return the shares by which history gives way where light has changed all at once, (n,) float32.

    After one event nothing changes any more: of a twentieth of the light nine tenths would stay for seconds.
    Where much has changed, more would be noise.
    """
    return np.asarray(np.maximum(changed, np.minimum(AT_ONCE * changed, _AT_ONCE_MOST)))


def _blurred(image: np.ndarray) -> np.ndarray:
    """The mean over 3 x 3."""
    padded = np.pad(image, 1, mode="edge")
    rows = padded[:-2] + padded[1:-1] + padded[2:]
    return np.asarray((rows[:, :-2] + rows[:, 1:-1] + rows[:, 2:]) / 9.0)
