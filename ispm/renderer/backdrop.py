"""What is seen behind the picture: a color that the screen shows, or the scene's environment.

The color neither lights anything nor is reflected, and is shown as it is. The environment is light of the
scene, and exposed and tone mapped with the rest.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ispm.kernels.threads import run_threads
from ispm.optics.environment import environment_radiance
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
    width, height = this.view.size
    out = np.zeros((height, width, 3), np.float32)
    edges = np.linspace(0, height, this.threads + 1).astype(np.int64)

    def part(k: int) -> None:
        first, last = edges[k], edges[k + 1]
        rows = np.arange(first, last)[:, None] + 0.5
        if len(rows):
            _, directions = this.view.rays_through(np.arange(width) + 0.5, rows)
            seen = np.ascontiguousarray(directions, np.float32), np.ascontiguousarray(alpha[first:last])
            fill_behind(this.packed.environment, *seen, out[first:last])

    run_threads(part, this.threads)
    return out


@jit
def fill_behind(table, directions, alpha, out):
    """Write (h, w, 3) radiance from (h, w, 3) unit directions where (h, w) alpha is below 1, times the
    rest."""
    for y in range(out.shape[0]):
        for x in range(out.shape[1]):
            rest = np.float32(1) - alpha[y, x]
            if rest > np.float32(0):
                d = directions[y, x]
                light = environment_radiance(table, (d[0], d[1], d[2]))
                for c in range(3):
                    out[y, x, c] = rest * light[c]


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
