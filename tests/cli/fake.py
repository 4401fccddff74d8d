"""What stands for the renderer in tests of the command line."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ispm.renderer.picture import Frame

SMALL = "render cornell-box --size 8x6 "


@dataclass
class FakeStats:
    stored_photons: int = 123_456
    total_ms: float = 12.5
    flux: float = float("nan")


class FakeRenderer:
    """Stands for the renderer: keeps what it was given and gives a grey frame."""

    made: ClassVar[list] = []
    error: ClassVar[BaseException | None] = None

    def __init__(self, scene, settings, **options):
        if FakeRenderer.error:
            raise FakeRenderer.error
        self.scene, self.settings, self.options = scene, settings, options
        FakeRenderer.made.append(self)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def render(self):
        width, height = self.settings.size
        light = np.full((height, width, 3), 0.25, np.float32)
        layers = {"full": light, "direct": light, "depth": light[..., 0]}
        return Frame(layers, FakeStats(), self.settings, {})
