"""Light from infinitely far, all around: an equirectangular image of radiance.

World space, +Y up: the image's center column lies along -Z, right of it +X. Directions are unit.
"""

from typing import NamedTuple

import numpy as np


class EnvironmentTable(NamedTuple):
    """An environment as kernels read it; of a scene without one all arrays are empty.

    radiance  (h, w, 3) float32 cd/m2, the image's top row first
    rows      (h + 1,) float32 cumulative probability of its rows, 0 to 1
    columns   (h, w + 1) float32 likewise of the pixels in each row
    to_image  (3, 3) float32 rotation from world space to the image's frame
    """

    radiance: np.ndarray
    rows: np.ndarray
    columns: np.ndarray
    to_image: np.ndarray


NO_ENVIRONMENT = EnvironmentTable(
    np.zeros((0, 0, 3), np.float32),
    np.zeros(0, np.float32),
    np.zeros((0, 0), np.float32),
    np.eye(3, dtype=np.float32),
)
