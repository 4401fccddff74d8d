"""What a kernel's machine code depends on, in one digest: its code, and all that its names stand for.

Globals, closures and default values are followed to the end, through other kernels, plain functions and
modules; of numba, numpy and Python names suffice, as their versions stand in the kernel's key. Comments,
docstrings, paths and time stamps of files change nothing.
"""

from __future__ import annotations

import enum
import hashlib
import inspect
import types
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from llvmlite import ir
from numba.core import types as core_types
from numba.core.dispatcher import Dispatcher

numba_types: Any = core_types  # its names are made when numba starts, unseen by type checkers
_PLAIN = (int, float, complex, bool, str, bytes, type(None), type(...))
_VERSIONED = ("numba", "numpy", "llvmlite", "math", "cmath", "operator", "builtins", "typing")


class Dependencies:
    """All that a function's machine code follows from.

    digest  hexadecimal, the same in every process and on every machine
    weight  bytes of bytecode: the time of compilation goes by it
    """

    def __init__(self, function: Any) -> None:
        self.weight = 0
        self._parts: dict[str, str] = {}
        self._called: dict[str, list[types.FunctionType]] = {}  # functions by name
        root = self._text(function, "a kernel")
        lines = [root, *(f"{name}: {text}" for name, text in sorted(self._parts.items()))]
        self.digest = hashlib.sha256("\n".join(lines).encode()).hexdigest()

    def _text(self, value: Any, where: str) -> str:
        """Return what stands for `value`, and note what it depends on in turn."""
        if isinstance(value, Dispatcher):
            options = sorted((k, repr(v)) for k, v in value.targetoptions.items() if k != "fastmath")
            fast = sorted(value.targetoptions.get("fastmath") or ())
            return f"kernel {self._text(value.py_func, where)} {options} {fast}"
        if isinstance(value, enum.Enum):
            return f"{type(value).__qualname__}.{value.name}={value.value!r}"
        if isinstance(value, (np.generic, np.ndarray)):
            return f"{self._text(value.dtype, where)}{value.shape}:{value.tobytes().hex()}"
        if isinstance(value, np.dtype):
            return f"dtype {value!r} {value.itemsize} {value.isalignedstruct}"
        if type(value) in _PLAIN:
            return repr(value)
        if isinstance(value, (tuple, list)):
            return f"{type(value).__name__}({', '.join(self._text(v, where) for v in value)})"
        if isinstance(value, types.ModuleType):
            return f"module {value.__name__}"  # what a function takes from it is followed by name
        if isinstance(value, (numba_types.Type, ir.Type)):
            return f"type {value}"
        if hasattr(value, "_defn"):  # numba's intrinsics
            return f"intrinsic {self._function(value._defn, where)}"
        if _root(value) in _VERSIONED:
            return f"{value.__module__}.{getattr(value, '__qualname__', None) or repr(value)}"
        if isinstance(value, types.FunctionType):
            return self._function(value, where)
        if isinstance(value, type):
            return self._class(value, where)
        raise TypeError(f"{where} names a {type(value).__qualname__}, whose content cannot be told")

    def _function(self, function: types.FunctionType, where: str) -> str:
        """Note code, defaults and names of `function`; return its name.

        Functions that share a name, as those that one factory makes, are told apart by number.
        """
        home = f"{function.__module__}.{function.__qualname__}"
        alike = self._called.setdefault(home, [])
        for number, other in enumerate(alike):
            if other is function:
                return f"{home}#{number}"
        found = f"{home}#{len(alike)}"
        alike.append(function)
        self.weight += sum(len(code.co_code) for code in _codes(function.__code__))
        defaults = function.__defaults__ or (), sorted((function.__kwdefaults__ or {}).items())
        codes = [_code(code, function.__doc__) for code in _codes(function.__code__)]
        own = [*codes, self._text(defaults, home)]
        own += [f"{name}={self._text(value, home)}" for name, value in _names(function)]
        self._parts[found] = "|".join(own)
        return found

    def _class(self, kind: type, where: str) -> str:
        """Note a class: a named tuple by its fields and their defaults, all that kernels see of it; another,
        of which intrinsics are made, by its source file."""
        name = f"{kind.__module__}.{kind.__qualname__}"
        if issubclass(kind, tuple) and hasattr(kind, "_fields"):
            defaults = self._text(list(getattr(kind, "_field_defaults", {}).items()), where)
            self._parts[name] = f"{kind._fields} {defaults}"
        else:
            self._parts[name] = _file_digest(inspect.getfile(kind))
        return f"class {name}"


def type_text(kind: Any) -> str:
    """Return what tells a numba type of an argument: its own name leaves out the fields of named tuples."""
    if not isinstance(kind, numba_types.BaseTuple):
        return repr(kind)
    named = isinstance(kind, numba_types.BaseNamedTuple)
    name = f"{kind.instance_class.__name__} {kind.fields}" if named else ""
    return f"{name}({', '.join(map(type_text, kind))})"


@cache
def _file_digest(path: str) -> str:
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()


def _root(value: Any) -> str:
    return str(getattr(value, "__module__", None) or type(value).__module__).split(".")[0]


def _codes(code: types.CodeType) -> Iterator[types.CodeType]:
    """Yield `code` and those within it: comprehensions and inner functions."""
    yield code
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            yield from _codes(constant)


def _code(code: types.CodeType, doc: str | None) -> str:
    parts: tuple[Any, ...] = code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars
    parts += code.co_flags, code.co_argcount, code.co_kwonlyargcount, code.co_exceptiontable.hex()
    constants = ["" if c is doc else _constant(c) for c in code.co_consts]
    return repr((code.co_code.hex(), constants, *parts))


def _constant(value: Any) -> str:
    if isinstance(value, types.CodeType):
        return "code"  # _codes yields it
    if isinstance(value, frozenset):  # its order is that of the process
        return f"frozenset{sorted(map(repr, value))}"
    return repr(value)


def _names(function: types.FunctionType) -> list[tuple[str, Any]]:
    """Return what the names of `function` stand for: globals, attributes of modules, closures."""
    found: dict[str, Any] = {}
    names = {name for code in _codes(function.__code__) for name in code.co_names}
    for name in names & function.__globals__.keys():
        value = found[name] = function.__globals__[name]
        if isinstance(value, types.ModuleType) and value.__name__.split(".")[0] not in _VERSIONED:
            found |= {f"{name}.{part}": getattr(value, part) for part in names if hasattr(value, part)}
    cells = zip(function.__code__.co_freevars, function.__closure__ or (), strict=True)
    found |= {f"{name} of the closure": cell.cell_contents for name, cell in cells}
    return sorted(found.items())
