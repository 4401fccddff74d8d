"""A scene's lights as the records that kernels and shaders read."""

from __future__ import annotations

import math

import numpy as np

from ispm.optics import records
from ispm.scene.light import DirectionalLight, Light, PointLight, SpotLight

_SHARPEST = 1e-6  # difference of the cosines of a spot's cones, in float32
_KINDS = {
    PointLight: records.LIGHT_POINT,
    SpotLight: records.LIGHT_SPOT,
    DirectionalLight: records.LIGHT_DIRECTIONAL,
}


def light_record(light: Light, world: np.ndarray, called: str) -> np.ndarray:
    """Return a light as a LIGHT.

    world   (4, 4) from object to world space
    called  in messages
    Raises SceneError where it cannot be.
    """
    light.check(called)
    row = np.zeros((), records.LIGHT)
    row["position"] = world[:3, 3]
    row["kind"] = _KINDS[type(light)]
    row["intensity"] = light.intensity
    along = -world[:3, 2] / max(float(np.linalg.norm(world[:3, 2])), 1e-30)
    row["direction"], row["cone_offset"] = along, 1.0
    if isinstance(light, DirectionalLight):
        return row
    row["range"] = light.range if np.isfinite(light.range) else 0.0
    if isinstance(light, SpotLight):
        row["cone_scale"], row["cone_offset"] = _cone(light)
    return row


def _cone(light: SpotLight) -> tuple[float, float]:
    """Scale and offset of a spot's falloff; KHR_lights_punctual, inner and outer cone angles."""
    inner, outer = light.inner_angle, light.outer_angle
    scale = 1.0 / max(math.cos(inner) - math.cos(outer), _SHARPEST)
    return scale, -math.cos(outer) * scale
