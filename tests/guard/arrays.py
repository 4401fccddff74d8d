"""All that a renderer gives of a case, as arrays by name."""

from __future__ import annotations

import warnings

import numpy as np

import ispm
from guard.scenes import SIZE, Case, cases
from ispm.gpu import Gpu

PHOTONS = 2000
_OF_THE_RUN = ("peak_memory", "adapter", "timing", "tracer")  # of statistics; and what ends like these:
_TIMES = ("_ms", "fps_direct", "fps_full")


def arrays(case: Case, renderer: ispm.Renderer, *, scale: int = 1) -> dict[str, np.ndarray]:
    """Render a case.

    renderer  may have rendered anything before
    scale     factor on the sides of the picture; photons grow with its pixels
    ->        layers, `image` and views (h, w) or (h, w, c); `photons.FIELD` (N,) or (N, 3) as stored;
              `stats.FIELD` and `exposure` (); `pose` and `clip_from_world` (4, 4),
              `intrinsics` (3, 3)
    """
    size = SIZE[0] * scale, SIZE[1] * scale
    scene = case.scene()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ispm.SceneWarning)
        renderer.settings = ispm.Settings(**{"size": size, "photons": PHOTONS * scale**2, **case.settings})
        renderer.camera = case.camera
        renderer.reset()  # live frames would go on from those of a case before
        for time in case.times:
            renderer.scene = scene if time is None else scene.at(time)
            frame = renderer.render()
        found = {name: frame[name] for name in frame}
        found |= {"image": frame.image, "exposure": frame.exposure, **frame.camera}
        found |= {f"view.{name}": renderer.view(name) for name in case.views}
    photons, stats = renderer.photons(), frame.stats.as_dict()
    found |= {f"photons.{name}": photons[name] for name in photons.dtype.names}
    for name, value in stats.items():
        if name not in _OF_THE_RUN and not name.endswith(_TIMES):
            found[f"stats.{name}"] = value
    return {name: np.array(value) for name, value in found.items()}


def open_renderer(gpu: Gpu | None = None, threads: int = 2) -> ispm.Renderer:
    """Return a renderer for all cases."""
    return ispm.Renderer(cases()[0].scene(), threads=threads, gpu=gpu)
