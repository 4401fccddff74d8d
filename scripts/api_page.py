"""Write docs/api.md, every public name, from signatures and docstrings.

python scripts/api_page.py           # rewrites it
python scripts/api_page.py --check   # exit code 1 where it is out of date

Stops where a public name is in no chapter or has no docstring, or where that does not name a parameter.
"""

from __future__ import annotations

import enum
import inspect
import math
import re
import sys
from collections.abc import Callable, Iterator
from dataclasses import fields
from pathlib import Path
from types import ModuleType
from typing import Any

import ispm
from ispm.settings import LoadLimits

PAGE = Path(__file__).parents[1] / "docs" / "api.md"
CHAPTERS = {
    "Pictures": ["render", "Renderer", "Settings", "Frame", "Names", "read_names", "Stats", "compare"],
    "Where light comes from": ["LightPaths", "PhotonPath"],
    "The live view": ["view", "Viewer"],
    "Films": ["animate", "Film", "CameraPath", "CameraKey", "Turntable"],
    "Scenes": ["load", "builtin", "save", "Scene", "Node", "Part", "Animation", "Channel"],
    "Shapes and surfaces": [
        "shapes",
        "Mesh",
        "Morph",
        "Skin",
        "Material",
        "AlphaMode",
        "Texture",
        "Wrap",
        "TextureUse",
    ],
    "Lights": ["PointLight", "SpotLight", "DirectionalLight", "RectLight", "DiskLight", "SphereLight"],
    "Surroundings": ["Environment", "Sky"],
    "Cameras and rotations": ["Camera", "euler", "axis_angle"],
    "The machine": ["adapters"],
    "Errors": ["IspmError", "SceneError", "SettingsError", "OutputError", "AdapterError", "SceneWarning"],
}
INTRODUCTION = """\
# Every name

<!-- written by scripts/api_page.py from the docstrings; `make docs` does it again -->

`import ispm` gives the names below; [Python by task](python.md) shows them at work. Conventions are those of
glTF 2.0: right-handed, +Y up, metres; cameras look and lights shine along their node's -Z. Colors and light
are linear Rec. 709: radiance and emission in cd/m², intensity in candela, a sun's in lux, flux in lumen, each
per channel. Angles are in radians, times in seconds unless a name ends in `_ms`. Matrices are (4, 4), for
column vectors; a `pose` is camera-to-world. Pictures are arrays (height, width, channels), row 0 on top;
sizes are (width, height). A `Point` is three numbers, a `Quaternion` four: x, y, z, w. Where a tuple of
numbers is asked for, an array or a list of them serves.
"""
_ITEM = re.compile(r"^(\w[\w ,/]*?) {2,}(\S.*)$|^(\w[\w, ]*?)   (\S.*)$")


def page() -> str:
    """Return the page. Raises SystemExit naming what is missing."""
    listed = [name for names in CHAPTERS.values() for name in names]
    stray = set(listed) ^ (set(ispm.__all__) - {"__version__"})
    if stray or len(listed) != len(set(listed)):
        raise SystemExit(f"api_page: in no chapter, in two, or not public: {', '.join(sorted(stray))}")
    lines = [INTRODUCTION]
    for chapter, names in CHAPTERS.items():
        lines.append(f"- {chapter}: " + ", ".join(f"[{name}](#{_anchor(name)})" for name in names))
    for chapter, names in CHAPTERS.items():
        lines += ["", f"## {chapter}"]
        for name in names:
            lines += _entry(name, getattr(ispm, name))
    return re.sub(r"\n{3,}", "\n\n", "\n".join(lines)) + "\n"


def _entry(name: str, value: Any) -> list[str]:
    """The lines about one name."""
    lines = ["", f"### {name}", ""]
    if isinstance(value, ModuleType):
        lines += _text(name, value)
        for inside in value.__all__:
            lines += _function(f"{name}.{inside}", getattr(value, inside))
        return lines
    if not inspect.isclass(value):
        return [*lines, *_function(name, value)[3:], *(_limits() if name == "load" else [])]
    if issubclass(value, enum.Enum):
        return [*lines, *_text(name, value), "", *(f"- `{name}.{member.name}`" for member in value)]
    if issubclass(value, (Exception, Warning)):
        kinds = [f"`{base.__name__}`" for base in value.__bases__]
        return [*lines, f"A kind of {' and '.join(kinds)}.", "", *_text(name, value)]
    if name != "Stats":
        lines += [_signature(name, value), ""]
    lines += _text(name, value)
    if name == "Settings":
        lines += ["", "[The table of settings](../README.md#settings) has their meaning and defaults."]
    elif name == "Stats":
        lines += ["", "Fields: " + ", ".join(f"`{f.name}`" for f in fields(value)) + "."]
    else:
        _require_named(name, value)
    properties = [(n, m) for n, m in _members(value) if not callable(m)]
    lines += ["", "Properties:", ""] * bool(properties)
    for inside, member in properties:
        text = " ".join(_text(f"{name}.{inside}", member.func if hasattr(member, "func") else member.fget))
        lines.append(f"- `.{inside}`: {' '.join(text.split())}")
    for inside, member in _members(value):
        if callable(member):
            lines += _function(f"{name}.{inside}", member, bound=True)
    return lines


def _limits() -> list[str]:
    """The table of what files may ask for."""
    rows = []
    for f in fields(LoadLimits):
        most = f"{f.default:,} {f.metadata['unit']}".strip()
        rows.append(f"| `{f.name}` | {most} | {f.metadata['help']} |")
    return ["", "| limit | default | meaning |", "|---|---|---|", *rows]


def _members(owner: type) -> Iterator[tuple[str, Any]]:
    """Public methods and properties of a class, its own before those it inherits from this package."""
    seen: set[str] = set()
    for base in owner.__mro__:
        if base.__module__.partition(".")[0] != "ispm":
            continue
        for name, member in vars(base).items():
            if name.startswith("_") or name in seen or name in _WITHIN:
                continue
            if isinstance(member, classmethod | staticmethod):
                member = member.__func__
            if inspect.isfunction(member) or isinstance(member, property) or hasattr(member, "func"):
                seen.add(name)
                yield name, member


def _function(name: str, function: Callable[..., Any], *, bound: bool = False) -> list[str]:
    """The lines about one function."""
    text = _text(name, function)
    _require_named(name, function)
    return ["", f"#### {name}", "", _signature(name, function, bound=bound), "", *text]


def _require_named(name: str, value: Any) -> None:
    """Stop where a docstring does not name a parameter."""
    doc = _doc(name, value)
    for parameter in _parameters(value):
        if not re.search(rf"\b{re.escape(parameter.name)}\b", doc) and parameter.name not in _PLAIN:
            raise SystemExit(f"api_page: the docstring of {name} does not name '{parameter.name}'")


_WITHIN = ("check", "last_made_of", "made_of", "move", "stand_as", "trajectories")  # for this package
_PLAIN = ("name", "self", "cls")  # say what they are


def _parameters(value: Any) -> list[inspect.Parameter]:
    return [p for p in inspect.signature(value).parameters.values() if p.name not in ("self", "cls")]


def _signature(name: str, value: Any, *, bound: bool = False) -> str:
    """A call with its parameters, types and defaults, as code."""
    words, kind = [], None
    for p in _parameters(value):
        if p.kind is p.KEYWORD_ONLY and kind not in (p.KEYWORD_ONLY, p.VAR_POSITIONAL):
            words.append("*")
        kind = p.kind
        text = {p.VAR_KEYWORD: "**", p.VAR_POSITIONAL: "*"}.get(p.kind, "") + p.name
        if p.annotation is not p.empty and p.kind is not p.VAR_KEYWORD:
            text += f": {_type(p.annotation)}"
        if p.default is not p.empty:
            text += f" = {_default(p.default)}"
        words.append(text)
    returned = inspect.signature(value).return_annotation if not inspect.isclass(value) else None
    arrow = f" -> {_type(returned)}" if returned not in (None, "None", inspect.Signature.empty) else ""
    head = name if bound else f"ispm.{name}"
    if name == "Settings":
        words = ["**settings"]
    return f"`{head}({', '.join(words)}){arrow}`"


def _type(annotation: Any) -> str:
    text = annotation if isinstance(annotation, str) else getattr(annotation, "__name__", str(annotation))
    return text.replace("np.", "").replace("os.PathLike[str]", "Path").replace("Convention", "str")


def _default(value: Any) -> str:
    if isinstance(value, enum.Enum):
        return f"{type(value).__name__}.{value.name}"
    if getattr(value, "__name__", ""):
        return "..."
    if isinstance(value, float):
        return str(value) if math.isinf(value) or value == int(value) else f"{value:.4g}"
    return "..." if "factory" in repr(value) else repr(value)


def _doc(name: str, value: Any) -> str:
    doc = inspect.getdoc(value)
    if not doc:
        raise SystemExit(f"api_page: {name} has no docstring")
    return doc


def _text(name: str, value: Any) -> list[str]:
    """A docstring as Markdown: what stands in columns becomes a list."""
    lines: list[str] = []
    in_item = False
    for line in _doc(name, value).splitlines():
        item = _ITEM.match(line)
        if item:
            what, told = (item[1], item[2]) if item[1] else (item[3], item[4])
            if not in_item:
                lines.append("")
            lines.append(f"- `{what.strip()}`: {told}")
            in_item = True
        elif in_item and line.startswith(" "):
            lines[-1] += " " + line.strip()
        else:
            if in_item and line:
                lines.append("")
            in_item = False
            if line.startswith("Raises") and lines and lines[-1]:
                lines.append("")
            lines.append(line)
    return [re.sub(r"(?<!`)\*\*(?=\w)", r"\\*\\*", re.sub(r"; +", "; ", line)) for line in lines]


def _anchor(name: str) -> str:
    return name.lower().replace(".", "")


def main() -> int:
    """Rewrite or check the page; return the exit code."""
    text = page()
    if "--check" in sys.argv[1:]:
        return int(not PAGE.exists() or PAGE.read_text("utf-8") != text)
    PAGE.write_text(text, "utf-8")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
