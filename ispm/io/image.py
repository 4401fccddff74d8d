"""Pictures in files: PNG and JPEG to look at; EXR, NPY and NPZ to compute with.

Arrays are (height, width, channels), row 0 on top; colors are linear Rec. 709 unless they are uint8 sRGB.
"""

from __future__ import annotations

import errno
import io
import json
import os
import re
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ispm.errors import OutputError
from ispm.io.atomic import replacing, write_whole
from ispm.io.png import encode_png

ENDINGS = (".png", ".jpg", ".jpeg", ".exr", ".npy", ".npz")
ABOUT = "__about__"  # the array of an NPZ that says how the others were made
NAMES = "names"  # likewise, the names behind ids, as JSON
EXR_NAMES = "ispm:names"  # likewise the attribute of an EXR

_WHOLE = "full"  # the layer that is the picture itself
_LEVEL = 1  # of NPZ; numpy's 6 takes a quarter longer, for 2 per cent of the size
_HALF_MAX = 65504.0
_MAX_PIXELS = 1 << 28  # of an EXR; a broken header may ask for terabytes
_REC709 = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)  # primaries and white point, x and y


def require_ending(path: str | Path) -> str:
    """Return the ending of `path` in small letters. Raises OutputError where no picture has such a one."""
    ending = Path(path).suffix.lower()
    if ending not in ENDINGS:
        if not ending and Path(path).is_dir():
            raise OutputError(f"{path}: is a folder; name a file in it")
        problem = f"pictures cannot be written as '{ending}'" if ending else "the name has no ending"
        raise OutputError(f"{path}: {problem}; use one of {', '.join(ENDINGS)}")
    return ending


def write_png(path: str | Path, pixels: np.ndarray, text: Mapping[str, str] | None = None) -> None:
    """Write (h, w, 3 or 4) uint8 or uint16 sRGB pixels, and `text` in text chunks. Raises OutputError."""
    write_whole(path, [encode_png(pixels, text)])


def write_jpeg(path: str | Path, pixels: np.ndarray, text: Mapping[str, str] | None = None) -> None:
    """Write (h, w, 3) uint8 sRGB pixels, colors as fine as light, and `text` as JSON in the comment.

    Raises OutputError.
    """
    from PIL import Image

    comment, out = json.dumps(text).encode() if text else b"", io.BytesIO()  # Pillow overlooks full disks
    Image.fromarray(pixels).save(out, format="jpeg", quality=95, subsampling=0, comment=comment)
    write_whole(path, [out.getbuffer()])


def write_exr(
    path: str | Path,
    layers: Mapping[str, np.ndarray],
    metadata: Mapping[str, Any] | None = None,
    float: bool = False,
) -> None:
    """Write layers as an OpenEXR file, ZIP-compressed.

    layers    by name, (h, w) or (h, w, 3): `full` becomes R, G, B, `alpha` A, the others `direct.R`,
              `depth.Z`, `normal.X`, `instance.ID`; integers are stored as uint32
    metadata  attributes: text, numbers, (4, 4) matrices
    float     32 bits a channel; else colors and normals take 16
    Raises OutputError.
    """
    import OpenEXR

    channels = {
        name: plane
        for layer, values in layers.items()
        for name, plane in _channels(layer, np.asarray(values), float)
    }
    header = {
        "compression": OpenEXR.ZIP_COMPRESSION,
        "type": OpenEXR.scanlineimage,
        "chromaticities": _REC709,
        **{key: _attribute(value) for key, value in (metadata or {}).items()},
    }
    with replacing(path) as beside:
        try:
            OpenEXR.File(header, channels).write(str(beside))
        except RuntimeError as error:  # says "... "name". The reason."
            raise OSError(str(error).rpartition('". ')[2].rstrip(".")) from error
        if not OpenEXR.File(str(beside)).parts:  # it does not look whether its last bytes were taken
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def write_npy(path: str | Path, radiance: np.ndarray) -> None:
    """Write one array. Raises OutputError."""
    out = io.BytesIO()
    np.save(out, radiance)
    write_whole(path, [out.getbuffer()])


def write_npz(
    path: str | Path,
    layers: Mapping[str, np.ndarray],
    text: Mapping[str, str] | None = None,
    *,
    compressed: bool = True,
) -> None:
    """Write arrays by name, and `text` as JSON in the array ABOUT. Raises OutputError."""
    about = {ABOUT: np.array(json.dumps(text))} if text else {}
    out, method = io.BytesIO(), zipfile.ZIP_DEFLATED if compressed else zipfile.ZIP_STORED
    with zipfile.ZipFile(out, "w", method, compresslevel=_LEVEL) as archive:
        for name, array in {**layers, **about}.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as file:
                np.lib.format.write_array(file, np.asanyarray(array), allow_pickle=False)
    write_whole(path, [out.getbuffer()])


def read_picture(path: str | Path, key: str | None = None) -> np.ndarray:
    """Return the picture in `path` as (h, w, 3) float32, linear.

    key  the array of an NPZ, the layer of an EXR; may also be given as `FILE.npz:KEY`
    PNG is taken as sRGB, and what it shows of a picture is clipped and tone mapped.
    Raises OutputError where there is no such picture.
    """
    array = read_array(path, key)
    if array.ndim == 2:
        array = np.repeat(array[..., None], 3, axis=2)
    if array.ndim != 3 or array.shape[2] < 3:
        raise OutputError(f"{path}: has shape {array.shape}, not that of a picture, (height, width, 3)")
    return np.ascontiguousarray(array[..., :3], np.float32)


def read_array(path: str | Path, key: str | None = None) -> np.ndarray:
    """Return what `path`, or `FILE.npz:KEY`, holds as it is stored; a PNG's colors become linear."""
    file, key_in_path = _split_key(str(path))
    readers: dict[str, Callable[[Path, str | None], np.ndarray]] = {
        ".exr": _read_exr,
        ".npy": _read_npy,
        ".npz": _read_npz,
        ".png": _read_png,
    }
    reader = readers.get(file.suffix.lower())
    if reader is None:
        other = f", not '{file.suffix}'" if file.suffix else "; the name has no ending"
        raise OutputError(f"{file}: pictures are read from {', '.join(readers)}{other}")
    if not file.is_file():
        raise OutputError(f"{file}: there is no such file")
    try:
        return reader(file, key or key_in_path)
    except OutputError:
        raise
    except Exception as error:  # what a damaged file makes these libraries raise is not documented
        raise OutputError(f"{file}: cannot be read as {file.suffix}: {error}") from error


def srgb_to_linear(values: np.ndarray) -> np.ndarray:
    """Return linear float32 in [0, 1] for sRGB uint8 values (IEC 61966-2-1)."""
    code = np.arange(256) / 255.0
    table = np.where(code <= 0.04045, code / 12.92, ((code + 0.055) / 1.055) ** 2.4)
    return np.take(table.astype(np.float32), values)


def _channels(layer: str, values: np.ndarray, float: bool) -> list[tuple[str, np.ndarray]]:
    if np.issubdtype(values.dtype, np.integer):
        return [(f"{layer}.ID", np.ascontiguousarray(values, np.uint32))]
    if values.ndim == 2:
        name, exact = (
            ("A", float) if layer == "alpha" else (f"{layer}.Z", True)
        )  # half is too coarse for depth
        return [(name, _stored(values, exact))]
    prefix = "" if layer == "full" else f"{layer}."
    axes = "XYZ" if layer == "normal" else "RGB"
    return [(prefix + axis, _stored(values[..., i], float)) for i, axis in enumerate(axes)]


def _stored(plane: np.ndarray, float: bool) -> np.ndarray:
    if float:
        return np.ascontiguousarray(plane, np.float32)
    return np.ascontiguousarray(np.clip(plane, -_HALF_MAX, _HALF_MAX), np.float16)


def _attribute(value: Any) -> Any:
    return np.asarray(value, np.float32) if isinstance(value, np.ndarray) else value


def _split_key(path: str) -> tuple[Path, str | None]:
    match = re.fullmatch(r"(.+\.(?:npz|exr)):([^/\\:]+)", path, re.IGNORECASE)
    file, layer = match.groups() if match else (path, None)
    return Path(file), layer


def _read_exr(path: Path, layer: str | None) -> np.ndarray:
    import OpenEXR

    # A damaged file opens without an error and has no parts, so the header is looked at first.
    low, high = OpenEXR.File(str(path), header_only=True).header()["dataWindow"]
    width, height = (int(b) - int(a) + 1 for a, b in zip(low, high, strict=True))
    if min(width, height) < 1 or width * height > _MAX_PIXELS:
        raise OutputError(f"{path}: {width} x {height} pixels cannot be right")
    file = OpenEXR.File(str(path), separate_channels=True)
    if not file.parts:
        raise OutputError(f"{path}: the file is damaged or cut short")
    channels = file.channels()
    prefix = f"{layer}." if layer else ""
    for axes in ("RGB", "XYZ", "Z", ("ID",), "Y"):
        names = [prefix + axis for axis in axes]
        if all(name in channels for name in names):
            planes = [channels[name].pixels for name in names]
            return planes[0] if len(planes) == 1 else np.stack(planes, axis=-1)
    wanted = f"layer '{layer}'" if layer else "channels R, G, B"
    raise OutputError(f"{path}: has no {wanted}; it has {', '.join(channels)}")


def _read_npy(path: Path, _key: str | None) -> np.ndarray:
    return np.asarray(np.load(path, allow_pickle=False))


def _read_npz(path: Path, key: str | None) -> np.ndarray:
    with np.load(path, allow_pickle=False) as arrays:
        names = [name for name in arrays.files if name not in (ABOUT, NAMES)]
        if key is None:
            key = names[0] if len(names) == 1 else _WHOLE if _WHOLE in names else None
        if key not in names:
            problem = f"has no array '{key}'" if key else "holds several arrays"
            raise OutputError(f"{path}: {problem}; write {path.name}:KEY with one of {', '.join(names)}")
        return np.asarray(arrays[key])


def _read_png(path: Path, _key: str | None) -> np.ndarray:
    from PIL import Image

    with Image.open(path, formats=["PNG"]) as picture:
        if picture.mode not in ("L", "LA", "P", "RGB", "RGBA"):
            raise OutputError(f"{path}: PNG of mode {picture.mode} is not supported; use 8 bits a channel")
        return srgb_to_linear(np.asarray(picture.convert("RGB")))
