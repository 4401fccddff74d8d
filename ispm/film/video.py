"""Videos by PyAV, the extra `video`: the same pictures make the same bytes.

Encoders run in one thread, since how they share work out may change what they write, and containers hold no
times and no random numbers.
"""

from __future__ import annotations

import errno
import io
import os
from collections.abc import Iterable
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from ispm.errors import OutputError, SettingsError
from ispm.film.settings import Film
from ispm.film.yuv import to_yuv
from ispm.io.atomic import replacing
from ispm.settings import Settings


@dataclass(frozen=True)
class _Codec:
    """An encoder of FFmpeg's.

    format   of its pixels;  bits  of their samples;  halved  whether chroma has half of the rows
    options  of the encoder; what is lost is hard to see
    """

    encoder: str
    format: str = "yuv420p"
    bits: int = 8
    halved: bool = True
    options: dict[str, str] = field(default_factory=dict)


_CODECS = {
    "h264": _Codec("libx264", options={"crf": "16", "preset": "slow"}),
    "av1": _Codec("libsvtav1", options={"crf": "22", "preset": "6", "svtav1-params": "lp=1"}),
    "vp9": _Codec("libvpx-vp9", options={"crf": "20", "b": "0", "cpu-used": "2"}),
    "prores": _Codec("prores_ks", "yuv422p10le", 10, False, {"profile": "hq", "vendor": "apl0"}),
}
_HOLDS = {  # the first is meant by "auto"
    ".mp4": ("h264", "av1"),
    ".mkv": ("h264", "av1", "vp9"),
    ".webm": ("vp9", "av1"),
    ".mov": ("prores",),
}
_FORMATS = {".mp4": "mp4", ".mkv": "matroska", ".webm": "webm", ".mov": "mov"}
_BT709, _LIMITED = 1, 1  # ITU-T H.273, tables 2 to 4; FFmpeg's AVCOL_RANGE_MPEG


def codec_of(path: Path, film: Film) -> str:
    """Return the codec of a video. Raises OutputError where PyAV is missing or the file does not hold it."""
    try:
        import av
    except ImportError:
        numbered = path.with_name(f"{path.stem}-%04d.png")
        raise OutputError(
            f"{path}: videos need PyAV; pip install 'ispm[video]', or name numbered pictures: {numbered}"
        ) from None
    del av
    holds = _HOLDS[path.suffix.lower()]
    codec = holds[0] if film.codec == "auto" else film.codec
    if codec not in holds:
        others = " or ".join(ending for ending, codecs in _HOLDS.items() if codec in codecs)
        raise OutputError(
            f"{path}: a {path.suffix} does not hold {codec}; name it {others}, or choose another"
        )
    return codec


def require_pictures(path: Path, codec: str, settings: Settings) -> None:
    """Raise SettingsError or OutputError where a codec cannot hold the pictures of these settings."""
    import av

    (width, height), kind = settings.size, _CODECS[codec]
    if width % 2 or (height % 2 and kind.halved):
        even = f"{width + width % 2}x{height + height % 2 * kind.halved}"
        raise SettingsError(
            f"size: {width}x{height} has an odd side, and two pixels share a color; use {even}"
        )
    if settings.background == "transparent":
        raise SettingsError("background: a video has no transparency; write numbered pictures")
    try:
        _encode(io.BytesIO(), [np.zeros((height, width, 3), np.uint8)], Film(), kind, path.suffix.lower())
    except (av.FFmpegError, ValueError):
        raise OutputError(
            f"{path}: {codec} takes no pictures of {width}x{height} here; choose another size or codec"
        ) from None


def bits_of(codec: str) -> int:
    """Return how many bits a channel of the pictures should have that a codec is given: 8 or 16."""
    return 8 if _CODECS[codec].bits == 8 else 16


def write_video(path: Path, pictures: Iterable[np.ndarray], film: Film, codec: str) -> None:
    """Write a video, or nothing.

    pictures  (h, w, 3) sRGB, uint8, or uint16 as `bits_of` says
    Raises OutputError where it cannot be written.
    """
    with replacing(path) as beside:
        count = _encode(str(beside), pictures, film, _CODECS[codec], path.suffix.lower())
        if _count(beside) != count:  # the last bytes' fate is not told
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def _encode(
    file: str | io.BytesIO, pictures: Iterable[np.ndarray], film: Film, codec: _Codec, ending: str
) -> int:
    """Write a video and return the number of its pictures."""
    import av

    os.environ.setdefault("SVT_LOG", "0")  # SVT-AV1 tells of itself on stderr
    options = {"fflags": "+bitexact"}
    if ending in (".mp4", ".mov") and isinstance(file, str):
        options["movflags"] = "+faststart"  # so that players begin before they have all of it
    rate = _rate(film.fps)
    stream: Any = None
    count = 0
    with av.open(file, "w", format=_FORMATS[ending], options=options) as made:
        for count, pixels in enumerate(pictures, 1):
            if stream is None:
                stream = made.add_stream(codec.encoder, rate=rate, options=codec.options)
                _describe(stream, pixels, codec)
            frame = _frame(pixels, codec)
            frame.pts, frame.time_base = count - 1, 1 / rate
            made.mux(stream.encode(frame))
        made.mux(stream.encode())
    return count


def _rate(fps: float) -> Fraction:
    """Pictures a second as a ratio: 23.976 and 29.97 stand for 24000 / 1001 and 30000 / 1001."""
    television = Fraction(1000 * round(fps), 1001)
    return television if abs(fps - television) < 1e-3 else Fraction(fps).limit_denominator(1001)


def _describe(stream: Any, pixels: np.ndarray, codec: _Codec) -> None:
    stream.height, stream.width = pixels.shape[:2]
    stream.pix_fmt = codec.format
    stream.codec_context.thread_count = 1
    _tag(stream.codec_context)


def _tag(owner: Any) -> None:
    """Say which colors its samples mean."""
    owner.color_primaries = owner.color_trc = owner.colorspace = _BT709
    owner.color_range = _LIMITED


def _frame(pixels: np.ndarray, codec: _Codec) -> Any:
    import av

    frame = av.VideoFrame(pixels.shape[1], pixels.shape[0], codec.format)
    for plane, samples in zip(frame.planes, to_yuv(pixels, codec.bits, codec.halved), strict=True):
        rows = np.zeros((plane.height, plane.line_size), np.uint8)
        row = np.ascontiguousarray(samples).view(np.uint8)
        rows[:, : row.shape[1]] = row
        plane.update(rows.tobytes())
    frame.color_primaries = frame.color_trc = frame.colorspace = _BT709
    frame.color_range = _LIMITED
    return frame


def _count(path: Path) -> int:
    """Pictures in a video."""
    import av

    with av.open(str(path)) as file:
        return sum(packet.size > 0 for packet in file.demux(video=0))


def read_png(path: Path, bits: int) -> np.ndarray:
    """Return the (h, w, 3) pixels of a PNG of 8 or 16 bits: uint8 or uint16."""
    import av

    with av.open(str(path)) as file:
        picture = next(file.decode(video=0))
        return np.asarray(picture.to_ndarray(format="rgb24" if bits == 8 else "rgb48le"))
