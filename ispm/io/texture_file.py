"""Picture files that users name as textures."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from ispm.errors import SceneError
from ispm.io.mtl_picture import MORE_FORMATS
from ispm.io.picture import decode
from ispm.settings import LoadLimits


def read_pixels(path: str | os.PathLike[str]) -> np.ndarray:
    """Return a picture file as (height, width, 4) uint8. Raises SceneError where it cannot be used."""
    file, limits = Path(path), LoadLimits()
    if not file.is_file():  # also of devices, which may never end
        raise SceneError(f"{path}: there is no such file")
    try:
        if file.stat().st_size > limits.max_file_bytes:
            raise SceneError(f"it is larger than {limits.max_file_bytes} bytes")
        return decode(memoryview(file.read_bytes()), limits, MORE_FORMATS)
    except SceneError as error:
        raise SceneError(f"{path}: {error}") from None
    except OSError as error:
        raise SceneError(f"{path}: cannot be read: {error.strerror or error}") from None
