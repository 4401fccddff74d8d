"""Pictures of radiance: Radiance's RGBE (.hdr), and OpenEXR.

Source: Ward, Real Pixels, Graphics Gems II, 1991; run lengths as in Radiance's color.c.
"""

from __future__ import annotations

import os
import re
from pathlib import Path

import numpy as np

from ispm.errors import OutputError, SceneError, warn_caller
from ispm.optics.jit import jit
from ispm.scene.environment import HIGHEST, WIDEST, averaged, fewer_columns, fewer_rows, told_of_averaging

i64 = np.int64

ENDINGS = (".hdr", ".exr")
_MAX_PIXELS = 1 << 27  # 16384 x 8192
_MAX_BYTES = 1 << 30
_HEADER = 1 << 16  # bytes in which a header must end
_AT_ONCE = 1 << 21  # pixels that are decoded together
_SIZE = re.compile(rb"([-+])Y +(\d{1,9}) +([-+])X +(\d{1,9})")
_RUN_WIDTHS = range(8, 1 << 15)  # of the rows that may have run lengths for each channel
_FAULTS = ("the file ends within its pixels", "a run of pixels does not fit its row")


def read_environment(path: str | os.PathLike[str]) -> np.ndarray:
    """Return what an .hdr or .exr shows, (h, w, 3) float32, linear, row 0 on top.

    More than 4096 x 2048 pixels are averaged to these, and what is below 0 becomes 0, with a SceneWarning.
    Raises SceneError, in one line that begins with the path, where it cannot be used.
    """
    file = Path(path)
    if not str(path) or file.suffix.lower() not in ENDINGS:
        raise SceneError(f"{path}: environments are read from {' '.join(ENDINGS)}, and this is neither")
    if not file.is_file():  # also of devices, which may never end
        raise SceneError(f"{path}: there is no such file")
    try:
        image = _read_rgbe(file) if file.suffix.lower() == ".hdr" else _read_exr(file)
    except OutputError as error:
        raise SceneError(str(error)) from None
    except SceneError as error:
        raise SceneError(f"{path}: {error}") from None
    except OSError as error:
        raise SceneError(f"{path}: cannot be read: {error.strerror or error}") from None
    except MemoryError:
        raise SceneError(f"{path}: it needs more memory than there is") from None
    if not np.isfinite(image).all():
        y, x, _ = np.argwhere(~np.isfinite(image))[0].tolist()
        raise SceneError(f"{path}: the pixel in row {y}, column {x} is no finite number")
    if (image < 0.0).any():
        warn_caller(f"{path}: {int((image < 0.0).any(axis=2).sum()):,} pixels below 0 are taken as 0")
        image = np.maximum(image, np.float32(0.0))
    return image


def _read_exr(path: Path) -> np.ndarray:
    """Pixels of an .exr. Raises OutputError and SceneError."""
    from ispm.io.about import read_about
    from ispm.io.image import read_picture

    found = read_about(path)
    _require_size(found.width, found.height)
    return averaged(read_picture(path), str(path))


def _read_rgbe(path: Path) -> np.ndarray:
    """Pixels of an .hdr. Raises SceneError."""
    if path.stat().st_size > _MAX_BYTES:
        raise SceneError(f"it has more than {_MAX_BYTES} bytes")
    data = np.fromfile(path, np.uint8)
    start, width, height, turned = _header(data[:_HEADER].tobytes(), str(path))
    _require_size(width, height)
    image = fewer_rows(_decoded(data, start, width, height), HIGHEST)
    if image.shape[:2] != (height, width):
        told_of_averaging(str(path), width, height)
    return np.ascontiguousarray(image[turned])


def _require_size(width: int, height: int) -> None:
    if min(width, height) < 1 or width * height > _MAX_PIXELS:
        raise SceneError(f"{width} x {height} pixels; 1 to {_MAX_PIXELS} are read")


def _header(data: bytes, called: str) -> tuple[int, int, int, tuple[slice, slice]]:
    """Where pixels begin, width, height, and how rows and columns are turned. Raises SceneError."""
    if not data.startswith((b"#?RADIANCE", b"#?RGBE")):
        raise SceneError("it is no Radiance picture: those begin with #?RADIANCE")
    text, found, rest = data.partition(b"\n\n")
    line, ended, _ = rest.partition(b"\n")
    if not found or not ended:
        raise SceneError("its header does not end")
    said = dict(each.partition(b"=")[::2] for each in text.split(b"\n")[1:])
    form = said.get(b"FORMAT", b"32-bit_rle_rgbe").strip()
    if form != b"32-bit_rle_rgbe":
        raise SceneError(f"its format is {_shown(form)}; 32-bit_rle_rgbe is read")
    if said.get(b"EXPOSURE") is not None:
        warn_caller(
            f"{called}: EXPOSURE={_shown(said[b'EXPOSURE'])} in its header is not taken off its pixels"
        )
    size = _SIZE.fullmatch(line.strip())
    if size is None:
        raise SceneError(f"its size is given as {_shown(line)}; -Y HEIGHT +X WIDTH is read")
    down, height, right, width = size.groups()
    turned = slice(None, None, 1 if down == b"-" else -1), slice(None, None, 1 if right == b"+" else -1)
    return len(text) + len(found) + len(line) + len(ended), int(width), int(height), turned


def _shown(text: bytes) -> str:
    """A header's text, within a line."""
    short = text[:40].decode("ascii", "replace").strip()
    return "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in short)


def _decoded(data: np.ndarray, start: int, width: int, height: int) -> np.ndarray:
    """(h, w, 3) float32 of all rows, averaged to the columns that are kept.

    Raises SceneError for bytes that are no pixels.
    """
    if len(data) - start < 4 * height:
        raise SceneError(_FAULTS[0])
    image = np.empty((height, min(width, WIDEST), 3), np.float32)
    each = max(_AT_ONCE // width, 1)
    for first in range(0, height, each):
        texels = np.zeros((min(each, height - first), width, 4), np.uint8)
        start = decode_rows(data, start, width in _RUN_WIDTHS, texels)
        if start < 0:
            raise SceneError(_FAULTS[-start - 1])
        image[first : first + each] = fewer_columns(radiance_of(texels), WIDEST)
    return image


def radiance_of(texels: np.ndarray) -> np.ndarray:
    """Return (..., 3) float32 of (..., 4) uint8 RGBE: mantissa / 256 * 2^(e - 128), and 0 where e is 0."""
    exponent = texels[..., 3].astype(np.int32)
    scale = np.ldexp(np.float32(1.0), exponent - (128 + 8)).astype(np.float32)
    return np.asarray(texels[..., :3] * np.where(exponent > 0, scale, np.float32(0.0))[..., None])


@jit
def decode_rows(data, at, may_run, out):
    """Decode rows of RGBE.

    data     (n,) uint8 of a file;  at  where the rows begin
    may_run  whether rows may have run lengths for each channel
    out      (h, w, 4) uint8
    -> where the bytes of the rows end; -1 where the data end before; -2 where a run leaves its row
    """
    for row in range(out.shape[0]):
        if at + 4 > len(data):
            return -1
        width = out.shape[1]
        if may_run and data[at] == 2 and data[at + 1] == 2 and data[at + 2] < 128:
            if (i64(data[at + 2]) << 8 | i64(data[at + 3])) != width:
                return -2
            at = _decode_channels(data, at + 4, out[row])
        else:
            at = _decode_pixels(data, at, out[row])
        if at < 0:
            return at
    return at


@jit
def _decode_channels(data, at, out):
    """Decode a row, (w, 4), of which each channel has its own run lengths; return as `decode_rows`."""
    width = out.shape[0]
    for channel in range(4):
        x = i64(0)
        while x < width:
            if at + 2 > len(data):
                return -1
            count = i64(data[at])
            at += 1
            same = count > 128
            count = count - 128 if same else count
            if count == 0 or x + count > width:
                return -2
            if not same and at + count > len(data):
                return -1
            for k in range(count):
                out[x + k, channel] = data[at] if same else data[at + k]
            at += 1 if same else count
            x += count
    return at


@jit
def _decode_pixels(data, at, out):
    """Decode a row, (w, 4), of whole pixels, among which 1, 1, 1, n repeats the last one n times, or 256 n
    where another repeat is before it, and so on; return as `decode_rows`."""
    width = out.shape[0]
    x, shift = i64(0), i64(0)
    while x < width:
        if at + 4 > len(data):
            return -1
        if data[at] == 1 and data[at + 1] == 1 and data[at + 2] == 1:
            count = i64(data[at + 3]) << shift if shift < 24 else width
            if x == 0 or x + count > width:
                return -2
            for k in range(count):
                for channel in range(4):
                    out[x + k, channel] = out[x - 1, channel]
            x, shift = x + count, shift + 8
        else:
            for channel in range(4):
                out[x, channel] = data[at + channel]
            x, shift = x + 1, i64(0)
        at += 4
    return at
