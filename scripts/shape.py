"""How the package is built, in numbers: what is long, numbered, crowded or goes in circles.

python scripts/shape.py                  # a table; of ispm, or of another PACKAGE
python scripts/shape.py --json
python scripts/shape.py --sample 40      # functions at random, whose docstrings are to be read; --seed

rooms      folders of the package; a module beside them is a room of its own
arguments  of functions, self and cls aside; * and ** count one each
numbered   subscripts by an integer, written out or a module's constant, of a name, an attribute or another
           such subscript: `b[7]`, `b[_ETA]`, `scene[6][1]`. Not counted: negative ones; what is called shape,
           size or strides; arrays (annotated so, or as lists and the like; made by numpy in the same
           function; with a shape that begins with a letter beside their name in the docstring); vectors
vectors    names of which a function reads [0], [1] and [2] and no others: components, told apart
kernels    functions compiled by @jit; what is public has no name that begins with _
stated     docstrings with a shape, a type of numbers or a unit; whether all that needs one has it, a reader
           must tell
circles    of rooms that import each other at their top; and imports within functions that would close one
code       lines that are not blank, comments or docstrings
"""

from __future__ import annotations

import argparse
import ast
import io
import json
import random
import re
import tokenize
from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

MOST_ARGUMENTS = 8
_SHOWN = 10  # longest functions
_WIDE = r"\b(ndarray|list|dict|Sequence|Mapping|Iterable|str|bytes)\b"  # annotations
_SIZES = re.compile(r"(^|[._])(shape|size|strides)$")
_CAPITALS = r"_?[A-Z][A-Z0-9_]*"
_PLACES = re.compile(
    rf"^({_CAPITALS}(?:, {_CAPITALS})*) = [\d, ]+(?:#.*)?$", re.MULTILINE
)  # integer constants
_STATED = re.compile(
    r"\([\w.+*/ -]+,[^)]*\)|(?<![\w'])(u?int\d*|float\d*|bool|unit|m|m2|m3|ms|s|lm|lx|cd|sr|px)(?![\w'])"
    r"|metre|radian|degree|second|pixel|texel|byte|share|0 to 1|record|RGB|linear|\b[A-Z]{4,}\b"
)
_SILENT = {
    tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER
}  # fmt: skip


@dataclass
class Found:
    """One function; numbered: `line text` of each access by number; vectors: how many are of components."""

    place: str
    name: str
    arguments: int
    lines: int
    kernel: bool
    public: bool
    stated: bool
    numbered: list[str]
    vectors: int


def measure(package: Path) -> tuple[dict[str, Any], list[str]]:
    """Return all figures of a package's folder, as JSON has them, and its public functions and kernels."""
    rooms: dict[str, Counter[str]] = defaultdict(Counter)
    top: dict[str, set[str]] = defaultdict(set)
    lazy: dict[str, set[str]] = defaultdict(set)
    functions: list[Found] = []
    skips = 0
    for path in sorted([*package.rglob("*.py"), *package.rglob("*.wgsl")]):
        inside, text = path.relative_to(package), path.read_text("utf-8")
        room, kind = inside.parts[0].partition(".")[0], path.suffix[1:]
        lines = _python_code(text) if kind == "py" else len(re.findall(r"^\s*(?!\s|//).", text, re.MULTILINE))
        rooms[room].update({"files": 1, "lines": len(text.splitlines()), kind: lines})
        if kind == "py":
            skips += len(re.findall(r"#\s*fmt:\s*skip", text))
            constants = {name for names in _PLACES.findall(text) for name in names.split(", ")}
            tree = ast.parse(text)
            functions += [_function(*found, str(inside), constants) for found in _functions(tree)]
            for other, late in _imports(tree, package.name):
                (lazy if late else top)[room] |= {other} - {room}
    everything = {a: top[a] | lazy[a] for a in {*top, *lazy}}
    closing = [
        f"{a} -> {b}" for a in sorted(lazy) for b in sorted(lazy[a] - top[a]) if a in _reached(b, everything)
    ]
    public, kernels = [f for f in functions if f.public], [f for f in functions if f.kernel]
    figures = {
        "rooms": {name: dict(counts) for name, counts in sorted(rooms.items())},
        "code": {kind: sum(counts[kind] for counts in rooms.values()) for kind in ("py", "wgsl")},
        "functions": len(functions),
        "kernels": len(kernels),
        "arguments": sorted(
            ([f.arguments, f.name, f.place] for f in functions if f.arguments > MOST_ARGUMENTS), reverse=True
        ),
        "numbered_in_kernels": [f"{f.place} {n}" for f in kernels for n in f.numbered],
        "numbered_elsewhere": [f"{f.place} {n}" for f in functions if not f.kernel for n in f.numbered],
        "vectors": sum(f.vectors for f in functions),
        "longest": sorted(([f.lines, f.name, f.place] for f in functions), reverse=True)[:_SHOWN],
        "circles": sorted({" ".join(sorted(_circle(a, top))) for a in top} - {""}),
        "lazy_circles": closing,
        "stated": {"public": [sum(f.stated for f in public), len(public)],
                   "kernels": [sum(f.stated for f in kernels), len(kernels)]},
        "fmt_skip": skips,
    }  # fmt: skip
    return figures, [f"{f.place} {f.name}" for f in functions if f.public or f.kernel]


def _functions(
    tree: ast.AST, above: str = "", public: bool = True
) -> Iterator[tuple[ast.FunctionDef, str, bool]]:
    """Yield functions with their names, and whether they are public; those inside others belong to these."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.FunctionDef):
            yield node, above + node.name, public and not node.name.startswith("_")
        elif isinstance(node, ast.ClassDef):
            yield from _functions(node, f"{above}{node.name}.", public and not node.name.startswith("_"))
        else:
            yield from _functions(node, above, public)


def _function(node: ast.FunctionDef, name: str, public: bool, file: str, constants: set[str]) -> Found:
    a, doc = node.args, ast.get_docstring(node) or ""
    given = [*a.posonlyargs, *a.args, *a.kwonlyargs, *filter(None, (a.vararg, a.kwarg))]
    count = sum(argument.arg not in ("self", "cls") for argument in given)
    kernel = any(re.match(r"(\w+\.)*n?jit\b", ast.unparse(decorator)) for decorator in node.decorator_list)
    numbered, vectors = _numbered(node, _arrays(node, doc), constants)
    lines = (node.end_lineno or node.lineno) - node.lineno + 1
    stated = bool(_STATED.search(doc))
    return Found(f"{file}:{node.lineno}", name, count, lines, kernel, public, stated, numbered, vectors)


def _arrays(node: ast.FunctionDef, doc: str) -> set[str]:
    """Names that hold arrays: by annotation, by what made them, or by the shape in the docstring."""
    known = set(re.findall(r"\b(\w+)\b[^()\n]*\([A-Za-z]\w*,", doc))
    for inner in ast.walk(node):
        if (
            isinstance(inner, ast.arg)
            and inner.annotation
            and re.search(_WIDE, ast.unparse(inner.annotation))
        ):
            known.add(inner.arg)
        if isinstance(inner, ast.AnnAssign) and re.search(_WIDE, ast.unparse(inner.annotation)):
            known.add(ast.unparse(inner.target))
        if isinstance(inner, ast.Assign) and re.match(r"np\.|\[", ast.unparse(inner.value)):
            known |= {ast.unparse(target) for target in inner.targets}
    return known


def _numbered(node: ast.FunctionDef, arrays: set[str], constants: set[str]) -> tuple[list[str], int]:
    """Return `line text` of each access by number, and how many others are components of vectors."""
    uses: dict[str, list[tuple[str, str]]] = defaultdict(list)
    for inner in ast.walk(node):
        if not isinstance(inner, ast.Subscript):
            continue
        number, base = ast.unparse(inner.slice), inner.value
        if not number.isdigit() and number not in constants:
            continue
        name = ast.unparse(base)
        nested = isinstance(base, ast.Subscript) and ast.unparse(base.slice).isdigit()
        if (isinstance(base, ast.Name | ast.Attribute) or nested) and not (
            name in arrays or _SIZES.search(name)
        ):
            uses[name].append((number, f"{inner.lineno} {ast.unparse(inner)}"))
    vectors = [each for each in uses.values() if {number for number, _ in each} == {"0", "1", "2"}]
    return [text for each in uses.values() if each not in vectors for _, text in each], sum(map(len, vectors))


def _imports(tree: ast.AST, package: str, late: bool = False) -> Iterator[tuple[str, bool]]:
    """Yield the rooms that a module imports, and whether only once a function is called."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.If) and ast.unparse(node.test).endswith("TYPE_CHECKING"):
            continue
        names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
        if isinstance(node, ast.ImportFrom):
            names = [f"{node.module}.{alias.name}" for alias in node.names]
        yield from ((name.split(".")[1], late) for name in names if name.startswith(f"{package}."))
        yield from _imports(node, package, late or isinstance(node, ast.FunctionDef))


def _reached(room: str, edges: dict[str, set[str]]) -> set[str]:
    """Return the rooms that `room` imports, by way of others too."""
    found: set[str] = set()
    todo = [room]
    while todo:
        new = edges.get(todo.pop(), set()) - found
        found |= new
        todo += new
    return found


def _circle(room: str, edges: dict[str, set[str]]) -> set[str]:
    return {other for other in _reached(room, edges) if room in _reached(other, edges)}


def _python_code(text: str) -> int:
    tokens = tokenize.generate_tokens(io.StringIO(text).readline)
    lines = {n for t in tokens if t.type not in _SILENT for n in range(t.start[0], t.end[0] + 1)}
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            lines -= set(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    return len(lines)


def table(figures: dict[str, Any]) -> str:
    """Return the figures as Markdown."""
    measures = {
        "lines of code, Python and WGSL": "{py:,}, {wgsl:,}".format(**figures["code"]),
        "functions, kernels of them": f"{figures['functions']:,}, {figures['kernels']:,}",
        f"functions of more than {MOST_ARGUMENTS} arguments": len(figures["arguments"]),
        "numbered accesses in kernels": len(figures["numbered_in_kernels"]),
        "numbered accesses elsewhere": len(figures["numbered_elsewhere"]),
        "components of vectors, not counted among these": figures["vectors"],
        "circles of rooms": "; ".join(figures["circles"]) or "none",
        "imports within functions that would close one": "; ".join(figures["lazy_circles"]) or "none",
        "public functions that state shapes or units": "{} of {}".format(*figures["stated"]["public"]),
        "kernels that do": "{} of {}".format(*figures["stated"]["kernels"]),
        "fmt: skip": figures["fmt_skip"],
    }
    rows = ["| room | files | lines | code |", "|---|---:|---:|---:|"]
    for name, c in figures["rooms"].items():
        rows.append(f"| {name} | {c['files']} | {c['lines']:,} | {c.get('py', 0) + c.get('wgsl', 0):,} |")
    rows += ["", "| measure | figure |", "|---|---:|", *(f"| {name} | {n} |" for name, n in measures.items())]
    for title, kind in (("longest functions, lines", "longest"), ("most arguments", "arguments")):
        rows += ["", f"| {title} | function | file |", "|---:|---|---|"]
        rows += [f"| {count} | `{name}` | {place} |" for count, name, place in figures[kind]]
    return "\n".join(rows)


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description="Print how the package is built, in numbers.")
    parser.add_argument("package", nargs="?", type=Path, default=Path(__file__).parents[1] / "ispm")
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--sample", type=int, default=0, metavar="N")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    figures, readable = measure(given.package)
    if given.sample:
        print(*random.Random(given.seed).sample(readable, min(given.sample, len(readable))), sep="\n")
    else:
        print(json.dumps(figures, indent=1) if given.json else table(figures))


if __name__ == "__main__":
    main()
