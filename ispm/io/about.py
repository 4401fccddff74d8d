"""What a picture's file says of itself: its size, what it holds, and how it was made."""

from __future__ import annotations

import json
import os
import zipfile
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ispm.errors import OutputError
from ispm.io.image import ABOUT, ENDINGS, EXR_NAMES, NAMES
from ispm.scene.names import Names

_MOST_TEXT = 1 << 20  # bytes; what is longer was not written here
_PREFIX = "ispm:"
_CHANNEL_LIST = b"channels\0chlist\0"
_EXR_BITS = (32, 16, 32)  # unsigned, half, float


@dataclass
class PictureFile:
    """A picture in a file.

    channels  names of its channels, or of its arrays with their shapes
    bits      of a channel, each once
    made      how: `Software`, `scene`, `command`, `settings` (JSON), `seed`, `camera`; as far as it is known
    """

    width: int
    height: int
    channels: list[str]
    bits: list[int]
    made: dict[str, str] = field(default_factory=dict)


def read_about(path: str | Path) -> PictureFile:
    """Return what a .png, .jpg, .exr, .npz or .npy says of itself.

    Raises OutputError where there is no such picture, or it cannot be read.
    """
    file = Path(path)
    reader = _READERS.get(file.suffix.lower())
    if reader is None:
        raise OutputError(f"{file}: is no picture; those end in {', '.join(ENDINGS)}")
    if not file.is_file():
        raise OutputError(f"{file}: there is no such file")
    try:
        return reader(file)
    except Exception as error:  # what a damaged file makes these libraries raise is not documented
        raise OutputError(f"{file}: cannot be read as {file.suffix}: {error}") from error


def read_names(path: str | os.PathLike[str]) -> Names:
    """Return what the ids in a picture that a frame was saved to stand for.

    path  an .exr or .npz that `Frame.save` wrote
    Raises OutputError where there is no such file, or no table in it.
    """
    file = Path(path)
    if file.suffix.lower() not in (".exr", ".npz"):
        raise OutputError(f"{file}: names are kept in .exr and .npz")
    if not file.is_file():
        raise OutputError(f"{file}: there is no such file")
    try:
        return Names.from_json(_table(file))
    except Exception as error:  # what a damaged file makes these libraries raise is not documented
        raise OutputError(f"{file}: holds no names that can be read") from error


def _table(path: Path) -> str:
    if path.suffix.lower() == ".npz":
        with np.load(path, allow_pickle=False) as arrays:
            return str(arrays[NAMES])
    import OpenEXR

    return str(OpenEXR.File(str(path), header_only=True).header()[EXR_NAMES])


def _png(path: Path) -> PictureFile:
    from PIL import Image, PngImagePlugin

    with Image.open(path, formats=["PNG"]) as picture:
        assert isinstance(picture, PngImagePlugin.PngImageFile)
        channels = list(picture.getbands())
        with open(path, "rb") as file:
            bits = file.read(25)[24]  # Pillow does not tell
        return PictureFile(*picture.size, channels, [bits], _ours(picture.text))


def _jpeg(path: Path) -> PictureFile:
    from PIL import Image

    with Image.open(path, formats=["JPEG"]) as picture:
        comment = picture.info.get("comment", b"")
        return PictureFile(*picture.size, list(picture.getbands()), [8], _parsed(comment))


def _exr(path: Path) -> PictureFile:
    import OpenEXR

    header = OpenEXR.File(str(path), header_only=True).header()
    low, high = header["dataWindow"]
    width, height = (int(b) - int(a) + 1 for a, b in zip(low, high, strict=True))
    with open(path, "rb") as file:
        kinds = _exr_channels(file.read(_MOST_TEXT))
    bits = sorted({_EXR_BITS[kind] for kind in kinds.values()})
    words = _ours({key: value for key, value in header.items() if _is_text(value) and key != EXR_NAMES})
    return PictureFile(width, height, list(kinds), bits, words)


def _exr_channels(data: bytes) -> dict[str, int]:
    """Names and kinds of channels, which the library gives with pixels only (OpenEXR File Layout, chlist)."""
    start = data.index(_CHANNEL_LIST) + len(_CHANNEL_LIST) + 4
    kinds = {}
    while data[start]:
        end = data.index(0, start)
        kinds[data[start:end].decode()] = data[end + 1]
        start = end + 17
    return kinds


def _npy(path: Path) -> PictureFile:
    array = np.load(path, mmap_mode="r", allow_pickle=False)
    return _arrays({path.stem: (array.shape, array.dtype)})


def _npz(path: Path) -> PictureFile:
    arrays = {}
    with zipfile.ZipFile(path) as archive:
        for name in archive.namelist():
            with archive.open(name) as member:  # the header alone, not the pixels
                major, minor = np.lib.format.read_magic(member)
                read = getattr(np.lib.format, f"read_array_header_{major}_{minor}")
                shape, _, dtype = read(member)
                arrays[name.removesuffix(".npy")] = shape, dtype
    _, text = arrays.pop(ABOUT, (None, None))
    arrays.pop(NAMES, None)
    made = {}
    if text is not None and text.itemsize < 4 * _MOST_TEXT:
        with np.load(path, allow_pickle=False) as file:
            made = _parsed(str(file[ABOUT]).encode())
    return _arrays(arrays, made)


def _arrays(arrays: dict[str, tuple[Any, np.dtype[Any]]], made: dict[str, str] | None = None) -> PictureFile:
    shapes = [shape for shape, _ in arrays.values() if len(shape) >= 2]
    if not shapes:
        raise ValueError("it holds no picture")
    names = [f"{name} {'x'.join(map(str, shape))} {dtype}" for name, (shape, dtype) in arrays.items()]
    bits = sorted({8 * dtype.itemsize for _, dtype in arrays.values()})
    height, width, *_ = shapes[0]
    return PictureFile(int(width), int(height), names, bits, made or {})


def _parsed(text: bytes) -> dict[str, str]:
    """Our words in JSON; nothing where it is none of ours."""
    try:
        words = json.loads(text) if len(text) < _MOST_TEXT else None
    except ValueError:
        return {}
    return _ours(words) if isinstance(words, dict) else {}


def _ours(words: dict[str, Any]) -> dict[str, str]:
    known = {key.removeprefix(_PREFIX): value for key, value in words.items() if key.startswith(_PREFIX)}
    software = {key: words[key] for key in ("Software",) if known and key in words}
    return {key: value for key, value in {**software, **known}.items() if _is_text(value)}


def _is_text(value: Any) -> bool:
    return isinstance(value, str) and len(value) < _MOST_TEXT


_READERS: dict[str, Callable[[Path], PictureFile]] = {
    ".png": _png,
    ".jpg": _jpeg,
    ".jpeg": _jpeg,
    ".exr": _exr,
    ".npy": _npy,
    ".npz": _npz,
}
