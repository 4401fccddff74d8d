"""A scene's environment as the table that kernels read."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256

import numpy as np

from ispm.optics.environment import NO_ENVIRONMENT, EnvironmentTable
from ispm.optics.environment_table import environment_power, environment_table, placed_environment
from ispm.scene.environment import Environment
from ispm.scene.sky import Sky, disc_of, dome_of, require_environment
from ispm.scene.sun import SunDisc
from ispm.scene.values import kept_value


@dataclass(frozen=True, eq=False)
class Panorama:
    """An environment's image, and the table of it without rotation and intensity.

    version  of the environment, as the table was made
    """

    image: np.ndarray
    version: int
    table: EnvironmentTable

    @cached_property
    def power(self) -> float:
        """The integral of luminance over the sphere, lm/m2."""
        return environment_power(self.table)

    @cached_property
    def digest(self) -> bytes:
        """A hash of the image, 32 bytes."""
        radiance = self.table.radiance
        return sha256(str(radiance.shape).encode() + radiance.tobytes()).digest()


@dataclass(frozen=True, eq=False)
class Surround:
    """A scene's environment; panorama None: it has none.

    table       what kernels read
    intensity   factor of the image
    background  whether it is seen behind the scene
    disc        of its sun, which is a light of its own
    made_of     all but the image, to be compared
    """

    table: EnvironmentTable
    intensity: float
    background: bool
    panorama: Panorama | None
    disc: SunDisc | None
    made_of: tuple[object, ...]

    @property
    def power(self) -> float:
        """The integral of luminance over the sphere, lm/m2; 0 without an environment."""
        return 0.0 if self.panorama is None else self.intensity * self.panorama.power

    @cached_property
    def digest(self) -> bytes:
        """A hash of all that tells on a picture, 32 bytes."""
        if self.panorama is None:
            return bytes(32)
        numbers = np.array([self.intensity, self.background], np.float64)
        whole = (
            self.panorama.digest
            + self.table.to_image.tobytes()
            + numbers.tobytes()
            + self.table.disc.tobytes()
        )
        return sha256(whole).digest()


NO_SURROUND = Surround(NO_ENVIRONMENT, 1.0, False, None, None, ())


def pack_environment(around: Environment | Sky | None, before: Surround | None = None) -> Surround:
    """Return a scene's environment, a sky's with its sun's disc: `before` itself if it is as then.

    Raises SceneError for a value out of range.
    """
    require_environment(around)
    environment = dome_of(around)
    if environment is None:
        return NO_SURROUND
    image, version = environment.image, environment.version
    turn, scale, background = environment.rotation, environment.intensity, environment.background
    disc = disc_of(around)
    made_of = *map(kept_value, (turn, scale, background)), disc
    panorama = None if before is None else before.panorama
    if panorama is not None and (panorama.image is not image or panorama.version != version):
        panorama = None
    if before is not None and panorama is not None and before.made_of == made_of:
        return before
    environment.check()
    panorama = panorama or Panorama(image, version, environment_table(image))
    table = placed_environment(panorama.table, float(turn), float(scale))
    if disc is not None:
        table = table._replace(disc=disc.record())
    return Surround(table, float(scale), bool(background), panorama, disc, made_of)
