"""Pictures for textures, decoded by Pillow."""

from __future__ import annotations

import dataclasses
import io
import warnings
from typing import Any

import numpy as np

from ispm.errors import SceneError
from ispm.scene.material import Texture
from ispm.settings import LoadLimits

FORMATS = ("PNG", "JPEG", "WEBP")


def decode(data: memoryview, limits: LoadLimits, more: tuple[str, ...] = ()) -> np.ndarray:
    """Return a PNG, JPEG or WebP as (height, width, 4) uint8, 16-bit channels cut to 8.

    more  further formats, by Pillow's names
    Raises SceneError where it has more pixels than allowed, before they are decoded, or is broken.
    """
    from PIL import Image, UnidentifiedImageError

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", Image.DecompressionBombWarning)  # the limit below is ours
        try:
            with Image.open(io.BytesIO(data), formats=FORMATS + more) as image:
                width, height = image.size
                if width * height > limits.max_image_pixels:
                    raise SceneError(
                        f"{width} x {height} pixels; max_image_pixels={limits.max_image_pixels} is the most"
                    )
                return rgba(image)
        except Image.DecompressionBombError:
            raise SceneError("it has more pixels than can be decoded safely") from None
        except UnidentifiedImageError:
            raise SceneError(f"it is none of {', '.join(FORMATS + more)}") from None
        except SceneError:
            raise
        except Exception as error:  # Pillow's decoders raise a dozen kinds for broken pictures
            raise SceneError(f"it cannot be decoded: {error}") from None


def rgba(image: Any) -> np.ndarray:
    """Return a Pillow picture as (height, width, 4) uint8."""
    if image.mode.startswith("I"):  # 16-bit gray, which Pillow would clip rather than scale
        gray = (np.asarray(image).astype(np.uint32) >> 8).clip(0, 255).astype(np.uint8)
        return np.dstack([gray, gray, gray, np.full_like(gray, 255)])
    return np.array(image.convert("RGBA"))


def shrunk(texture: Texture, largest: int) -> Texture:
    """Return `texture` halved by averaging, in linear light, until neither side is longer than `largest`."""
    if max(texture.pixels.shape[:2]) <= largest:
        return texture
    from ispm.optics.texture import mip_chain

    levels = mip_chain(dataclasses.replace(texture, mipmaps=True))
    fitting = next(level for level in levels if max(level.shape[:2]) <= largest)
    return dataclasses.replace(texture, pixels=fitting)
