"""`ispm scenes`: the built-in scenes."""

from __future__ import annotations

from ispm.cli.console import Console
from ispm.cli.options import command


@command()
def scenes(console: Console) -> None:
    """List the built-in scenes, and those that are downloaded at their first use.

    Example: ispm scenes

    The table goes to stderr; for programs, --json prints it on stdout.
    """
    from ispm.io.named import abouts

    lines = abouts()
    console.table("built-in scenes", list(lines.items()))
    console.result({"scenes": [{"name": name, "about": about} for name, about in lines.items()]})
