"""The background: what a screen shows behind the picture. It neither lights anything nor is reflected."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ispm.settings import Settings
from ispm.stages.tonemap import tonemap

LAYER = "background"


def background_color(settings: Settings) -> np.ndarray | None:
    """Return the background's linear (3,) float32; None where it is black or transparent."""
    color = settings.background
    return None if isinstance(color, str) or not any(color) else np.array(color, np.float32)


def without_background(layers: Mapping[str, np.ndarray], radiance: np.ndarray) -> np.ndarray:
    """Return radiance (h, w, 3) of what is there: the same whatever the background."""
    return radiance - layers[LAYER] if LAYER in layers else radiance


def shown(
    layers: Mapping[str, np.ndarray], radiance: np.ndarray, exposure: float, mode: str, bits: int = 8
) -> np.ndarray:
    """Return sRGB codes of radiance (h, w, 3) that holds the background, which keeps its own color."""
    behind = layers.get(LAYER)
    return tonemap(without_background(layers, radiance), exposure, mode, bits=bits, behind=behind)
