"""A live picture at rest: passes take the place of what it showed as it came to rest."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from ispm.renderer.backdrop import ENVIRONMENT, LAYER
from ispm.renderer.layers import Layers, sum_layers
from ispm.renderer.made_of import MadeOf
from ispm.renderer.picture import Frame
from ispm.renderer.progress import KEPT, SUMMED, Progress
from ispm.settings import Settings

# Passes that what the live picture keeps of frames before is worth: 16 give way slowly, 4 show the first pass
# come. The rest of its light is of one frame: with as much worth what one path brought would stay for long.
_WORTH = {"indirect": 8.0, "irradiance": 8.0}
_WORTH_OF_FRAME = 1.0
_GONE = 32  # passes after which it counts no more: its kernels' bias would stay


class Rest:
    """The mean of the passes of a picture that stands still, and the live frame that it began with.

    made_of  scene, camera and settings of all of them
    """

    def __init__(self, live: Frame, made_of: MadeOf) -> None:
        self.made_of = made_of
        self._live = live
        self._progress: Progress | None = None

    @property
    def passes(self) -> int:
        """How many there are."""
        return self._progress.passes if self._progress else 0

    def add(self, frame: Frame, settings: Settings, threads: int) -> Frame:
        """Add the frame of the next pass; return what is to be shown."""
        if self._progress is None:
            self._progress = Progress.start(frame, self.made_of)
        else:
            self._progress.add(frame)
        mean = self._progress.frame(settings, threads)
        mean.names = frame.names
        return _mixed(mean, self._live, self.passes, threads) if self.passes < _GONE else mean


def _mixed(mean: Frame, live: Frame, passes: int, threads: int) -> Frame:
    """The mean of so many passes with a part of the live frame in it."""

    def mix(name: str) -> np.ndarray:
        worth = _WORTH.get(name, _WORTH_OF_FRAME)
        weight = np.float32(worth / (worth + passes) * (1.0 - passes / _GONE))
        return np.asarray(mean[name] + weight * (live[name] - mean[name]))

    makers: dict[str, Callable[[], np.ndarray]]
    makers = {name: partial(mix, name) for name in (*SUMMED, LAYER, ENVIRONMENT) if name in mean.layers}
    makers["full"] = lambda: sum_layers(layers["direct"], layers["indirect"], layers["emission"], threads)
    makers |= {name: partial(mean.layers.__getitem__, name) for name in KEPT}
    layers: Layers = Layers(makers)
    return Frame(layers, mean.stats, mean.settings, mean.camera, mean.scene, names=mean.names)
