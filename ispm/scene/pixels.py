"""Pictures that users give as arrays, brought to the one form that textures keep."""

from __future__ import annotations

import numpy as np

from ispm.errors import SceneError
from ispm.scene.color import encoded

_ACCEPTED = "uint8 or uint16, or floats of 0 to 1"


def rgba_of(where: str, pixels: object, srgb: bool) -> np.ndarray:
    """Return pixels as (height, width, 4) uint8, opaque where they have no alpha: themselves where they are.

    pixels  (h, w) gray or (h, w, 1 to 4): gray, gray and alpha, RGB, RGBA; uint8 and uint16 as they are kept,
            16 bits cut to 8; floats linear, 0 to 1
    srgb    whether floats are encoded; alpha never is
    Raises SceneError for others, which begins with `where`.
    """
    if not isinstance(pixels, np.ndarray):
        raise SceneError(f"{where}: pixels must be a path or a numpy array, not a {type(pixels).__name__}")
    channels = pixels.shape[2] if pixels.ndim == 3 else int(pixels.ndim == 2)
    if not 1 <= channels <= 4 or not pixels.size:
        raise SceneError(
            f"{where}: pixels must have shape (height, width) or (height, width, 1 to 4), not {pixels.shape}"
        )
    if pixels.dtype == np.uint8 and channels == 4:
        return pixels
    planes = pixels[..., None] if pixels.ndim == 2 else pixels
    color, alpha = (planes[..., :-1], planes[..., -1:]) if channels in (2, 4) else (planes, None)
    color = _bytes(where, color, srgb)
    if color.shape[2] == 1:
        color = np.repeat(color, 3, axis=2)
    opacity = np.full_like(color[..., :1], 255) if alpha is None else _bytes(where, alpha, False)
    return np.concatenate([color, opacity], axis=2)


def _bytes(where: str, values: np.ndarray, srgb: bool) -> np.ndarray:
    if values.dtype == np.uint8:
        return values
    if values.dtype == np.uint16:
        return (values >> 8).astype(np.uint8)
    if values.dtype.kind != "f":
        raise SceneError(f"{where}: pixels must be of {_ACCEPTED}, not of {values.dtype}")
    if not (values.min() >= 0.0 and values.max() <= 1.0):  # NaN is neither
        raise SceneError(
            f"{where}: pixels of {values.dtype} must be 0 to 1, not {values.min():g} to {values.max():g}; "
            "divide them, or give uint8"
        )
    return np.rint(255.0 * (encoded(values) if srgb else values)).astype(np.uint8)
