"""How the time of a frame grows with photons, pixels, triangles, lights and instances."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import astuple, dataclass, field
from functools import partial
from typing import NamedTuple

import numpy as np

from ispm.bench.change import uncertainty
from ispm.bench.growth_scene import hall
from ispm.bench.suite import FORMAT, Machine, Spread, render_moving, spread
from ispm.renderer import Renderer
from ispm.scene.scene import Scene
from ispm.settings import Settings

FRAMES, QUICK_FRAMES = 11, 5
_SIZE, _PHOTONS = (480, 270), 20_000
_STUDENT = 3.182  # quantile of Student's t for 95 % and the 3 degrees of freedom of a line through 5 points


class Power(NamedTuple):
    """An exponent p of time ~ amount^p, and its uncertainty at 95 %."""

    exponent: float
    uncertainty: float

    def is_within(self, limit: float) -> bool:
        """Whether the exponent is at most the limit, but for its uncertainty."""
        return self.exponent <= limit + self.uncertainty


@dataclass(frozen=True)
class Series:
    """One time along a curve.

    name   "frame": from the call to the picture, packing included; "trace": the photons alone
    times  ms
    power  of the line through all points, logarithm over logarithm; its uncertainty: of their scatter
    last   from the last point but one to the last, where what does not grow counts least; its uncertainty: of
           the medians
    limit  what the exponents should not exceed: 1, or of a logarithm, see `logarithmic`
    """

    name: str
    times: list[Spread]
    power: Power
    last: Power
    limit: float

    @property
    def is_within(self) -> bool:
        """Whether it grows no faster than its limit says."""
        return self.power.is_within(self.limit) and self.last.is_within(self.limit)


@dataclass(frozen=True)
class Curve:
    """Times against the amount of one thing, all else being equal."""

    name: str
    amounts: list[int]
    frames: int
    series: list[Series]
    adapter: str


@dataclass
class GrowthReport:
    """The outcome of `ispm bench --growth`; `machine` as of the last curve."""

    machine: Machine
    curves: list[Curve] = field(default_factory=list)
    format: int = FORMAT
    kind: str = "growth"


class _Point(NamedTuple):
    """What is rendered for a point of a curve."""

    amount: int
    scene: Callable[[], Scene]
    settings: Settings


def measure_growth(
    quick: bool = False, frames: int | None = None, tell: Callable[[str], None] = lambda line: None
) -> Iterator[Curve]:
    """Measure frames of a hall in which everything moves, and yield each curve as it is done.

    quick   a quarter of the pixels and fewer frames
    frames  measured of each point, after three that are not counted; None: 11, or 5 if quick
    tell    is called with a line before each curve
    Raises AdapterError where no adapter serves.
    """
    count = frames or (QUICK_FRAMES if quick else FRAMES)
    with Renderer(hall(), Settings(size=(64, 36))) as renderer:
        for name, points in _curves(2 if quick else 1).items():
            tell(f"{name}: {', '.join(f'{point.amount:,}' for point in points)} ...")
            yield measure_curve(renderer, name, points, count)


def _curves(shrink: int) -> dict[str, list[_Point]]:
    """The points of each curve, by its name."""
    base = Settings(size=(_SIZE[0] // shrink, _SIZE[1] // shrink), photons=_PHOTONS)
    sizes = [(160 * 2**k // shrink, 90 * 2**k // shrink) for k in range(5)]
    return {
        "photons": [_Point(n, hall, base.replace(photons=n)) for n in (1_250 * 4**k for k in range(5))],
        "pixels": [_Point(w * h, hall, base.replace(size=(w, h))) for w, h in sizes],
        "triangles": [_Point(n, partial(hall, triangles=n), base) for n in (4**k for k in range(6, 11))],
        "lights": [_Point(n, partial(hall, lights=n), base) for n in (2**k for k in range(5))],
        "instances": [_Point(n, partial(hall, instances=n), base) for n in (4**k for k in range(2, 7))],
    }


def measure_curve(renderer: Renderer, name: str, points: Sequence[_Point], frames: int) -> Curve:
    """Render the points of a curve, `frames` frames of each."""
    wall, trace, adapter = [], [], ""
    for point in points:
        renderer.settings = point.settings
        rendered = render_moving(renderer, point.scene(), frames)
        wall.append(spread([each.wall_ms for each in rendered]))
        trace.append(spread([each.stats.trace_ms for each in rendered]))
        adapter = rendered[-1].stats.adapter
    amounts = [point.amount for point in points]
    searched = name in ("triangles", "instances")  # by the tracer, in trees
    return Curve(
        name,
        amounts,
        frames,
        [
            series("frame", amounts, wall, frames, 1.0),
            series("trace", amounts, trace, frames, logarithmic(amounts) if searched else 1.0),
        ],
        adapter,
    )


def series(name: str, amounts: Sequence[int], times: list[Spread], frames: int, limit: float) -> Series:
    """Return times with the exponents by which they grow."""
    return Series(name, times, fit_power(amounts, times), last_power(amounts, times, frames), limit)


def logarithmic(amounts: Sequence[int]) -> float:
    """Return the exponent of a time that is the logarithm of the amount n: d ln(ln n) / d ln n = 1 / ln n, in
    the mean. What is constant in a time makes it less."""
    return float(np.mean(1.0 / np.log(amounts)))


def fit_power(amounts: Sequence[int], times: Sequence[Spread]) -> Power:
    """Return the slope of the least squares line through ln median over ln amount, of five points."""
    x, y = np.log(amounts), np.log([each.median for each in times])
    x, y = x - x.mean(), y - y.mean()
    slope = float(x @ y / (x @ x))
    residuals = y - slope * x
    return Power(slope, _STUDENT * math.sqrt(float(residuals @ residuals) / (len(x) - 2) / float(x @ x)))


def last_power(amounts: Sequence[int], times: Sequence[Spread], frames: int) -> Power:
    """Return the slope between the last two points."""
    step = math.log(amounts[-1] / amounts[-2])
    before, last = (_relative(each) for each in times[-2:])
    ratio = times[-1].median / times[-2].median
    return Power(math.log(ratio) / step, uncertainty(before, last, frames) / step)


def _relative(times: Spread) -> Spread:
    return Spread(*(value / times.median for value in astuple(times)))


def curve_line(curve: Curve) -> str:
    """Return how a frame grows, in a line."""
    (frame, trace), n = curve.series, curve.name
    first, last = (f"{frame.times[k].median:.0f} ms at {curve.amounts[k]:,}" for k in (0, -1))
    return f"  {first}, {last}: frame ~ {n}^{_exponent(frame.power)}, trace ~ {n}^{_exponent(trace.power)}"


def growth_table(curves: Sequence[Curve]) -> list[tuple[object, ...]]:
    """Return a table of exponents with a row of headings."""
    rows: list[tuple[object, ...]] = [
        ("curve", "from", "to", "time", "first ms", "last ms", "exponent", "of the last step", "limit", "")
    ]
    for curve in curves:
        rows += [
            (
                curve.name,
                curve.amounts[0],
                curve.amounts[-1],
                each.name,
                each.times[0].median,
                each.times[-1].median,
                _exponent(each.power),
                _exponent(each.last),
                each.limit,
                "" if each.is_within else "faster",
            )
            for each in curve.series
        ]
    return rows


def _exponent(power: Power) -> str:
    return f"{power.exponent:.2f} ± {power.uncertainty:.2f}"
