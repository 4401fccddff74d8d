"""Pictures for textures, decoded by Pillow."""

from __future__ import annotations

import io
import struct
import warnings
from hashlib import sha256
from typing import Any

import numpy as np

from ispm.errors import SceneError
from ispm.io.apart import RESERVE, Apart
from ispm.io.budget import LOOK, Budget
from ispm.io.notes import Notes

FORMATS = ("PNG", "JPEG", "WEBP")
TILE = 1024  # pixels a side that are converted at once, so that large pictures are not there three times
SCAN = b"\xff\xda"  # begins each scan of a JPEG (ITU T.81, B.2.3)
OPENING = 20 * LOOK  # steps to find out what a picture is
STEPS_A_PIXEL = 4
SCANS_A_STEP = 10  # of a pixel's band: 0.75 ns each
LONGEST = 1 << 16  # pixels of a side
KTX2 = b"\xabKTX 20\xbb\r\n\x1a\n"  # the first bytes of a file (KTX 2.0, 3.1)
# format, bytes of its type, width, height, depth, layers, faces, levels, packing
_KTX2_HEADER = struct.Struct("<12s9I")
_KTX2_LEVEL, _KTX2_LENGTH, _ZSTD = 80, 24, 2  # where the largest is told, in how many bytes; its packing


class Pictures:
    """The pictures of a scene: equal ones are decoded once and share their pixels.

    more   formats beside PNG, JPEG and WebP, by Pillow's names
    apart  where KTX2 is decoded; None: it is not
    """

    def __init__(
        self, budget: Budget, notes: Notes, more: tuple[str, ...] = (), apart: Apart | None = None
    ) -> None:
        self._budget, self._notes, self._formats, self._apart = budget, notes, FORMATS + more, apart
        self._found: dict[tuple[bytes, bool], np.ndarray | str] = {}  # pixels, or why there are none

    def decode(self, data: memoryview, *, srgb: bool) -> np.ndarray:
        """Return a picture as (height, width, 4) uint8, 16-bit channels cut to 8.

        Those larger than `max_texture`, or than a quarter of the memory left, are halved, in linear light.
        Raises SceneError where it has more pixels than allowed, before they are decoded, or is broken.
        """
        self._budget.take("the picture", work=len(data) // 8 + 1)
        digest = sha256(data).digest()
        if (digest, srgb) not in self._found:
            try:
                pixels, halvings = self._decode(data, srgb)
                self._found[digest, srgb] = pixels
                if not halvings:
                    self._found[digest, not srgb] = pixels
            except SceneError as error:
                self._found[digest, srgb] = self._found[digest, not srgb] = str(error)
        found = self._found[digest, srgb]
        if isinstance(found, str):
            raise SceneError(found)
        return found

    def _decode(self, data: memoryview, srgb: bool) -> tuple[np.ndarray, int]:
        """The pixels, and how many times they were halved."""
        self._budget.take("the picture", work=OPENING)
        if self._apart is not None and data[:12] == KTX2:
            pixels, halvings = self._ktx2(data, self._apart)
        else:
            pixels, halvings = self._by_pillow(data)
        for _ in range(halvings):
            from ispm.optics.texture import halved

            pixels = halved(pixels, srgb)
        self._budget.take("the picture", memory=pixels.nbytes)
        return pixels, halvings

    def _ktx2(self, data: memoryview, apart: Apart) -> tuple[np.ndarray, int]:
        """The pixels of a KTX2 as KHR_texture_basisu has them, and how many times they are to be halved."""
        if len(data) < _KTX2_LEVEL + _KTX2_LENGTH:
            raise SceneError("it is cut short within its header")
        _, form, _, width, height, depth, layers, faces, _, packing = _KTX2_HEADER.unpack_from(data)
        if form or depth or layers or faces != 1 or not width * height:
            raise SceneError("it is a KTX2 of another kind; single pictures in ETC1S and UASTC are read")
        unpacked = int.from_bytes(data[_KTX2_LEVEL + 16 : _KTX2_LEVEL + 24], "little")
        if packing == _ZSTD and unpacked != -(-width // 4) * -(-height // 4) * 16:
            raise SceneError(f"{unpacked} bytes are none of {width} x {height} pixels in UASTC")
        # The decoder holds four bytes of each pixel and what it unpacks, and so do we.
        halvings = self._admit(width, height, passing=10)
        pixels = apart.decode("ktx2", data)["pixels"]
        if pixels.shape != (height, width, 4):
            raise SceneError("its decoder gives pixels of another size")
        return pixels, halvings

    def _by_pillow(self, data: memoryview) -> tuple[np.ndarray, int]:
        """Likewise those of the formats that Pillow reads."""
        from PIL import Image, UnidentifiedImageError

        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of bombs, for the limits are ours, and of odd metadata
            try:
                with Image.open(io.BytesIO(data), formats=self._formats) as image:
                    bands = len(image.getbands())
                    scans = bytes(data).count(SCAN) if image.format == "JPEG" else 0
                    # Pillow holds four bytes of each pixel, and so do we; and all coefficients where scans
                    # add to them. WebP's decoder keeps two pictures of its own.
                    passing = (16 if image.format == "WEBP" else 8) + (2 * bands if scans > 1 else 0)
                    halvings = self._admit(*image.size, passing, bands * scans)
                    return rgba(image), halvings
            except Image.DecompressionBombError:
                raise SceneError("it has more pixels than can be decoded safely") from None
            except UnidentifiedImageError:
                raise SceneError(f"it is none of {', '.join(self._formats)}") from None
            except SceneError:
                raise
            except Exception as error:  # Pillow's decoders raise a dozen kinds for broken pictures
                raise SceneError(f"it cannot be decoded: {error}") from None

    def _admit(self, width: int, height: int, passing: int, scans: int = 0) -> int:
        """How many times the picture is to be halved. Raises SceneError where it cannot be decoded at all.

        passing  bytes for each pixel while it is decoded
        scans    of a JPEG, times its bands
        """
        limits = self._budget.limits
        count, what = width * height, f"{width} x {height} pixels"
        if count > limits.max_image_pixels:
            raise SceneError(f"{what}; max_image_pixels={limits.max_image_pixels} is the most")
        if max(width, height) > LONGEST:
            raise SceneError(f"{what}; a side may have {LONGEST} at most")
        self._budget.take(what, work=STEPS_A_PIXEL * count + scans * count // SCANS_A_STEP)
        self._budget.require(what, passing * count - RESERVE)
        halvings = 0
        while max(width, height) > limits.max_texture:
            width, height, halvings = max(1, width // 2), max(1, height // 2), halvings + 1
        fitting = halvings
        room = (self._budget.memory - limits.max_memory // 4) // 4  # what follows finds room, too
        while 4 * width * height > room and max(width, height) > 1:
            width, height, halvings = max(1, width // 2), max(1, height // 2), halvings + 1
        self._notes.count(
            "picture is halved, for want of memory; max_memory allows more",
            "pictures are halved, for want of memory; max_memory allows more",
            int(halvings > fitting),
        )
        return halvings


def rgba(image: Any) -> np.ndarray:
    """Return a Pillow picture as (height, width, 4) uint8."""
    width, height = image.size
    pixels = np.empty((height, width, 4), np.uint8)
    for top in range(0, height, TILE):
        for left in range(0, width, TILE):
            right, bottom = min(left + TILE, width), min(top + TILE, height)
            pixels[top:bottom, left:right] = _rgba(image.crop((left, top, right, bottom)))
    return pixels


def _rgba(image: Any) -> np.ndarray:
    if image.mode.startswith("I"):  # 16-bit gray, which Pillow would clip rather than scale
        gray = (np.asarray(image).astype(np.uint32) >> 8).clip(0, 255).astype(np.uint8)
        return np.dstack([gray, gray, gray, np.full_like(gray, 255)])
    return np.asarray(image.convert("RGBA"))
