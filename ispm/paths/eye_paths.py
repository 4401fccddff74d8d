"""Rays from the eye, and what the paths find that continue from their first hits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ispm.accel.rays import HIT
from ispm.accel.records import Scratch
from ispm.optics.records import NO_HIT


@dataclass(frozen=True)
class EyeRays:
    """Rays through the pixels whose paths are wanted.

    origins, directions  (n, 3) float32, unit
    distances  (n,) float32 m to what the pixel shows
    keys       (n,) uint32, of the random numbers
    width      m that a pixel covers at the origin, and more at each m of the path
    slack      shares of the distance: a ray starts so far before what its pixel shows, which lies not farther
               behind than so
    hits       (n,) HIT, what the pixels show; None: it is looked for
    shows_environment  whether one that meets nothing at all shows the scene's environment
    columns    pixels in a row of the picture whose pixels' numbers the keys are: weak lobes of some are left
               to others beside them; 0: all are looked at
    most       paths from a strong lobe; 0: as few as from a weak one
    of_coats   whether paths start from the clear coat of what a pixel shows, else from what is under it
    behind     whether they go straight on behind a blended surface that a pixel shows
    widening   at ends, direct light counts lobes as at least this times as wide as the lobe that led there:
               few paths find a light's image in a second narrow lobe
    """

    origins: np.ndarray
    directions: np.ndarray
    distances: np.ndarray
    keys: np.ndarray
    width: tuple[float, float]
    slack: tuple[float, float] = (1e-4, 1e-3)
    hits: np.ndarray | None = None
    shows_environment: bool = False
    columns: int = 0
    most: int = 4
    widening: float = 1.0
    of_coats: bool = False
    behind: bool = False


@dataclass(frozen=True)
class EyePaths:
    """What the paths found.

    direct, emission  (n, 3) float32 radiance that they bring to each ray; the latter of the environment too
    indirect  (n, 3) float32 likewise, of ends that have been lit and are no longer among these; zeros
    through  (n, 3) float32 share of the background that each sees through glass; mirrors show none of it, and
             where there is an environment, glass shows that
    ends    (m,) PATH_END in the order of the rays; lane: REFLECTED or TRANSMITTED by a smooth surface;
            SCATTERED: by a rough one, or a path's second end
    points  (m,) RECEIVER, the same; footprint: of a pixel
    firsts  (n,) FIRST_VERTEX, instance NO_HIT where the ray met something else
    rays    traced
    """

    direct: np.ndarray
    indirect: np.ndarray
    emission: np.ndarray
    through: np.ndarray
    ends: np.ndarray
    points: np.ndarray
    firsts: np.ndarray
    rays: int


def join_paths(parts: Sequence[EyePaths]) -> EyePaths:
    """Return what several calls found as if the rays of each had come after those of the ones before."""
    if len(parts) == 1:
        return parts[0]
    names = ("direct", "indirect", "emission", "through", "ends", "points", "firsts")
    joined = {name: np.concatenate([getattr(part, name) for part in parts]) for name in names}
    first, row = 0, 0
    for part in parts:
        joined["ends"]["slot"][row : row + len(part.ends)] += np.uint32(first)
        first, row = first + len(part.direct), row + len(part.ends)
    return EyePaths(**joined, rays=sum(part.rays for part in parts))


class RayArrays(NamedTuple):
    """The arrays of EyeRays, for kernels."""

    origins: np.ndarray
    directions: np.ndarray
    distances: np.ndarray
    keys: np.ndarray
    hits: np.ndarray


def ray_arrays(rays: EyeRays) -> RayArrays:
    """Return the arrays of n rays; hits: (n,) HIT, without an instance where they are to be looked for."""
    hits = rays.hits
    if hits is None:
        hits = np.zeros(len(rays.keys), HIT)
        hits["instance"] = NO_HIT
    # parts of arrays in another order would be of another type, and kernels for it be compiled
    origins, directions = np.ascontiguousarray(rays.origins), np.ascontiguousarray(rays.directions)
    return RayArrays(origins, directions, rays.distances, rays.keys, hits)


class EyeOut(NamedTuple):
    """What kernels write: arrays of EyePaths, and by chunks

    ends    (m,) PATH_END_AND_POINT, of which each chunk has an equal part
    counts  (chunks, 2) int64, ends and rays
    """

    direct: np.ndarray
    emission: np.ndarray
    through: np.ndarray
    firsts: np.ndarray
    ends: np.ndarray
    counts: np.ndarray


class EyeThread(NamedTuple):
    """What one thread works with: Scratch, the (1,) float32 that is its surfaces' footprint, see
    `SurfaceTable.own_footprint`, and a number for each light, see `light_of_few`."""

    scratch: Scratch
    footprint: np.ndarray
    values: np.ndarray


class Done(NamedTuple):
    """How far a chunk is: the next free row of the ends, and the number of rays traced."""

    row: np.int64
    traced: np.int64
