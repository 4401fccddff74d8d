"""How far a picture is from another: bias, relMSE, mean relative error, FLIP."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np

from ispm.bench.flip import flip
from ispm.errors import OutputError
from ispm.io.image import srgb_to_linear
from ispm.optics.vector import LUMINANCE
from ispm.stages.tonemap import auto_exposure, tonemap

_REGULARISER = 1e-3  # eps over the squared mean of the reference


@dataclass(frozen=True)
class LightErrors:
    """Errors of a picture's light against a reference, over the pixels compared and their channels.

    bias                 mean(A) / mean(B) - 1: above 0 where the picture is too bright
    relmse               mean of (A - B)^2 / (B^2 + eps), eps = 1e-3 mean(B)^2, less the reference's own
    mean_relative_error  mean of |A - B| / sqrt(B^2 + eps)
    pixels               how many were compared
    """

    bias: float
    relmse: float
    mean_relative_error: float
    pixels: int


@dataclass(frozen=True)
class Comparison(LightErrors):
    """Those of the light, and mean FLIP of both pictures tone mapped at the reference's auto exposure."""

    flip: float


def compare(
    a: np.ndarray,
    b: np.ndarray,
    mask: np.ndarray | None = None,
    *,
    reference_error: float = 0.0,
    displayed: bool = False,
) -> Comparison:
    """Compare the picture `a` with the reference `b`; return numbers with these names, and how many `pixels`.

    `bias` is mean(a) / mean(b) - 1; `relmse` the mean of (a - b)^2 / (b^2 + eps), eps = 0.001 mean(b)^2;
    `mean_relative_error` the mean of |a - b| / sqrt(b^2 + eps); `flip` the mean of FLIP, both pictures tone
    mapped at the reference's auto exposure.

    a, b             (h, w, 3) linear radiance
    mask             (h, w) the pixels to compare, where it is not 0; default: all
    reference_error  relMSE of the reference against the truth, taken off `relmse`
    displayed        the pictures are tone mapped already: FLIP takes them as they are
    Raises OutputError where the shapes differ, the mask is empty, or a value compared is not finite.
    """
    light = compare_light(a, b, mask, reference_error=reference_error)
    on_screen = flip(*_on_screen(a, b, displayed))[_chosen(a, b, mask)]
    return Comparison(**asdict(light), flip=float(on_screen.mean()))


def compare_light(
    a: np.ndarray, b: np.ndarray, mask: np.ndarray | None = None, *, reference_error: float = 0.0
) -> LightErrors:
    """Compare as `compare` does, without FLIP, which takes most of the time."""
    chosen = _chosen(a, b, mask)
    picked_a, picked_b = _picked(a, chosen, "picture"), _picked(b, chosen, "reference")
    if not picked_b.any():
        raise OutputError("the reference is black wherever it is compared; relative errors have no meaning")
    difference = picked_a - picked_b
    scale = picked_b**2 + _REGULARISER * picked_b.mean() ** 2
    return LightErrors(
        bias=float(picked_a.mean() / picked_b.mean() - 1.0),
        relmse=float((difference**2 / scale).mean() - reference_error),
        mean_relative_error=float((np.abs(difference) / np.sqrt(scale)).mean()),
        pixels=len(picked_b),
    )


def difference_picture(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return (h, w, 3) uint8: red where `a` is brighter than the reference `b`, blue where darker.

    a, b  (h, w, 3) linear radiance
    The color's strength is the root of the relative error of luminance, with relMSE's regulariser; full at 1.
    """
    weights = LUMINANCE
    luminance_a, luminance_b = (np.asarray(x, np.float64) @ weights for x in (a, b))
    scale = np.sqrt(luminance_b**2 + _REGULARISER * np.nanmean(luminance_b) ** 2)
    error = np.nan_to_num((luminance_a - luminance_b) / np.maximum(scale, 1e-30), nan=1.0)
    strength = np.rint(255.0 * np.sqrt(np.minimum(np.abs(error), 1.0))).astype(np.uint8)
    picture = np.zeros((*strength.shape, 3), np.uint8)
    picture[..., 0] = np.where(error > 0.0, strength, 0)
    picture[..., 2] = np.where(error < 0.0, strength, 0)
    return picture


def _chosen(a: np.ndarray, b: np.ndarray, mask: np.ndarray | None) -> np.ndarray:
    """Return the (h, w) pixels to compare."""
    if not all(isinstance(each, np.ndarray) and each.ndim == 3 for each in (a, b)):
        raise OutputError("pictures to compare must be arrays (height, width, 3), as frame.radiance is")
    if a.shape != b.shape:
        raise OutputError(
            f"the pictures differ in shape, {_shape(a)} and {_shape(b)}; render at the same size"
        )
    chosen = np.ones(b.shape[:2], bool) if mask is None else np.asarray(mask) != 0
    if chosen.shape != b.shape[:2]:
        raise OutputError(f"the mask is {_shape(chosen)}, the pictures are {_shape(b)}")
    if not chosen.any():
        raise OutputError("the mask picks no pixel")
    return chosen


def _picked(picture: np.ndarray, chosen: np.ndarray, name: str) -> np.ndarray:
    """Return the chosen pixels as (n, channels) float64, all finite."""
    values: np.ndarray = np.asarray(picture)[chosen].astype(np.float64)
    bad = int((~np.isfinite(values)).any(axis=-1).sum())
    if bad:
        raise OutputError(f"the {name} has {bad} pixels that are not finite")
    return values


def _on_screen(a: np.ndarray, b: np.ndarray, displayed: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return each picture as displayed, (h, w, 3) linear RGB in [0, 1], which FLIP compares."""
    if displayed:
        return np.clip(a, 0.0, 1.0), np.clip(b, 0.0, 1.0)
    exposure = auto_exposure(b)
    return srgb_to_linear(tonemap(a, exposure)), srgb_to_linear(tonemap(b, exposure))


def _shape(array: np.ndarray) -> str:
    return " x ".join(str(n) for n in array.shape[1::-1])
