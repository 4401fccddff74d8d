"""Read our own WGSL: includes, bindings, and structs as numpy dtypes. Knows nothing of wgpu.

A shader is the only declaration of what it binds and of how its records lie in memory; Python reads
both from the text, so that neither is written twice.
"""

import re
from dataclasses import dataclass, field
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np

_INCLUDE = re.compile(r"^// include (?P<path>\S+)$")
_BINDING = re.compile(r"@group\((\d+)\)\s*@binding\((\d+)\)\s*var(?:<([\w, ]+)>)?\s+(\w+)\s*:\s*([^;]+);")
_STRUCT = re.compile(r"\bstruct\s+(\w+)\s*\{(.*?)\}", re.S)
_FIELD = re.compile(r"(\w+)\s*:\s*([\w<>, ]+?)\s*(?:,\s*\n|,?\s*$)", re.M)
_CONSTANT = re.compile(r"^const (\w+)[^=]*= ([-+.e\d]+)[uif]?;", re.M)
_ARRAY = re.compile(r"array<\s*(\w+)\s*,\s*(\d+)u?\s*>$")

# type: (numpy base, shape, size, alignment) in bytes; WGSL specification, section 14.4.1
_HOST_SHAREABLE: dict[str, tuple[str, tuple[int, ...], int, int]] = {
    "f32": ("<f4", (), 4, 4),
    "u32": ("<u4", (), 4, 4),
    "i32": ("<i4", (), 4, 4),
    "vec2f": ("<f4", (2,), 8, 8),
    "vec3f": ("<f4", (3,), 12, 16),
    "vec4f": ("<f4", (4,), 16, 16),
    "vec2u": ("<u4", (2,), 8, 8),
    "vec3u": ("<u4", (3,), 12, 16),
    "vec4u": ("<u4", (4,), 16, 16),
    "mat4x4f": ("<f4", (4, 4), 64, 16),
}


@dataclass(frozen=True)
class Binding:
    """One `@group @binding` variable of a shader."""

    name: str
    group: int
    index: int
    space: str  # "uniform", "storage, read", "storage, read_write"; "" for textures and samplers
    type: str


@dataclass(frozen=True)
class Source:
    """A shader's text with its includes in, and where each line came from."""

    text: str
    origin: tuple[tuple[str, int], ...]  # origin[i] = (file, line) of line i, both counted from 1
    _dtypes: dict[str, np.dtype] = field(default_factory=dict, init=False, compare=False, repr=False)

    @property
    def bindings(self) -> dict[str, Binding]:
        """The shader's bindings by name."""
        return {
            name: Binding(name, int(group), int(index), space, kind.strip())
            for group, index, space, name, kind in _BINDING.findall(_uncomment(self.text))
        }

    @property
    def constants(self) -> dict[str, float]:
        """The shader's constants that are plain numbers, by name."""
        return {name: float(value) for name, value in _CONSTANT.findall(self.text)}

    def dtype(self, struct: str) -> np.dtype:
        """Return the numpy dtype with exactly the memory layout of `struct`."""
        if struct not in self._dtypes:
            structs = dict(_STRUCT.findall(_uncomment(self.text)))
            self._dtypes[struct] = _struct_dtype(structs, struct)[0]
        return self._dtypes[struct]

    def located(self, message: str) -> str:
        """Rewrite the line numbers of a compiler's message as file:line of our sources."""

        def rename(match: re.Match[str]) -> str:
            line, column = match.groups()
            if 0 < int(line) <= len(self.origin):
                path, number = self.origin[int(line) - 1]
                return f"{path}:{number}:{column}"
            return match.group()

        return re.sub(r"[\w/.]*wgsl:(\d+):(\d+)", rename, message)


@cache
def load(path: str) -> Source:
    """Read `path` (relative to the package) with its `// include other.wgsl` lines, each file once."""
    lines: list[str] = []
    origin: list[tuple[str, int]] = []
    seen: set[str] = set()

    def read(path: str) -> None:
        if path in seen:
            return
        seen.add(path)
        text = (files("ispm") / path).read_text(encoding="utf-8")
        for number, line in enumerate(text.splitlines(), 1):
            if match := _INCLUDE.match(line):
                read(match["path"])
            else:
                lines.append(line)
                origin.append((path, number))

    read(path)
    return Source("\n".join(lines) + "\n", tuple(origin))


def _uncomment(text: str) -> str:
    return re.sub(r"//[^\n]*", "", text)


def _round_up(value: int, step: int) -> int:
    return -(-value // step) * step


def _struct_dtype(structs: dict[str, str], name: str) -> tuple[np.dtype, int]:
    """The dtype of struct `name` and its alignment."""
    names: list[str] = []
    formats: list[Any] = []
    offsets: list[int] = []
    end, alignment = 0, 4
    for member, kind in _FIELD.findall(structs[name]):
        form, size, align = _layout(structs, kind.strip())
        end = _round_up(end, align)
        names.append(member)
        formats.append(form)
        offsets.append(end)
        end += size
        alignment = max(alignment, align)
    size = _round_up(end, alignment)
    layout = np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": size})
    return layout, alignment


def _layout(structs: dict[str, str], kind: str) -> tuple[object, int, int]:
    """(numpy format, size, alignment) of one WGSL type."""
    if kind in _HOST_SHAREABLE:
        base, shape, size, align = _HOST_SHAREABLE[kind]
        return (base, shape), size, align
    if match := _ARRAY.match(kind):
        element, count = match.groups()
        form, size, align = _layout(structs, element)
        if _round_up(size, align) != size:
            raise ValueError(f"array of {element} has gaps numpy cannot express; pad the element")
        return (form, (int(count),)), size * int(count), align
    dtype, align = _struct_dtype(structs, kind)
    return dtype, dtype.itemsize, align
