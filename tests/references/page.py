"""Tables in docs/accuracy.md, between markers."""

from __future__ import annotations

import re
from pathlib import Path

PAGE = Path(__file__).parents[2] / "docs" / "accuracy.md"


def write_between(title: str, text: str) -> None:
    """Replace what is between `<!-- title: ... -->` and `<!-- /title -->`."""
    pattern = rf"(<!-- {title}: .*? -->\n).*?(<!-- /{title} -->)"
    page = PAGE.read_text("utf-8")
    page = re.sub(pattern, lambda found: f"{found[1]}{text}\n{found[2]}", page, flags=re.DOTALL)
    PAGE.write_text(page, "utf-8")


def read_between(title: str) -> list[list[str]]:
    """Return the cells of the rows of the table that stands there."""
    found = re.search(rf"<!-- {title}: .*? -->\n(.*?)<!-- /{title} -->", PAGE.read_text("utf-8"), re.DOTALL)
    lines = found[1].splitlines()[2:] if found else []
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]


def table(headings: list[str], rows: list[list[str]], sides: str) -> str:
    """Return it as Markdown; sides: `l` or `r` per column."""
    rules = ["---:" if side == "r" else "---" for side in sides]
    lines = [" | ".join(cells) for cells in (headings, rules, *rows)]
    return "\n".join(f"| {line} |" for line in lines)
