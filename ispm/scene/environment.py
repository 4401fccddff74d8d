"""Light from all around: an equirectangular picture of radiance."""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ispm.errors import SceneError, warn_caller
from ispm.scene.values import BRIGHTEST, Strict, array_of, require

WIDEST, HIGHEST = 4096, 2048  # pixels that are kept


@dataclass(eq=False)
class Environment(Strict):
    """What lights a scene from infinitely far, and is seen behind it and in mirrors. Compared by identity.

    image       a picture file (.hdr .exr), or an array, (height, width, 3), linear, 0 or more, row 0 on top:
                radiance in cd/m2. Its center column lies along -Z, right of it +X, its top row about +Y.
                Values are bilinear between the pixels' centers. Kept as an array; more than 4096 x 2048
                pixels are averaged to these, with a SceneWarning: the light stays the same.
    rotation    radians about +Y, counterclockwise seen from above
    intensity   factor of the radiance
    background  whether it is seen behind the scene; in mirrors and through glass it always is
    name        default, of a file: its name without the ending
    file        the path of the file that it was read from; empty: of none
    version     counts calls of `touch`
    Another array may be given at any time; call `touch` after editing it in place.
    Raises SceneError for an image, or a file, that cannot be used.
    """

    image: np.ndarray
    rotation: float
    intensity: float
    background: bool
    name: str
    file: str
    version: int

    def __init__(
        self,
        image: np.ndarray | str | os.PathLike[str],
        rotation: float = 0.0,
        intensity: float = 1.0,
        background: bool = True,
        name: str = "",
    ) -> None:
        self.rotation, self.intensity, self.background = rotation, intensity, background
        self.name, self.file, self.version = name, "", 0
        if isinstance(image, str | os.PathLike):
            from ispm.io.hdr import read_environment

            self.name, self.file = name or Path(image).stem, os.fspath(image)
            self.image = read_environment(image)
        else:
            self.image = image
            self._check_values()
            self.image = averaged(self.image, self._called())
        self.check()

    def __repr__(self) -> str:
        height, width = self.image.shape[:2]
        return f"<Environment '{self.name}': {width}x{height}>"

    def touch(self) -> None:
        """Say that the image was edited in place, so that renderers read it again."""
        self.version += 1

    def check(self) -> None:
        """Raise SceneError for a value that cannot be used."""
        called = self._called()
        require(f"{called}: rotation, in radians,", self.rotation)
        require(f"{called}: intensity", self.intensity, 0.0, BRIGHTEST)
        self._check_values()
        height, width = self.image.shape[:2]
        if width > WIDEST or height > HIGHEST:
            raise SceneError(
                f"{called}: the image has {width} x {height} pixels, and {WIDEST} x {HIGHEST} is the most; "
                "make a new Environment of it, which averages them"
            )
        brightest = float(self.image.max()) * self.intensity
        require(f"{called}: the brightest pixel, times the intensity,", brightest, 0.0, BRIGHTEST)

    def _check_values(self) -> None:
        array_of(f"{self._called()}: image", self.image, (None, None, 3), 0.0, BRIGHTEST)
        if not isinstance(self.image, np.ndarray):
            raise SceneError(f"{self._called()}: image must be a numpy array, not a {_kind(self.image)}")
        if not self.image.size:
            raise SceneError(f"{self._called()}: the image has no pixels")

    def _called(self) -> str:
        return f"environment '{self.name}'" if self.name else "environment"


def averaged(image: np.ndarray, called: str) -> np.ndarray:
    """Return an image of at most 4096 x 2048 pixels, warning in one line where it has more."""
    height, width = image.shape[:2]
    if width > WIDEST or height > HIGHEST:
        told_of_averaging(called, width, height)
        image = fewer_rows(fewer_columns(image, WIDEST), HIGHEST)
    return image


def told_of_averaging(called: str, width: int, height: int) -> None:
    """Warn that so many pixels become fewer."""
    kept = f"{min(width, WIDEST)} x {min(height, HIGHEST)}"
    warn_caller(f"{called}: its {width} x {height} pixels are averaged to {kept}")


def fewer_columns(image: np.ndarray, most: int) -> np.ndarray:
    """Return (h, w, 3) float32 averaged to `most` columns: itself where it has no more."""
    return _fewer(image, min(most, image.shape[1]), 1, lambda x: x)


def fewer_rows(image: np.ndarray, most: int) -> np.ndarray:
    """Return (h, w, 3) float32 averaged over solid angles to `most` rows: itself where it has no more."""
    height = len(image)
    return _fewer(image, min(most, height), 0, lambda y: -np.cos(y * math.pi / height))


def _fewer(
    image: np.ndarray, count: int, axis: int, measure: Callable[[np.ndarray], np.ndarray]
) -> np.ndarray:
    """`image` with `count` pixels along an axis, each the mean, by a measure, of what it covers."""
    before = image.shape[axis]
    if count == before:
        return image
    edges = np.arange(count + 1) * (before / count)
    first = edges[:-1].astype(np.int64)
    along = (1, -1, 1) if axis else (-1, 1, 1)
    shape = (image.shape[0], count, 3) if axis else (count, *image.shape[1:])
    total = np.zeros(shape, np.float32)
    whole = measure(edges[1:]) - measure(edges[:-1])
    for k in range(-(-before // count) + 1):
        low, high = np.maximum(edges[:-1], first + k), np.minimum(edges[1:], first + k + 1)
        share = np.maximum(measure(high) - measure(low), 0.0) / whole
        rows = np.minimum(first + k, before - 1)
        total += share.astype(np.float32).reshape(along) * np.take(image, rows, axis=axis)
    return total


def _kind(value: object) -> str:
    return type(value).__name__
