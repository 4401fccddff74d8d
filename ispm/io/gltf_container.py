"""The container of a glTF file: JSON or GLB, and the bytes that it names by URI."""

from __future__ import annotations

import base64
import binascii
import struct
from pathlib import Path
from urllib.parse import unquote, unquote_to_bytes

import msgspec

from ispm.errors import SceneError
from ispm.io.budget import Budget
from ispm.io.folder import read_inside
from ispm.io.gltf_schema import Gltf

MAGIC = b"glTF"
JSON_CHUNK, BINARY_CHUNK = 0x4E4F534A, 0x004E4942  # "JSON" and "BIN\0", little endian
BOM = b"\xef\xbb\xbf"  # the byte order mark of UTF-8


def unwrap(data: memoryview) -> tuple[memoryview, memoryview | None]:
    """Return the JSON and the binary chunk, None where there is none, of a GLB; other files are all JSON.

    Told by the first bytes rather than by the name. Source: glTF 2.0, chapter 4.
    Raises SceneError where the file is empty, damaged or of another version.
    """
    if not data:
        raise SceneError("the file is empty")
    if data[:4] != MAGIC:
        return data, None
    if len(data) < 12:
        raise SceneError(f"the GLB header has {len(data)} of its 12 bytes; the file is cut short")
    version, length = struct.unpack_from("<II", data, 4)
    if version != 2:
        raise SceneError(f"this is version {version} of GLB; version 2 is supported")
    if length > len(data):
        raise SceneError(f"the file is cut short: {len(data)} of {length} bytes are there")
    chunks = _chunks(data[12:length])
    first, text = chunks.pop(0) if chunks else (None, data)
    if first != JSON_CHUNK:
        raise SceneError("the first chunk of the GLB is not JSON")
    return text, next((body for kind, body in chunks if kind == BINARY_CHUNK), None)


def _chunks(data: memoryview) -> list[tuple[int, memoryview]]:
    """The (kind, body) of each chunk of a GLB."""
    chunks = []
    while data:
        if len(data) < 8:
            raise SceneError(f"the GLB ends with {len(data)} bytes that are no chunk")
        length, kind = struct.unpack_from("<II", data)
        if length > len(data) - 8:
            raise SceneError(f"a chunk of the GLB is cut short: {len(data) - 8} of {length} bytes are there")
        chunks.append((kind, data[8 : 8 + length]))
        data = data[8 + length :]
    return chunks


def parse(text: memoryview) -> Gltf:
    """Return the records in `text`, UTF-8 JSON; a byte order mark and padding zeros are skipped.

    Raises SceneError where it cannot be read.
    """
    data = bytes(text).removeprefix(BOM).rstrip(b"\0")
    if b"\0" in data[:4]:
        raise SceneError("the text is not UTF-8; save it as UTF-8")
    if not data.lstrip().startswith(b"{"):
        raise SceneError("this is neither GLB nor glTF JSON")
    try:
        return msgspec.json.decode(data, type=Gltf)
    except msgspec.ValidationError as error:
        raise SceneError(f"the glTF breaks the schema: {error}") from None
    except UnicodeDecodeError:
        raise SceneError("the text is not UTF-8; save it as UTF-8") from None
    except msgspec.DecodeError as error:
        raise SceneError(f"the JSON cannot be read: {error}") from None
    except RecursionError:
        raise SceneError("the JSON is nested too deeply") from None


def read_uri(uri: str, folder: Path, budget: Budget) -> memoryview:
    """Return the bytes that `uri` names: a data: URI, or a file inside `folder`, links resolved.

    Raises SceneError for everything else: nothing is fetched, and nothing outside the folder is read.
    """
    if uri[:5].lower() == "data:":
        return memoryview(_data_uri(uri))
    return read_inside(unquote(uri), folder, budget)


def _data_uri(uri: str) -> bytes:
    head, comma, body = uri.partition(",")
    if not comma:
        raise SceneError(f"the data URI '{uri[:40]}...' has no data")
    if not head.lower().endswith(";base64"):
        return unquote_to_bytes(body)
    try:
        return base64.b64decode(unquote_to_bytes(body) if "%" in body else body, validate=True)
    except (binascii.Error, ValueError) as error:
        raise SceneError(f"the data URI '{head[:40]}...' is not valid base64: {error}") from None
