"""Punctual lights, as in KHR_lights_punctual."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from ispm.errors import SceneError
from ispm.scene.values import BRIGHTEST, LEAST, Strict, require, told

_FLAT = math.pi / 2.0 + 1e-6  # files round it


@dataclass
class PointLight(Strict):
    """Shines alike in all directions from its node's origin.

    intensity  (3,) cd per channel, linear
    range      m, beyond which nothing is lit; infinite by default
    """

    intensity: tuple[float, float, float] = (1.0, 1.0, 1.0)
    range: float = math.inf
    name: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        self.check()

    def __repr__(self) -> str:
        return told(self)

    def check(self) -> None:
        """Raise SceneError for a value out of range."""
        _check_shine(self.name, self.intensity, self.range)


@dataclass
class SpotLight(Strict):
    """Shines from its node's origin along its -Z, full within one cone, fading to nothing at another.

    intensity     (3,) cd per channel within the inner cone, linear
    range         m, beyond which nothing is lit; infinite by default
    inner_angle   radians from the axis to the inner cone's edge
    outer_angle   radians from the axis to where the light ends, above `inner_angle`, at most pi / 2
    """

    intensity: tuple[float, float, float] = (1.0, 1.0, 1.0)
    range: float = math.inf
    inner_angle: float = 0.0
    outer_angle: float = math.pi / 4.0
    name: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        self.check()

    def __repr__(self) -> str:
        return told(self)

    def check(self) -> None:
        """Raise SceneError for a value out of range."""
        _check_shine(self.name, self.intensity, self.range)
        for name in ("inner_angle", "outer_angle"):
            require(f"light '{self.name}': {name}, in radians,", getattr(self, name), 0.0, _FLAT)
        if not self.inner_angle < self.outer_angle:
            raise SceneError(
                f"light '{self.name}': inner_angle {self.inner_angle:g} must be below "
                f"outer_angle {self.outer_angle:g}"
            )


@dataclass
class DirectionalLight(Strict):
    """Shines along its node's -Z from infinitely far, like the sun.

    intensity  (3,) lx per channel on a surface that faces it, linear
    """

    intensity: tuple[float, float, float] = (1.0, 1.0, 1.0)
    name: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        self.check()

    def __repr__(self) -> str:
        return told(self)

    def check(self) -> None:
        """Raise SceneError for a value out of range."""
        _check_shine(self.name, self.intensity)


Light = PointLight | SpotLight | DirectionalLight


def _check_shine(name: str, intensity: object, range: object = math.inf) -> None:
    require(f"light '{name}': intensity", intensity, 0.0, BRIGHTEST, 3)
    require(f"light '{name}': range", range, LEAST, math.inf)
