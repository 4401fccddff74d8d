"""All kernels that rendering asks for, with the types of their arguments: `kernels.txt`, a line each.

    ispm.accel.collapse.shift_refs(uint64, int64, int64, int64)
    ispm.photons.grid._find_cells(array(ispm.optics.records.RECEIVER, 1), tuple(int64, int64))

Arrays are contiguous, rows first: a part of one in another order would have a type of its own. Elements are
numbers, or records by the name of their dtype, so that a new field changes no line. Named tuples stand with
the names of their classes. `make kernels` writes the file from what small renderings call.
"""

from __future__ import annotations

import ast
import importlib
import re
import sys
from functools import cache
from pathlib import Path
from typing import Any

import numba
import numpy as np
from numba import types as numba_types

types: Any = numba_types
FILE = Path(__file__).with_name("kernels.txt")
MEND = "run: make kernels"

Signature = tuple[Any, ...]  # numba's types of the arguments


def lines(file: Path = FILE) -> list[str]:
    """Return the lines of the manifest; no line for one that is not there."""
    return file.read_text("utf-8").split("\n")[:-1] if file.exists() else []


def parse(line: str) -> tuple[Any, Signature]:
    """Return the kernel that a line names, which is imported, and the types of its arguments.

    Raises ValueError where it cannot be understood, ImportError or AttributeError where names are gone.
    """
    try:
        call = ast.parse(line, mode="eval").body
    except SyntaxError as error:
        raise ValueError(f"{FILE.name}: '{line}' is not understood; {MEND}") from error
    if not isinstance(call, ast.Call):
        raise ValueError(f"{FILE.name}: '{line}' is no kernel with its arguments; {MEND}")
    return _named(call.func), tuple(_type(node) for node in call.args)


def line(kernel: Any, signature: Signature) -> str:
    """Return the line for a kernel and the types of its arguments; the inverse of `parse`.

    Raises ValueError for types that no line can tell.
    """
    function = kernel.py_func
    arguments = ", ".join(_text(kind) for kind in signature)
    return f"{function.__module__}.{function.__qualname__}({arguments})"


def _named(node: ast.expr) -> Any:
    """Return what a dotted name stands for."""
    home, _, name = ast.unparse(node).rpartition(".")
    return getattr(importlib.import_module(home), name)


def _type(node: ast.expr) -> Any:
    if isinstance(node, ast.Name):
        return getattr(types, node.id)
    if isinstance(node, ast.Attribute):
        return numba.from_dtype(_named(node))
    match node:
        case ast.Call(func=ast.Name("array"), args=[element, ast.Constant(int() as dimensions)]):
            return _array(_type(element), dimensions)
        case ast.Call(func=ast.Name("tuple"), args=parts):
            return types.Tuple([_type(part) for part in parts])
        case ast.Call(func=ast.Attribute() as named, args=parts):
            return types.BaseTuple.from_types([_type(part) for part in parts], _named(named))
    raise ValueError(f"{FILE.name}: '{ast.unparse(node)}' is no type; {MEND}")


def _text(kind: Any) -> str:
    if isinstance(kind, types.Array) and kind == _array(kind.dtype, kind.ndim):
        return f"array({_text(kind.dtype)}, {kind.ndim})"
    if isinstance(kind, types.BaseAnonymousTuple):
        return f"tuple({', '.join(map(_text, kind))})"
    if isinstance(kind, types.BaseNamedTuple):
        name = f"{kind.instance_class.__module__}.{kind.instance_class.__qualname__}"
        return f"{name}({', '.join(map(_text, kind))})"
    if isinstance(kind, types.Record):
        return _record_name(kind)
    if isinstance(kind, types.NoneType):
        return "none"
    if isinstance(kind, (types.Number, types.Boolean)):
        return "boolean" if isinstance(kind, types.Boolean) else str(kind)
    raise ValueError(f"kernels are called with {kind}, which {FILE.name} has no words for")


def _array(element: Any, dimensions: int) -> Any:
    """Return the type of an array; records that are packed count as not aligned."""
    aligned = not isinstance(element, types.Record) or bool(element.aligned)
    return types.Array(element, dimensions, "C", aligned=aligned)


@cache
def _record_name(record: Any) -> str:
    """Return the full name of the dtype that `record` was made from, where it is defined."""
    found = [  # what is preferred comes first: where it is made, then a module of records
        (not _defines(module, name), "records" not in module.__name__, f"{module.__name__}.{name}")
        for module in list(sys.modules.values())
        if getattr(module, "__name__", "").startswith("ispm.")
        for name, value in vars(module).items()
        if isinstance(value, np.dtype) and value.fields and numba.from_dtype(value) == record
    ]
    if not found:
        raise ValueError(f"kernels are called with {record}; give that dtype a name in its module")
    _, _, best = min(found)
    return best


def _defines(module: Any, name: str) -> bool:
    """Whether a module makes what `name` stands for, rather than imports it."""
    source = Path(module.__file__).read_text("utf-8")
    return re.search(rf"^[\w, ]*\b{name}\b[\w, ]*= ", source, re.MULTILINE) is not None
