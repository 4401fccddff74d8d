"""Which maps emit how many photons in a pass, and where their samples lie."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ispm.lights.aim import LIT, SEEN, aimed_maps, lit_map, near_maps
from ispm.lights.lightmap import LightMap, light_maps
from ispm.optics.records import LIGHT_SPOT
from ispm.optics.rng import random4
from ispm.optics.vector import LUMINANCE
from ispm.scene.packed import Packed

_DIMENSION = 1 << 20  # of the random numbers that shift whole maps, and those after it
_FLOOR = 0.1  # of an equal share: what a light gets however weak it is
_LEAST_BASE = 0.05  # of a light's photons, which its own map keeps
_AIMED_MOST = 8  # maps of a light
_AIMED_LEAST = 128  # photons that a map which is aimed is worth drawing for, on average
_SPOT_WIDTH = 8  # texels that see a cone's fade well enough
_SPARE = 2.0  # texels of an edge that could emit a photon for each that does
_FINEST = 2.0  # texels of an edge over the root of the photons; a texel may emit several


@dataclass(frozen=True, eq=False)
class PlannedMap:
    """What a map does in one pass.

    photons  that it emits in expectation
    width    texels of a face's edge
    shift    of its samples in texels, in [-0.5, 0.5), right of and below the texels' centres
    offset   of the lattice that thins its texels, in [0, 1)
    """

    map: LightMap
    photons: int
    width: int
    shift: tuple[float, float]
    offset: float

    @property
    def density(self) -> float:
        """Photons per unit of the map's measure, sr or m2."""
        return self.photons / self.map.measure


def share_photons(packed: Packed, photon_count: int, others: Sequence[float] = ()) -> np.ndarray:
    """Return how many photons each light emits, (L,) int64: in proportion to its luminous flux.

    others  luminous flux, lm, of what else shines, whose numbers come after those of the lights
    But each light that shines gets a tenth of an equal share, and one.
    """
    measures = np.array([map.measure for map in light_maps(packed)])
    power = packed.lights["intensity"].astype(np.float64) @ LUMINANCE * measures
    power = np.append(power, np.array(others, np.float64))
    if photon_count == 0 or not power.any():
        return np.zeros(len(power), np.int64)
    shares = np.where(power > 0.0, np.maximum(power / power.sum(), _FLOOR / np.count_nonzero(power)), 0.0)
    counts = np.rint(photon_count * shares / shares.sum()).astype(np.int64)
    return np.where(power > 0.0, np.maximum(counts, 1), 0)


def plan_maps(
    packed: Packed,
    counts: np.ndarray,
    caustic_share: float,
    seed: int,
    pass_index: int,
    seen: np.ndarray | None = None,
    sunlit: Sequence[np.ndarray] = (),
) -> list[PlannedMap]:
    """Return what the maps of all lights do, light by light, a light's own map first.

    counts         (L,) or more, photons of each light
    caustic_share  of a light's photons are aimed at what casts caustics, where there is any
    seen           (n, 3) m, points in the picture: half of a directional light's other photons are aimed at
                   them, if its own map is much wider; None: unknown
    sunlit         of each light (n, 3) m, places where it shines: half of a directional light's photons are
                   aimed at these first, if all that is seen is much wider; empty: unknown
    """
    lights, maps, hulls = packed.lights, light_maps(packed), packed.caustic_hulls
    told = hulls, counts[: len(lights)], caustic_share, seed, pass_index
    return plan_views(lights, maps, *told, seen=seen, sunlit=sunlit)


def plan_views(
    lights: np.ndarray,
    maps: Sequence[LightMap],
    hulls: np.ndarray,
    counts: np.ndarray,
    caustic_share: float,
    seed: int,
    pass_index: int,
    first: int = 0,
    seen: np.ndarray | None = None,
    sunlit: Sequence[np.ndarray] = (),
) -> list[PlannedMap]:
    """Return what the maps of some lights do, as `plan_maps`.

    lights  (L,) LIGHT;  maps  the own map of each;  counts  (L,) photons of each
    hulls   (n, k, 3) points round each object that casts caustics, world space
    first   number of the first light, that tells its random numbers
    """
    plan: list[PlannedMap] = []
    for index, (light, base, count) in enumerate(zip(lights, maps, counts, strict=True), first):
        if count:
            places = seen, sunlit[index - first] if sunlit else None
            shared = _share(base, light, hulls, int(count), caustic_share, *places)
            for k, (map, photons) in enumerate(shared):
                x, y, z, _ = random4(
                    np.uint32(index), np.uint32(_DIMENSION + k), np.uint32(pass_index), np.uint32(seed)
                )
                width = map_width(map, light, photons)
                plan.append(PlannedMap(map, photons, width, (float(x) - 0.5, float(y) - 0.5), float(z)))
    return plan


def map_width(map: LightMap, light: np.void, photons: int) -> int:
    """Return the width of a map's face so that its texels emit at most one photon each.

    A texel covers at most 4 k^2 / W^2 sr, k the spread, and must not carry more than the part 1 / N of the
    map's measure. For a cube W^2 >= N / pi, and about 52 % of the texels survive; for a lamp's hemicube
    W^2 >= 4 N / pi, and 16 %. Of a single face nearly all would: a grid, which mirrors fold into rings. So it
    has four texels a photon.
    """
    largest = map.measure if map.orthographic else 4.0 * map.spread**2
    needed = math.sqrt(photons * largest / map.measure)
    if len(map.axes) == 1:
        needed *= _SPARE
    least = _SPOT_WIDTH if light["kind"] == LIGHT_SPOT else 1
    return max(least, math.ceil(min(needed, _FINEST * math.sqrt(photons))))


def _share(
    base: LightMap,
    light: np.void,
    hulls: np.ndarray,
    count: int,
    caustic_share: float,
    seen: np.ndarray | None,
    lit: np.ndarray | None,
) -> list[tuple[LightMap, int]]:
    """A light's maps and their photons."""
    wanted = min(caustic_share, 1.0 - _LEAST_BASE) * count
    most = min(_AIMED_MOST, int(wanted) // _AIMED_LEAST)
    aimed = aimed_maps(base, light, hulls, most) if most and len(hulls) else []
    total = sum(map.measure for map in aimed)
    shares = [(map, round(wanted * (map.measure / total))) for map in aimed]  # of one map, exactly 1
    rest = count - sum(photons for _, photons in shares)
    near = near_maps(base, seen, lit) if seen is not None and rest >= _AIMED_LEAST else []
    shone_on = lit_map(base, near, lit) if lit is not None and rest >= _AIMED_LEAST else None
    if shone_on:
        shares.append((shone_on, round(LIT * rest)))
        rest -= shares[-1][1]
    shares += [(map, round(SEEN * rest / len(near))) for map in near]
    shares = [(map, photons) for map, photons in shares if photons]
    return [(base, count - sum(photons for _, photons in shares)), *shares]
