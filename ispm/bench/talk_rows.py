"""The talk's table: what its rows ask for, and what they took on a GeForce GTX 280 and eight cores.

Source: McGuire and Luebke, Hardware-Accelerated Global Illumination by Image Space Photon Mapping, talk at
High Performance Graphics 2009, table "Performance Details".
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ispm.errors import SettingsError

STAGES = ("direct_ms", "bounce_map_ms", "copy_ms", "trace_ms", "radiance_ms")  # of `TalkRow.stages`


@dataclass(frozen=True)
class TalkRow:
    """A row of the table.

    number               from 1
    scene                built in, with the triangles, moving objects and lights of the talk's
    size                 pixels across and down
    stored               photons
    stages               ms of STAGES
    fps_direct, fps_full frames per second with direct light alone, and with all light
    """

    number: int
    scene: str
    photons: int
    bounces: int
    size: tuple[int, int]
    subsampling: int
    stored: int
    stages: tuple[float, ...]
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
    TalkRow(1, "ironworks-car", 8_448, 1, _HD, 4, 3_450, (14.2, 0.1, 6.2, 17.2, 8.1), 121.8, 26.5),
    TalkRow(2, "ironworks-car", 8_448, 3, _HD, 4, 5_134, (14.2, 0.1, 6.3, 24.8, 10.2), 121.8, 20.6),
    TalkRow(3, "ironworks-water", 26_896, 1, _HD, 4, 18_852, (8.9, 0.1, 13.5, 49.0, 8.2), 159.9, 13.4),
    TalkRow(4, "ironworks-water", 40_000, 1, _HD, 2, 28_273, (9.0, 0.1, 19.7, 72.7, 16.9), 159.9, 8.7),
    TalkRow(5, "cargo-bay", 20_356, 3, _HD, 6, 7_143, (12.5, 0.1, 8.0, 21.6, 9.6), 138.9, 21.4),
    TalkRow(6, "cargo-bay", 20_356, 1, _HD, 6, 4_919, (12.6, 0.1, 7.6, 16.1, 8.8), 138.9, 26.7),
    TalkRow(7, "cargo-level", 20_356, 3, _HD, 6, 7_489, (17.2, 0.1, 8.3, 29.9, 21.0), 95.7, 15.2),
    TalkRow(8, "cargo-map", 95_948, 3, _HD, 6, 61_000, (150.2, 0.7, 67.0, 284.4, 14.5), 6.5, 2.0),
    TalkRow(9, "glass-sphere", 26_640, 2, _SQUARE, 6, 10_941, (2.2, 0.6, 9.8, 8.9, 3.8), 199.0, 38.8),
    TalkRow(10, "glass-sphere", 137_780, 3, _SQUARE, 3, 66_447, (2.5, 0.8, 36.1, 31.0, 21.4), 199.0, 10.3),
    TalkRow(11, "glass-sphere", 18_000, 2, _HD, 6, 7_319, (9.0, 0.3, 7.6, 4.0, 11.3), 163.0, 34.1),
    TalkRow(12, "objects-in-box", 27_620, 3, _HD, 8, 37_433, (8.2, 0.1, 16.6, 22.8, 40.1), 177.6, 11.8),
    TalkRow(13, "objects-in-box", 27_620, 2, _HD, 10, 30_515, (8.3, 0.1, 16.1, 17.2, 23.2), 177.6, 15.8),
    TalkRow(14, "atrium", 13_688, 1, _TALL, 4, 11_308, (8.8, 0.1, 8.4, 56.7, 12.9), 195.2, 11.9),
    TalkRow(15, "atrium", 6_240, 1, _HD, 4, 5_136, (8.8, 0.1, 5.4, 28.2, 7.2), 195.2, 22.4),
    TalkRow(16, "glass-figure", 29_928, 2, _HD, 6, 32_767, (9.8, 0.1, 15.1, 45.4, 35.3), 137.0, 9.6),
    # The table leaves out row 17's frames per second with direct light: those of row 16 stand here.
    TalkRow(17, "glass-figure", 29_928, 2, _HD, 16, 32_767, (9.4, 0.1, 15.1, 45.3, 10.1), 137.0, 12.8),
    TalkRow(18, "caustic-ring", 101_124, 1, _SMALL, 1, 5_020, (1.4, 0.1, 21.3, 6.4, 3.4), 200.0, 28.0),
    TalkRow(19, "caustic-ring", 324_900, 1, _SMALL, 1, 16_030, (1.4, 0.3, 63.5, 20.1, 9.6), 200.0, 10.9),
    TalkRow(20, "caustic-ring", 101_124, 1, _HD, 1, 5_020, (7.6, 0.1, 22.1, 7.3, 14.3), 197.5, 24.3),
]


def rows_of(text: str) -> Sequence[TalkRow]:
    """Return the rows that numbers and ranges name, such as "1,3-5", in the table's order, each once.

    Raises SettingsError for what is no such text, and for rows that there are not.
    """
    wanted: set[int] = set()
    for part in text.split(","):
        first, dash, last = (word.strip() for word in part.partition("-"))
        last = last if dash else first
        if not (first.isdecimal() and last.isdecimal()):
            raise SettingsError(f"--rows: '{part.strip()}' is no row; give numbers and ranges, as 1,3-5")
        low, high = int(first), int(last)
        if not 1 <= low <= high <= len(ROWS):
            raise SettingsError(f"--rows: '{part.strip()}' is not within the rows 1 to {len(ROWS)}")
        wanted.update(range(low, high + 1))
    return [row for row in ROWS if row.number in wanted]
