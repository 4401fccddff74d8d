"""What lamps with a surface and a sky cost: frames of `atrium` beside those of its own light, a point.

In processor time, which a frame of the same work takes alike however many cores share it. Each moment is
rendered with one light after the other, so that what else the machine does falls on all alike.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass

import numpy as np

from ispm.bench.suite import FORMAT, SCENE, Machine, Spread, moments, spread
from ispm.gpu import open_gpu
from ispm.kernels.jit import seconds_compiling
from ispm.library.builtin import builtin
from ispm.library.shapes import icosphere
from ispm.renderer import Renderer, Stats
from ispm.scene.light import PointLight, RectLight
from ispm.scene.material import Material
from ispm.scene.scene import Scene
from ispm.scene.sky import Sky
from ispm.settings import Settings

FRAMES, QUICK_FRAMES = 9, 5
_WARM_UP = 2  # frames that are not counted: kernels compile, memory grows
_GLOW = (60_000.0, 56_000.0, 50_000.0)  # cd/m2
_BULBS = 10, 5  # along the court and across, of 20 triangles each
POINT = "point"


@dataclass(frozen=True)
class LightCost:
    """What a frame takes with one light.

    seconds  of processors, all cores together
    ratio    of that to the same moment with the point
    limit    that the ratio's median should not exceed; infinite: none
    stored   photons of the last frame: each is found again where pixels gather light, whatever lamp sent it
    """

    light: str
    frames: int
    seconds: Spread
    ratio: Spread
    limit: float
    stored: int


@dataclass
class LightsReport:
    """The outcome of `ispm bench --lights`."""

    machine: Machine
    lights: list[LightCost]
    format: int = FORMAT
    kind: str = "lights"


def measure_lights(
    quick: bool = False, frames: int | None = None, tell: Callable[[str], None] = lambda line: None
) -> tuple[list[LightCost], str]:
    """Return what frames of `SCENE` take with each light, and the adapter's name.

    quick   a quarter of the pixels and fewer frames
    frames  measured, after two that are not counted; None: 9, or 5 if quick
    tell    is called with a line before each moment
    Raises AdapterError where no adapter serves.
    """
    settings, count = Settings(), frames or (QUICK_FRAMES if quick else FRAMES)
    if quick:
        width, height = settings.size
        settings = settings.replace(size=(width // 2, height // 2))
    seconds: dict[str, list[float]] = {name: [] for name in LIGHTS}
    with ExitStack() as stack:
        gpu = open_gpu()
        drawn = []
        for name, (make, _) in LIGHTS.items():
            scene = make()
            renderer = stack.enter_context(Renderer(scene, settings, gpu=gpu))
            drawn.append((name, renderer, moments(scene, count + _WARM_UP)))
        stats: dict[str, Stats] = {}
        for k in range(count + _WARM_UP):
            tell(f"moment {k + 1} of {count + _WARM_UP} ...")
            for name, renderer, each in drawn:
                renderer.scene = next(each)
                taken, stats[name] = _rendered(renderer)
                seconds[name].append(taken)
    costs = [_cost(name, seconds, limit, stats[name].stored_photons) for name, (_, limit) in LIGHTS.items()]
    return costs, stats[POINT].adapter


def _rendered(renderer: Renderer) -> tuple[float, Stats]:
    """Processor seconds of a frame but for the compilation of kernels, and its statistics."""
    before, started = seconds_compiling(), time.process_time()
    stats = renderer.render().stats
    return time.process_time() - started - (seconds_compiling() - before), stats


def _cost(name: str, seconds: dict[str, list[float]], limit: float, stored: int) -> LightCost:
    taken, by_point = (np.array(seconds[each][_WARM_UP:]) for each in (name, POINT))
    ratio = spread((taken / by_point).tolist())
    return LightCost(name, len(taken), spread(taken.tolist()), ratio, limit, stored)


def lights_table(costs: list[LightCost]) -> list[tuple[object, ...]]:
    """Return a table with a row of headings."""
    rows: list[tuple[object, ...]] = [
        (
            "light",
            "processor ms",
            "5 %",
            "95 %",
            "times the point's",
            "5 %",
            "95 %",
            "limit",
            "",
            "photons stored",
        )
    ]
    for each in costs:
        taken, ratio = each.seconds, each.ratio
        within = "" if ratio.median <= each.limit else "more"
        limit: object = "" if math.isinf(each.limit) else each.limit
        milliseconds = (1e3 * value for value in (taken.median, taken.low, taken.high))
        rows.append(
            (each.light, *milliseconds, ratio.median, ratio.low, ratio.high, limit, within, each.stored)
        )
    return rows


def _dark() -> Scene:
    """The scene without its light."""
    scene = builtin(SCENE)
    for node in scene.nodes:
        node.light = None
    return scene


def _under_rectangle() -> Scene:
    """A panel of 2 x 2 m in the middle of the court, which faces down."""
    scene = _dark()
    scene.add(RectLight(_GLOW, width=2.0, height=2.0), name="panel", translation=(0.0, 9.0, 0.0)).look_at(
        (0.0, 0.0, 0.001)
    )
    return scene


def _under_point() -> Scene:
    """A point of the panel's flux in its place: what of its cost is the place's, where no photon is lost."""
    scene = _dark()
    r, g, b = (value * 2.0 * 2.0 / 4.0 for value in _GLOW)
    scene.add(PointLight((r, g, b)), name="point", translation=(0.0, 8.9, 0.0))
    return scene


def _under_sky() -> Scene:
    """A clear sky, its sun as high as the point is."""
    scene = _dark()
    scene.environment = Sky(sun_elevation=math.radians(61.0))
    return scene


def _under_bulbs() -> Scene:
    """1,000 triangles that glow: 50 bulbs of 20 across the court."""
    scene = _dark()
    bulb, glow = icosphere(0.15, 1, "bulb"), Material((0.0, 0.0, 0.0), emission=_GLOW, name="glow")
    along, across = _BULBS
    for k in range(along * across):
        x, z = np.linspace(-9.0, 9.0, along)[k % along], np.linspace(-3.5, 3.5, across)[k // along]
        scene.add(bulb, material=glow, name=f"bulb {k}", translation=(x, 4.5 + 2.0 * (k * 7 % 10) / 10, z))
    return scene


LIGHTS: dict[str, tuple[Callable[[], Scene], float]] = {
    POINT: (lambda: builtin(SCENE), math.inf),
    "rectangle": (_under_rectangle, 1.3),
    "point there": (_under_point, math.inf),
    "sky and sun": (_under_sky, 1.5),
    "1,000 triangles": (_under_bulbs, 2.0),
}
"""By name: the scene, and how many times a frame of the point's it should not exceed."""
