"""What a shader binds: layouts and bind groups by name, read out of its WGSL."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from copy import copy
from typing import Any, Protocol

import numpy as np
import wgpu

from ispm import wgsl
from ispm.errors import IspmError
from ispm.gpu import memory
from ispm.gpu.buffer import Buffer
from ispm.gpu.texture import Texture

_COMMENT = re.compile(r"//[^\n]*")
_FUNCTION = re.compile(r"\bfn\s+(?P<name>\w+)")
_OVERRIDE = re.compile(r"\boverride\s+(\w+)")
_WORD = re.compile(r"(?<![.\w])[A-Za-z_]\w*")  # no fields
_ERROR = re.compile(r"error: (?P<fault>.*)\n\s*┌─ (?P<place>\S+)")
_MOST_GROUPS = 1 << 14  # of a shader that are kept: one for each material
_ACCESS = {"write": "write-only", "read": "read-only", "read_write": "read-write"}
_SAMPLE_TYPES = {"u32": "uint", "i32": "sint"}


class Uploads(Protocol):
    """Something that puts small arrays where a shader can read them as uniforms, until submission."""

    def uniform(self, array: np.ndarray) -> dict[str, Any]:
        """Return the buffer binding that holds the bytes of `array`."""


class Shader:
    """A WGSL module and the layouts of what its entry points use.

    Bindings that no function reachable from the entry points mentions are left out, so that one
    file may hold several entry points. Raises IspmError with file:line where the compiler objects.
    """

    def __init__(
        self,
        device: wgpu.GPUDevice,
        path: str,
        entries: Sequence[str],
        visibility: int,
        constants: Mapping[str, float],
    ) -> None:
        self.device, self.path, self.label = device, path, f"{path} {'+'.join(entries)}"
        self.source = wgsl.load(path)
        text = _COMMENT.sub("", self.source.text)
        self._check(text, entries, constants)
        words = _reachable(text, entries)
        self.groups: dict[int, dict[str, wgsl.Binding]] = {}
        for binding in self.source.bindings.values():
            if binding.name in words:
                self.groups.setdefault(binding.group, {})[binding.name] = binding
        with self.explained():
            self.module = device.create_shader_module(label=path, code=self.source.text)
        self.layouts = [
            device.create_bind_group_layout(
                label=f"{self.label} group {group}",
                entries=[_layout(b, visibility, text) for b in self.groups.get(group, {}).values()],
            )
            for group in range(max(self.groups, default=-1) + 1)
        ]
        self.pipeline_layout = device.create_pipeline_layout(bind_group_layouts=self.layouts)
        self._forget()

    def _forget(self) -> None:
        self._groups: dict[tuple[object, ...], tuple[wgpu.GPUBindGroup, list[Any]]] = {}
        self._generation = memory.generation()  # what was freed is not to be kept alive

    def shared(self) -> Shader:
        """Return the same shader with bind groups of its own, which keep nobody else's resources alive."""
        other = copy(self)
        other._forget()
        return other

    def explained(self) -> _Explained:
        """Return a context that turns the driver's errors into an IspmError about our files."""
        return _Explained(self.label, self.source)

    def bind(self, group: int, given: Mapping[str, Any], uploads: Uploads | None) -> wgpu.GPUBindGroup:
        """Return a bind group of named resources; the same one for the same, until memory is allocated.

        Raises TypeError for a name that is missing or unknown and for a resource that does not fit.
        """
        bindings = self.groups.get(group, {})
        if given.keys() != bindings.keys():
            missing, unknown = sorted(bindings.keys() - given.keys()), sorted(given.keys() - bindings.keys())
            raise TypeError(f"{self.label}, group {group}: missing {missing}, unknown {unknown}")
        resources = [self._resource(b, given[name], uploads) for name, b in bindings.items()]
        if self._generation != memory.generation() or len(self._groups) >= _MOST_GROUPS:
            self._forget()
        key = group, *map(_told, resources)
        if key not in self._groups:
            entries = [
                {"binding": b.index, "resource": resource}
                for b, resource in zip(bindings.values(), resources, strict=True)
            ]
            with self.explained():
                made = self.device.create_bind_group(layout=self.layouts[group], entries=entries)
            self._groups[key] = made, resources  # held, so that no other resource gets one's id
        return self._groups[key][0]

    def _resource(self, binding: wgsl.Binding, given: Any, uploads: Uploads | None) -> Any:
        if isinstance(given, Texture):
            return given.view
        if isinstance(given, Buffer):
            return {"buffer": given.handle, "offset": 0, "size": given.nbytes}
        if isinstance(given, (wgpu.GPUSampler, dict)):
            return given
        if binding.space == "uniform" and isinstance(given, (np.ndarray, np.void)) and uploads is not None:
            array = np.atleast_1d(np.asarray(given))
            size = self.source.dtype(binding.type).itemsize
            if array.nbytes != size:
                raise TypeError(
                    f"{self.label}: '{binding.name}' takes {size} bytes of {binding.type}, not {array.nbytes}"
                )
            return uploads.uniform(array)
        raise TypeError(
            f"{self.label}: '{binding.name}' of type {binding.type} cannot be a {type(given).__name__}"
        )

    def _check(self, text: str, entries: Sequence[str], constants: Mapping[str, float]) -> None:
        functions = set(_FUNCTION.findall(text))
        if absent := [entry for entry in entries if entry not in functions]:
            raise TypeError(f"{self.path}: there is no entry point {absent}")
        if unknown := sorted(constants.keys() - set(_OVERRIDE.findall(text))):
            raise TypeError(f"{self.path}: there is no override {unknown}")


def _told(resource: Any) -> object:
    """What tells a resource of a bind group from others while it lives."""
    if isinstance(resource, dict):
        return id(resource["buffer"]), resource["offset"], resource["size"]
    return id(resource)


class _Explained:
    """Turns wgpu's errors into one line that names our file and line."""

    def __init__(self, label: str, source: wgsl.Source) -> None:
        self._label, self._source = label, source

    def __enter__(self) -> None: ...

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        if isinstance(error, wgpu.GPUError):
            message = str(error)
            if match := _ERROR.search(message):
                line = self._source.located(f"{match['place']}: {match['fault']}")
                raise IspmError(line.removeprefix("wgsl:")) from error
            raise IspmError(f"{self._label}: {' '.join(message.split())}") from error


def _reachable(text: str, entries: Sequence[str]) -> set[str]:
    """Every word in the entry points and in the functions they call, directly or not."""
    bodies = {m["name"]: set(_WORD.findall(_body(text, m.end()))) for m in _FUNCTION.finditer(text)}
    seen: set[str] = set()
    words: set[str] = set()
    waiting = list(entries)
    while waiting:
        name = waiting.pop()
        if name not in seen:
            seen.add(name)
            words |= bodies[name]
            waiting += [word for word in bodies[name] if word in bodies]
    return words


def _body(text: str, start: int) -> str:
    """The function body that opens after `start`, braces matched."""
    begin = text.index("{", start)
    depth = 0
    for match in re.finditer(r"[{}]", text[begin:]):
        depth += 1 if match.group() == "{" else -1
        if depth == 0:
            return text[begin : begin + match.end()]
    return text[begin:]


def _layout(binding: wgsl.Binding, visibility: int, text: str) -> dict[str, Any]:
    """WebGPU's layout entry of one binding."""
    entry: dict[str, Any] = {"binding": binding.index, "visibility": visibility}
    kind = binding.type
    inner = kind[kind.find("<") + 1 : -1].replace(" ", "") if "<" in kind else ""
    if binding.space == "uniform":
        entry["buffer"] = {"type": "uniform"}
    elif binding.space.startswith("storage"):
        writable = "write" in binding.space
        entry["buffer"] = {"type": "storage" if writable else "read-only-storage"}
        if writable:  # a vertex shader may not write
            entry["visibility"] &= ~wgpu.ShaderStage.VERTEX
    elif kind == "sampler":
        entry["sampler"] = {"type": _sampler_type(binding.name, text)}
    elif kind.startswith("texture_storage"):
        format, access = inner.split(",")
        entry["storage_texture"] = {"format": format, "access": _ACCESS[access]}
        entry["visibility"] &= ~wgpu.ShaderStage.VERTEX
    else:
        entry["texture"] = {
            "sample_type": _sample_type(binding.name, kind, inner, text),
            "multisampled": "multisampled" in kind,
        }
    return entry


def _sample_type(name: str, kind: str, inner: str, text: str) -> str:
    if kind.startswith("texture_depth"):
        return "depth"
    if inner in _SAMPLE_TYPES:
        return _SAMPLE_TYPES[inner]
    # a texture that meets a sampler in some call is filtered; any other may be of an unfilterable format
    filtered = re.search(rf"\b{name}\s*,\s*(?P<sampler>\w+)", text)
    samplers = set(re.findall(r"var\s+(\w+)\s*:\s*sampler\s*;", text))
    return "float" if filtered and filtered["sampler"] in samplers else "unfilterable-float"


def _sampler_type(name: str, text: str) -> str:
    """What a sampler must be: one that meets a texture of depth may not filter."""
    met = set(re.findall(rf"(\w+)\s*,\s*{name}\b", text))
    depths = set(re.findall(r"var\s+(\w+)\s*:\s*texture_depth", text))
    return "non-filtering" if met & depths else "filtering"
