"""Pictures for textures, decoded by Pillow."""

from __future__ import annotations

import io
import warnings
from hashlib import sha256
from typing import Any

import numpy as np

from ispm.errors import SceneError
from ispm.io.budget import LOOK, Budget
from ispm.io.notes import Notes

FORMATS = ("PNG", "JPEG", "WEBP")
TILE = 1024  # pixels a side that are converted at once, so that large pictures are not there three times
SCAN = b"\xff\xda"  # begins each scan of a JPEG (ITU T.81, B.2.3)
OPENING = 20 * LOOK  # steps to find out what a picture is
STEPS_A_PIXEL = 4
SCANS_A_STEP = 10  # of a pixel's band: 0.75 ns each
LONGEST = 1 << 16  # pixels of a side
RESERVE = 256 << 20  # bytes above the limit while a picture is decoded


class Pictures:
    """The pictures of a scene: equal ones are decoded once and share their pixels.

    more  formats beside PNG, JPEG and WebP, by Pillow's names
    """

    def __init__(self, budget: Budget, notes: Notes, more: tuple[str, ...] = ()) -> None:
        self._budget, self._notes, self._formats = budget, notes, FORMATS + more
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
        from PIL import Image, UnidentifiedImageError

        self._budget.take("the picture", work=OPENING)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of bombs, for the limits are ours, and of odd metadata
            try:
                with Image.open(io.BytesIO(data), formats=self._formats) as image:
                    halvings = self._admit(image, data)
                    pixels = rgba(image)
            except Image.DecompressionBombError:
                raise SceneError("it has more pixels than can be decoded safely") from None
            except UnidentifiedImageError:
                raise SceneError(f"it is none of {', '.join(self._formats)}") from None
            except SceneError:
                raise
            except Exception as error:  # Pillow's decoders raise a dozen kinds for broken pictures
                raise SceneError(f"it cannot be decoded: {error}") from None
        for _ in range(halvings):
            from ispm.optics.texture import halved

            pixels = halved(pixels, srgb)
        self._budget.take("the picture", memory=pixels.nbytes)
        return pixels, halvings

    def _admit(self, image: Any, data: memoryview) -> int:
        """How many times the picture is to be halved. Raises SceneError where it cannot be decoded at all."""
        limits, (width, height) = self._budget.limits, image.size
        count, what = width * height, f"{width} x {height} pixels"
        if count > limits.max_image_pixels:
            raise SceneError(f"{what}; max_image_pixels={limits.max_image_pixels} is the most")
        if max(width, height) > LONGEST:
            raise SceneError(f"{what}; a side may have {LONGEST} at most")
        scans = bytes(data).count(SCAN) if image.format == "JPEG" else 0
        many = len(image.getbands()) * count
        self._budget.take(what, work=STEPS_A_PIXEL * count + many * scans // SCANS_A_STEP)
        # Pillow holds four bytes of each pixel, and so do we; and all coefficients where scans add to them.
        # WebP's decoder keeps two pictures of its own.
        passing = (16 if image.format == "WEBP" else 8) * count + (2 * many if scans > 1 else 0)
        self._budget.require(what, passing - RESERVE)
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
