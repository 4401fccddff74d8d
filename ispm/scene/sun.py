"""The disc of a sky's sun, and where on it each pass of a picture has its light come from."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ispm.scene.packed_light import Lit


class SunDisc(NamedTuple):
    """A sun's disc, as wide as it is seen.

    direction  to its middle, unit, world space
    radius     radians that it is across by half, above 0
    radiance   cd/m2, linear RGB
    """

    direction: tuple[float, float, float]
    radius: float
    radiance: tuple[float, float, float]

    def record(self) -> np.ndarray:
        """Return it as `EnvironmentTable.disc`."""
        reach = (2.0 * math.sin(0.5 * self.radius)) ** 2
        return np.array([*self.direction, reach, *self.radiance], np.float32)


def sun_disc(direction: np.ndarray, radius: float, irradiance: np.ndarray) -> SunDisc | None:
    """Return the even disc that gives a surface facing it an irradiance, (3,) lx; None: there is none."""
    if radius <= 0.0 or not np.any(irradiance):
        return None
    x, y, z = (float(v) for v in direction)
    red, green, blue = (float(v) / (math.pi * math.sin(radius) ** 2) for v in irradiance)
    return SunDisc((x, y, z), float(radius), (red, green, blue))


def turned(lit: Lit, disc: SunDisc | None, index: int) -> Lit:
    """Return a scene's lights as pass `index` has them. The last is the sun, which shines from the middle of
    its disc in pass 0, and over many passes evenly from all of it."""
    if disc is None or index == 0:
        return lit
    rows = lit.rows.copy()
    rows[-1]["direction"] = -_toward(disc, index)
    return replace(lit, rows=rows)


def _toward(disc: SunDisc, index: int) -> np.ndarray:
    """The unit direction to a place on the disc, (3,)."""
    from ispm.optics.sampling import LATTICE  # brings numba, which scenes load without

    share, turn = (index * step % 1.0 for step in LATTICE)
    away, around = math.sin(disc.radius) * math.sqrt(share), 2.0 * math.pi * turn
    middle = np.array(disc.direction)
    across = np.cross(middle, np.eye(3)[np.abs(middle).argmin()])
    across /= np.linalg.norm(across)
    offset = math.cos(around) * across + math.sin(around) * np.cross(middle, across)
    return np.asarray(math.sqrt(1.0 - away * away) * middle + away * offset)
