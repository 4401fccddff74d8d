"""`ispm bench`: the benchmark."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

from ispm.cli.console import Console, to_json
from ispm.cli.options import command
from ispm.io.atomic import replacing, require_writable


@command()
def bench(
    console: Console,
    /,
    *,
    quick: Annotated[bool, Parameter(help="a quarter of the pixels", negative="")] = False,
    output: Annotated[
        str | None, Parameter(name=("--output", "-o"), help="write the table as JSON", metavar="FILE")
    ] = None,
) -> None:
    """Measure this machine.

    Example: ispm bench --quick

    Times of a frame, stage by stage, while camera, light and an object move; photons traced per second,
    beside Embree where the package embreex is installed; memory. Medians, and the 5th and 95th percentile.
    """
    if output is not None:
        require_writable(output)
    from ispm.bench.report import tables
    from ispm.bench.suite import run_bench

    with console.step("measuring"):
        report = run_bench(quick)
    for title, rows in tables(report):
        console.table(title, rows)
    if output is not None:
        with replacing(output) as path:
            path.write_text(to_json(report) + "\n", "utf-8")
        console.written(output)
    console.result(report)
