"""Photon light at the ends of eye paths: an image of some of them, and from it all of them.

Ends are receivers of light like pixels' surfaces. Those that neighbouring pixels see by way of the same
reflection or refraction make up a picture of their own, so that what serves the picture serves them: few
are estimated, filtered, and spread over the others.
"""

from __future__ import annotations

import math

import numpy as np
from numba import literal_unroll

from ispm.kernels.simd import address, atomic_add
from ispm.kernels.threads import run_threads
from ispm.optics.jit import jit
from ispm.optics.records import RECEIVER

f32, i64, u32 = np.float32, np.int64, np.uint32

_SAME_WAY = 0.5  # cosine of two normals, above which ends may lie on one surface
_SPREAD_MAX = 64.0  # widths that neighbours in a curved mirror lie apart, at most
# As in stages/upsample.wgsl:
_PLANE_REACH = f32(1.3)  # low-resolution pixels off the tangent plane
_LEAST_NEAR = f32(1e-3)  # weight of a corner's place on the screen, as any of the four may have to serve
_FEW = f32(0.02)  # sum of weights below which farther neighbours are asked too
_TOO_LITTLE = f32(1e-3)  # sum of weights below which an end has no neighbour
_TURNED = f32(0.01)  # least share of its weight that a receiver keeps whose bump faces elsewhere
_FROST_REACH = 5  # pixels on each side over which rough glass is averaged
_OUTLIER = f32(3)  # times the mean of its neighbourhood, above which a pixel's light is cut
_CHUNK = 256


def image_of_ends(
    points: np.ndarray, cells: np.ndarray, size: tuple[int, int], block: int, pass_index: int
) -> np.ndarray:
    """Return one end of each cell as an image, (h w,) RECEIVER; invalid where a cell has none.

    points  (m,) RECEIVER, whose footprint is that of a pixel;  cells  (m,) int: w y + x
    block   pixels of a cell's side
    Passes take the ends of a cell in turn.
    A receiver's footprint is the distance to its nearest neighbour on its surface, which in a curved mirror
    is farther than the rays' width.
    """
    order = np.argsort(cells, kind="stable")
    used, first, count = np.unique(cells[order], return_index=True, return_counts=True)
    image = np.zeros(size[0] * size[1], RECEIVER)
    image[used] = points[order[first + (count // 2 + pass_index) % count]]
    image["footprint"] *= f32(block)
    apart = _nearest_neighbour(image.reshape(size[1], size[0])).reshape(-1)
    widest = image["footprint"] * f32(_SPREAD_MAX)
    image["footprint"] = np.where(np.isfinite(apart), np.clip(apart, image["footprint"], widest),
                                  image["footprint"])  # fmt: skip
    return image


def _nearest_neighbour(image: np.ndarray) -> np.ndarray:
    """(h, w) float32 m to the nearest of the four receivers beside each; inf where none is on its surface."""
    apart = np.full(image.shape, np.inf, np.float32)
    for axis in (0, 1):
        a = image[:-1] if axis == 0 else image[:, :-1]
        b = image[1:] if axis == 0 else image[:, 1:]
        facing = np.einsum("...k,...k->...", a["ng"], b["ng"])
        distance = np.linalg.norm(a["position"] - b["position"], axis=-1)
        distance[(facing < _SAME_WAY) | (a["valid"] * b["valid"] == 0)] = np.inf
        near = (apart[:-1], apart[1:]) if axis == 0 else (apart[:, :-1], apart[:, 1:])
        for side in near:
            np.minimum(side, distance, out=side)
    return apart


def spread_light(
    points: np.ndarray,
    places: np.ndarray,
    image: np.ndarray,
    light: np.ndarray,
    size: tuple[int, int],
    block: int,
    threads: int,
) -> tuple[np.ndarray, np.ndarray]:
    """Return light at ends from that of the image's receivers, (m, 16), and (m,) whether any was near.

    points  (m,) RECEIVER;  places  (m, 2) float32 in the image, centres of cells at whole numbers
    light   (h w, 16) of the image;  block  pixels to a side of its cells
    Joint bilateral, as stages/upsample.wgsl.
    """
    out = np.zeros((len(points), 16), np.float32)
    found = np.zeros(len(points), np.bool_)
    counter = np.zeros(8, np.int64)
    least = f32(0 if block == 1 else _LEAST_NEAR)
    run_threads(
        lambda _: _spread(points, places, image, light, size, least, address(counter), out, found), threads
    )
    return out, found


@jit
def _spread(points, places, image, light, size, least, counter, out, found):
    while True:
        first = atomic_add(counter, i64(_CHUNK))
        if first >= len(points):
            return
        for i in range(first, min(first + i64(_CHUNK), len(points))):
            found[i] = _mix(points, places, image, light, size, least, i, out)


@jit
def _mix(points, places, image, light, size, least, i, out):
    """Write the mean light of the 2 x 2 receivers about end `i`, or where these hardly match of 4 x 4; return
    whether any is on its surface."""
    x0, y0 = i64(math.floor(places[i, 0])), i64(math.floor(places[i, 1]))
    fx, fy = places[i, 0] - f32(x0), places[i, 1] - f32(y0)
    weight, gloss_weight = f32(0), f32(0)
    for corner in range(4):
        right, below = corner & 1, corner >> 1
        near = (fx if right else f32(1) - fx) * (fy if below else f32(1) - fy) + least
        w, gloss = _add_tap(points, image, light, size, i, (x0 + right, y0 + below), near, out)
        weight, gloss_weight = weight + w, gloss_weight + gloss
    if weight < _FEW:
        for k in range(16):
            right, below = k % 4 - 1, k // 4 - 1
            away = (f32(right) - fx) ** 2 + (f32(below) - fy) ** 2
            near = f32(math.exp(-away))
            w, gloss = _add_tap(points, image, light, size, i, (x0 + right, y0 + below), near, out)
            weight, gloss_weight = weight + w, gloss_weight + gloss
    for c in range(16):
        total = weight if c < 4 else gloss_weight
        out[i, c] = out[i, c] / total if total > f32(0) else f32(0)
    return weight >= _TOO_LITTLE


@jit
def _add_tap(points, image, light, size, i, cell, near, out):
    """Add the light of the receiver in a cell, weighted; return its weights, for irradiance and for gloss.

    near  weight of the cell's place on the screen
    """
    x, y = cell
    if x < 0 or y < 0 or x >= size[0] or y >= size[1]:
        return f32(0), f32(0)
    k = y * size[0] + x
    w = near * _likeness(points[i], image[k])
    if w <= f32(0):
        return f32(0), f32(0)
    for c in range(4):
        out[i, c] += w * light[k, c]
    if not (points[i].alpha > f32(0) and image[k].alpha > f32(0)):
        return w, f32(0)
    gloss = w * max(f32(1) - f32(4) * abs(points[i].alpha - image[k].alpha), f32(1e-3))
    for c in range(4, 16):
        out[i, c] += gloss * light[k, c]
    return w, gloss


@jit
def _likeness(point, receiver):
    """1 where a receiver lies in a point's tangent plane and faces as it does, bumps included, down to 0."""
    if receiver.valid == u32(0):
        return f32(0)
    z, facing, bump = f32(0), f32(0), f32(0)
    for k in range(3):
        z += point.ng[k] * (receiver.position[k] - point.position[k])
        facing += point.ng[k] * receiver.ng[k]
        bump += point.n[k] * receiver.n[k]
    reach = _PLANE_REACH * receiver.footprint * min(point.slant, f32(10))
    close = max(f32(1) - z * z / (reach * reach), f32(0))
    return close * close * _eighth_power(facing) * max(_eighth_power(bump), _TURNED)


@jit
def _eighth_power(cosine):
    """Of a cosine, 0 below 0."""
    x = max(cosine, f32(0))
    x *= x
    x *= x
    return x * x


def reflect_light(ends: np.ndarray, light: np.ndarray, count: int) -> np.ndarray:
    """Return the radiance that (m, 16) light at (m,) PATH_END sends back along `count` rays, (n, 3)."""
    out = np.zeros((count, 3), np.float32)
    _reflect(ends, light, out)
    return out


@jit
def _reflect(ends, light, out):
    for i in range(len(ends)):
        for c in literal_unroll((0, 1, 2)):
            out[ends[i].slot, c] += ends[i].weight[c] * reflect_incident(ends[i], light, i, c)


@jit
def reflect_incident(end, light, i, c):
    """Return channel `c` of the radiance that row `i` of the light makes at an end; as receivers.wgsl."""
    fresnel, gloss, grazing = light[i, 4 + c], light[i, 8 + c], light[i, 12 + c]
    kept = (f32(1) - end.dielectric_f0) * light[i, c] - (end.dielectric_f90 - end.dielectric_f0) * fresnel
    shown = end.diffuse[c] * f32(1 / math.pi) * kept + end.f0[c] * gloss + end.f90 * grazing
    return max(shown, f32(0))


def denoise_rough_transmission(
    light: np.ndarray, pixels: np.ndarray, width: int, frost: np.ndarray, threads: int
) -> None:
    """Average the noise out of the light of pixels that show rough glass, (n, c), in place.

    pixels  (n,) numbers y width + x, sorted;  frost  (n,) or more FIRST_VERTEX
    Light is averaged over a fifth of what the surface blurs it, at most 11 x 11 pixels, whose paths went out
    in different directions; and single paths that found a light's image through two rough faces are cut.
    """
    if not (frost["blur"] > 0.0).any():
        return
    rows = np.full((int(pixels[-1]) // width + 1, width), -1, np.int32)
    rows[pixels // width, pixels % width] = np.arange(len(pixels))
    given = light.copy()
    counter = np.zeros(8, np.int64)
    run_threads(lambda _: _smooth(given, pixels, rows, frost, address(counter), light), threads)


@jit
def _smooth(given, pixels, rows, frost, counter, light):
    while True:
        first = atomic_add(counter, i64(_CHUNK))
        if first >= len(pixels):
            return
        for i in range(first, min(first + i64(_CHUNK), len(pixels))):
            if frost[i].blur > f32(0):
                x, y = i64(pixels[i]) % rows.shape[1], i64(pixels[i]) // rows.shape[1]
                radius = min(frost[i].blur, f32(_FROST_REACH))
                _average(given, rows, frost, i, x, y, max(radius, f32(2)), f32(np.inf), light)
                _average(given, rows, frost, i, x, y, radius, _OUTLIER * _sum(light, i), light)


@jit
def _average(given, rows, frost, i, x, y, radius, most, light):
    """Write the mean light of the pixels about (x, y) that show the same surface facing the same way.

    Light above `most`, which few paths found, is cut.
    """
    for c in range(light.shape[1]):
        light[i, c] = f32(0)
    reach = i64(radius)
    total, inverse = f32(0), f32(1) / ((radius + f32(1)) * (radius + f32(1)))
    for row in range(max(y - reach, 0), min(y + reach + 1, rows.shape[0])):
        for column in range(max(x - reach, 0), min(x + reach + 1, rows.shape[1])):
            k = rows[row, column]
            if k < 0:
                continue
            away = f32((row - y) * (row - y) + (column - x) * (column - x))
            w = _same_frost(frost[i], frost[k]) * max(f32(1) - away * inverse, f32(0))
            if w <= f32(0):
                continue
            total += w
            w *= min(most / max(_sum(given, k), f32(1e-30)), f32(1))
            for c in range(light.shape[1]):
                light[i, c] += w * given[k, c]
    for c in range(light.shape[1]):
        light[i, c] /= total


@jit
def _sum(light, i):
    total = f32(0)
    for c in range(light.shape[1]):
        total += light[i, c]
    return total


@jit
def _same_frost(a, b):
    """1 for surfaces that blur alike, down to 0."""
    if a.instance != b.instance or b.blur <= f32(0) or abs(a.tint - b.tint) > f32(0.02):
        return f32(0)
    bend = f32(0)
    for k in range(3):
        bend += (a.n[k] - b.n[k]) * (a.n[k] - b.n[k])
    return max(f32(1) - f32(4) * bend / (a.alpha * a.alpha), f32(0))
