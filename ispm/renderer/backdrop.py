"""What is seen behind the picture: a color that the screen shows, or the scene's environment.

The color neither lights anything nor is reflected, and is shown as it is. The environment is light of the
scene, and exposed and tone mapped with the rest.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from ispm.kernels.threads import run_threads
from ispm.optics.environment import seen_radiance
from ispm.optics.jit import jit
from ispm.renderer.one_pass import Pass
from ispm.settings import Settings
from ispm.stages.tonemap import tonemap

LAYER = "background"  # of a color
ENVIRONMENT = "environment"


def background_color(settings: Settings) -> np.ndarray | None:
    """Return the background's linear (3,) float32; None where it is black or transparent."""
    color = settings.background
    return None if isinstance(color, str) or not any(color) else np.array(color, np.float32)


def shows_environment(this: Pass) -> bool:
    """Return whether pixels that show nothing show the scene's environment: a color takes its place."""
    settings = this.settings
    return this.packed.surround.background and (
        settings.background != "transparent" and background_color(settings) is None
    )


def environment_behind(this: Pass, alpha: np.ndarray) -> np.ndarray:
    """Return the environment's radiance in pixels, (h, w, 3) float32, times the share that nothing covers.

    alpha  (h, w) float32, the share that something does
    """
    view = this.view
    width, height = view.size
    _, corners = view.rays_through(np.array([0.0, width, 0.0]), np.array([0.0, 0.0, height]))
    corners = corners / (corners @ view.forward)[:, None]  # on a plane, where they are even over the picture
    corner, right, down = corners[0], (corners[1] - corners[0]) / width, (corners[2] - corners[0]) / height
    out = np.zeros((height, width, 3), np.float32)
    edges = np.linspace(0, height, this.threads + 1).astype(np.int64)

    def part(k: int) -> None:
        rows = slice(edges[k], edges[k + 1])
        plane = corner + edges[k] * down, right, down
        fill_behind(this.packed.environment, *plane, alpha[rows], out[rows])

    alpha = np.ascontiguousarray(alpha)
    run_threads(part, this.threads)
    return out


@jit
def fill_behind(table, corner, right, down, alpha, out):
    """Write (h, w, 3) radiance where (h, w) alpha is below 1, times the rest.

    corner, right, down  (3,) float64: direction of the first pixel's corner, and its steps by a pixel
    """
    for y in range(out.shape[0]):
        for x in range(out.shape[1]):
            rest = np.float32(1) - alpha[y, x]
            if rest > np.float32(0):
                light = seen_radiance(table, _towards(corner, right, down, x + 0.5, y + 0.5), True)
                for c in range(3):
                    out[y, x, c] = rest * light[c]


@jit
def _towards(corner, right, down, x, y):
    """The unit direction, three float32, of a place in the picture."""
    a = corner[0] + x * right[0] + y * down[0]
    b = corner[1] + x * right[1] + y * down[1]
    c = corner[2] + x * right[2] + y * down[2]
    part = 1.0 / math.sqrt(a * a + b * b + c * c)
    return np.float32(a * part), np.float32(b * part), np.float32(c * part)


def without_background(layers: Mapping[str, np.ndarray], radiance: np.ndarray) -> np.ndarray:
    """Return radiance (h, w, 3) of what is there: the same whatever the background."""
    for name in (LAYER, ENVIRONMENT):
        if name in layers:
            radiance = radiance - layers[name]
    return radiance


def metered(layers: Mapping[str, np.ndarray], radiance: np.ndarray) -> np.ndarray:
    """Return radiance (h, w, 3) by which a picture is exposed: of what is there, or where nothing is lit, of
    the environment behind it."""
    there = without_background(layers, radiance)
    return layers[ENVIRONMENT] if ENVIRONMENT in layers and not (there > 0.0).any() else there


def shown(
    layers: Mapping[str, np.ndarray], radiance: np.ndarray, exposure: float, mode: str, bits: int = 8
) -> np.ndarray:
    """Return sRGB codes of radiance (h, w, 3) that holds the background, whose color stays as it is."""
    behind = layers.get(LAYER)
    light = radiance if behind is None else radiance - behind
    return tonemap(light, exposure, mode, bits=bits, behind=behind)
