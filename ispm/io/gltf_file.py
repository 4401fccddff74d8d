"""An open glTF file: its records, and its buffers as numpy arrays."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TypeVar

import numpy as np

from ispm.errors import SceneError
from ispm.io import gltf_schema as schema
from ispm.io.apart import Apart
from ispm.io.budget import Budget
from ispm.io.folder import map_file
from ispm.io.gltf_container import BOM, parse, read_uri, unwrap
from ispm.io.notes import Notes
from ispm.settings import LoadLimits

COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
_UNFILTERING = 6  # bytes that are passing for each of a buffer view while its filter is taken off
MOST_ZEROS = 1_000_000  # elements that take no bytes of the file, so that small files stay small

Item = TypeVar("Item")


class GltfFile:
    """The records of a glTF file, and its accessors as arrays; leaving it ends the decoders that it started.

    Raises SceneError where the file cannot be read.
    """

    def __init__(self, path: Path, limits: LoadLimits) -> None:
        self.folder = path.parent
        self.limits = limits
        self.budget = Budget(limits)
        self.notes = Notes()
        self.apart = Apart(self.budget)
        text, self._binary = unwrap(map_file(path, self.budget))
        self.gltf = parse(text)
        if text[:3] == BOM:
            self.notes.add("the text begins with a byte order mark, which glTF does not allow")
        self._buffers: dict[int, memoryview] = {}
        self._sparse: dict[int, np.ndarray] = {}
        self._decoded: dict[int, memoryview] = {}
        self._provided: dict[int, tuple[int, np.ndarray]] = {}

    def __enter__(self) -> GltfFile:
        return self

    def __exit__(self, *_: object) -> None:
        self.apart.close()

    def view(self, index: int) -> memoryview:
        """Return the bytes of a buffer view. Raises SceneError where they are not all there."""
        view = item(self.gltf.buffer_views, index, "buffer view")
        if view.extensions.meshopt is None:
            return self._range(view, index)
        if index not in self._decoded:
            self._decoded[index] = self._meshopt(view.extensions.meshopt, view.byte_length, index)
        return self._decoded[index]

    def _range(self, view: schema.BufferView | schema.Meshopt, index: int) -> memoryview:
        data = self._buffer(view.buffer)
        if view.byte_offset + view.byte_length > len(data):
            raise SceneError(
                f"buffer view {index} ends at byte {view.byte_offset + view.byte_length} of a buffer "
                f"of {len(data)}"
            )
        return data[view.byte_offset : view.byte_offset + view.byte_length]

    def _meshopt(self, packed: schema.Meshopt, length: int, index: int) -> memoryview:
        """The bytes of a buffer view that is compressed, counted before they are decoded."""
        size, what = packed.count * packed.byte_stride, f"buffer view {index}"
        if size != length:
            raise SceneError(f"{what} has {length} bytes, but its meshopt stream {size}")
        stream = self._range(packed, index)
        self.budget.take(what, memory=size, work=size)
        self.budget.require(what, _UNFILTERING * size)
        from ispm.io.meshopt import decode

        try:
            elements = decode(stream, packed.mode, packed.filter, packed.count, packed.byte_stride)
        except SceneError as error:
            raise SceneError(f"{what}: {error}") from None
        return elements.reshape(-1).data

    def uri(self, uri: str) -> memoryview:
        """Return the bytes that a URI of this file names."""
        return read_uri(uri, self.folder, self.budget)

    def _buffer(self, index: int) -> memoryview:
        if index not in self._buffers:
            buffer = item(self.gltf.buffers, index, "buffer")
            data = self._binary if buffer.uri is None and index == 0 else None
            if buffer.uri is not None:
                data = self.uri(buffer.uri)
            if data is None:
                raise SceneError(f"buffer {index} has no data")
            if len(data) < buffer.byte_length:
                raise SceneError(f"buffer {index} has {len(data)} of its {buffer.byte_length} bytes")
            self._buffers[index] = data[: buffer.byte_length]
        return self._buffers[index]

    def count(self, index: int) -> int:
        """Return how many elements an accessor has. Raises SceneError where there are more than allowed."""
        count = item(self.gltf.accessors, index, "accessor").count
        if count > self.limits.max_elements:
            raise SceneError(
                f"accessor {index} has {count} elements; max_elements={self.limits.max_elements} is the most"
            )
        return count

    def stored(self, index: int, *, matrices: bool = False) -> np.ndarray:
        """Return an accessor's (count, width) components as they are stored, in place where they can be.

        matrices  whether it may hold some, of 4 rows, column by column
        """
        accessor = item(self.gltf.accessors, index, "accessor")
        if accessor.type not in WIDTHS or (accessor.type == "MAT4" and not matrices):
            raise SceneError(f"accessor {index} holds matrices where none belong")
        what = f"accessor {index}"
        if index in self._provided:
            return self._provided[index][1]
        dtype, shape = COMPONENTS[accessor.component_type], (self.count(index), WIDTHS[accessor.type])
        if accessor.buffer_view is None:
            if shape[0] > MOST_ZEROS:
                raise SceneError(f"{what} has {shape[0]} elements and no buffer view to hold them")
            values = np.broadcast_to(np.zeros(1, dtype), shape)
        else:
            values = self._strided(accessor.buffer_view, accessor.byte_offset, dtype, shape, what)
        if accessor.sparse is None:
            return values
        if index not in self._sparse:
            self.budget.take(what, memory=values.nbytes)
            self._sparse[index] = self._replaced(values, accessor.sparse, what)
        return self._sparse[index]

    def provide(self, index: int, values: np.ndarray, *, by: int) -> None:
        """Have an accessor hold `values`, (count, width), that are decoded elsewhere.

        by  the buffer view that they come from
        Raises SceneError where they are not as many, or as wide, as the accessor says.
        """
        accessor = item(self.gltf.accessors, index, "accessor")
        if values.shape != (accessor.count, WIDTHS.get(accessor.type)):
            told = " x ".join(map(str, values.shape))
            raise SceneError(
                f"{told} numbers are not the {accessor.count} {accessor.type} of accessor {index}"
            )
        kind = np.dtype(COMPONENTS[accessor.component_type])
        if (values.dtype.kind == "f") != (kind.kind == "f"):
            raise SceneError(f"its {values.dtype.name} numbers are not those of accessor {index}")
        self._provided[index] = by, values.astype(kind)

    def provided(self, *indices: int, by: int) -> bool:
        """Return whether accessors hold what is decoded from the buffer view `by` already.

        Raises SceneError where one of them holds what comes from another.
        """
        found = [self._provided[index][0] for index in indices if index in self._provided]
        if any(view != by for view in found):
            raise SceneError(f"an accessor is to hold what buffer views {found[0]} and {by} decode to")
        return len(found) == len(indices)

    def _replaced(self, values: np.ndarray, sparse: schema.Sparse, what: str) -> np.ndarray:
        """A copy of `values` with the elements of `sparse` in their places."""
        count, (rows, width) = sparse.count, values.shape
        if count > rows:
            raise SceneError(f"{what}: {count} sparse elements are more than its {rows}")
        kind = COMPONENTS[sparse.indices.component_type]
        at = self._strided(sparse.indices.buffer_view, sparse.indices.byte_offset, kind, (count, 1), what)
        new = self._strided(
            sparse.values.buffer_view, sparse.values.byte_offset, values.dtype.str, (count, width), what
        )
        if count and int(at.max()) >= rows:
            raise SceneError(f"{what}: sparse index {int(at.max())} points past the last of {rows} elements")
        result = np.array(values)
        result[at[:, 0]] = new
        return result

    def _strided(self, view: int, offset: int, dtype: str, shape: tuple[int, int], what: str) -> np.ndarray:
        """Components inside a buffer view; all arithmetic in Python's integers, which do not overflow."""
        data = self.view(view)
        size = np.dtype(dtype).itemsize
        element = size * shape[1]
        stride = self.gltf.buffer_views[view].byte_stride or element
        if stride < element:
            raise SceneError(f"{what}: its elements of {element} bytes overlap at a stride of {stride}")
        end = offset + stride * (shape[0] - 1) + element if shape[0] else offset
        if end > len(data):
            raise SceneError(f"{what} ends at byte {end} of buffer view {view}, which has {len(data)}")
        return np.ndarray(shape, dtype, data, offset, (stride, size))

    def floats(
        self,
        index: int,
        types: Sequence[str],
        rows: np.ndarray | slice = slice(None),
        *,
        normalized: bool = False,
    ) -> np.ndarray | None:
        """Return `rows` of an accessor as a (n, width) float32 array of its own; None if not of `types`.

        normalized  take integers as fractions, -1..1 or 0..1, even where the file does not say so
        """
        accessor = item(self.gltf.accessors, index, "accessor")
        if accessor.type not in types:
            return None
        stored = self.stored(index, matrices=True)
        count = len(stored) if isinstance(rows, slice) else len(rows)
        self.budget.take(f"accessor {index}", memory=4 * stored.shape[1] * count)
        stored = stored[rows]
        values = np.array(stored, np.float32, order="C")
        if stored.dtype.kind != "f" and (accessor.normalized or normalized):
            values /= np.float32(np.iinfo(stored.dtype).max)
            np.maximum(values, np.float32(-1.0), out=values)
        return values

    def holds_zeros(self, index: int) -> bool:
        """Return whether an accessor has no bytes at all, so that all its elements are 0."""
        accessor = item(self.gltf.accessors, index, "accessor")
        return accessor.buffer_view is None and accessor.sparse is None

    def indices(self, index: int) -> np.ndarray:
        """Return a (count,) accessor of unsigned integers. Raises SceneError where it is none."""
        accessor = item(self.gltf.accessors, index, "accessor")
        if accessor.type != "SCALAR" or COMPONENTS[accessor.component_type][1] != "u":
            raise SceneError(f"accessor {index} holds indices that are not unsigned integers")
        return self.stored(index)[:, 0]


def item(items: Sequence[Item], index: int, what: str) -> Item:
    """Return `items[index]`. Raises SceneError where there is none."""
    if index >= len(items):
        raise SceneError(f"{what} {index} does not exist; the file has {len(items)}")
    return items[index]


def label(kind: str, index: int, name: str) -> str:
    """Return what to call a record in a message: its name, or its number."""
    return f"{kind} '{name}'" if name else f"{kind} {index}"
