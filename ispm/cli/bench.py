"""`ispm bench`: the benchmark."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from ispm.cli.console import Console, to_json
from ispm.cli.options import command
from ispm.errors import SettingsError
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
    frames: Annotated[int | None, Parameter(help="frames that count, of each scene", metavar="N")] = None,
    output: Annotated[
        str | None, Parameter(name=("--output", "-o"), help="write the table as JSON", metavar="FILE")
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
    """
    if report is not None and (compare is None or output is not None or quick):
        raise SettingsError(
            f"{report}: a report is given to --compare alone: ispm bench NEW.json --compare OLD.json"
        )
    if frames is not None and frames < 1:
        raise SettingsError(f"--frames: must be 1 or more, not {frames}")
    if talk and compare is not None:
        raise SettingsError("--talk: its table is not for --compare; leave one of them out")
    if output is not None:
        require_writable(output)
    if talk:
        return _measure_talk(console, quick, frames, output)
    from ispm.bench.change import parse_report, read_report

    before = None if compare is None else read_report(compare)
    if report is not None and before is not None:
        return _tell_changes(console, before, read_report(report))
    from ispm.bench.report import tables
    from ispm.bench.suite import run_bench

    with console.step("measuring"):
        measured = run_bench(quick, frames=frames)
    for title, rows in tables(measured):
        console.table(title, rows)
    _write(console, measured, output)
    if before is not None:
        return _tell_changes(console, before, parse_report(to_json(measured), "this run"))
    console.result(measured)
    return 0


def _measure_talk(console: Console, quick: bool, frames: int | None, output: str | None) -> int:
    """Measure the talk's table; return the exit code."""
    from ispm.bench.suite import watch_machine
    from ispm.bench.talk import measure_talk, summary, talk_table

    machine, measured = watch_machine(), []
    for each in measure_talk(quick, frames, tell=console.say):
        console.say(
            f"  direct {each.times.no_bounces.median:.0f} ms, with indirect {each.added_ms:.0f} ms more"
        )
        measured.append(each)
    console.table("the talk's table", talk_table(measured))
    console.say(summary(measured))
    report = {"machine": machine(measured[-1].times.stats.adapter), "rows": measured}
    _write(console, report, output)
    console.result(report)
    return 0


def _write(console: Console, measured: object, output: str | None) -> None:
    """Write what was measured as JSON, where wanted."""
    if output is not None:
        with replacing(output) as path:
            path.write_text(to_json(measured) + "\n", "utf-8")
        console.written(output)


def _tell_changes(console: Console, before: Measured, now: Measured) -> int:
    """Print what changed between two reports; return the exit code."""
    from ispm.bench.change import changes, rows

    found = changes(before, now)
    slower = [each.stage for each in found if each.is_slower]
    console.table("times of a frame, before and now", rows(found))
    console.say(f"slower: {', '.join(slower) or 'nothing'}")
    console.result({"changes": [{**asdict(each), "ratio": each.ratio} for each in found], "slower": slower})
    return SLOWER if slower else 0
