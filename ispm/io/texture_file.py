"""Picture files that users name as textures."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from ispm.errors import SceneError
from ispm.io.budget import Budget
from ispm.io.folder import map_file
from ispm.io.mtl_picture import MORE_FORMATS
from ispm.io.notes import Notes
from ispm.io.picture import Pictures
from ispm.settings import LoadLimits

_LIMITS = LoadLimits(max_texture=1 << 20, max_memory=4 << 30)  # what users name themselves is not halved


def read_pixels(path: str | os.PathLike[str]) -> np.ndarray:
    """Return a picture file as (height, width, 4) uint8. Raises SceneError where it cannot be used."""
    file, budget = Path(path), Budget(_LIMITS)
    if not file.is_file():  # also of devices, which may never end
        raise SceneError(f"{path}: there is no such file")
    try:
        return Pictures(budget, Notes(), MORE_FORMATS).decode(map_file(file, budget), srgb=True)
    except SceneError as error:
        raise SceneError(f"{path}: {error}") from None
    except OSError as error:
        raise SceneError(f"{path}: cannot be read: {error.strerror or error}") from None
