"""Embree, to compare the tracer's speed with: called from numba code for each ray, without Python between.

Needs the optional package `embreex`, of which only the shared library is used: its Python interface has no
instances.
"""

from __future__ import annotations

import ctypes
import time
from collections.abc import Callable
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm
import numpy as np
from numba import types

from ispm.accel.rays import HIT
from ispm.accel.world import World
from ispm.kernels.simd import address, alloca, atomic_add, ldf, ldu, stf, stu
from ispm.kernels.threads import run_threads, thread_count
from ispm.optics.jit import jit
from ispm.optics.records import NO_HIT
from ispm.scene.packed import Packed, to_world

f32, i64, u32, u64 = np.float32, np.int64, np.uint32, np.uint64

# Constants of Embree 4's API.
_TRIANGLES, _INSTANCE = 0, 121  # RTC_GEOMETRY_TYPE_TRIANGLE, _INSTANCE
_INDICES, _POSITIONS = 0, 1  # RTC_BUFFER_TYPE_INDEX, _VERTEX
_UINT3, _FLOAT3, _FLOAT3X4_ROWS = 0x5003, 0x9003, 0x9134  # RTC_FORMAT_UINT3, _FLOAT3, _FLOAT3X4_ROW_MAJOR
# Words of four bytes in an RTCRayHit, whose first three are the origin: tnear, dir, time, tfar, mask, u, v,
# primID, geomID, instID.
_NEAR, _DIRECTION, _TIME, _FAR, _MASK, _U, _V, _PRIMITIVE, _GEOMETRY, _PLACED = (
    3,
    4,
    7,
    8,
    9,
    15,
    16,
    17,
    18,
    19,
)
_CHUNK = 256  # rays a thread takes at a time

_intersect: Any = types.ExternalFunction("rtcIntersect1", types.void(types.uintp, types.uintp, types.uintp))


class EmbreeScene:
    """The instances of a packed scene in Embree, until it is closed.

    Raises ImportError where `embreex` is not installed.
    """

    def __init__(self, packed: Packed) -> None:
        self._library = _load_library()
        self._device = self._library.rtcNewDevice(b"threads=1")
        self._kept: list[np.ndarray] = []
        meshes = [self._mesh(packed, k) for k in range(len(packed.geometry.ranges))]
        self.scene: int = self._library.rtcNewScene(self._device)
        rows = packed.instances
        for matrix, mesh in zip(to_world(rows), rows["mesh"], strict=True):
            geometry = self._library.rtcNewGeometry(self._device, _INSTANCE)
            self._library.rtcSetGeometryInstancedScene(geometry, meshes[mesh])
            self._library.rtcSetGeometryTransform(geometry, 0, _FLOAT3X4_ROWS, matrix.ctypes.data)
            self._attach(self.scene, geometry)
        self._library.rtcCommitScene(self.scene)
        for mesh in meshes:
            self._library.rtcReleaseScene(mesh)  # its instances hold it

    def close(self) -> None:
        """Free the library's objects; nothing can be traced afterwards."""
        self._library.rtcReleaseScene(self.scene)
        self._library.rtcReleaseDevice(self._device)

    def trace(self, origins: np.ndarray, directions: np.ndarray, threads: int = 1) -> np.ndarray:
        """Return the nearest hits, (N,) HIT, as `World.trace` does; `t` is infinite where nothing is hit.

        origins, directions  (N, 3), world space; t counts in lengths of the direction
        """
        origins = np.ascontiguousarray(origins, np.float32)
        directions = np.ascontiguousarray(directions, np.float32)
        hits = np.empty(len(origins), HIT)
        counter = np.zeros(1, np.int64)
        addresses = [address(a) for a in (origins, directions, counter, hits)]
        run_threads(lambda _: _trace(u64(self.scene), len(origins), *addresses), threads)
        return hits

    def _mesh(self, packed: Packed, k: int) -> int:
        part = packed.geometry.ranges[k]
        last = part.first_index + 3 * part.triangle_count
        triangles = packed.geometry.indices[part.first_index : last] - np.uint32(part.first_vertex)
        count = int(triangles.max()) + 1
        positions = np.zeros((count + 1, 3), np.float32)  # Embree reads 16 bytes of the last one
        positions[:-1] = packed.geometry.vertices["position"][part.first_vertex :][:count]
        self._kept += [positions, triangles]
        geometry = self._library.rtcNewGeometry(self._device, _TRIANGLES)
        share = self._library.rtcSetSharedGeometryBuffer
        share(geometry, _POSITIONS, 0, _FLOAT3, positions.ctypes.data, 0, 12, count)
        share(geometry, _INDICES, 0, _UINT3, triangles.ctypes.data, 0, 12, part.triangle_count)
        scene: int = self._library.rtcNewScene(self._device)
        self._attach(scene, geometry)
        self._library.rtcCommitScene(scene)
        return scene

    def _attach(self, scene: int, geometry: int) -> None:
        self._library.rtcCommitGeometry(geometry)
        self._library.rtcAttachGeometry(scene, geometry)
        self._library.rtcReleaseGeometry(geometry)


def compare_rates(
    world: World,
    packed: Packed,
    origins: np.ndarray,
    directions: np.ndarray,
    threads: int | None = None,
    repetitions: int = 7,
) -> dict[str, float]:
    """Return `own` and `embree` rays per second and their `ratio`, medians of alternating runs.

    origins, directions  (N, 3) float32; `world` follows `packed`
    Raises ImportError where `embreex` is not installed.
    """
    count = thread_count(threads)
    embree = EmbreeScene(packed)
    kept, world.threads = world.threads, count
    runs: list[Callable[[], Any]] = [
        lambda: world.trace(origins, directions),
        lambda: embree.trace(origins, directions, count),
    ]
    try:
        for run in runs:
            run()
        seconds = np.array([[_seconds(run) for run in runs] for _ in range(repetitions)])
    finally:
        world.threads = kept
        embree.close()
    own, raw = np.median(len(origins) / seconds, axis=0)
    return {"own": float(own), "embree": float(raw), "ratio": float(np.median(seconds[:, 1] / seconds[:, 0]))}


def _seconds(run: Callable[[], Any]) -> float:
    start = time.perf_counter()
    run()
    return time.perf_counter() - start


@cache
def _load_library() -> ctypes.CDLL:
    """Load Embree from the wheel of `embreex`, for ctypes and for compiled code."""
    spec = find_spec("embreex")
    if spec is None or spec.origin is None:
        raise ImportError("comparing with Embree needs the package embreex; pip install embreex")
    folder = Path(spec.origin).parent
    folders = (folder.parent / "embreex.libs", folder)
    path = min((p for place in folders for p in place.glob("*embree4*")), default=None)
    if path is None:
        raise ImportError(f"embreex in {folder} brings no library named embree4; reinstall it")
    for tbb in sorted(p for place in folders for p in place.glob("*tbb*")):
        ctypes.CDLL(str(tbb), ctypes.RTLD_GLOBAL)
    library = ctypes.CDLL(str(path), ctypes.RTLD_GLOBAL)
    llvm.load_library_permanently(str(path))
    _declare(library)
    return library


def _declare(library: ctypes.CDLL) -> None:
    """Declare the types that Embree's functions take and return."""
    pointer, size, word, number = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_uint, ctypes.c_int
    for name, result, arguments in (
        ("rtcNewDevice", pointer, [ctypes.c_char_p]),
        ("rtcNewScene", pointer, [pointer]),
        ("rtcCommitScene", None, [pointer]),
        ("rtcNewGeometry", pointer, [pointer, number]),
        ("rtcSetSharedGeometryBuffer", None, [pointer, number, word, number, pointer, size, size, size]),
        ("rtcSetGeometryInstancedScene", None, [pointer, pointer]),
        ("rtcSetGeometryTransform", None, [pointer, word, number, pointer]),
        ("rtcCommitGeometry", None, [pointer]),
        ("rtcAttachGeometry", word, [pointer, pointer]),
        ("rtcReleaseGeometry", None, [pointer]),
        ("rtcReleaseScene", None, [pointer]),
        ("rtcReleaseDevice", None, [pointer]),
    ):
        function = getattr(library, name)
        function.restype, function.argtypes = result, arguments


@jit
def _trace(scene, count, origins, directions, counter, hits):
    """Write a HIT for each ray; threads share `counter`.

    scene  RTCScene;  origins, directions, counter, hits  addresses: of count x 3 float32 twice, of one int64,
    of count HIT
    """
    ray = alloca(16)  # 128 bytes, more than an RTCRayHit has
    while True:
        first = atomic_add(counter, i64(1)) * _CHUNK
        if first >= count:
            return
        for i in range(first, min(first + _CHUNK, count)):
            for k in range(3):
                stf(ray, k, ldf(origins, 3 * i + k))
                stf(ray, _DIRECTION + k, ldf(directions, 3 * i + k))
            stf(ray, _NEAR, f32(0))
            stf(ray, _TIME, f32(0))
            stf(ray, _FAR, f32(np.inf))
            stu(ray, _MASK, u32(NO_HIT))
            for word in (10, 11):  # id, flags
                stu(ray, word, u32(0))
            for word in (_PRIMITIVE, _GEOMETRY, _PLACED):
                stu(ray, word, u32(NO_HIT))
            _intersect(scene, ray, u64(0))
            stf(hits, 5 * i, ldf(ray, _FAR))
            stu(hits, 5 * i + 1, ldu(ray, _PLACED))
            stu(hits, 5 * i + 2, ldu(ray, _PRIMITIVE))
            stf(hits, 5 * i + 3, ldf(ray, _U))
            stf(hits, 5 * i + 4, ldf(ray, _V))
