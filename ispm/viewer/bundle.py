"""The page in one piece, for canvases that have no server to ask for its files."""

from __future__ import annotations

import json
import re
from pathlib import Path

_PAGE = Path(__file__).parent / "page"
_IMPORT = re.compile(r'^import \{([^}]*)\} from "\./([\w.]+)";\n', re.MULTILINE)
_EXPORT = re.compile(r"^export (const|let|class|function|async function) (\w+)", re.MULTILINE)
_STYLE = re.compile(r'<link rel="stylesheet" href="([\w.]+)">')
_FOLDED = "no-left no-right"  # what a cell of a notebook is too narrow for


def script(first: str, instead: dict[str, str]) -> str:
    """Return the module `first` of the page with all that it imports, as one script.

    Each module becomes a function that is called once and returns what it exports.
    instead  what other modules import in place of one; it may import that one itself
    """
    made: dict[str, str] = {}
    _add(made, first, instead)
    return "\n".join(made.values())


def _add(made: dict[str, str], name: str, instead: dict[str, str]) -> None:
    def imported(file: str) -> str:
        return file if instead.get(file) == name else instead.get(file, file)

    text = (_PAGE / name).read_text("utf-8")
    for _, file in _IMPORT.findall(text):
        if imported(file) not in made:
            _add(made, imported(file), instead)
    text = _IMPORT.sub(lambda m: f"const {{{m[1].replace(' as ', ': ')}}} = {_name(imported(m[2]))};\n", text)
    names = [found[1] for found in _EXPORT.findall(text)]
    text = _EXPORT.sub(r"\1 \2", text)
    made[name] = f"const {_name(name)} = (() => {{\n{text}return {{ {', '.join(names)} }};\n}})();"


def _name(file: str) -> str:
    return "module_" + re.sub(r"\W", "_", file)


def page() -> str:
    """Return the page as one document, which speaks to the window that it is a frame of."""
    text = (_PAGE / "index.html").read_text("utf-8")
    code = script("app.js", {"link.js": "comm.js"})
    for old, new in (
        ('<link rel="icon" href="icon.svg">\n', ""),
        ('<script type="module" src="app.js"></script>', ""),
        ("<body>", f'<body class="{_FOLDED}">'),
        ("</body>", f'<script type="module">{code}</script></body>'),
    ):
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    return _STYLE.sub(lambda m: f"<style>{(_PAGE / m[1]).read_text('utf-8')}</style>", text)


def widget() -> str:
    """Return the module that a notebook runs."""
    return f"const PAGE = {json.dumps(page())};\n{(_PAGE / 'widget.js').read_text('utf-8')}"
