"""Write the table of settings in README.md from their one definition.

python scripts/settings_table.py           # rewrites it
python scripts/settings_table.py --check   # exit code 1 where it is out of date
"""

from __future__ import annotations

import re
import sys
from dataclasses import fields
from pathlib import Path

from ispm.knobs import as_text
from ispm.settings import Settings

README = Path(__file__).parents[1] / "README.md"


def table() -> str:
    """Return the table as Markdown."""
    rows = ["| setting | default | meaning |", "|---|---|---|"]
    for f in fields(Settings):
        choices = f"; {', '.join(f'`{c}`' for c in f.metadata['choices'])}" if f.metadata["choices"] else ""
        rows.append(f"| `{f.name}` | {as_text(f.default)} | {f.metadata['help']}{choices} |")
    return "\n".join(rows)


def main() -> int:
    """Rewrite or check the README; return the exit code."""
    before = README.read_text("utf-8")
    pattern = r"(<!-- settings: .*? -->\n).*?(<!-- /settings -->)"
    after = re.sub(pattern, lambda m: m[1] + table() + "\n" + m[2], before, flags=re.DOTALL)
    if "--check" in sys.argv[1:]:
        return int(before != after)
    README.write_text(after, "utf-8")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
