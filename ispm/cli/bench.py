"""`ispm bench`: the benchmark."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from ispm.cli.console import Console
from ispm.cli.options import command


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
    """
    from ispm.bench.suite import run_bench

    run_bench(quick=quick, json=console.as_json, out=Path(output) if output else None)
