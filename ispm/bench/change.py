"""How the times of a benchmark changed since an earlier one, stage by stage."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import msgspec

from ispm.bench.suite import FORMAT, Spread
from ispm.errors import SettingsError

LEAST = 0.03  # of a stage's median: a stage that is slower by less is not reported
_NOTCH = 1.57  # see McGill, Tukey and Larsen, Variations of Box Plots, 1978


@dataclass(frozen=True)
class Change:
    """One stage before and now.

    before, now  medians, ms
    uncertainty  of the difference of the medians, ms: 95 % of equal runs' differ by less
    """

    stage: str
    before: float
    now: float
    uncertainty: float

    @property
    def ratio(self) -> float:
        """Now over before; NaN where that was 0."""
        return self.now / self.before if self.before else math.nan

    @property
    def is_slower(self) -> bool:
        """Whether it takes longer by more than LEAST and what the frames of both runs scatter by."""
        return self.now - self.before > LEAST * self.before + self.uncertainty


@dataclass(frozen=True)
class _Machine:
    processor: str
    cores: int
    adapter: str


@dataclass(frozen=True)
class _Stats:
    width: int
    height: int
    subsampling: int
    polygons: int
    emitted_photons: int


@dataclass(frozen=True)
class _Frame:
    scene: str
    frames: int
    stats: _Stats
    columns: dict[str, Spread]
    no_bounces: Spread


@dataclass(frozen=True)
class _Number:
    number: int


@dataclass(frozen=True)
class _Row:
    talk: _Number
    times: _Frame


@dataclass(frozen=True)
class _FrameReport:
    machine: _Machine
    frame: _Frame


@dataclass(frozen=True)
class _TalkReport:
    machine: _Machine
    rows: list[_Row]


@dataclass(frozen=True)
class _Header:
    format: int = 0
    kind: str = "frame"


@dataclass(frozen=True)
class Measured:
    """What is compared of a report: the fields that times depend on.

    kind    "frame", or "talk" of `ispm bench --talk`
    frames  by name: "" the only one, or "row 3" and so on of the talk's table
    """

    kind: str
    machine: _Machine
    frames: dict[str, _Frame]


def read_report(path: str | Path) -> Measured:
    """Read a report that `ispm bench --output` wrote. Raises SettingsError for what is none, or too old."""
    try:
        data = Path(path).read_bytes()
    except OSError as error:
        raise SettingsError(f"{path}: cannot be read: {error.strerror}") from None
    return parse_report(data, str(path))


def parse_report(data: bytes | str, called: str) -> Measured:
    """Return what is compared of a report's JSON. Raises SettingsError, saying what the report is called."""
    try:
        header = msgspec.json.decode(data, type=_Header)
        if header.format == FORMAT and header.kind == "talk":
            talk = msgspec.json.decode(data, type=_TalkReport)
            return Measured("talk", talk.machine, {f"row {row.talk.number}": row.times for row in talk.rows})
        if header.format == FORMAT and header.kind == "frame":
            report = msgspec.json.decode(data, type=_FrameReport)
            return Measured("frame", report.machine, {"": report.frame})
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise SettingsError(f"{called}: is no report of ispm bench: {error}") from None
    if header.format == FORMAT:
        raise SettingsError(
            f"{called}: is of ispm bench --{header.kind}, which is not compared; give one of ispm bench or "
            f"ispm bench --talk"
        )
    raise SettingsError(
        f"{called}: is of format {header.format}, not {FORMAT}: measure again by ispm bench --output"
    )


def changes(before: Measured, now: Measured) -> list[Change]:
    """Return the stages of two reports side by side, in ms; of the talk's table, those of the rows in both.

    Raises SettingsError where they are of two machines, or did not measure the same.
    """
    _require_equal(
        "",
        ("kind", before.kind, now.kind),
        ("processor", before.machine.processor, now.machine.processor),
        ("count of cores", before.machine.cores, now.machine.cores),
        ("adapter", before.machine.adapter, now.machine.adapter),
    )
    both = [name for name in now.frames if name in before.frames]
    if not both:
        raise SettingsError("the reports cannot be compared: no row of the talk's table is in both")
    return [change for name in both for change in _frame_changes(name, before.frames[name], now.frames[name])]


def in_one_alone(before: Measured, now: Measured) -> list[str]:
    """Return the names of frames that `changes` leaves out, since only one of the reports has them."""
    return sorted(before.frames.keys() ^ now.frames.keys(), key=lambda name: int(name.split()[-1]))


def _frame_changes(name: str, before: _Frame, now: _Frame) -> list[Change]:
    _require_equal(
        f"{name}: " if name else "",
        ("scene", before.scene, now.scene),
        ("count of triangles", before.stats.polygons, now.stats.polygons),
        ("size", _size(before), _size(now)),
        ("subsampling", before.stats.subsampling, now.stats.subsampling),
        ("count of photons", before.stats.emitted_photons, now.stats.emitted_photons),
        ("count of frames", before.frames, now.frames),
        ("list of stages", sorted(before.columns), sorted(now.columns)),
    )
    pairs = {  # rates and frames per second follow from these
        column.removesuffix("_ms").replace("_", " "): (values, now.columns[column])
        for column, values in before.columns.items()
        if column.endswith("_ms")
    }
    pairs["total at 0 bounces"] = before.no_bounces, now.no_bounces
    return [
        Change(
            f"{name}: {stage}" if name else stage, old.median, new.median, uncertainty(old, new, now.frames)
        )
        for stage, (old, new) in pairs.items()
    ]


def _require_equal(where: str, *pairs: tuple[str, object, object]) -> None:
    for what, mine, yours in pairs:
        if mine != yours:
            raise SettingsError(
                f"the reports cannot be compared: {where}the {what} was {mine}, and now is {yours}"
            )


def table(found: list[Change]) -> list[tuple[object, ...]]:
    """Return a table of changes with a row of headings."""
    headings = ("stage", "before", "now", "unit", "now / before", "beyond", "")
    return [
        headings,
        *(
            (
                c.stage,
                c.before,
                c.now,
                "ms",
                c.ratio,
                c.before * (1.0 + LEAST) + c.uncertainty,
                "slower" * c.is_slower,
            )
            for c in found
        ),
    ]


def _size(frame: _Frame) -> str:
    return f"{frame.stats.width}x{frame.stats.height}"


def uncertainty(old: Spread, new: Spread, count: int) -> float:
    """Return what the medians of two runs of `count` frames differ by without cause, at 95 %.

    A median's notch is _NOTCH times the range of its quartiles over the root of the count.
    """
    return _NOTCH * math.hypot(old.q3 - old.q1, new.q3 - new.q1) / math.sqrt(count)
