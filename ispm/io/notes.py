"""Warnings of a reader about a file that can be drawn all the same."""

from __future__ import annotations

from collections import Counter

MOST_WARNINGS = 50


class Notes:
    """Faults of a file: each once, like faults counted."""

    def __init__(self) -> None:
        self._lines: dict[str, None] = {}
        self._counts: Counter[tuple[str, str]] = Counter()

    def add(self, message: str) -> None:
        """Note a fault, in one line."""
        self._lines[message] = None

    def count(self, one: str, many: str, times: int = 1) -> None:
        """Note one of several faults of a kind: 'primitive is', 'primitives are'."""
        if times:
            self._counts[one, many] += times

    def lines(self) -> list[str]:
        """Return the lines to show."""
        counted = [f"{n} {one if n == 1 else many}" for (one, many), n in self._counts.items()]
        lines = [*counted, *self._lines]
        if len(lines) > MOST_WARNINGS:
            lines[MOST_WARNINGS:] = [f"and {len(lines) - MOST_WARNINGS} more faults"]
        return lines
