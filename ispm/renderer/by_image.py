"""The light of photons and gather rays at what some pixels show, from an image of few of these points."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from ispm.frame import Receivers
from ispm.optics.incident import channels, no_light
from ispm.optics.records import take
from ispm.paths.ends import image_of_ends, spread_light, without_gaps
from ispm.renderer.gather import PhotonLight
from ispm.renderer.one_pass import Pass
from ispm.stages.filter import filter_estimate, filter_points

_MISSED_SHARE = 1 / 64  # receivers of missed pixels to those of the picture, while blocks can grow; measured


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
    column, row = without_gaps(x // block), without_gaps(y // block)
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
