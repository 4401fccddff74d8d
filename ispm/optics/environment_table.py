"""What kernels read of an environment's image: chances of its pixels, irradiance by normals, and suns."""

import math

import numpy as np

from ispm.optics.environment import NO_ENVIRONMENT, NODES, SUN, EnvironmentTable
from ispm.optics.vector import LUMINANCE

_STEPS = 1 << 24  # of cumulative probability: float32 and random numbers have all of them
_LEAST = 4  # steps that a pixel with any light has in its row, and such a row in the image
_PI = math.pi
_LEAST_SUN = 0.3  # of all light: sunlight that is less is drawn, known and filtered with the sky's
_SMALL = 0.1  # radians from the upper to the lower end of one sun at most
_FILLED = 0.4  # of the rectangle about it, that it fills
_COARSE = 32  # rows of blocks of pixels, for irradiance, and half the columns
_SUBBLOCK_ROWS = 512  # likewise, of smaller blocks, which give the mean direction of those
_FINE = 128  # rows of pixels at least, likewise
_PARTS = 8  # of a pixel along each side, which are as bright as suns or not
_SOME = 1 << 14  # pixels at a time


def environment_table(image: np.ndarray) -> EnvironmentTable:
    """Return an image as kernels read it, not turned nor scaled.

    image  (h, w, 3) cd/m2, 4096 x 2048 pixels at most
    Pixels are drawn in proportion to their solid angle times the greatest luminance in them, and a little
    more often where that is next to nothing, so that each has a probability that has any light.
    """
    radiance = np.require(image, np.float32, ("C", "W"))  # kernels take what can be written for another type
    angles = _row_solid_angles(len(radiance))[:, None]
    weights = _greatest_luminance(radiance) * angles
    if not weights.any():  # in the dark all directions are alike
        weights += angles
    rows = _cumulative(weights.sum(axis=1)[None])[0]
    table = NO_ENVIRONMENT._replace(radiance=radiance, rows=rows, columns=_cumulative(weights))
    brightest = np.float32(SUN * environment_power(table) / (4.0 * _PI))
    finer = _finer(radiance)
    is_brighter = finer @ np.array(LUMINANCE, np.float32) > brightest
    if is_brighter.any():
        table = table._replace(brightest=brightest)
        dark, bright = _divided(finer, is_brighter, brightest)
        irradiance, sunlight = _irradiance(dark), _irradiance(bright)
        if sunlight.mean() > _LEAST_SUN * (sunlight + irradiance).mean():
            return _with_suns(table._replace(irradiance=irradiance, sunlight=sunlight), weights)
    return table._replace(irradiance=_irradiance(finer))


def _with_suns(table: EnvironmentTable, weights: np.ndarray) -> EnvironmentTable:
    """A table that draws from its suns alone, too; weights: (h, w) of its pixels."""
    greatest = weights / _row_solid_angles(len(weights))[:, None]
    weights = np.where(greatest > table.brightest, weights, 0.0)
    chances = np.diff(table.columns) * np.diff(table.rows)[:, None]
    share = np.float32(chances[weights > 0.0].sum(dtype=float))
    rows = _cumulative(weights.sum(axis=1)[None])[0]
    return table._replace(sun_rows=rows, sun_columns=_cumulative(weights), sun_share=share)


def is_one_sun(table: EnvironmentTable) -> bool:
    """Return whether sunlight comes from one small part of the sky, which is as good as filled with it."""
    rows = np.flatnonzero(np.diff(table.sun_rows) > 0.0)
    if not 0 < len(rows) <= max(_SMALL / _PI * len(table.radiance), 2.0):
        return False
    has_sun = np.diff(table.sun_columns[rows]) > 0.0
    columns = np.flatnonzero(has_sun.any(axis=0))
    across = len(has_sun[0]) - int(np.diff(columns, append=columns[0] + len(has_sun[0])).max()) + 1
    return bool(has_sun.sum() >= _FILLED * (rows[-1] - rows[0] + 1) * across)


def _finer(radiance: np.ndarray) -> np.ndarray:
    """An image, (h, w, 3), of _FINE rows at least: what is between the pixels' centers of a coarser one."""
    parts = -(-_FINE // len(radiance))
    if parts == 1:
        return radiance
    finer = np.pad(np.pad(radiance, ((1, 1), (0, 0), (0, 0)), "edge"), ((0, 0), (1, 1), (0, 0)), "wrap")
    before, share = np.divmod((np.arange(parts) + 0.5) / parts - 0.5, 1.0)
    for axis in range(2):
        count = radiance.shape[axis]
        at = (np.arange(count)[:, None] + before.astype(int) + 1).ravel()
        weights = np.tile(share, count).astype(np.float32).reshape((-1, 1, 1) if axis == 0 else (-1, 1))
        finer = (1 - weights) * finer.take(at, axis) + weights * finer.take(at + 1, axis)
    return finer


def _divided(
    radiance: np.ndarray, is_brighter: np.ndarray, brightest: np.float32
) -> tuple[np.ndarray, np.ndarray]:
    """Each pixel's part of an image, (h, w, 3), that is no brighter, and the part that is; as means over the
    pixel of what is between the centers, some of which are brighter, (h, w) bool."""
    dark, bright = radiance.copy(), np.zeros_like(radiance)
    tall = np.pad(is_brighter, ((1, 1), (0, 0)))
    about = np.pad(tall[:-2] | tall[1:-1] | tall[2:], ((0, 0), (1, 1)), "wrap")
    rows, columns = np.nonzero(about[:, :-2] | about[:, 1:-1] | about[:, 2:])
    aside = np.abs((np.arange(_PARTS) + 0.5) / _PARTS - 0.5 - np.array([-1.0, 0.0, 1.0])[:, None])
    weights = np.maximum(1.0 - aside, 0.0).astype(np.float32)  # of the pixels before, at and after, by part
    for first in range(0, len(rows), _SOME):
        row, column = rows[first : first + _SOME], columns[first : first + _SOME]
        down = np.clip(row + np.arange(-1, 2)[:, None], 0, len(radiance) - 1)
        right = (column + np.arange(-1, 2)[:, None]) % radiance.shape[1]
        about = radiance[down[:, None], right[None]]
        parts = np.einsum("yv,xu,yxkc->vukc", weights, weights, about, optimize=True)
        is_bright = (parts @ np.array(LUMINANCE, np.float32) > brightest)[..., None]
        bright[row, column] = np.where(is_bright, parts, 0).mean(axis=(0, 1))
        dark[row, column] = np.where(is_bright, 0, parts).mean(axis=(0, 1))
    return dark, bright


def _irradiance(radiance: np.ndarray) -> np.ndarray:
    """(m, m, 3) float32 lx by the normal, see EnvironmentTable; radiance: (h, w, 3), of which _COARSE blocks
    shine as from one direction each, the mean of their light."""
    flux = (
        radiance * np.asarray(_row_solid_angles(len(radiance)) / radiance.shape[1], np.float32)[:, None, None]
    )
    flux, down, right = _blocks(flux, _SUBBLOCK_ROWS)
    theta, phi = down[:, None] * (_PI / len(radiance)), right * (2.0 * _PI / radiance.shape[1]) - _PI
    power, sine = flux.sum(axis=2), np.sin(theta)
    parts = [power * d for d in (sine * np.sin(phi), np.cos(theta), -sine * np.cos(phi))]
    flux, toward, power = (_blocks(each, _COARSE)[0] for each in (flux, np.stack(parts, axis=-1), power))
    toward /= np.maximum(power, np.finfo(float).tiny)[..., None]
    s = np.linspace(-1.0, 1.0, NODES)
    x, y = np.meshgrid(s, s)
    z = 1.0 - np.abs(x) - np.abs(y)
    folded_x, folded_y = (1.0 - np.abs(y)) * np.sign(x), (1.0 - np.abs(x)) * np.sign(y)
    n = np.stack([np.where(z < 0.0, folded_x, x), np.where(z < 0.0, folded_y, y), z], axis=-1)
    n /= np.linalg.norm(n, axis=-1, keepdims=True)
    cosines = np.maximum(n.reshape(-1, 3) @ toward.reshape(-1, 3).T, 0.0)
    return np.asarray((cosines @ flux.reshape(-1, 3)).reshape(NODES, NODES, 3), np.float32)


def _blocks(values: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Sums over so many rows of blocks at most, and twice the columns, float64; and the middles of these."""
    found, middles = values, []
    for axis, wanted in enumerate((count, 2 * count)):
        size = values.shape[axis]
        edges = np.arange(min(size, wanted) + 1) * size // min(size, wanted)
        found = np.add.reduceat(found, edges[:-1], axis=axis).astype(float)
        middles.append(0.5 * (edges[:-1] + edges[1:]))
    return found, *middles


def placed_environment(table: EnvironmentTable, rotation: float, intensity: float) -> EnvironmentTable:
    """Return an environment turned and scaled.

    rotation  radians about +Y, counterclockwise seen from above
    """
    cosine, sine = math.cos(rotation), math.sin(rotation)
    to_image = np.array([[cosine, 0.0, -sine], [0.0, 1.0, 0.0], [sine, 0.0, cosine]], np.float32)
    if intensity == 1.0:
        return table._replace(to_image=to_image)
    light = table.radiance, table.irradiance, table.sunlight
    radiance, irradiance, sunlight = (a * np.float32(intensity) for a in light)
    table = table._replace(radiance=radiance, irradiance=irradiance, to_image=to_image)
    if intensity == 0.0:
        return table._replace(brightest=NO_ENVIRONMENT.brightest, sunlight=NO_ENVIRONMENT.sunlight)
    return table._replace(brightest=table.brightest * np.float32(intensity), sunlight=sunlight)


def environment_power(table: EnvironmentTable) -> float:
    """Return the integral of luminance over the sphere, lm/m2; 0 without an environment."""
    if not len(table.rows):
        return 0.0
    luminance = table.radiance.mean(axis=1, dtype=np.float64) @ np.array(LUMINANCE)
    return float(luminance @ row_weights(len(luminance)))


def row_weights(height: int) -> np.ndarray:
    """Return (h,) float64 sr: the integral over the sphere of what a row's pixels, each 1, give."""
    edges = np.linspace(0.0, _PI, height + 1)
    centers, step = edges[:-1] + 0.5 * _PI / height, _PI / height
    a, b = centers[:-1], centers[1:]
    rise = (np.sin(b) - np.sin(a)) / step
    weights = np.zeros(height)
    weights[:-1] += np.cos(a) - rise
    weights[1:] += rise - np.cos(b)
    weights[0] += 1.0 - math.cos(0.5 * step)  # from the poles to the centers next to them
    weights[-1] += 1.0 - math.cos(0.5 * step)
    return 2.0 * _PI * weights


def _row_solid_angles(height: int) -> np.ndarray:
    """(h,) float64 sr of a row."""
    middles = (np.arange(height) + 0.5) * _PI / height
    return np.asarray(4.0 * _PI * math.sin(0.5 * _PI / height) * np.sin(middles))


def _greatest_luminance(image: np.ndarray) -> np.ndarray:
    """(h, w) float64: a bound of the interpolant within each pixel, above 0 only where that is.

    It is greatest at the center, the middle of a side or a corner.
    """
    luminance = np.zeros(image.shape[:2])
    for c in range(3):
        luminance += image[..., c] * LUMINANCE[c]
    wider = _greatest_of_halves(np.concatenate([luminance[:, -1:], luminance, luminance[:, :1]], axis=1))
    taller = np.concatenate([wider[:1], wider, wider[-1:]])
    return np.ascontiguousarray(_greatest_of_halves(taller.T).T)


def _greatest_of_halves(values: np.ndarray) -> np.ndarray:
    """(n, m) of (n, m + 2): the greatest of each value and of its means with those beside it."""
    means = 0.5 * (values[:, 1:] + values[:, :-1])
    return np.asarray(np.maximum(values[:, 1:-1], np.maximum(means[:, 1:], means[:, :-1])))


def _cumulative(weights: np.ndarray) -> np.ndarray:
    """(n, m + 1) float32 cumulative probabilities of (n, m) weights, in whole _STEPS; none of a weight above
    0 is 0. Rows of zeros are even: nothing is drawn there."""
    weights = np.where(weights.any(axis=1, keepdims=True), weights, 1.0)
    some = weights > 0.0
    spare = _LEAST / _STEPS
    rest = 1.0 - spare * some.sum(axis=1, keepdims=True)
    shares = weights / weights.sum(axis=1, keepdims=True) * rest + np.where(some, spare, 0.0)
    cumulative = np.zeros((len(weights), weights.shape[1] + 1))
    np.cumsum(shares, axis=1, out=cumulative[:, 1:])
    cumulative /= cumulative[:, -1:]
    return np.asarray(np.rint(cumulative * _STEPS) / _STEPS, np.float32)
