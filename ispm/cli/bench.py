"""`ispm bench`: the benchmark."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from ispm.cli.console import Console, to_json
from ispm.cli.options import WHOLE, command
from ispm.errors import OutputError, SettingsError
from ispm.io.atomic import replacing, require_writable

if TYPE_CHECKING:
    from ispm.bench.change import Measured


SLOWER = 1  # exit code


@command()
def bench(
    console: Console,
    report: Annotated[
        str | None,
        Parameter(help="with --compare: an earlier report instead of measuring", metavar="NEW.json"),
    ] = None,
    /,
    *,
    quick: Annotated[bool, Parameter(help="a quarter of the pixels, and fewer frames", negative="")] = False,
    talk: Annotated[
        bool, Parameter(help="the scenes of the talk's table, each as its row says", negative="")
    ] = False,
    rows: Annotated[
        str | None, Parameter(help="with --talk: these rows alone, as 1,3-5", metavar="ROWS")
    ] = None,
    growth: Annotated[
        bool,
        Parameter(help="the time of a frame against photons, pixels, triangles and so on", negative=""),
    ] = False,
    lights: Annotated[
        bool,
        Parameter(
            help="what a rectangle, a sky and 1,000 glowing triangles cost beside a point", negative=""
        ),
    ] = False,
    frames: Annotated[
        int | None, WHOLE, Parameter(help="frames that count, of each scene", metavar="N")
    ] = None,
    output: Annotated[
        str | None,
        Parameter(
            name=("--output", "-o"),
            help="write what is measured as JSON; --talk and --growth do after each row and curve",
            metavar="FILE",
        ),
    ] = None,
    compare: Annotated[
        str | None,
        Parameter(help="compare with what --output wrote earlier; exit with 1 if slower", metavar="OLD.json"),
    ] = None,
) -> int:
    """Measure this machine.

    Example: ispm bench --quick

    Times of a frame, stage by stage, while camera, light and an object move; photons traced per second,
    beside Embree where the package embreex is installed; memory. Medians, and the 5th and 95th percentile.
    A stage is slower if its median grew by more than 3 % plus the uncertainty of both medians. --talk: the
    twenty rows of the talk's table instead, with what indirect light adds to a frame here and there.
    --growth: small scenes of ever more of one thing, and the power of it by which a frame's time grows.
    --lights: processor time of frames with other lights in place of the scene's point.
    """
    if report is not None and (compare is None or output is not None or quick or rows or growth or lights):
        raise SettingsError(
            f"{report}: a report is given to --compare alone: ispm bench NEW.json --compare OLD.json"
        )
    if frames is not None and frames < 1:
        raise SettingsError(f"--frames: must be 1 or more, not {frames}")
    if rows is not None and not talk:
        raise SettingsError("--rows: are those of the talk's table; give --talk as well")
    if growth and (talk or compare is not None):
        raise SettingsError("--growth: is measured alone; leave --talk and --compare out")
    if lights and (talk or growth or compare is not None):
        raise SettingsError("--lights: is measured alone; leave --talk, --growth and --compare out")
    if output is not None and Path(output).suffix.lower() != ".json":
        raise OutputError(f"--output: {output} would be JSON; name it .json")
    if output is not None:
        require_writable(output)
    if growth or lights:
        return (_measure_growth if growth else _measure_lights)(console, quick, frames, output)
    from ispm.bench.change import parse_report, read_report

    before = None if compare is None else read_report(compare)
    if report is not None and before is not None:
        return _tell_changes(console, before, read_report(report))
    if before is not None and (before.kind == "talk") != talk:
        without = "without" if talk else "with"
        raise SettingsError(f"{compare}: was measured {without} --talk; measure this machine so, too")
    measured = (_measure_talk if talk else _measure_frame)(console, quick, frames, output, rows or "")
    if before is not None:
        return _tell_changes(console, before, parse_report(to_json(measured), "this run"))
    console.result(measured)
    return 0


def _measure_frame(console: Console, quick: bool, frames: int | None, output: str | None, _: str) -> object:
    """Measure one scene; return the report."""
    from ispm.bench.report import tables
    from ispm.bench.suite import run_bench

    with console.step("measuring"):
        measured = run_bench(quick, frames=frames)
    for title, rows in tables(measured):
        console.table(title, rows)
    if output is not None:
        _write(measured, output)
        console.written(output)
    return measured


def _measure_talk(
    console: Console, quick: bool, frames: int | None, output: str | None, wanted: str
) -> object:
    """Measure rows of the talk's table, all where none is wanted; return the report."""
    from ispm.bench.suite import watch_machine
    from ispm.bench.talk import TalkReport, measure_talk, row_line, summary, talk_table
    from ispm.bench.talk_rows import ROWS, rows_of
    from ispm.bench.yardsticks import measure_yardsticks, yardstick_table

    rows = rows_of(wanted) if wanted else ROWS
    machine, rates = watch_machine(), measure_yardsticks()
    console.table("yardsticks", yardstick_table(rates))
    report = TalkReport(rates, machine(rates.adapter))
    for each in measure_talk(rates, quick, frames, rows, console.say):
        console.say(row_line(each))
        report.rows.append(each)
        report.machine = machine(rates.adapter)
        if output is not None:
            _write(report, output)
    console.table("the talk's table", talk_table(report.rows))
    console.say(summary(report.rows))
    if output is not None:
        console.written(output)
    return report


def _measure_growth(console: Console, quick: bool, frames: int | None, output: str | None) -> int:
    """Measure how the time of a frame grows; return the exit code."""
    from ispm.bench.growth import GrowthReport, curve_line, growth_table, measure_growth
    from ispm.bench.suite import watch_machine

    machine = watch_machine()
    report = GrowthReport(machine(""))
    for curve in measure_growth(quick, frames, console.say):
        console.say(curve_line(curve))
        report.curves.append(curve)
        report.machine = machine(curve.adapter)
        if output is not None:
            _write(report, output)
    console.table("growth", growth_table(report.curves))
    if output is not None:
        console.written(output)
    console.result(report)
    return 0


def _measure_lights(console: Console, quick: bool, frames: int | None, output: str | None) -> int:
    """Measure what lights cost; return the exit code."""
    from ispm.bench.lights import LightsReport, lights_table, measure_lights
    from ispm.bench.suite import watch_machine

    machine = watch_machine()
    costs, adapter = measure_lights(quick, frames, console.say)
    report = LightsReport(machine(adapter), costs)
    console.table("frames by their light", lights_table(costs))
    if output is not None:
        _write(report, output)
        console.written(output)
    console.result(report)
    return 0


def _write(measured: object, output: str) -> None:
    """Write what was measured as JSON."""
    with replacing(output) as path:
        path.write_text(to_json(measured) + "\n", "utf-8")


def _tell_changes(console: Console, before: Measured, now: Measured) -> int:
    """Print what changed between two reports; return the exit code."""
    from ispm.bench.change import changes, in_one_alone, table

    found = changes(before, now)
    slower = [each.stage for each in found if each.is_slower]
    console.table("times of a frame, before and now", table(found))
    if left := in_one_alone(before, now):
        console.say(f"not compared, as they are in one report alone: {', '.join(left)}")
    console.say(f"slower: {', '.join(slower) or 'nothing'}")
    console.result({"changes": [{**asdict(each), "ratio": each.ratio} for each in found], "slower": slower})
    return SLOWER if slower else 0
