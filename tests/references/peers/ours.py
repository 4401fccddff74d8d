"""ispm: one pass, then progressive ones.

python -m references.peers.ours SCENE FOLDER SECONDS [SETTING=VALUE ...]
"""

from __future__ import annotations

import statistics
import sys
import time

import numpy as np

from ispm import Renderer, __version__, load
from ispm.settings import resolve
from references import outside
from references.peers import SIZE, Recorder, work

_REPEATS = 3
_MOST = 1_000_000  # passes: the time ends them


def render(name: str, recorder: Recorder) -> None:
    """Keep the picture of one pass and the means of 2, 4, 8, ..., and of all that there was time for."""
    chosen = sys.argv[4:]
    settings = resolve(dict(setting.split("=") for setting in chosen), {"size": SIZE})
    with Renderer(load(outside() / f"scene_{name}.glb"), settings) as renderer:
        renderer.render()  # compiles, builds trees
        recorder.ready(" ".join([f"ispm {__version__},", *(chosen or ["default"])]))
        recorder.add(*_one_pass(renderer))
        seconds, resumed = 0.0, time.perf_counter()
        for passes, frame in enumerate(renderer.converge(_MOST, time_limit=recorder.limit), 1):
            seconds += time.perf_counter() - resumed
            if passes > 1 and passes & (passes - 1) == 0:
                recorder.add(seconds, frame.radiance)
            resumed = time.perf_counter()
        if seconds > recorder.last:
            recorder.add(seconds, frame.radiance)


def _one_pass(renderer: Renderer) -> tuple[float, np.ndarray]:
    seconds = []
    for _ in range(_REPEATS):
        started = time.perf_counter()
        frame = renderer.render()
        seconds.append(time.perf_counter() - started)
    return statistics.median(seconds), frame.radiance


if __name__ == "__main__":
    work(render)
