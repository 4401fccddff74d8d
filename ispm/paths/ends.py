"""Photon light at the ends of eye paths: an image of some of them, and from it all of them.

Ends are receivers of light like pixels' surfaces. Those that neighbouring pixels see by way of the same
reflection or refraction make up a picture of their own, so that what serves the picture serves them: few
are estimated, filtered, and spread over the others.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import literal_unroll

from ispm.kernels.share import run_shared, shared_rows
from ispm.optics.bsdf import NARROW_ALPHA
from ispm.optics.gradient import WORDS, turn, turned_light
from ispm.optics.incident import FilteredLight
from ispm.optics.jit import jit
from ispm.optics.records import RECEIVER, TAKES_NONE
from ispm.optics.vector import dot, sub, vec3

f32, i64, u32 = np.float32, np.int64, np.uint32

SAME_SURFACE = 0.5  # cosine of two normals, above which ends may lie on one surface
_SPREAD_MAX = 64.0  # widths that neighbours in a curved mirror lie apart, at most
# As in stages/upsample.wgsl:
_PLANE_REACH = f32(1.3)  # low-resolution pixels off the tangent plane
_LEAST_NEAR = f32(1e-3)  # added to bilinear weights, as any of the four receivers may be the only one to fit
_FEW = f32(0.02)  # sum of weights below which farther neighbours are used too
_LEAST_TOTAL = f32(1e-30)  # of weights: one over less overflows float32
_TOO_LITTLE = f32(1e-3)  # sum of weights below which an end has no neighbour
_TURNED = f32(0.01)  # least share of its weight that a receiver keeps whose bump faces elsewhere
_GAP = 4  # unused rows between used ones of an image, at most: those on its sides never mix by interpolation
_CHUNK = 256
_NO_GRADIENT = np.zeros((0, WORDS), np.float32)


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
    image = np.zeros(size[0] * size[1], RECEIVER)
    counts = np.bincount(cells, minlength=len(image))
    before = (counts // 2 + pass_index) % np.maximum(counts, 1)
    _choose_ends(points, cells, before, f32(block), image)
    _reach_neighbours(image, size[0], size[1])
    return image


def without_gaps(numbers: np.ndarray) -> np.ndarray:
    """Return (n,) int numbers of rows or columns with all but `_GAP` of each run of unused ones left out."""
    placed = np.zeros(int(numbers.max()) + 1, np.int64)
    placed[numbers] = 1
    used = np.flatnonzero(placed)
    placed[used] = np.cumsum(np.minimum(np.diff(used, prepend=used[0]), _GAP + 1))
    return np.asarray(placed[numbers])


@jit
def _choose_ends(points, cells, before, block, image):
    """Write one of (m,) RECEIVER for each of (h w,) cells: the one of its own that comes after `before`
    others, which are counted down. `block` as of `image_of_ends`."""
    for i in range(len(cells)):
        cell = cells[i]
        if before[cell] == 0:
            image[cell] = points[i]
            image[cell].footprint *= block
        before[cell] -= 1


@jit
def _reach_neighbours(image, width, height):
    """Widen footprints of (h w,) RECEIVER to the nearest of the four beside each that is on its surface."""
    for row in range(len(image)):
        if image[row].valid == u32(0):
            continue
        x, y, nearest = row % width, row // width, f32(np.inf)
        for right, down in ((1, 0), (-1, 0), (0, 1), (0, -1)):
            if 0 <= x + right < width and 0 <= y + down < height:
                other = image[row + right + down * width]
                if other.valid != u32(0) and dot(vec3(image[row].ng), vec3(other.ng)) >= f32(SAME_SURFACE):
                    away = sub(vec3(image[row].position), vec3(other.position))
                    nearest = min(nearest, f32(math.sqrt(dot(away, away))))
        if nearest < f32(np.inf):
            ray = image[row].footprint
            image[row].footprint = min(max(nearest, ray), ray * f32(_SPREAD_MAX))


def spread_light(
    points: np.ndarray,
    positions: np.ndarray,
    image: np.ndarray,
    filtered: FilteredLight,
    size: tuple[int, int],
    block: int,
    threads: int,
) -> tuple[np.ndarray, np.ndarray]:
    """Return light at ends from that of the image's receivers, (m, 16), and (m,) whether any was near.

    points  (m,) RECEIVER;  positions  (m, 2) float32 in the image, centres of cells at whole numbers
    image   (h w,) RECEIVER;  filtered  their light;  block  pixels to a side of its cells
    Joint bilateral, as stages/upsample.wgsl, but for what that has no light for: ends aside of all receivers.
    """
    out = np.zeros((len(points), 16), np.float32)
    found = np.zeros(len(points), np.bool_)
    gradient = _NO_GRADIENT if filtered.gradient is None else filtered.gradient
    few = _Image(image, filtered.light, gradient, *size, f32(0 if block == 1 else _LEAST_NEAR))
    run_shared(lambda counter: _spread(points, positions, few, counter, out, found), threads)
    return out, found


class _Image(NamedTuple):
    """An image of few ends: (h w,) RECEIVER, their light, (h w, 16) float32, its gradient, (h w, WORDS) or no
    rows, width, height, and what is added to the bilinear weights of its cells."""

    receivers: np.ndarray
    light: np.ndarray
    gradient: np.ndarray
    width: int
    height: int
    least: np.float32


@jit
def _spread(points, positions, image, counter, out, found):
    """Write what `spread_light` returns to (m, 16) float32 and (m,) bool, for as many ends as a thread
    gets."""
    for i in shared_rows(counter, _CHUNK, len(points)):
        found[i] = _mix(points[i], positions[i, 0], positions[i, 1], image, out[i])


@jit
def _mix(point, x, y, image, out):
    """Write the mean light of the 2 x 2 receivers about a RECEIVER at (x, y) of the image, or where these
    hardly match of 4 x 4, to (16,) float32 zeros; return whether any is on its surface."""
    x0, y0 = i64(math.floor(x)), i64(math.floor(y))
    fx, fy = x - f32(x0), y - f32(y0)
    weight, fresnel_weight, gloss_weight = f32(0), f32(0), f32(0)
    for corner in range(4):
        right, below = corner & 1, corner >> 1
        near = (fx if right else f32(1) - fx) * (fy if below else f32(1) - fy) + image.least
        w, fresnel, gloss = _add_tap(point, image, x0 + right, y0 + below, near, out)
        weight, fresnel_weight, gloss_weight = weight + w, fresnel_weight + fresnel, gloss_weight + gloss
    if weight < _FEW:
        for k in range(16):
            right, below = k % 4 - 1, k // 4 - 1
            away = (f32(right) - fx) ** 2 + (f32(below) - fy) ** 2
            near = f32(math.exp(-away))
            w, fresnel, gloss = _add_tap(point, image, x0 + right, y0 + below, near, out)
            weight, fresnel_weight, gloss_weight = weight + w, fresnel_weight + fresnel, gloss_weight + gloss
    for c in range(16):
        total = weight if c < 4 else (fresnel_weight if c < 8 else gloss_weight)
        out[c] = out[c] / total if total > _LEAST_TOTAL else f32(0)
    return weight >= _TOO_LITTLE


@jit
def _add_tap(point, image, x, y, near, out):
    """Add the light of the receiver in cell (x, y), weighted, to (16,) float32; return its weights, for
    irradiance, Fresnel's part of it, and gloss.

    near  weight of the cell's position
    """
    if x < 0 or y < 0 or x >= image.width or y >= image.height:
        return f32(0), f32(0), f32(0)
    k = y * image.width + x
    receiver, light = image.receivers[k], image.light[k]
    w = near * _likeness(point, receiver)
    if w <= f32(0):
        return f32(0), f32(0), f32(0)
    if len(image.gradient):
        off = turn(vec3(receiver.n), vec3(point.n))
        for c in range(3):
            out[c] += w * turned_light(light, image.gradient[k], c, off)
        out[3] += w * light[3]
    else:
        for c in range(4):
            out[c] += w * light[c]
    if not (point.alpha > f32(0) and receiver.alpha > f32(0)):
        return w, f32(0), f32(0)
    fresnel = w * max(f32(1) - f32(4) * abs(point.alpha - receiver.alpha), f32(1e-3))
    gloss = fresnel if (point.alpha < NARROW_ALPHA) == (receiver.alpha < NARROW_ALPHA) else f32(0)
    for c in range(4):
        out[4 + c] += fresnel * light[4 + c]
        out[8 + c] += gloss * light[8 + c]
        out[12 + c] += gloss * light[12 + c]
    return w, fresnel, gloss


@jit
def _likeness(point, receiver):
    """Weight in [0, 1]: 1 where a RECEIVER lies in the tangent plane of another, `point`, and its normals are
    the same."""
    if receiver.valid == u32(0) or (receiver.alpha == f32(TAKES_NONE)) != (point.alpha == f32(TAKES_NONE)):
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
    """The eighth power of a float32 cosine, 0 below 0."""
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
    """Add what `reflect_light` returns to (n, 3) `out`."""
    for i in range(len(ends)):
        for c in literal_unroll((0, 1, 2)):
            out[ends[i].slot, c] += ends[i].weight[c] * reflect_incident(ends[i], light, i, c)


@jit
def reflect_incident(end, light, i, c):
    """Return channel `c` of the radiance that row `i` of (m, 16) light makes at a PATH_END; as
    receivers.wgsl."""
    fresnel, gloss, grazing = light[i, 4 + c], light[i, 8 + c], light[i, 12 + c]
    kept = (f32(1) - end.dielectric_f0) * light[i, c] - (end.dielectric_f90 - end.dielectric_f0) * fresnel
    shown = end.diffuse[c] * f32(1 / math.pi) * kept + end.f0[c] * gloss + end.f90 * grazing
    return max(shown, f32(0))
