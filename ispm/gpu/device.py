"""Choosing an adapter, and the device made of it: where all GPU objects come from."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import wgpu

from ispm import wgsl
from ispm.errors import AdapterError, SettingsError
from ispm.gpu.buffer import Buffer
from ispm.gpu.c_types import read_types_alone
from ispm.gpu.compute import Compute
from ispm.gpu.raster import DEPTH_TESTED, Raster, RasterState, Target
from ispm.gpu.readback import Readback
from ispm.gpu.recording import Recording, UniformPool
from ispm.gpu.texture import Sampler, Texture, make_sampler
from ispm.gpu.timing import Timer

_BACKENDS = ("Vulkan", "Metal", "D3D12")
_TYPES = ("DiscreteGPU", "IntegratedGPU", "CPU")  # best first; other types rank just above the CPU
FEATURES = ("float32-blendable", "timestamp-query")  # optional ones, requested where the adapter has them
# parts of the messages by which drivers say that memory or a limit does not suffice
_TOO_MUCH = ("not enough memory", "out of memory", "maximum buffer size", "exceeds the limit", "binding_size")
_CURE = "on Debian and Ubuntu `apt-get install mesa-vulkan-drivers` brings one that runs on the CPU"

# WebGPU specification, section 3.6.2. Asked for by name, because a device made without limits may grant
# more than the baseline, and shaders that came to rely on it would fail elsewhere.
_BASELINE = {
    "max-bind-groups": 4,
    "max-sampled-textures-per-shader-stage": 16,
    "max-samplers-per-shader-stage": 16,
    "max-storage-buffers-per-shader-stage": 8,
    "max-storage-textures-per-shader-stage": 4,
    "max-uniform-buffers-per-shader-stage": 12,
    "max-uniform-buffer-binding-size": 65536,
    "max-vertex-buffers": 8,
    "max-vertex-attributes": 16,
    "max-inter-stage-shader-variables": 16,
    "max-color-attachments": 8,
    "max-color-attachment-bytes-per-sample": 32,
    "max-compute-workgroup-storage-size": 16384,
    "max-compute-invocations-per-workgroup": 256,
    "max-compute-workgroup-size-x": 256,
    "max-compute-workgroup-size-y": 256,
    "max-compute-workgroup-size-z": 64,
    "min-uniform-buffer-offset-alignment": 256,
    "min-storage-buffer-offset-alignment": 256,
}
# Limits of sizes that grow with the scene and the picture: as high as the adapter has them.
_GENEROUS = (
    "max-texture-dimension-2d",
    "max-storage-buffer-binding-size",
    "max-buffer-size",
    "max-compute-workgroups-per-dimension",
)


@dataclass(frozen=True)
class AdapterInfo:
    """What an adapter says of itself; `type` is DiscreteGPU, IntegratedGPU, CPU or another of wgpu's."""

    name: str
    backend: str
    type: str
    driver: str


def list_adapters() -> list[AdapterInfo]:
    """Return the graphics adapters that can serve, the preferred one first.

    Each has a `name`, a `backend` (Vulkan, Metal, D3D12), a `type` (DiscreteGPU, IntegratedGPU, CPU) and a
    `driver`.
    """
    require_own_process()
    return [_info(adapter) for adapter in _adapters()]


_first_process: int | None = None  # id of the first to open an adapter: this one, or one it was forked from


def require_own_process() -> None:
    """Raise AdapterError in a process forked from one that has opened an adapter: its driver would hang."""
    global _first_process
    _first_process = _first_process or os.getpid()
    if _first_process != os.getpid():
        raise AdapterError(
            "this process was forked from one that had opened a graphics adapter, and drivers do not survive "
            "that; start processes by multiprocessing.get_context('spawn')"
        )


def open_gpu(adapter: str | None = None) -> Gpu:
    """Return a device on the preferred adapter: discrete before integrated before CPU.

    adapter  part of a name, to choose by; default: the environment's ISPM_ADAPTER
    Raises AdapterError where there is none, none matches, or the driver refuses; SettingsError for what is
    no name.
    """
    if adapter is not None and not isinstance(adapter, str):
        raise SettingsError(f"adapter: must be part of an adapter's name, or None, not {adapter!r}")
    require_own_process()
    wanted = adapter if adapter is not None else os.environ.get("ISPM_ADAPTER", "")
    found = _adapters()
    if not found:
        raise AdapterError(f"no graphics adapter with Vulkan, Metal or Direct3D 12 was found; {_CURE}")
    matching = [a for a in found if wanted.lower() in _info(a).name.lower()]
    if not matching:
        names = ", ".join(f"'{_info(a).name}'" for a in found)
        raise AdapterError(f"no graphics adapter is called '{wanted}'; there is {names}")
    return Gpu(matching[0])


@contextmanager
def within_memory(task: str) -> Iterator[None]:
    """Turn out-of-memory errors of numpy and of drivers into a SettingsError that says what to reduce.

    task  what was to be done, as in "a picture of 16384x16384 pixels"
    """
    try:
        yield
    except (MemoryError, RuntimeError, wgpu.GPUError) as error:
        if not isinstance(error, MemoryError) and not any(w in str(error).lower() for w in _TOO_MUCH):
            raise
        cure = "take a smaller size, fewer photons or a larger subsampling, or another adapter"
        raise SettingsError(
            f"{task} needs more memory than there is, or than can be bound; {cure}"
        ) from error


@cache
def _prepare_wgpu() -> None:
    """Leave out the OpenGL backend: it is never used, and aborts where several threads enumerate adapters."""
    from wgpu.backends.wgpu_native import ffi
    from wgpu.backends.wgpu_native.extras import set_instance_extras

    read_types_alone(ffi)
    with suppress(RuntimeError):  # another user of wgpu was first
        set_instance_extras(backends=("Vulkan", "Metal", "DX12"))


def _adapters() -> list[wgpu.GPUAdapter]:
    _prepare_wgpu()
    os.environ.setdefault("XDG_RUNTIME_DIR", tempfile.gettempdir())  # unset, drivers complain on stderr
    found = [a for a in wgpu.gpu.enumerate_adapters_sync() if a.info["backend_type"] in _BACKENDS]
    return sorted(found, key=lambda a: _rank(a.info["adapter_type"]))


def _rank(kind: str) -> float:
    return _TYPES.index(kind) if kind in _TYPES else 1.5


def _info(adapter: wgpu.GPUAdapter) -> AdapterInfo:
    info = adapter.info
    return AdapterInfo(info["device"], info["backend_type"], info["adapter_type"], info["description"])


class Gpu:
    """A device and everything made on it. Made by `open_gpu`; `close` frees it.

    It keeps the pipelines, as to compile them takes longer than a small picture.

    info         the adapter
    max_texture  texels of the longest side of a texture
    max_buffer   bytes of the largest buffer
    max_binding  bytes of a storage buffer that a shader can bind at once
    """

    def __init__(self, adapter: wgpu.GPUAdapter) -> None:
        self.info = _info(adapter)
        limits = {k: min(v, adapter.limits[k]) for k, v in _BASELINE.items() if k.startswith("max")}
        limits |= {k: max(v, adapter.limits[k]) for k, v in _BASELINE.items() if k.startswith("min")}
        limits |= {k: adapter.limits[k] for k in _GENEROUS}
        features = [name for name in FEATURES if name in adapter.features]
        try:
            self.device = adapter.request_device_sync(
                label="ispm", required_features=features, required_limits=limits
            )
        except (RuntimeError, wgpu.GPUError) as error:
            reason = " ".join(str(error).split())
            raise AdapterError(f"{self.info.name}: the driver gave no device ({reason})") from error
        self._features = frozenset(features)
        self.max_texture: int = limits["max-texture-dimension-2d"]
        self.max_buffer: int = limits["max-buffer-size"]
        self.max_binding: int = min(limits["max-storage-buffer-binding-size"], self.max_buffer)
        self._samplers: dict[tuple[Any, ...], Sampler] = {}
        self._computes: dict[tuple[str, ...], Compute] = {}
        self._rasters: dict[tuple[str, ...], Raster] = {}
        self._readback = Readback(self.device)
        self._uniforms = UniformPool(self.device)
        self._timer = Timer(self.device) if self.has("timestamp-query") else None

    @property
    def name(self) -> str:
        """The adapter's name."""
        return self.info.name

    @property
    def is_software(self) -> bool:
        """Whether the adapter is a program on the CPU."""
        return self.info.type == "CPU"

    def has(self, feature: str) -> bool:
        """Whether the device has an optional feature of WebGPU, such as `float32-blendable`."""
        return feature in self._features

    def compute(self, path: str, entry: str = "main", **constants: float) -> Compute:
        """Return the compute shader `entry` of the file `path`; see `Compute`."""
        key = wgsl.load(path).text, path, entry, repr(constants)
        if key not in self._computes:
            self._computes[key] = Compute(self.device, path, entry, constants)
        return self._computes[key].shared()

    def raster(
        self,
        path: str,
        targets: Sequence[str | Target] = (),
        state: RasterState = DEPTH_TESTED,
        **constants: float,
    ) -> Raster:
        """Return a render pipeline of the file `path`; see `Raster`.

        targets  formats of the color attachments, in order
        """
        key = wgsl.load(path).text, path, repr(targets), repr(state), repr(constants)
        if key not in self._rasters:
            self._rasters[key] = Raster(self.device, path, targets, state, constants)
        return self._rasters[key].shared()

    def texture(self, name: str, format: str, *, usage: Sequence[str] = (), samples: int = 1) -> Texture:
        """Return a texture without size yet; see `Texture`."""
        return Texture(self.device, name, format, usage, samples)

    def buffer(self, name: str, usage: str = "storage") -> Buffer:
        """Return an empty buffer; `usage` is storage, vertex or index."""
        return Buffer(self.device, name, usage)

    def sampler(
        self,
        wrap: tuple[str, str] = ("clamp-to-edge", "clamp-to-edge"),
        *,
        linear: bool = True,
        mipmaps: bool = True,
    ) -> Sampler:
        """Return a sampler; the same one for the same arguments."""
        key = (wrap, linear, mipmaps)
        if key not in self._samplers:
            self._samplers[key] = make_sampler(self.device, *key)
        return self._samplers[key]

    def frame(self, *, timed: bool = False) -> Recording:
        """Return a context in which commands are recorded; leaving it submits them.

        timed  without timestamp queries, measure stages by waiting for the end of each
        """
        require_own_process()
        return Recording(self.device, self._uniforms, self._readback, self._timer, timed)

    def read_texture(self, texture: Texture, dtype: Any, channels: int = 1) -> np.ndarray:
        """Return a texture's level 0 as (height, width), or (height, width, channels) of several."""
        return self.read_many([(texture, dtype, channels)])[0]

    def read_buffer(self, buffer: Buffer, dtype: Any, count: int) -> np.ndarray:
        """Return the first `count` elements of a buffer, (count,) of `dtype`."""
        return self.read_many([(buffer, dtype, count)])[0]

    def read_many(self, wanted: Sequence[tuple[Any, ...]]) -> list[np.ndarray]:
        """Return several textures and buffers after one wait; items are the arguments of
        `read_texture` or `read_buffer`."""
        return self._readback.read(wanted)

    def wait(self) -> None:
        """Return when all that was submitted is done."""
        self._readback.wait()

    def close(self) -> None:
        """Free the device and all memory on it; nothing made of it works afterwards."""
        self.device.destroy()
