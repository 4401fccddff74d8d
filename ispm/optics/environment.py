"""Light from infinitely far, all around: an equirectangular image of radiance.

World space, +Y up: the image's center column lies along -Z, right of it +X. Directions are unit. Places in
an image are in pixels, x right and y down, centers at .5; theta is the angle from +Y.
Radiance is bilinear between the pixels' centers, goes on beyond the sides, and stays beyond the topmost and
lowest centers. Directions are drawn by pixel, and within one evenly over its solid angle.
`environment_table.py` makes what kernels read.
Source: Pharr, Jakob and Humphreys, Physically Based Rendering, fourth edition, 12.5.
"""

import math
from typing import NamedTuple

import numpy as np

from ispm.optics.jit import jit
from ispm.optics.sampling import octahedral_encode
from ispm.optics.vector import add, vec3

f32 = np.float32

_PI = math.pi
NODES = 65  # normals along a side, for irradiance
SUN = 8.0  # times the mean luminance: brighter light has shadows of its own in a picture of one pass
# 1/sr, at most, of draws in proportion to radiance from directions no brighter than that
SKY_DENSITY = f32(SUN / (4.0 * _PI))


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
    sunlight    (m, m, 3) as `irradiance`, which is without it, of brighter directions where these bring
                much of all light; else (0, 0, 3)
    sun_rows, sun_columns  as `rows` and `columns`, of pixels with sunlight alone, where there is any
    sun_share   of the probability of all pixels, that of these
    disc        (7,) float32 of the disc of a sun that is a light of its own, whose light is in none of these:
                the unit direction to its middle, the square of how far others within differ from it, and
                the RGB radiance, cd/m2; (0,) without one
    """

    radiance: np.ndarray
    rows: np.ndarray
    columns: np.ndarray
    to_image: np.ndarray
    irradiance: np.ndarray
    brightest: np.float32
    sunlight: np.ndarray
    sun_rows: np.ndarray
    sun_columns: np.ndarray
    sun_share: np.float32
    disc: np.ndarray


NO_ENVIRONMENT = EnvironmentTable(
    np.zeros((0, 0, 3), np.float32),
    np.zeros(0, np.float32),
    np.zeros((0, 0), np.float32),
    np.eye(3, dtype=np.float32),
    np.zeros((0, 0, 3), np.float32),
    np.float32(np.inf),
    np.zeros((0, 0, 3), np.float32),
    np.zeros(0, np.float32),
    np.zeros((0, 0), np.float32),
    np.float32(0),
    np.zeros(0, np.float32),
)


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
def seen_radiance(table, d, is_clear):
    """Return `environment_radiance`, and if `is_clear` that of the sun's disc with it: of ways from the eye
    by mirrors and clear glass alone, on which no draw from the lights brings it."""
    radiance = environment_radiance(table, d)
    if is_clear and len(table.disc) > 0 and d[1] > f32(0):  # below the horizon there is ground
        x, y, z = d[0] - table.disc[0], d[1] - table.disc[1], d[2] - table.disc[2]
        if x * x + y * y + z * z < table.disc[3]:
            radiance = add(radiance, (table.disc[4], table.disc[5], table.disc[6]))
    return radiance


@jit
def environment_irradiance(table, n):
    """Return the irradiance, RGB lx, of a surface of unit normal `n` that nothing shades, by sunlight and by
    what else there is: within 1 % or so, as it is interpolated between normals."""
    m = table.to_image
    a = m[0, 0] * n[0] + m[0, 1] * n[1] + m[0, 2] * n[2]
    b = m[1, 0] * n[0] + m[1, 1] * n[1] + m[1, 2] * n[2]
    c = m[2, 0] * n[0] + m[2, 1] * n[1] + m[2, 2] * n[2]
    x, y = octahedral_encode((a, b, c))
    last = NODES - 1
    s, t = (x + f32(1)) * f32(0.5) * f32(last), (y + f32(1)) * f32(0.5) * f32(last)
    column, row = min(max(int(s), 0), last - 1), min(max(int(t), 0), last - 1)
    s, t = s - f32(column), t - f32(row)
    sun = f32(0), f32(0), f32(0)
    if len(table.sunlight) > 0:
        sun = _between_nodes(table.sunlight, row, column, s, t)
    return sun, _between_nodes(table.irradiance, row, column, s, t)


@jit
def _between_nodes(nodes, row, column, s, t):
    """A Vector of (m, m, 3) nodes: (s, t) of the way from one to the next column and row."""
    above = _between(vec3(nodes[row, column]), vec3(nodes[row, column + 1]), s)
    below = _between(vec3(nodes[row + 1, column]), vec3(nodes[row + 1, column + 1]), s)
    return _between(above, below, t)


@jit
def sample_environment(table, u1, u2):
    """Return (wi, radiance, pdf): a direction, the RGB radiance from there, and the density, 1/sr.

    u1, u2  float32 random numbers of [0, 1)
    """
    return _sample(table, table.rows, table.columns, u1, u2)


@jit
def sample_suns(table, u1, u2):
    """Return what `sample_environment` does, drawn from pixels with sunlight alone; but for the density,
    which is that among all pixels: `sun_share` of the draws' own."""
    return _sample(table, table.sun_rows, table.sun_columns, u1, u2)


@jit
def _sample(table, rows, columns, u1, u2):
    """What `sample_environment` returns, by these cumulative probabilities."""
    height, width = len(table.columns), table.columns.shape[1] - 1
    row, v = _drawn(rows, u1)
    column, u = _drawn(columns[row], u2)
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
