"""Punctual lights, as in KHR_lights_punctual."""

from __future__ import annotations

import math
from dataclasses import dataclass, field


@dataclass
class PointLight:
    """Shines alike in all directions from its node's origin.

    intensity  (3,) cd per channel, linear
    range      m, beyond which nothing is lit; infinite by default
    """

    intensity: tuple[float, float, float] = (1.0, 1.0, 1.0)
    range: float = math.inf
    name: str = field(default="", compare=False)


@dataclass
class SpotLight:
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


@dataclass
class DirectionalLight:
    """Shines along its node's -Z from infinitely far, like the sun.

    intensity  (3,) lx per channel on a surface that faces it, linear
    """

    intensity: tuple[float, float, float] = (1.0, 1.0, 1.0)
    name: str = field(default="", compare=False)


Light = PointLight | SpotLight | DirectionalLight
