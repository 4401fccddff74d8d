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
