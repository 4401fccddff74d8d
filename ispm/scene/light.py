"""Punctual lights, as in KHR_lights_punctual."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from ispm.errors import SceneError
from ispm.scene.values import BRIGHTEST, LEAST, Strict, as_code, require

_FLAT = math.pi / 2.0 + 1e-6  # files round it


class _Punctual(Strict):
    """What the lights share: checked as they are made, shown as the code that makes them."""

    intensity: tuple[float, float, float]
    name: str

    def __post_init__(self) -> None:
        self.check()

    def __repr__(self) -> str:
        return as_code(self)

    def check(self, called: str = "") -> None:
        """Raise SceneError for a value out of range; `called` names this light in the message."""
        called = called or light_called(self)
        require(f"{called}: intensity", self.intensity, 0.0, BRIGHTEST, 3)
        require(f"{called}: range", getattr(self, "range", math.inf), LEAST, math.inf)


@dataclass(repr=False)
class PointLight(_Punctual):
    """Shines alike in all directions from its node's origin.

    intensity  (3,) cd per channel, linear
    range      m, beyond which nothing is lit; infinite by default
    """

    intensity: tuple[float, float, float] = (1.0, 1.0, 1.0)
    range: float = math.inf
    name: str = field(default="", compare=False)


@dataclass(repr=False)
class SpotLight(_Punctual):
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

    def check(self, called: str = "") -> None:
        """Raise SceneError for a value out of range; `called` names this light in the message."""
        super().check(called)
        called = called or light_called(self)
        for name in ("inner_angle", "outer_angle"):
            require(f"{called}: {name}, in radians,", getattr(self, name), 0.0, _FLAT)
        if not self.inner_angle < self.outer_angle:
            raise SceneError(
                f"{called}: inner_angle {self.inner_angle:g} must be below outer_angle {self.outer_angle:g}"
            )


@dataclass(repr=False)
class DirectionalLight(_Punctual):
    """Shines along its node's -Z from infinitely far, like the sun.

    intensity  (3,) lx per channel on a surface that faces it, linear
    """

    intensity: tuple[float, float, float] = (1.0, 1.0, 1.0)
    name: str = field(default="", compare=False)


Light = PointLight | SpotLight | DirectionalLight


def light_called(light: _Punctual, node: str = "", index: int | None = None) -> str:
    """Return what messages call a light: by its name or its node's, else by its kind and number."""
    name = light.name or node
    number = "" if index is None else f" {index}"
    return f"light '{name}'" if name else f"{type(light).__name__}{number} without a name"
