"""FLIP: the difference between two pictures as somebody sees it who flips between them.

Source: Andersson, Nilsson, Akenine-Moeller, Oskarsson, Astrom, Fairchild, "FLIP: A Difference Evaluator for
Alternating Images", HPG 2020; sections and constants are those of the paper.
"""

from __future__ import annotations

import math
from functools import partial

import numpy as np

PIXELS_PER_DEGREE = 67.0206  # a screen of 0.7 m and 3840 pixels seen from 0.7 m (section 6)

_QC, _PC, _PT = 0.7, 0.4, 0.95  # remapping of color differences (section 4.1.3)
_QF, _W = 0.5, 0.082  # exponent of the feature difference; width of the detectors, degrees (4.2)

# Contrast sensitivity as sums of Gaussians a sqrt(pi / b) exp(-pi^2 x^2 / b), x in degrees (table 1).
_SENSITIVITY = (((1.0, 0.0047),), ((1.0, 0.0053),), ((34.1, 0.04), (13.5, 0.025)))

_XYZ_FROM_RGB = np.array(
    [
        [10135552 / 24577794, 8788810 / 24577794, 4435075 / 24577794],
        [2613072 / 12288897, 8788810 / 12288897, 887015 / 12288897],
        [1425312 / 73733382, 8788810 / 73733382, 70074185 / 73733382],
    ]
)
_WHITE = _XYZ_FROM_RGB.sum(axis=1)
# Y, Cx, Cz without the constant of Y: linear in XYZ over the white point.
_OPPONENT_FROM_XYZ = np.array([[0.0, 116.0, 0.0], [500.0, -500.0, 0.0], [0.0, 200.0, -200.0]]) / _WHITE
_OPPONENT_FROM_RGB = _OPPONENT_FROM_XYZ @ _XYZ_FROM_RGB
_RGB_FROM_OPPONENT = np.linalg.inv(_OPPONENT_FROM_RGB)


def flip(test: np.ndarray, reference: np.ndarray, pixels_per_degree: float = PIXELS_PER_DEGREE) -> np.ndarray:
    """Return (h, w) differences from 0, not seen, to 1.

    test, reference  (h, w, 3) linear Rec. 709 in [0, 1], as a screen shows them
    """
    a, b = (np.asarray(picture, np.float64) @ _OPPONENT_FROM_RGB.T for picture in (test, reference))
    color = _color_difference(_seen(a, pixels_per_degree), _seen(b, pixels_per_degree))
    feature = _feature_difference(a[..., 0] / 116.0, b[..., 0] / 116.0, pixels_per_degree)
    return np.asarray(color ** (1.0 - feature))


def _seen(opponent: np.ndarray, ppd: float) -> np.ndarray:
    """Filter by contrast sensitivity, then to CIELAB with Hunt's adjustment (sections 4.1.1 and 4.1.2)."""
    widest = max(b for channel in _SENSITIVITY for _, b in channel)
    radius = math.ceil(3.0 * math.sqrt(widest / (2.0 * math.pi**2)) * ppd)
    degrees = np.arange(-radius, radius + 1) / ppd
    filtered = np.empty_like(opponent)
    for c, gaussians in enumerate(_SENSITIVITY):
        total, weight = np.zeros(opponent.shape[:2]), 0.0
        for a, b in gaussians:
            line = np.exp(-(math.pi**2) * degrees**2 / b)
            height = a * math.sqrt(math.pi / b)
            total += height * _convolve(opponent[..., c], line, line)
            weight += height * line.sum() ** 2
        filtered[..., c] = total / weight
    return _hunt_lab(np.clip(filtered @ _RGB_FROM_OPPONENT.T, 0.0, 1.0))


def _hunt_lab(rgb: np.ndarray) -> np.ndarray:
    """CIELAB whose a and b are scaled by 0.01 L: colors of dark pixels matter less."""
    t = rgb @ _XYZ_FROM_RGB.T / _WHITE
    edge = 6.0 / 29.0
    f = np.where(t > edge**3, np.cbrt(t), t / (3.0 * edge**2) + 4.0 / 29.0)
    lightness = 116.0 * f[..., 1] - 16.0
    a, b = 500.0 * (f[..., 0] - f[..., 1]), 200.0 * (f[..., 1] - f[..., 2])
    return np.stack([lightness, 0.01 * lightness * a, 0.01 * lightness * b], axis=-1)


def _hyab(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Distance of large color differences: city block in lightness, Euclidean in color."""
    d = a - b
    return np.asarray(np.abs(d[..., 0]) + np.hypot(d[..., 1], d[..., 2]))


def _color_difference(test: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """Distances remapped to [0, 1]: the lower 40 per cent of the range take 95 per cent of it."""
    green, blue = _hunt_lab(np.eye(3)[1]), _hunt_lab(np.eye(3)[2])
    largest = float(_hyab(green, blue)) ** _QC
    power = _hyab(test, reference) ** _QC
    knee = _PC * largest
    above = _PT + (power - knee) / (largest - knee) * (1.0 - _PT)
    return np.asarray(np.where(power < knee, power * (_PT / knee), above))


def _feature_difference(test: np.ndarray, reference: np.ndarray, ppd: float) -> np.ndarray:
    """How much edges and points differ (section 4.2), from lightness in [0, 1]."""
    deviation = 0.5 * _W * ppd
    radius = math.ceil(3.0 * deviation)
    x = np.arange(-radius, radius + 1)
    gaussian = np.exp(-(x**2) / (2.0 * deviation**2))
    edge, point = -x * gaussian, (x**2 / deviation**2 - 1.0) * gaussian
    differences = [
        np.abs(_magnitude(test, kernel, gaussian) - _magnitude(reference, kernel, gaussian))
        for kernel in (edge, point)
    ]
    return np.asarray((np.maximum(*differences) / math.sqrt(2.0)) ** _QF)


def _magnitude(image: np.ndarray, kernel: np.ndarray, gaussian: np.ndarray) -> np.ndarray:
    """Length of the responses along x and y; the kernel's positive and negative weights each sum to 1."""
    kernel = np.where(kernel > 0.0, kernel / kernel[kernel > 0.0].sum(), -kernel / kernel[kernel < 0.0].sum())
    gaussian = gaussian / gaussian.sum()
    respond = partial(_convolve, image)
    return np.asarray(np.hypot(respond(kernel, gaussian), respond(gaussian, kernel)))


def _convolve(image: np.ndarray, across: np.ndarray, down: np.ndarray) -> np.ndarray:
    """Correlate (h, w) with across along x and down along y; edges are repeated."""
    radius = len(across) // 2
    height, width = image.shape
    padded = np.pad(image, radius, mode="edge")
    rows = sum(weight * padded[:, k : k + width] for k, weight in enumerate(across))
    return np.asarray(sum(weight * rows[k : k + height] for k, weight in enumerate(down)))
