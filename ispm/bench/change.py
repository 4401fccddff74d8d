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
class Measured:
    """What is compared of a report: the fields of `Report` that times depend on."""

    format: int
    machine: _Machine
    frame: _Frame


@dataclass(frozen=True)
class _Header:
    format: int = 0


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
        version = msgspec.json.decode(data, type=_Header).format
        if version == FORMAT:
            return msgspec.json.decode(data, type=Measured)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise SettingsError(f"{called}: is no report of ispm bench: {error}") from None
    raise SettingsError(
        f"{called}: is of format {version}, not {FORMAT}: measure again by ispm bench --output"
    )


def changes(before: Measured, now: Measured) -> list[Change]:
    """Return the stages of two reports side by side, in ms.

    Raises SettingsError where they are of two machines, or did not measure the same.
    """
    for what, mine, yours in (
        ("processor", before.machine.processor, now.machine.processor),
        ("count of cores", before.machine.cores, now.machine.cores),
        ("adapter", before.machine.adapter, now.machine.adapter),
        ("scene", before.frame.scene, now.frame.scene),
        ("count of triangles", before.frame.stats.polygons, now.frame.stats.polygons),
        ("size", _size(before), _size(now)),
        ("subsampling", before.frame.stats.subsampling, now.frame.stats.subsampling),
        ("count of photons", before.frame.stats.emitted_photons, now.frame.stats.emitted_photons),
        ("count of frames", before.frame.frames, now.frame.frames),
        ("list of stages", sorted(before.frame.columns), sorted(now.frame.columns)),
    ):
        if mine != yours:
            raise SettingsError(f"the reports cannot be compared: the {what} was {mine}, and now is {yours}")
    count = now.frame.frames
    pairs = {  # rates and frames per second follow from these
        name.removesuffix("_ms").replace("_", " "): (values, now.frame.columns[name])
        for name, values in before.frame.columns.items()
        if name.endswith("_ms")
    }
    pairs["total at 0 bounces"] = before.frame.no_bounces, now.frame.no_bounces
    return [
        Change(stage, old.median, new.median, _uncertainty(old, new, count))
        for stage, (old, new) in pairs.items()
    ]


def rows(found: list[Change]) -> list[tuple[object, ...]]:
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


def _size(report: Measured) -> str:
    return f"{report.frame.stats.width}x{report.frame.stats.height}"


def _uncertainty(old: Spread, new: Spread, count: int) -> float:
    """Return what the medians of two runs of `count` frames differ by without cause, at 95 %.

    A median's notch is _NOTCH times the range of its quartiles over the root of the count.
    """
    return _NOTCH * math.hypot(old.q3 - old.q1, new.q3 - new.q1) / math.sqrt(count)
