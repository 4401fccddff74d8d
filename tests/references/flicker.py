"""How much pictures of a standing scene differ from seed to seed: what a film of it would flicker."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ispm import Renderer, Scene, Settings
from ispm.gpu import Gpu
from ispm.optics.vector import LUMINANCE

FRAMES = 16
HEADINGS = ("scene", "setting", "median", "95 %")


@dataclass(frozen=True)
class Flicker:
    """One line of the table: standard deviation over mean of a pixel's luminance.

    median, most  of the pixels, and of all but 5 % of them
    """

    scene: str
    setting: str
    median: float
    most: float

    def cells(self) -> list[str]:
        """Return it as text."""
        return [self.scene, self.setting, f"{self.median:.1%}", f"{self.most:.1%}"]


def measure_flicker(title: str, scene: Scene, settings: dict[str, Settings], gpu: Gpu) -> Iterator[Flicker]:
    """Yield a row for each of the settings, by name; pixels without light are left out."""
    for name, chosen in settings.items():
        with Renderer(scene, chosen, gpu=gpu) as renderer:
            pictures = []
            for seed in range(FRAMES):
                renderer.settings = chosen.replace(seed=seed)
                pictures.append(renderer.render().radiance.astype(np.float64) @ LUMINANCE)
        mean, spread = np.mean(pictures, axis=0), np.std(pictures, axis=0, ddof=1)
        lit = mean > 0.0
        median, most = np.quantile(spread[lit] / mean[lit], (0.5, 0.95))
        yield Flicker(title, name, float(median), float(most))
