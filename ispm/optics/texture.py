"""Textures for the CPU, filtered as the graphics hardware does it: mip levels, wrap modes, trilinear."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256
from itertools import zip_longest
from typing import TYPE_CHECKING

import numpy as np

from ispm.optics.jit import jit
from ispm.optics.vector import add, dot, scale

if TYPE_CHECKING:
    from ispm.scene.material import Texture

f32 = np.float32
u8 = np.uint8
u32 = np.uint32

# Columns of TextureTable.rows.
WIDTH, HEIGHT, LEVELS, OFFSET, WRAP_U, WRAP_V, LINEAR, SRGB = range(8)
_CLAMP, _MIRROR = 1, 2  # as in scene.material.Wrap


def _decode_srgb(encoded: np.ndarray) -> np.ndarray:
    """IEC 61966-2-1, encoded 0..1 to linear 0..1."""
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)


_DARKEST = f32(1e-8)  # added to products of colors, so that black surfaces have a mean, too
_BYTES = np.arange(256) / 255
# What bytes stand for, 0 to 1, (256,) float32.
FROM_BYTE = _BYTES.astype(f32)
FROM_SRGB = _decode_srgb(_BYTES).astype(f32)


@dataclass(frozen=True)
class TextureTable:
    """All textures with their mip levels, as numba reads them.

    texels  (total,) uint32, RGBA 8 bits each, red lowest; levels of a texture lie one after another
    rows    (textures, 8) int64: width, height, levels, offset of level 0 in texels, wrap u, wrap v
            (scene.material.Wrap), linear, srgb
    """

    texels: np.ndarray
    rows: np.ndarray

    @cached_property
    def digest(self) -> bytes:
        """32 bytes that tell these textures from others."""
        return sha256(self.rows.tobytes() + self.texels.tobytes()).digest()

    @classmethod
    def pack(cls, textures: Sequence[Texture], colors: Sequence[Texture | None] = ()) -> TextureTable:
        """Return the table of `textures`, a row each, in their order; colors: of each, see `mip_chain`."""
        parts: list[np.ndarray] = [np.zeros(0, u32)]
        rows = np.zeros((len(textures), 8), np.int64)
        offset = 0
        for row, texture, color in zip_longest(rows, textures, colors):
            levels = mip_chain(texture, color)
            height, width, _ = texture.pixels.shape
            row[:4] = width, height, len(levels), offset
            row[4:] = texture.wrap_u, texture.wrap_v, texture.linear, texture.srgb
            parts += [np.ascontiguousarray(level).view("<u4").ravel() for level in levels]
            offset += sum(level.shape[0] * level.shape[1] for level in levels)
        return cls(np.concatenate(parts), rows)


def mip_chain(texture: Texture, color: Texture | None = None) -> list[np.ndarray]:
    """Return (h, w, 4) uint8 levels down to 1 x 1, or the first alone if the texture has no mipmaps.

    Each texel is the mean of the area it covers, in linear light, whatever the size's parity.

    color  the base color of what `texture` tells the metalness of, in blue. Metal reflects base times
           metalness, the Lambert lobe the rest of base: the mean of metalness is the one that is the nearest
           to both (least squares), so that bright metal on dark paint counts by more than its area
    """
    levels = [np.ascontiguousarray(texture.pixels, dtype=u8)]
    colors = mip_chain(color) if color is not None else []
    while texture.mipmaps and levels[-1].shape[:2] != (1, 1):
        smaller = halved(levels[-1], texture.srgb)
        if color is not None:
            _average_metal(levels[-1], _least_as_large(colors, levels[-1].shape), color.srgb, smaller)
        levels.append(smaller)
    return levels


def _least_as_large(levels: list[np.ndarray], shape: tuple[int, ...]) -> np.ndarray:
    """The smallest level that is at least as large as (h, w, 4), or the first."""
    return next((a for a in levels[::-1] if a.shape[0] >= shape[0] and a.shape[1] >= shape[1]), levels[0])


def halved(pixels: np.ndarray, srgb: bool) -> np.ndarray:
    """Return (h, w, 4) uint8 `pixels` at half their size, rounded down; the mean is that of linear light."""
    smaller = np.empty((max(1, pixels.shape[0] // 2), max(1, pixels.shape[1] // 2), 4), u8)
    _halve(pixels, smaller, srgb)
    return smaller


@jit
def _halve(source, smaller, srgb):
    """Average `source` (h, w, 4) into `smaller`, half its size rounded down."""
    decode = FROM_SRGB if srgb else FROM_BYTE
    height, width = smaller.shape[0], smaller.shape[1]
    for y in range(height):
        for x in range(width):
            r = g = b = a = f32(0)
            for j in range(3):
                wy = _box_weight(y, j, source.shape[0], height)
                sy = min(2 * y + j, source.shape[0] - 1)
                for i in range(3):
                    w = wy * _box_weight(x, i, source.shape[1], width)
                    sx = min(2 * x + i, source.shape[1] - 1)
                    r += w * decode[source[sy, sx, 0]]
                    g += w * decode[source[sy, sx, 1]]
                    b += w * decode[source[sy, sx, 2]]
                    a += w * FROM_BYTE[source[sy, sx, 3]]
            smaller[y, x, 0] = _encode(r, srgb)
            smaller[y, x, 1] = _encode(g, srgb)
            smaller[y, x, 2] = _encode(b, srgb)
            smaller[y, x, 3] = _encode(a, False)


@jit
def _average_metal(source, colors, srgb, smaller):
    """Write into the blue of `smaller` the mean of that of `source`, (h, w, 4), by how much each texel brings
    of the mean color: colors are (..., ..., 4) of the same surface, srgb or not."""
    decode = FROM_SRGB if srgb else FROM_BYTE
    height, width = smaller.shape[0], smaller.shape[1]
    for y in range(height):
        for x in range(width):
            color = of_metal = f32(0), f32(0), f32(0)
            share = f32(0)
            for j in range(3):
                wy = _box_weight(y, j, source.shape[0], height)
                sy = min(2 * y + j, source.shape[0] - 1)
                cy = sy * colors.shape[0] // source.shape[0]
                for i in range(3):
                    w = wy * _box_weight(x, i, source.shape[1], width)
                    sx = min(2 * x + i, source.shape[1] - 1)
                    cx = sx * colors.shape[1] // source.shape[1]
                    metal, rgb = FROM_BYTE[source[sy, sx, 2]], colors[cy, cx]
                    brought = scale(w, (decode[rgb[0]], decode[rgb[1]], decode[rgb[2]]))
                    color, of_metal = add(color, brought), add(of_metal, scale(metal, brought))
                    share += w * metal
            share = (dot(color, of_metal) + _DARKEST * share) / (dot(color, color) + _DARKEST)
            smaller[y, x, 2] = _encode(share, False)


@jit
def _box_weight(i, tap, size, half):
    """Return the share of source texel 2 i + tap in texel i of a row of `half`, made from one of `size`."""
    if size == 1:
        return f32(tap == 0)
    if size % 2 == 0:
        return f32(0.5) if tap < 2 else f32(0)
    overlap = (half - i, half, i + 1)
    return f32(overlap[tap]) / f32(size)


@jit
def _encode(value, srgb):
    """Return linear `value` as a byte; halves round to even, since up would brighten every level."""
    if srgb:
        curve = f32(1.055) * value ** f32(1 / 2.4) - f32(0.055)
        value = f32(12.92) * value if value <= f32(0.0031308) else curve
    return u8(np.rint(min(max(value, f32(0)), f32(1)) * f32(255)))


@jit
def sample_texture(texels, rows, texture, u, v, level):
    """Return RGBA, linear, of row `texture` at (u, v) and a mip level; v = 0 is the top.

    Trilinear, or the nearest texel of the nearest level where the row is not `linear`.
    """
    top = f32(rows[texture, LEVELS] - 1)
    level = min(max(level, f32(0)), top)
    if not rows[texture, LINEAR]:
        level = np.floor(level + f32(0.5))
    base = int(level)
    t = level - f32(base)
    upper = _sample_level(texels, rows, texture, u, v, base)
    if t == f32(0):
        return upper
    return _lerp4(upper, _sample_level(texels, rows, texture, u, v, base + 1), t)


@jit
def _sample_level(texels, rows, texture, u, v, level):
    """Return linear RGBA of one level, an int; other arguments as of `sample_texture`."""
    width, height, first = _level_place(rows, texture, level)
    wrap_u, wrap_v = rows[texture, WRAP_U], rows[texture, WRAP_V]
    srgb = rows[texture, SRGB]
    x = _reduce(u, wrap_u) * f32(width)
    y = _reduce(v, wrap_v) * f32(height)
    if not rows[texture, LINEAR]:
        column = _wrap(math.floor(x), width, wrap_u)
        return _texel(texels, first + _wrap(math.floor(y), height, wrap_v) * width + column, srgb)
    x -= f32(0.5)
    y -= f32(0.5)
    x0, y0 = math.floor(x), math.floor(y)
    fx, fy = x - f32(x0), y - f32(y0)
    left, right = _wrap(x0, width, wrap_u), _wrap(x0 + 1, width, wrap_u)
    upper = first + _wrap(y0, height, wrap_v) * width
    lower = first + _wrap(y0 + 1, height, wrap_v) * width
    return _lerp4(
        _lerp4(_texel(texels, upper + left, srgb), _texel(texels, upper + right, srgb), fx),
        _lerp4(_texel(texels, lower + left, srgb), _texel(texels, lower + right, srgb), fx),
        fy,
    )


@jit
def _level_place(rows, texture, level):
    """Return width, height and first texel, int64, of a mip level."""
    width, height, first = rows[texture, WIDTH], rows[texture, HEIGHT], rows[texture, OFFSET]
    for _ in range(level):
        first += width * height
        width = max(1, width >> 1)
        height = max(1, height >> 1)
    return width, height, first


@jit
def _reduce(x, wrap):
    """Return a float32 coordinate near [0, 1), so that large ones keep their fraction and fit an int."""
    if wrap == _CLAMP:
        return min(max(x, f32(0)), f32(1))
    if wrap == _MIRROR:
        return x - f32(2) * np.floor(x * f32(0.5))
    return x - np.floor(x)


@jit
def _wrap(i, size, wrap):
    """Return which texel stands at index `i` of an endless row; in 0..size - 1 whatever NaN became."""
    if wrap == _CLAMP:
        return min(max(i, 0), size - 1)
    if wrap == _MIRROR:
        i = i % (2 * size)
        return i if i < size else 2 * size - 1 - i
    return i % size


@jit
def _texel(texels, index, srgb):
    """Linear RGBA, float32, of a texel by its index."""
    texel = texels[index]
    decode = FROM_SRGB if srgb else FROM_BYTE
    return (
        decode[texel & u32(255)],
        decode[(texel >> u32(8)) & u32(255)],
        decode[(texel >> u32(16)) & u32(255)],
        FROM_BYTE[texel >> u32(24)],
    )


@jit
def _lerp4(first, second, t):
    """RGBA between two, float32: the first where t is 0."""
    (r, g, b, a), (r1, g1, b1, a1), s = first, second, f32(1) - t
    return s * r + t * r1, s * g + t * g1, s * b + t * b1, s * a + t * a1
