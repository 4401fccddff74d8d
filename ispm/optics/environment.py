"""Light from infinitely far, all around: an equirectangular image of radiance.

World space, +Y up: the image's center column lies along -Z, right of it +X. Directions are unit. Places in
an image are in pixels, x right and y down, centers at .5; theta is the angle from +Y.
Radiance is bilinear between the pixels' centers, goes on beyond the sides, and stays beyond the topmost and
lowest centers. Directions are drawn by pixel, and within one evenly over its solid angle.
Source: Pharr, Jakob and Humphreys, Physically Based Rendering, fourth edition, 12.5.
"""

import math
from typing import NamedTuple

import numpy as np

from ispm.optics.jit import jit
from ispm.optics.sampling import octahedral_encode
from ispm.optics.vector import LUMINANCE, vec3

f32 = np.float32

_STEPS = 1 << 24  # of cumulative probability: float32 and random numbers have all of them
_LEAST = 4  # steps that a pixel with any light has in its row, and such a row in the image
_PI = math.pi
_NODES = 65  # normals along a side, for irradiance
_SUN = 8.0  # times the mean luminance: brighter light has shadows of its own in a picture of one pass
_COARSE = 32  # rows of blocks of pixels, likewise, and half the columns


class EnvironmentTable(NamedTuple):
    """An environment as kernels read it; of a scene without one all arrays are empty.

    radiance  (h, w, 3) float32 cd/m2, the image's top row first
    rows      (h + 1,) float32 cumulative probability of its rows, 0 to 1
    columns   (h, w + 1) float32 likewise of the pixels in each row
    to_image  (3, 3) float32 rotation from world space to the image's frame
    irradiance  (m, m, 3) float32 lx on a surface that nothing shades, by its normal in the image's frame,
                which `octahedral_encode` maps to [-1, 1]^2, whose corners are the first and last nodes
    brightest   luminance, cd/m2, above which light is as of a sun: some times the mean; infinite where
                none is
    """

    radiance: np.ndarray
    rows: np.ndarray
    columns: np.ndarray
    to_image: np.ndarray
    irradiance: np.ndarray
    brightest: np.float32


NO_ENVIRONMENT = EnvironmentTable(
    np.zeros((0, 0, 3), np.float32),
    np.zeros(0, np.float32),
    np.zeros((0, 0), np.float32),
    np.eye(3, dtype=np.float32),
    np.zeros((0, 0, 3), np.float32),
    np.float32(np.inf),
)


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
    to_image = NO_ENVIRONMENT.to_image
    table = EnvironmentTable(
        radiance, rows, _cumulative(weights), to_image, _irradiance(radiance), NO_ENVIRONMENT.brightest
    )
    brightest = np.float32(_SUN * environment_power(table) / (4.0 * _PI))
    luminance = radiance @ np.array(LUMINANCE, np.float32)
    return table._replace(brightest=brightest) if luminance.max() > brightest else table


def _irradiance(radiance: np.ndarray) -> np.ndarray:
    """(m, m, 3) float32 lx by the normal, see EnvironmentTable; radiance: (h, w, 3), taken as the means of
    _COARSE blocks over their solid angles."""
    finer = -(-_COARSE // len(radiance))
    radiance = np.repeat(np.repeat(radiance, finer, axis=0), finer, axis=1)
    height, width = radiance.shape[:2]
    edges_y = np.arange(min(height, _COARSE) + 1) * height // min(height, _COARSE)
    edges_x = np.arange(min(width, 2 * _COARSE) + 1) * width // min(width, 2 * _COARSE)
    flux = radiance.astype(np.float64) * _row_solid_angles(height)[:, None, None] / width
    flux = np.add.reduceat(np.add.reduceat(flux, edges_y[:-1], axis=0), edges_x[:-1], axis=1)
    theta = (edges_y[:-1] + edges_y[1:])[:, None] * (0.5 * _PI / height)
    phi = (edges_x[:-1] + edges_x[1:]) * (_PI / width) - _PI
    sine = np.sin(theta)
    toward = np.stack([sine * np.sin(phi), np.cos(theta) + 0.0 * phi, -sine * np.cos(phi)], axis=-1)
    s = np.linspace(-1.0, 1.0, _NODES)
    x, y = np.meshgrid(s, s)
    z = 1.0 - np.abs(x) - np.abs(y)
    folded_x, folded_y = (1.0 - np.abs(y)) * np.sign(x), (1.0 - np.abs(x)) * np.sign(y)
    n = np.stack([np.where(z < 0.0, folded_x, x), np.where(z < 0.0, folded_y, y), z], axis=-1)
    n /= np.linalg.norm(n, axis=-1, keepdims=True)
    cosines = np.maximum(n.reshape(-1, 3) @ toward.reshape(-1, 3).T, 0.0)
    return np.asarray((cosines @ flux.reshape(-1, 3)).reshape(_NODES, _NODES, 3), np.float32)


def placed_environment(table: EnvironmentTable, rotation: float, intensity: float) -> EnvironmentTable:
    """Return an environment turned and scaled.

    rotation  radians about +Y, counterclockwise seen from above
    """
    cosine, sine = math.cos(rotation), math.sin(rotation)
    to_image = np.array([[cosine, 0.0, -sine], [0.0, 1.0, 0.0], [sine, 0.0, cosine]], np.float32)
    if intensity == 1.0:
        return table._replace(to_image=to_image)
    radiance, irradiance = (a * np.float32(intensity) for a in (table.radiance, table.irradiance))
    brightest = table.brightest * np.float32(intensity) if intensity > 0.0 else np.float32(np.inf)
    return table._replace(radiance=radiance, to_image=to_image, irradiance=irradiance, brightest=brightest)


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


@jit
def has_environment(table):
    """Return whether an EnvironmentTable is of a scene with an environment."""
    return len(table.rows) > 0


@jit
def environment_radiance(table, d):
    """Return the radiance, RGB cd/m2, that comes from direction `d`, from the eye outwards."""
    x, y = image_place(table, d)
    return _radiance_at(table, x, y)


@jit
def environment_irradiance(table, n):
    """Return the irradiance, RGB lx, of a surface of unit normal `n` that nothing shades: within 1 % or
    so, as it is interpolated between normals."""
    m = table.to_image
    a = m[0, 0] * n[0] + m[0, 1] * n[1] + m[0, 2] * n[2]
    b = m[1, 0] * n[0] + m[1, 1] * n[1] + m[1, 2] * n[2]
    c = m[2, 0] * n[0] + m[2, 1] * n[1] + m[2, 2] * n[2]
    x, y = octahedral_encode((a, b, c))
    last = len(table.irradiance) - 1
    s, t = (x + f32(1)) * f32(0.5) * f32(last), (y + f32(1)) * f32(0.5) * f32(last)
    column, row = min(max(int(s), 0), last - 1), min(max(int(t), 0), last - 1)
    s, t = s - f32(column), t - f32(row)
    above = _between(vec3(table.irradiance[row, column]), vec3(table.irradiance[row, column + 1]), s)
    below = _between(vec3(table.irradiance[row + 1, column]), vec3(table.irradiance[row + 1, column + 1]), s)
    return _between(above, below, t)


@jit
def sample_environment(table, u1, u2):
    """Return (wi, radiance, pdf): a direction, the RGB radiance from there, and the density, 1/sr.

    u1, u2  float32 random numbers of [0, 1)
    """
    height, width = len(table.columns), table.columns.shape[1] - 1
    row, v = _drawn(table.rows, u1)
    column, u = _drawn(table.columns[row], u2)
    # Evenly over the solid angle is evenly in sin^2(theta / 2), theta from the nearer pole: float32 is fine
    # there.
    upper = 2 * row < height
    from_pole = row if upper else height - 1 - row
    step = f32(_PI) / f32(height)
    near, far = (
        f32(math.sin(f32(0.5) * step * f32(from_pole))),
        f32(math.sin(f32(0.5) * step * f32(from_pole + 1))),
    )
    within = v if upper else f32(1) - v
    square = near * near + within * (far * far - near * near)
    half = f32(math.sqrt(square))
    theta = f32(2) * f32(math.asin(min(half, f32(1))))
    sine = f32(2) * half * f32(math.sqrt(max(f32(1) - square, f32(0))))
    cosine = f32(1) - f32(2) * square
    x = f32(column) + u
    y = theta / step
    if not upper:
        y, cosine = f32(height) - y, -cosine
    wi = _to_world(table, _around(x / f32(width), sine, cosine))
    return wi, _radiance_at(table, x, y), _density(table, row, column)


@jit
def environment_light(table, d):
    """Return `environment_radiance` and `environment_pdf` of a direction."""
    x, y = image_place(table, d)
    height, width = len(table.columns), table.columns.shape[1] - 1
    return _radiance_at(table, x, y), _density(table, min(int(y), height - 1), min(int(x), width - 1))


@jit
def environment_pdf(table, d):
    """Return the density, 1/sr, with which `sample_environment` draws direction `d`."""
    x, y = image_place(table, d)
    height, width = len(table.columns), table.columns.shape[1] - 1
    return _density(table, min(int(y), height - 1), min(int(x), width - 1))


@jit
def image_place(table, d):
    """Return (x, y), float32 pixels of the image, of a direction in the world."""
    m = table.to_image
    a = m[0, 0] * d[0] + m[0, 1] * d[1] + m[0, 2] * d[2]
    b = m[1, 0] * d[0] + m[1, 1] * d[1] + m[1, 2] * d[2]
    c = m[2, 0] * d[0] + m[2, 1] * d[1] + m[2, 2] * d[2]
    u = f32(0.5) + f32(math.atan2(a, -c)) * f32(0.5 / _PI)
    v = f32(math.atan2(f32(math.sqrt(a * a + c * c)), b)) * f32(1 / _PI)
    return u * f32(table.radiance.shape[1]), v * f32(len(table.radiance))


@jit
def world_direction(table, x, y):
    """Return the unit direction in the world of a place in the image, float32 pixels."""
    theta = f32(_PI) * y / f32(len(table.radiance))
    around = x / f32(table.radiance.shape[1])
    return _to_world(table, _around(around, f32(math.sin(theta)), f32(math.cos(theta))))


@jit
def _around(u, sine, cosine):
    """The direction in the image's frame, of column u, 0 to 1, and of this sine and cosine of theta."""
    phi = f32(2 * _PI) * (u - f32(0.5))
    return sine * f32(math.sin(phi)), cosine, -sine * f32(math.cos(phi))


@jit
def _to_world(table, d):
    """A direction in the image's frame turned to the world."""
    m = table.to_image
    return (
        m[0, 0] * d[0] + m[1, 0] * d[1] + m[2, 0] * d[2],
        m[0, 1] * d[0] + m[1, 1] * d[1] + m[2, 1] * d[2],
        m[0, 2] * d[0] + m[1, 2] * d[1] + m[2, 2] * d[2],
    )


@jit
def _radiance_at(table, x, y):
    """Radiance, RGB cd/m2, at a place in the image, float32 pixels."""
    radiance = table.radiance
    height, width = radiance.shape[0], radiance.shape[1]
    right, down = x - f32(0.5), y - f32(0.5)
    column, row = math.floor(right), math.floor(down)
    s, t = right - f32(column), down - f32(row)
    left, beside = column % width, (column + 1) % width
    top, below = min(max(row, 0), height - 1), min(max(row + 1, 0), height - 1)
    r, g, b = _between(vec3(radiance[top, left]), vec3(radiance[top, beside]), s)
    low = _between(vec3(radiance[below, left]), vec3(radiance[below, beside]), s)
    return _between((r, g, b), low, t)


@jit
def _between(a, b, t):
    """a + t (b - a) of two Vectors."""
    return a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]), a[2] + t * (b[2] - a[2])


@jit
def _drawn(cumulative, u):
    """The index of (n + 1,) cumulative probabilities in whose part u of [0, 1) lies, and where in it, of
    [0, 1), float32."""
    low, high = 0, len(cumulative) - 1
    while high - low > 1:
        middle = (low + high) >> 1
        if cumulative[middle] <= u:
            low = middle
        else:
            high = middle
    part = (u - cumulative[low]) / (cumulative[low + 1] - cumulative[low])
    return low, min(part, f32(1 - 2.0**-24))


@jit
def _density(table, row, column):
    """Density of directions in a pixel, 1/sr."""
    height, width = len(table.columns), table.columns.shape[1] - 1
    chance = table.rows[row + 1] - table.rows[row]
    chance *= table.columns[row, column + 1] - table.columns[row, column]
    step = f32(_PI) / f32(height)
    middle = step * (f32(min(row, height - 1 - row)) + f32(0.5))
    angle = f32(4 * _PI) / f32(width) * f32(math.sin(middle)) * f32(math.sin(f32(0.5) * step))
    return chance / angle
