"""Rays from the eye, and what the paths find that continue from their first hits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ispm.accel.rays import HIT
from ispm.accel.records import Scratch
from ispm.optics.records import NO_HIT, RECEIVER, join
from ispm.paths.vertices import COLUMNS, DIRECT, EMISSION, FIRST_VERTEX, INDIRECT, PATH_END, THROUGH

LAMP_SAMPLES = 4  # draws from lamps with a surface and from the environment that light the ends of a pixel


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
    by_image   whether ends that lie side by side, as those that mirrors and clear glass show, are left
               without the direct light that their Lambert lobe has of lamps with a surface and of the
               environment: an image of them brings it
    within     the row of the instance whose solid the eye is in; NO_HIT: none
    draws      points of lamps with a surface, and directions of the environment, that light an end; one
               does where a narrow lobe or rough glass leads to it, of which several paths go out
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
    by_image: bool = False
    within: int = NO_HIT
    draws: int = LAMP_SAMPLES


@dataclass(frozen=True)
class EyePaths:
    """What the paths of n rays found.

    light   (n, COLUMNS) float32, of each RGB: radiance of direct light, of indirect light by ends that have
            been lit and are no longer among these, and of emission, the environment's too; and the share of
            the background seen through glass: mirrors show none of it, and where there is an environment,
            glass shows that
    firsts  (n,) FIRST_VERTEX, instance NO_HIT where the ray met something else
    ends    (m,) PATH_END in the order of the rays; lane: REFLECTED or TRANSMITTED by a smooth surface;
            SCATTERED: by a rough one, or a path's second end
    points  (m,) RECEIVER, the same; footprint: of a pixel
    rays    traced
    """

    light: np.ndarray
    firsts: np.ndarray
    ends: np.ndarray
    points: np.ndarray
    rays: int = 0

    @property
    def direct(self) -> np.ndarray:
        """(n, 3) radiance of direct light."""
        return self.light[:, DIRECT:INDIRECT]

    @property
    def indirect(self) -> np.ndarray:
        """(n, 3) radiance of indirect light."""
        return self.light[:, INDIRECT:EMISSION]

    @property
    def emission(self) -> np.ndarray:
        """(n, 3) radiance of emission."""
        return self.light[:, EMISSION:THROUGH]

    @property
    def through(self) -> np.ndarray:
        """(n, 3) share of the background."""
        return self.light[:, THROUGH:]


def no_paths(count: int) -> EyePaths:
    """Return the EyePaths of rays that are still to be followed."""
    light, firsts = np.zeros((count, COLUMNS), np.float32), np.zeros(count, FIRST_VERTEX)
    return EyePaths(light, firsts, np.zeros(0, PATH_END), np.zeros(0, RECEIVER))


def join_ends(parts: Sequence[EyePaths]) -> tuple[np.ndarray, np.ndarray]:
    """Return the ends and points of several calls as if the rays of each had come after those of the ones
    before."""
    if len(parts) == 1:
        return parts[0].ends, parts[0].points
    ends, points = join([part.ends for part in parts]), join([part.points for part in parts])
    first, row = 0, 0
    for part in parts:
        ends["slot"][row : row + len(part.ends)] += np.uint32(first)
        first, row = first + len(part.light), row + len(part.ends)
    return ends, points


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
    """What kernels write: `light` and `firsts` of EyePaths, and by chunks

    ends    (m,) PATH_END_AND_POINT, of which each chunk has an equal part
    counts  (chunks, 2) int64, ends and rays
    """

    light: np.ndarray
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


class Reach(NamedTuple):
    """How far a path went, float32 m from the eye.

    near  to what it met first;  met  the row of that instance, NO_HIT: the environment or nothing
    end   to its end; of a path that a lobe began, to the image that mirrors, and lobes without a Lambert lobe
          beside them, show of it
    """

    near: np.float32
    end: np.float32
    met: np.uint32


class Images(NamedTuple):
    """Where the mirrors that a path met show what it meets after them: a convex one of radius r shows what is
    far away r / 2 behind it.

    distance   m from the eye at which the last one is shown itself
    length     m of the path to it
    curvature  1/m, of the most curved one
    """

    distance: np.float32
    length: np.float32
    curvature: np.float32
