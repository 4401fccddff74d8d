"""What the commands print: results on stdout, everything else on stderr."""

from __future__ import annotations

import dataclasses
import json
import math
import os
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from typing import Any, TextIO

from ispm.errors import OutputError


class Console:
    """Prints for the user.

    quiet    nothing but results and errors
    as_json  one JSON object on stdout instead of the paths written
    """

    def __init__(self, *, quiet: bool = False, as_json: bool = False) -> None:
        self.quiet = quiet
        self.as_json = as_json
        self._warned: set[str] = set()

    def say(self, text: str) -> None:
        """Print a line on stderr."""
        if not self.quiet:
            tell(one_line(text))

    def warn(self, text: str) -> None:
        """Print a warning on stderr, each once."""
        if text not in self._warned and not self.quiet:
            self._warned.add(text)
            tell("ispm: warning: " + one_line(text))

    def written(self, path: object) -> None:
        """Print the path of a file that was written, on stdout."""
        if self.as_json:
            return
        try:
            print(path, flush=True)
        except UnicodeEncodeError as error:
            raise OutputError(
                f"stdout: is {error.encoding}, which cannot name {str(path)!a}; set PYTHONIOENCODING=utf-8"
            ) from None

    def result(self, value: Any) -> None:
        """Print a result as one JSON object on stdout, where JSON is wanted."""
        if self.as_json:
            print(to_json(value), flush=True)

    @property
    def is_live(self) -> bool:
        """Whether stderr is a terminal, where spinners and progress bars may be shown."""
        return not self.quiet and sys.stderr.isatty()

    @contextmanager
    def step(self, text: str, *, spin: bool = True) -> Iterator[None]:
        """Show that `text` is going on, by a spinner on a terminal, else by a line; then print its seconds.

        spin  False: a line on a terminal, too, as a progress bar will follow
        """
        start = time.perf_counter()
        if self.quiet:
            yield
        elif spin and self.is_live:
            from rich.console import Console as Rich

            with Rich(stderr=True, highlight=False).status(one_line(text)):
                yield
        else:
            self.say(f"{text} ...")
            yield
        self.say(f"{text}: {time.perf_counter() - start:.2f} s")

    def table(self, title: str, rows: Sequence[Sequence[object]]) -> None:
        """Print rows of cells as a table on stderr."""
        if self.quiet or self.as_json or not rows:
            return
        cells = [[_cell(value) for value in row] for row in rows]
        if sys.stderr.isatty():
            _rich_table(title, cells)
            return
        widths = [max(len(row[i]) for row in cells) for i in range(len(cells[0]))]
        for row in cells:
            tell("  ".join(c.ljust(w) for c, w in zip(row, widths, strict=True)).rstrip())


def tell(line: str) -> None:
    """Print a line on stderr; the work goes on where stderr cannot be written to any more."""
    try:
        print(line, file=sys.stderr, flush=True)
    except OSError:
        drop(sys.stderr)


def fault_of(stream: TextIO) -> str:
    """Print an empty line; return why a stream cannot take it, else an empty string."""
    try:
        print(file=stream, flush=True)
    except OSError as error:
        return error.strerror or str(error)
    return ""


def drop(stream: TextIO) -> None:
    """Redirect a stream to the null device, with what it has buffered."""
    with suppress(OSError, ValueError):  # it has no file descriptor, or a closed one
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def to_json(value: Any) -> str:
    """Return JSON of dataclasses, arrays and plain values; what is not finite becomes null."""
    return json.dumps(_plain(value), indent=2, allow_nan=False)


def _plain(value: Any) -> Any:
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: _plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, (bool, int, str)):
        return value
    return _plain(value.tolist()) if hasattr(value, "tolist") else str(value)


def _cell(value: object) -> str:
    if isinstance(value, bool) or value is None:
        return {True: "yes", False: "no", None: "-"}[value]
    if isinstance(value, int):
        return f"{value:,}"
    if isinstance(value, float) and math.isnan(value):
        return "-"
    if isinstance(value, float):
        return f"{value:,.2f}" if abs(value) >= 10 else f"{value:.4g}"
    if isinstance(value, (list, tuple)):
        return ", ".join(_cell(item) for item in value) or "-"
    return one_line(str(value))


def _rich_table(title: str, cells: list[list[str]]) -> None:
    from rich.console import Console as Rich
    from rich.table import Table
    from rich.text import Text

    table = Table(title=title, title_justify="left", show_header=False)
    for _ in cells[0]:
        table.add_column()
    for row in cells:
        table.add_row(*(Text(cell) for cell in row))
    Rich(stderr=True, highlight=False).print(table)


def one_line(text: str) -> str:
    """Return `text` in one line, without terminal control characters: names come from files."""
    return "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in " ".join(text.split()))
