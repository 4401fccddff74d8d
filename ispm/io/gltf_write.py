"""The glTF file that a scene becomes: JSON records, and the bytes that they refer to."""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator
from typing import Any

import numpy as np

from ispm.errors import SceneError
from ispm.io.gltf_container import BINARY_CHUNK, JSON_CHUNK, MAGIC
from ispm.io.png import encode_png

_KINDS = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
_COMPONENTS = {"<f4": 5126, "<u2": 5123, "<u4": 5125}
_OF_FILE = {"lights": "KHR_lights_punctual", "variants": "KHR_materials_variants"}  # kinds of extensions
_ARRAY, _INDICES = 34962, 34963  # what OpenGL calls buffers of vertices and of indices
_MOST_BYTES = (1 << 32) - 1  # of a GLB, and of each of its chunks


class Document:
    """Records by kind, numbered in the order they come, and one buffer."""

    def __init__(self) -> None:
        self._records: dict[str, list[dict[str, Any]]] = {}
        self._chunks: list[memoryview] = []
        self._length = 0
        self._pictures: list[np.ndarray] = []
        self._extensions: set[str] = set()

    def put(self, kind: str, record: dict[str, Any]) -> int:
        """Add a record, as in `put("meshes", {...})`, and return its number."""
        records = self._records.setdefault(kind, [])
        records.append(record)
        return len(records) - 1

    def use(self, extension: str) -> str:
        """Return the name of an extension, which the file then says that it uses."""
        self._extensions.add(extension)
        return extension

    def picture(self, pixels: np.ndarray, name: str) -> int:
        """Add an image of (h, w, 4) uint8 pixels, without their alpha where all are opaque."""
        self._pictures.append(pixels if (pixels[..., 3] < 255).any() else pixels[..., :3])
        return self.put("images", {"name": name} if name else {})

    def floats(self, values: np.ndarray, *, bounds: bool = False, vertices: bool = False) -> int:
        """Add an accessor of (n,) or (n, width) floats.

        bounds    say the least and the greatest, as is asked of positions and times
        vertices  they are attributes of vertices
        """
        array = np.ascontiguousarray(values, "<f4").reshape(len(values), -1)
        record = self._accessor(array, _ARRAY if vertices else None)
        if bounds:
            record |= {"min": array.min(axis=0).tolist(), "max": array.max(axis=0).tolist()}
        return self.put("accessors", record)

    def joints(self, values: np.ndarray) -> int:
        """Add an accessor of (n, 4) numbers of joints, uint16."""
        return self.put("accessors", self._accessor(np.ascontiguousarray(values, "<u2"), _ARRAY))

    def zeros(self, count: int) -> int:
        """Add an accessor of (n, 3) zeros, which takes no bytes."""
        nothing = [0.0, 0.0, 0.0]
        record = {"componentType": _COMPONENTS["<f4"], "count": count, "type": "VEC3"}
        return self.put("accessors", {**record, "min": nothing, "max": nothing})

    def indices(self, triangles: np.ndarray, vertex_count: int) -> int:
        """Add an accessor of (T, 3) numbers of vertices, in 16 bits where they fit."""
        kind = "<u2" if vertex_count < 0xFFFF else "<u4"  # the greatest number of all is reserved
        corners = np.ascontiguousarray(triangles.reshape(-1, 1), kind)
        return self.put("accessors", self._accessor(corners, _INDICES))

    def _accessor(self, array: np.ndarray, target: int | None) -> dict[str, Any]:
        return {
            "bufferView": self._view(array.reshape(-1).view(np.uint8).data, target),
            "componentType": _COMPONENTS[array.dtype.str],
            "count": len(array),
            "type": _KINDS[array.shape[1]],
        }

    def _view(self, data: memoryview, target: int | None = None) -> int:
        padding = -self._length % 4
        self._chunks.append(memoryview(bytes(padding)))
        record = {"buffer": 0, "byteOffset": self._length + padding, "byteLength": len(data)}
        self._chunks.append(data)
        self._length += padding + len(data)
        return self.put("bufferViews", record if target is None else {**record, "target": target})

    def glb(self) -> Iterator[bytes | memoryview]:
        """Yield the bytes of a .glb, pictures within. Raises SceneError where 32 bits cannot count them."""
        for record, pixels in zip(self._records.get("images", ()), self._pictures, strict=True):
            data = memoryview(encode_png(pixels))
            record |= {"mimeType": "image/png", "bufferView": self._view(data)}
        text = self._json(None, indent=None)
        text += b" " * (-len(text) % 4)
        body = self._length + -self._length % 4
        total = 12 + 8 + len(text) + (8 + body if body else 0)
        if total > _MOST_BYTES:
            raise SceneError(f"{total} bytes are more than a .glb can hold; save it as .gltf")
        yield struct.pack("<4sIIII", MAGIC, 2, total, len(text), JSON_CHUNK) + text
        if body:
            yield struct.pack("<II", body, BINARY_CHUNK)
            yield from self._chunks
            yield bytes(body - self._length)

    def gltf(self, stem: str, uris: list[str]) -> tuple[bytes, list[memoryview], list[np.ndarray]]:
        """Return the text of a .gltf, the chunks of the buffer beside it, and the pictures.

        stem  of the buffer's URI;  uris  of the pictures, one for each of `picture_count`
        """
        for record, uri in zip(self._records.get("images", ()), uris, strict=True):
            record["uri"] = uri
            if record.get("name") == uri[:80]:  # the name that the loader gives to pictures without one
                del record["name"]
        return self._json(stem + ".bin", indent=2) + b"\n", self._chunks, self._pictures

    @property
    def picture_count(self) -> int:
        """How many pictures there are."""
        return len(self._pictures)

    def _json(self, uri: str | None, indent: int | None) -> bytes:
        from ispm import __version__

        out: dict[str, Any] = {"asset": {"version": "2.0", "generator": f"ispm {__version__}"}, "scene": 0}
        if self._extensions:
            out["extensionsUsed"] = sorted(self._extensions)
        records = dict(self._records)
        of_file = {name: {kind: records.pop(kind)} for kind, name in _OF_FILE.items() if kind in records}
        if of_file:
            out["extensions"] = of_file
        if self._length:
            buffer = {"byteLength": self._length + (0 if uri else -self._length % 4)}
            out["buffers"] = [buffer if uri is None else {**buffer, "uri": uri}]
        separators = None if indent else (",", ":")
        try:
            text = json.dumps(out | records, allow_nan=False, indent=indent, separators=separators)
        except ValueError:
            raise SceneError("a number of the scene is not finite, which glTF cannot hold") from None
        return text.encode()
