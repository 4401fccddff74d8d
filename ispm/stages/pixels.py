"""The eye's pixels as the G-buffer holds them, for steps that light them on the CPU."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ispm.accel.layers import without_facets
from ispm.accel.lobes import dielectric_at
from ispm.accel.mesh import MATERIAL_WORDS, MATERIALS, word_of
from ispm.accel.records import Hit
from ispm.accel.surface import NO_LIGHT, SurfacePoint
from ispm.accel.texturing import TRANSMISSION_MAP, texture_row
from ispm.frame import GBuffer
from ispm.gpu import Gpu
from ispm.kernels.simd import ldf, ldu, u2f
from ispm.optics.bsdf import surface_bsdf
from ispm.optics.coat import NO_COAT, with_diffuse
from ispm.optics.jit import jit
from ispm.optics.records import (
    MATERIAL,
    MATERIAL_ANISOTROPIC,
    MATERIAL_SPECULAR_MAPPED,
    MATERIAL_TRANSLUCENT,
    MATERIAL_UNLIT,
    NO_HIT,
    PIXEL_BACK,
)
from ispm.optics.sampling import octahedral_decode
from ispm.optics.sheen import NO_SHEEN
from ispm.optics.texture import FROM_BYTE, FROM_SRGB
from ispm.optics.vector import Vector, dot, scale, sub, vec3
from ispm.stages.camera import CameraView

f32, i64, u32 = np.float32, np.int64, np.uint32

_FLAGS, _TRANSMISSION = word_of(MATERIAL, "flags"), word_of(MATERIAL, "transmission")
# A ray's start above its surface: of the distance, of coordinates, and of the scene's largest one, by which
# what is met on large triangles is rounded, but no more of the distance than a fraction of a pixel.
_CLEAR, _ROUNDED, _ROUNDED_FAR, _MOST = f32(2e-5), f32(1e-6), f32(4 * 2.0**-24), f32(5e-4)
OFF_PLANE = f32(1.5)  # pixels' widths that neighbors lie off a pixel's plane at most
TURNED = f32(0.9)  # cosine of the angle between their normals at least


class Pixels(NamedTuple):
    """What the G-buffer holds of n pixels, row by row, see `GBuffer`: (n, 4) and (n, 2) uint32, (n, 4) and
    (n,) float32, (n, 4) uint8; the last with one row where no material has textures for it."""

    points: np.ndarray
    normals: np.ndarray
    base: np.ndarray
    roughness: np.ndarray
    specular: np.ndarray


class PixelView(NamedTuple):
    """Where the eye is, (3,) m; the direction to it, of parallel views; a pixel's width, m, is
    `width . (x, y, z, 1)` of the point that it shows; pixels in a row; random numbers."""

    eye: np.ndarray
    parallel: bool
    back: np.ndarray
    width: np.ndarray
    columns: np.int64
    pass_index: np.uint32
    seed: np.uint32


def read_pixels(gpu: Gpu, gbuffer: GBuffer, view: CameraView, seed: int) -> tuple[Pixels, PixelView]:
    """Return the Pixels of a G-buffer, and what they were seen through; waits for them."""
    width, height = gbuffer.size
    read = gpu.read_many(
        [
            (gbuffer.points, np.uint32, 4),
            (gbuffer.normals, np.uint32, 2),
            (gbuffer.base, np.float16, 4),
            (gbuffer.emission, np.float16, 4),
            (gbuffer.specular, np.uint8, 4),
        ]
    )
    points, normals, base, emission = (a.reshape(width * height, -1) for a in read[:4])
    roughness, specular = emission[:, 3].astype(np.float32), read[4].reshape(-1, 4)
    return Pixels(points, normals, base.astype(np.float32), roughness, specular), pixel_view(view, seed)


def pixel_view(view: CameraView, seed: int) -> PixelView:
    """Return the PixelView of a camera's view."""
    *ahead, offset = view.clip_from_world[-1]
    return PixelView(
        view.eye.astype(np.float32),
        view.ymag is not None,
        (-view.forward).astype(np.float32),
        (view.footprint * np.array([*ahead, offset])).astype(np.float32),
        i64(view.size[0]),
        u32(view.pass_index),
        u32(seed),
    )


class Shown(NamedTuple):
    """A pixel's surface: SurfacePoint, wo, distance to the eye and the pixel's width there, m."""

    x: SurfacePoint
    wo: Vector
    distance: np.float32
    width: np.float32


@jit
def is_lit(tables, pixels, i):
    """Return whether row i of Pixels shows something that light makes visible."""
    word = pixels.points[i, 3]
    if word == u32(0):
        return False
    return ldu(tables.surfaces[MATERIALS], _material(word) + _FLAGS) & u32(MATERIAL_UNLIT) == u32(0)


@jit
def _material(word):
    """The word, int64, at which the MATERIAL begins that a pixel's `word` tells, see stages/material.wgsl."""
    return i64((word & u32(PIXEL_BACK - 1)) - u32(1)) * MATERIAL_WORDS


@jit
def transmitted_shares(tables, word):
    """Return the share of light that passes what a pixel of this material `word` shows as by glass, and the
    share of its diffuse light that leaves on the other side, float32."""
    share, row = f32(word >> u32(24)) * f32(1 / 255), _material(word)
    materials = tables.surfaces[MATERIALS]
    if ldu(materials, row + _FLAGS) & u32(MATERIAL_TRANSLUCENT) == u32(0):
        return share, f32(0)
    if texture_row(tables.surfaces, row, TRANSMISSION_MAP) < i64(0):
        share = ldf(materials, row + _TRANSMISSION)
    return f32(0), share


@jit
def shown_at(tables, pixels, view, i):
    """Return the Shown of row i of Pixels."""
    point, word, base = pixels.points[i], pixels.points[i, 3], pixels.base[i]
    position = u2f(point[0]), u2f(point[1]), u2f(point[2])
    transmission, share = transmitted_shares(tables, word)
    maps = _specular_maps(tables, pixels, i)
    dielectric = dielectric_at(tables.surfaces, _material(word), vec3(maps), maps[3])
    b = surface_bsdf(vec3(base), base[3], pixels.roughness[i], transmission, dielectric, True)
    b = with_diffuse(b, scale(f32(1) - share, b.diffuse))
    if ldu(tables.surfaces[MATERIALS], _material(word) + _FLAGS) & u32(MATERIAL_ANISOTROPIC) != u32(0):
        b = without_facets(b)  # which eye paths light
    n, ng = _unpacked(pixels.normals[i, 0]), _unpacked(pixels.normals[i, 1])
    to_eye, width = sub(vec3(view.eye), position), view.width
    distance = f32(math.sqrt(dot(to_eye, to_eye)))
    wo = vec3(view.back) if view.parallel else scale(f32(1) / distance, to_eye)
    side = max(dot(vec3(width), position) + width[3], f32(1e-30))
    hit = Hit(u32(NO_HIT), u32(0), f32(0), f32(0))
    return Shown(
        SurfacePoint(hit, position, ng, n, b, u32(0), True, NO_COAT, NO_SHEEN, NO_LIGHT), wo, distance, side
    )


@jit
def _specular_maps(tables, pixels, i):
    """What textures make of specular color and factor in row i of Pixels, four float32."""
    flags = ldu(tables.surfaces[MATERIALS], _material(pixels.points[i, 3]) + _FLAGS)
    if flags & u32(MATERIAL_SPECULAR_MAPPED) == u32(0):
        return f32(1), f32(1), f32(1), f32(1)
    texel = pixels.specular[i]
    return FROM_SRGB[texel[0]], FROM_SRGB[texel[1]], FROM_SRGB[texel[2]], FROM_BYTE[texel[3]]


@jit
def _unpacked(word):
    """The unit vector that `pack_normal` of sampling.wgsl has packed."""
    x, y = np.int16(word & u32(0xFFFF)), np.int16(word >> u32(16))
    return octahedral_decode(max(f32(x) * f32(1 / 32767), f32(-1)), max(f32(y) * f32(1 / 32767), f32(-1)))


@jit
def lift(tables, shown):
    """Return how far above a pixel's surface rays start, m, so that they clear it."""
    (x, y, z), distance = shown.x.position, shown.distance
    far = min(_ROUNDED_FAR * tables.trees.reach, _MOST * distance)
    return _CLEAR * distance + _ROUNDED * max(abs(x), max(abs(y), abs(z))) + far


class PixelPlane(NamedTuple):
    """Where a pixel's neighbors lie that are filtered with it: its point, m, geometric and shading normal,
    unit, and how far off its plane, m."""

    position: Vector
    ng: Vector
    n: Vector
    off: np.float32


@jit
def plane_at(pixels, view, i):
    """Return the PixelPlane of row i of Pixels."""
    point, width = pixels.points[i], view.width
    position = u2f(point[0]), u2f(point[1]), u2f(point[2])
    side = max(dot(vec3(width), position) + width[3], f32(1e-30))
    n, ng = _unpacked(pixels.normals[i, 0]), _unpacked(pixels.normals[i, 1])
    return PixelPlane(position, ng, n, OFF_PLANE * side)


@jit
def is_alike(pixels, plane, i, k):
    """Return whether row k of Pixels shows the material of row i, in its PixelPlane, turned alike."""
    point = pixels.points[k]
    if point[3] != pixels.points[i, 3]:
        return False
    off = dot(plane.ng, sub((u2f(point[0]), u2f(point[1]), u2f(point[2])), plane.position))
    if abs(off) > plane.off:
        return False
    return pixels.normals[k, 0] == pixels.normals[i, 0] or is_turned_alike(pixels, plane, k, TURNED)


@jit
def is_turned_alike(pixels, plane, k, cosine):
    """Return whether row k of Pixels is turned from a PixelPlane by less than the angle of this cosine."""
    return dot(_unpacked(pixels.normals[k, 0]), plane.n) > cosine
