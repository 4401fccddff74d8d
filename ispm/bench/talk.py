"""The scenes of the talk's table, each at its row's resolution, subsampling, photons and bounces."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

from ispm.bench.suite import FORMAT, FrameTimes, Machine, measure_frames
from ispm.bench.talk_rows import ROWS, TalkRow
from ispm.bench.yardsticks import Floor, Yardsticks, embree_rate, floor_of
from ispm.library.builtin import builtin
from ispm.settings import Settings

QUICK_FRAMES, FRAMES = 4, 20


@dataclass(frozen=True)
class TalkTimes:
    """A row, and what it takes here.

    talk      the row
    times     of its frames, in which camera, lights and objects move
    added_ms  median of whole frames less that of frames without bounces
    ratio     of these medians
    embree    rays per second at which Embree follows the photons; NaN where it is not installed
    floor     what `added_ms` would be at the yardsticks' rates
    """

    talk: TalkRow
    times: FrameTimes
    added_ms: float
    ratio: float
    embree: float
    floor: Floor


@dataclass
class TalkReport:
    """The outcome of `ispm bench --talk`, of the rows that were measured; `machine` as of the last."""

    yardsticks: Yardsticks
    machine: Machine
    rows: list[TalkTimes] = field(default_factory=list)
    format: int = FORMAT
    kind: str = "talk"


def measure_talk(
    rates: Yardsticks,
    quick: bool = False,
    frames: int | None = None,
    rows: Sequence[TalkRow] = ROWS,
    tell: Callable[[str], None] = lambda line: None,
) -> Iterator[TalkTimes]:
    """Measure rows of the talk's table, and yield each as it is done.

    rates   of the adapter, for floors
    quick   a quarter of the pixels and fewer frames
    frames  measured of each, after three that are not counted; None: 20, or 4 if quick
    tell    is called with a line before each row
    Raises AdapterError where no adapter serves.
    """
    for count, row in enumerate(rows, 1):
        width, height = (side // 2 for side in row.size) if quick else row.size
        tell(f"{count} of {len(rows)}: row {row.number}, {row.scene}, {width}x{height} ...")
        settings = Settings(
            size=(width, height), photons=row.photons, bounces=row.bounces, subsampling=row.subsampling
        )
        scene = builtin(row.scene)
        times = measure_frames(scene, settings, frames or (QUICK_FRAMES if quick else FRAMES))
        full, direct = times.columns["total_ms"].median, times.no_bounces.median
        embree = embree_rate(scene, settings)
        floor = floor_of(times, settings, embree, rates)
        yield TalkTimes(row, times, full - direct, full / direct, embree, floor)


def row_line(each: TalkTimes) -> str:
    """Return what a row took, in a line."""
    full, direct = each.times.columns["total_ms"].median, each.times.no_bounces.median
    least = "" if math.isnan(each.floor.total) else f", {each.floor.total:.0f} at least"
    return (
        f"  direct {direct:.0f} ms, all light {full:.0f} ms ({each.ratio:.2f} times; the talk: "
        f"{each.talk.ratio:.2f}); indirect light adds {each.added_ms:.0f} ms (the talk: "
        f"{each.talk.added_ms:.0f}{least})"
    )


def talk_table(measured: Sequence[TalkTimes]) -> list[tuple[object, ...]]:
    """Return a table of rows, with headings: ours beside the talk's."""
    rows: list[tuple[object, ...]] = [
        ("row", "scene", "triangles", "pixels", "K", "photons", "bounces", "direct ms", "full ms", "added ms",
         "talk's", "floor", "full / direct", "talk's")
    ]  # fmt: skip
    for each in measured:
        row, stats = each.talk, each.times.stats
        rows.append((
            row.number, row.scene, f"{stats.polygons:,}", f"{stats.width}x{stats.height}", row.subsampling,
            f"{stats.emitted_photons:,}", row.bounces, each.times.no_bounces.median,
            each.times.columns["total_ms"].median, each.added_ms, row.added_ms, each.floor.total, each.ratio,
            row.ratio,
        ))  # fmt: skip
    return rows


def summary(measured: Sequence[TalkTimes]) -> str:
    """Return a line that says in how many rows indirect light adds no more than in the talk."""
    fewer = sum(each.added_ms <= each.talk.added_ms for each in measured)
    doubled = sum(each.ratio <= 2.0 for each in measured)
    return (
        f"in {fewer} of {len(measured)} rows indirect light adds no more ms than in the talk; in {doubled} a "
        f"whole frame takes at most twice one of direct light"
    )
