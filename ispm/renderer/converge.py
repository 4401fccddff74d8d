"""Progressive passes: their mean converges to the truth.

Each pass is a picture with photons of its own and kernels smaller than those of the one before, so that noise
and bias of the mean vanish together (Knaus and Zwicker 2011, "Progressive photon mapping: a probabilistic
approach", section 4: the kernels' area falls as r_{i+1}^2 / r_i^2 = (i + alpha) / (i + 1)).
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

from ispm.errors import SceneError
from ispm.optics.sampling import LATTICE
from ispm.renderer.picture import Frame
from ispm.renderer.progress import Progress
from ispm.renderer.statistics import Stats
from ispm.renderer.watch import rendering_seconds
from ispm.settings import Settings

if TYPE_CHECKING:
    from ispm.renderer.renderer import Renderer

_LEAST_SMOOTHING = 0.01  # that settings take
_ALPHA = 2.0 / 3.0  # noise and bias of the mean fall alike, with the cube root of the passes


def of_pass(settings: Settings, index: int) -> Settings:
    """Return the settings of pass `index`: kernels shrink, and samples move about the pixel instead of being
    several, but in the first."""
    if index == 0:
        return settings
    smoothing = max(settings.smoothing * shrunk(index), _LEAST_SMOOTHING)
    return settings.replace(antialias=False, smoothing=smoothing)


def shrunk(index: int) -> float:
    """Return the radius of pass `index` over that of pass 0."""
    # the product of (k + alpha) / (k + 1) over k = 1 to index
    log = math.lgamma(index + 1 + _ALPHA) - math.lgamma(1 + _ALPHA) - math.lgamma(index + 2)
    return math.exp(0.5 * log)


def place_in_pixel(index: int) -> tuple[float, float]:
    """Return where pass `index` samples the pixels, right of and below their centres; of pass 0: there.

    Each second pass lies opposite the one before, so that the mean of few does not shift the picture. The
    first ones' samples stay closer to the centre: the narrowest kernels of these passes blur as much as is
    left of the pixel's square, 1 / (index + 1) of its variance.
    """
    k = (index + 1) // 2 * (1 if index % 2 else -1)
    spread = math.sqrt(index / (index + 1))
    x, y = (spread * ((0.5 + k * step) % 1.0 - 0.5) for step in LATTICE)
    return x, y


def converge(
    renderer: Renderer, goal: Settings, move: Callable[[int], None] | None = None
) -> Iterator[Frame]:
    """Render passes until one of the goal's ends is reached; yield the mean of all after each.

    move  called before each pass with its number: what it changes in scene and camera is blurred
    Continues `renderer.progress` where there is one; where that is at its end already, yields it once.
    Raises SettingsError where it is of another scene.
    """
    started = time.perf_counter()
    progress, settings = renderer.progress, renderer.settings
    made_of, longest = renderer.made_of(), 0.0
    if progress:
        progress.require(made_of, renderer.scene.name)
        mean = _mean(renderer, progress, settings)
        if _is_enough(mean.stats, goal):
            yield mean
            return
    while True:
        begun = rendering_seconds()
        done = progress.passes if progress else 0
        if move:
            move(done)
        frame = renderer.render_pass(done)
        if not move and renderer.last_made_of() != made_of:
            raise SceneError(
                f"the scene, its camera or the settings changed after pass {done}, and the mean would be of "
                "neither; call converge to start anew"
            )
        if progress is None:
            progress = renderer.progress = Progress.start(frame, made_of)
        else:
            progress.add(frame)
        mean = _mean(renderer, progress, settings)
        yield mean
        longest = max(longest, rendering_seconds() - begun)
        late = goal.time_limit and time.perf_counter() - started + longest > goal.time_limit
        if late or _is_enough(mean.stats, goal):
            return


def _mean(renderer: Renderer, progress: Progress, settings: Settings) -> Frame:
    """The mean so far, with the names of the renderer's scene and the exposure that it holds."""
    frame = progress.frame(settings, renderer.threads)
    frame.names = renderer.names
    return renderer.chosen.expose(frame)


def _is_enough(mean: Stats, goal: Settings) -> bool:
    """Whether the passes asked for are made, or their noise is as low as was asked."""
    low = goal.target_error > 0.0 and mean.error <= goal.target_error  # of one pass: not a number
    return mean.passes >= goal.most_passes or low
