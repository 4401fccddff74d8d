"""The scenes of the talk's table, each at its row's resolution, subsampling, photons and bounces.

Source: McGuire and Luebke, Hardware-Accelerated Global Illumination by Image Space Photon Mapping, talk at
High Performance Graphics 2009, table of results: a GeForce GTX 280 and eight cores.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from ispm.bench.suite import FrameTimes, measure_frames
from ispm.library.builtin import builtin
from ispm.settings import Settings

QUICK_FRAMES, FRAMES = 4, 20


@dataclass(frozen=True)
class TalkRow:
    """A row of the talk's table.

    scene                built in, with the triangles, moving objects and lights of the talk's
    size                 pixels across and down
    fps_direct, fps_full frames per second with direct light alone, and with all light
    """

    scene: str
    photons: int
    bounces: int
    size: tuple[int, int]
    subsampling: int
    fps_direct: float
    fps_full: float

    @property
    def added_ms(self) -> float:
        """What indirect light adds to a frame, ms."""
        return 1e3 / self.fps_full - 1e3 / self.fps_direct

    @property
    def ratio(self) -> float:
        """A frame with all light over one with direct light alone."""
        return self.fps_direct / self.fps_full


_HD, _TALL, _SQUARE, _SMALL = (1920, 1080), (1920, 1600), (512, 512), (512, 384)
ROWS = [
    TalkRow("ironworks-car", 8_448, 1, _HD, 4, 121.8, 26.5),
    TalkRow("ironworks-car", 8_448, 3, _HD, 4, 121.8, 20.6),
    TalkRow("ironworks-water", 26_896, 1, _HD, 4, 159.9, 13.4),
    TalkRow("ironworks-water", 40_000, 1, _HD, 2, 159.9, 8.7),
    TalkRow("cargo-bay", 20_356, 3, _HD, 6, 138.9, 21.4),
    TalkRow("cargo-bay", 20_356, 1, _HD, 6, 138.9, 26.7),
    TalkRow("cargo-level", 20_356, 3, _HD, 6, 95.7, 15.2),
    TalkRow("cargo-map", 95_948, 3, _HD, 6, 6.5, 2.0),
    TalkRow("glass-sphere", 26_640, 2, _SQUARE, 6, 199.0, 38.8),
    TalkRow("glass-sphere", 137_780, 3, _SQUARE, 3, 199.0, 10.3),
    TalkRow("glass-sphere", 18_000, 2, _HD, 6, 163.0, 34.1),
    TalkRow("objects-in-box", 27_620, 3, _HD, 8, 177.6, 11.8),
    TalkRow("objects-in-box", 27_620, 2, _HD, 10, 177.6, 15.8),
    TalkRow("atrium", 13_688, 1, _TALL, 4, 195.2, 11.9),
    TalkRow("atrium", 6_240, 1, _HD, 4, 195.2, 22.4),
    TalkRow("glass-figure", 29_928, 2, _HD, 6, 137.0, 9.6),
    TalkRow("glass-figure", 29_928, 2, _HD, 16, 137.0, 12.8),  # fps_direct of the row before: it has none
    TalkRow("caustic-ring", 101_124, 1, _SMALL, 1, 200.0, 28.0),
    TalkRow("caustic-ring", 324_900, 1, _SMALL, 1, 200.0, 10.9),
    TalkRow("caustic-ring", 101_124, 1, _HD, 1, 197.5, 24.3),
]


@dataclass(frozen=True)
class TalkTimes:
    """A row, and what it takes here.

    times     of its frames, in which camera, lights and objects move
    added_ms  median of whole frames less that of frames without bounces
    ratio     of these medians
    """

    row: TalkRow
    times: FrameTimes
    added_ms: float
    ratio: float


def measure_talk(
    quick: bool = False,
    frames: int | None = None,
    rows: Sequence[TalkRow] = ROWS,
    tell: Callable[[str], None] = lambda line: None,
) -> Iterator[TalkTimes]:
    """Measure rows of the talk's table, and yield each as it is done.

    quick   a quarter of the pixels and fewer frames
    frames  measured of each, after three that are not counted; None: 20, or 4 if quick
    tell    is called with a line before each row
    Raises AdapterError where no adapter serves.
    """
    for number, row in enumerate(rows, 1):
        width, height = (side // 2 for side in row.size) if quick else row.size
        tell(f"{number} of {len(rows)}: {row.scene}, {width}x{height}")
        settings = Settings(
            size=(width, height), photons=row.photons, bounces=row.bounces, subsampling=row.subsampling
        )
        times = measure_frames(builtin(row.scene), settings, frames or (QUICK_FRAMES if quick else FRAMES))
        full, direct = times.columns["total_ms"].median, times.no_bounces.median
        yield TalkTimes(row, times, full - direct, full / direct)


def talk_table(measured: Sequence[TalkTimes]) -> list[tuple[object, ...]]:
    """Return a table of rows, with headings: ours beside the talk's, and how many add no more than there."""
    rows: list[tuple[object, ...]] = [
        ("scene", "triangles", "pixels", "K", "photons", "bounces", "direct ms", "full ms", "added ms",
         "talk's", "full / direct", "talk's")
    ]  # fmt: skip
    for each in measured:
        row, stats = each.row, each.times.stats
        rows.append((
            row.scene, f"{stats.polygons:,}", f"{stats.width}x{stats.height}", row.subsampling,
            f"{stats.emitted_photons:,}", row.bounces, each.times.no_bounces.median,
            each.times.columns["total_ms"].median, each.added_ms, row.added_ms, each.ratio, row.ratio,
        ))  # fmt: skip
    return rows


def summary(measured: Sequence[TalkTimes]) -> str:
    """Return a line that says in how many rows indirect light adds no more than in the talk."""
    fewer = sum(each.added_ms <= each.row.added_ms for each in measured)
    doubled = sum(each.ratio <= 2.0 for each in measured)
    return (
        f"in {fewer} of {len(measured)} rows indirect light adds no more ms than in the talk; in {doubled} a "
        f"whole frame takes at most twice one of direct light"
    )
