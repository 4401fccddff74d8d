"""Small glTF files, made from arrays."""

import base64
import io
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from ispm.io.load import load
from ispm.scene.material import Material
from ispm.scene.scene import Scene

QUAD = np.array([[-1, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1]], np.float32)
QUAD_UV = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
QUAD_INDICES = np.array([0, 2, 1, 0, 3, 2], np.uint16)
TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
COMPONENTS = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}

CHECKS = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [255, 255, 255]]], np.uint8)


class GltfBuilder:
    """A glTF document under construction: `json` is free to change, arrays go in by `accessor`."""

    def __init__(self, **json: Any) -> None:
        self.json: dict[str, Any] = {"asset": {"version": "2.0"}, **json}
        self.data = b""

    def put(self, kind: str, record: dict[str, Any]) -> int:
        """Append a record and return its number."""
        self.json.setdefault(kind, []).append(record)
        return len(self.json[kind]) - 1

    def view(self, data: bytes, **record: Any) -> int:
        """Append a buffer view over `data`."""
        self.data += bytes(-len(self.data) % 4)
        record = {"buffer": 0, "byteOffset": len(self.data), "byteLength": len(data), **record}
        self.data += data
        return self.put("bufferViews", record)

    def accessor(self, values: np.ndarray, **record: Any) -> int:
        """Append an accessor over an array (n,) or (n, width)."""
        width = values.shape[1] if values.ndim == 2 else 1
        record = {
            "bufferView": self.view(values.tobytes()),
            "componentType": COMPONENTS[values.dtype.str[1:]],
            "count": len(values),
            "type": TYPES[width],
            **record,
        }
        return self.put("accessors", {key: value for key, value in record.items() if value is not None})

    def mesh(
        self, indices: np.ndarray | None = QUAD_INDICES, *, more: Any = None, **attributes: np.ndarray
    ) -> int:
        """Append a mesh of one primitive; a quad with texture coordinates unless attributes are given."""
        attributes = attributes or {"POSITION": QUAD, "TEXCOORD_0": QUAD_UV}
        primitive = {"attributes": {name: self.accessor(v) for name, v in attributes.items()}, **(more or {})}
        if indices is not None:
            primitive["indices"] = self.accessor(indices)
        return self.put("meshes", {"primitives": [primitive]})

    def node(self, **record: Any) -> int:
        """Append a node."""
        return self.put("nodes", record)

    def picture(self, pixels: np.ndarray, kind: str = "PNG") -> int:
        """Append a picture in a buffer view, and a texture that shows it."""
        stream = io.BytesIO()
        Image.fromarray(pixels).save(stream, kind)
        image = self.put("images", {"bufferView": self.view(stream.getvalue())})
        return self.put("textures", {"source": image})

    def finished(self) -> dict[str, Any]:
        """Return the document, with its buffer as a data: URI."""
        text = base64.b64encode(self.data).decode()
        buffer = {"byteLength": len(self.data), "uri": f"data:application/octet-stream;base64,{text}"}
        return {"buffers": [buffer], **self.json} if self.data else self.json

    def save(self, path: Path) -> Path:
        """Write the document as .gltf."""
        path.write_text(json.dumps(self.finished()))
        return path

    def save_glb(self, path: Path) -> Path:
        """Write the document as .glb."""
        text = json.dumps({"buffers": [{"byteLength": len(self.data)}], **self.json}).encode()
        text += b" " * (-len(text) % 4)
        body = self.data + bytes(-len(self.data) % 4)
        chunks = struct.pack("<II", len(text), 0x4E4F534A) + text
        chunks += struct.pack("<II", len(body), 0x004E4942) + body
        path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)
        return path

    def load(self, folder: Path, **limits: Any) -> Scene:
        """Write the document into `folder` and load it."""
        return load(self.save(folder / "scene.gltf"), **limits)


def quad(material: dict[str, Any] | None = None, **json: Any) -> GltfBuilder:
    """Return a quad with texture coordinates, with a material where one is given."""
    builder = GltfBuilder(**json)
    more = {} if material is None else {"material": builder.put("materials", material)}
    builder.node(mesh=builder.mesh(more=more), name="quad")
    return builder


def only_material(scene: Scene) -> Material:
    """Return a scene's one material."""
    (material,) = scene.materials
    return material
