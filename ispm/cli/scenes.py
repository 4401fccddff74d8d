"""`ispm scenes`: the built-in scenes."""

from __future__ import annotations

import inspect

from ispm.cli.console import Console
from ispm.cli.options import command


@command()
def scenes(console: Console) -> None:
    """List the built-in scenes.

    Example: ispm scenes
    """
    from ispm.scene.builtin import BUILTINS

    lines = {name: (inspect.getdoc(make) or "").partition("\n")[0] for name, make in BUILTINS.items()}
    console.table("built-in scenes", list(lines.items()))
    console.result({"scenes": [{"name": name, "about": about} for name, about in lines.items()]})
