"""A scene's environment as the table that kernels read."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256

import numpy as np

from ispm.optics.environment import (
    NO_ENVIRONMENT,
    EnvironmentTable,
    environment_power,
    environment_table,
    placed_environment,
)
from ispm.scene.environment import Environment
from ispm.scene.sky import Sky, dome_of, require_environment
from ispm.scene.values import kept_value


@dataclass(frozen=True, eq=False)
class Surround:
    """A scene's environment, or that it has none.

    table       what kernels read
    background  whether it is seen behind the scene
    plain       the table without rotation and intensity
    image, made_of   what it was made of, to be compared
    """

    table: EnvironmentTable
    background: bool
    plain: EnvironmentTable
    image: np.ndarray | None
    made_of: tuple[object, ...]

    @cached_property
    def power(self) -> float:
        """The integral of luminance over the sphere, lm/m2."""
        return environment_power(self.table)

    @cached_property
    def digest(self) -> bytes:
        """A hash of all that tells on a picture, 32 bytes."""
        whole = sha256(np.array([self.background, len(self.table.rows) > 0]).tobytes())
        for array in (self.table.radiance, self.table.to_image):
            whole.update(np.array(array.shape).tobytes())
            whole.update(np.ascontiguousarray(array).view(np.uint8).reshape(-1).data)
        return whole.digest()


NO_SURROUND = Surround(NO_ENVIRONMENT, False, NO_ENVIRONMENT, None, ())


def pack_environment(around: Environment | Sky | None, before: Surround | None = None) -> Surround:
    """Return a scene's environment, a sky without its sun: `before` itself if it is as then.

    Raises SceneError for a value out of range.
    """
    require_environment(around)
    environment = dome_of(around)
    if environment is None:
        return NO_SURROUND
    image, version = environment.image, environment.version
    turn, scale, background = environment.rotation, environment.intensity, environment.background
    made_of = (version, *map(kept_value, (turn, scale, background)))
    same_image = before is not None and before.image is image and before.made_of[0] == version
    if before is not None and same_image and before.made_of == made_of:
        return before
    environment.check()
    plain = before.plain if before is not None and same_image else environment_table(image)
    table = placed_environment(plain, float(turn), float(scale))
    return Surround(table, bool(background), plain, image, made_of)
