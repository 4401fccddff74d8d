"""Photons as they leave the lights: their first hits, from bounce maps or from rays.

Both ways draw the same photons in expectation; a test compares the flux they store per object.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ispm.optics.jit import jit
from ispm.optics.records import EMITTED, NO_HIT
from ispm.optics.rng import random4
from ispm.optics.sampling import equal_area_octahedral
from ispm.optics.vector import dot, scale
from ispm.scene.packed import Packed
from ispm.tracer.intersect import STACK_WORDS
from ispm.tracer.simd import address, alloca, ldf
from ispm.tracer.surface import SurfaceTable, closest_surface
from ispm.tracer.threads import run_threads
from ispm.tracer.world import World

f32, i64, u32 = np.float32, np.int64, np.uint32

_DIMENSION_SHIFT = 1 << 20  # of the random numbers that shift a whole map
_DIMENSION_RAY = (1 << 20) + 1


def share_photons(lights: np.ndarray, photon_count: int) -> np.ndarray:
    """Return how many photons each light emits: in proportion to its luminous flux.

    lights  (L,) LIGHT
    ->      (L,) int64; no light that shines gets none
    """
    power = lights["intensity"].astype(np.float64) @ (0.2126, 0.7152, 0.0722) * lights["solid_angle"]
    total = float(power.sum())
    if total <= 0.0 or photon_count == 0:
        return np.zeros(len(lights), np.int64)
    shares = np.rint(photon_count * power / total).astype(np.int64)
    return np.where(power > 0.0, np.maximum(shares, 1), 0)


def map_width(light: np.void, photon_count: int) -> int:
    """Return the width of a map's face so that thinning leaves `photon_count` photons.

    The largest texel covers nearly 4 k^2 / W^2 sr, k the spread; it must not carry more than one
    photon's flux, a share Omega / N of the maps' solid angle. For a cube W^2 >= N / pi, and about 52 %
    of the texels survive.
    """
    widest = 4.0 * float(light["spread"]) ** 2 / float(light["solid_angle"])
    return max(1, math.ceil(math.sqrt(widest * photon_count)))


def map_shift(seed: int, pass_index: int, light: int) -> tuple[float, float, float]:
    """Return a light's random numbers for one pass: its map's sub-texel shift and its thinning's.

    ->  x, y in [-0.5, 0.5) texels, and the offset of the thinning's lattice in [0, 1)
    """
    x, y, z, _ = random4(u32(light), u32(_DIMENSION_SHIFT), u32(pass_index), u32(seed))
    return float(x) - 0.5, float(y) - 0.5, float(z)


def thin(
    texels: np.ndarray,
    solid_angles: np.ndarray,
    row: np.void,
    photon_count: int,
    light: int,
    first_key: int,
    offset: float,
) -> np.ndarray:
    """Thin a light's map to photons of equal flux, in texel order.

    texels        (faces, W, W, 4) uint32: instance, primitive and bits of u, v
    solid_angles  (faces, W, W) float64 of the texels, sr
    row           LIGHT, number `light`
    offset        of the thinning's lattice, see `map_shift`
    ->            (M,) EMITTED, M = `photon_count` in expectation; flux I Omega / photon_count each,
                  Omega the maps' solid angle
    A texel of flux I dOmega survives with probability dOmega photon_count / Omega. Survivors are
    spread evenly by comparing against a lattice (the plastic number's, Roberts 2018) shifted at
    random, so that the expectation is exact and the count nearly constant.
    """
    out = np.empty(texels.shape[0] * texels.shape[1] * texels.shape[2], EMITTED)
    covered = float(row["solid_angle"])
    survival = (solid_angles * (photon_count / covered)).astype(np.float32)
    flux = (row["intensity"].astype(np.float64) * (covered / photon_count)).astype(np.float32)
    count = _thin(texels, survival, flux, u32(light), u32(first_key), offset, out)
    return out[:count]


@jit
def _thin(texels, survival, flux, light, first_key, offset, out):
    faces, height, width, _ = texels.shape
    count = i64(0)
    for face in range(faces):
        for y in range(height):
            for x in range(width):
                lattice = offset + x * 0.7548776662466927 + (y + face * height) * 0.5698402909980532
                if lattice - math.floor(lattice) >= survival[face, y, x]:
                    continue
                row = out[count]
                row.instance = texels[face, y, x, 0]
                row.primitive = texels[face, y, x, 1]
                bits = np.uint64(texels.ctypes.data)
                word = ((face * height + y) * width + x) * 4
                row.u = ldf(bits, word + 2)
                row.v = ldf(bits, word + 3)
                for c in range(3):
                    row.flux[c] = flux[c]
                row.key = u32(first_key + (face * height + y) * width + x)
                row.light = light
                count += 1
    return count


def emit_rays(
    packed: Packed,
    world: World,
    surfaces: SurfaceTable,
    counts: np.ndarray,
    seed: int,
    pass_index: int,
    threads: int,
) -> np.ndarray:
    """Draw photons by tracing rays from the lights, one in each cell of an equal-area sphere, or of the
    square that an aimed light's map covers.

    counts  (L,) photons wanted of each light; each gets the next square number
    ->      (M,) EMITTED, in order of light and cell
    """
    batches: list[np.ndarray] = []
    first_key = 0
    for light, wanted in enumerate(counts):
        if wanted == 0:
            continue
        side = math.ceil(math.sqrt(int(wanted)))
        rows = np.zeros(side * side, EMITTED)
        rows["light"] = light
        intensity = packed.lights["intensity"][light].astype(np.float64)
        rows["flux"] = (intensity * (4.0 * math.pi / (side * side))).astype(np.float32)
        aim = packed.lights[light : light + 1]
        rows["key"] = np.arange(first_key, first_key + side * side, dtype=np.uint32)
        first_key += side * side
        edges = np.linspace(0, len(rows), threads + 1).astype(np.int64)

        def part(k: int, rows: Any = rows, edges: Any = edges, aim: Any = aim) -> None:
            _emit_rays(
                address(world.table), surfaces.addresses, surfaces.texels, surfaces.rows, aim,
                rows[edges[k] : edges[k + 1]], u32(seed), u32(pass_index),
                i64(edges[k]), i64(len(rows)),
            )  # fmt: skip

        run_threads(part, threads)
        batches.append(rows)
    return np.concatenate(batches) if batches else np.zeros(0, EMITTED)


@jit
def _emit_rays(world, table, texels, texture_rows, lights, rows, seed, pass_index, first, count):
    side = i64(round(math.sqrt(count)))
    light = lights[0]
    origin = (light.position[0], light.position[1], light.position[2])
    stack, words = alloca(STACK_WORDS), alloca(2)
    for i in range(len(rows)):
        r0, r1, r2, _ = random4(rows[i].key, u32(_DIMENSION_RAY), pass_index, seed)
        cell = first + i
        x = (f32(cell % side) + r0) / f32(side)
        y = (f32(cell // side) + r1) / f32(side)
        x, y = f32(2) * x - f32(1), f32(2) * y - f32(1)
        d = equal_area_octahedral(x, y)
        if light.faces == u32(1):
            d, weight = _aimed_direction(light, x, y)
            for c in range(3):
                rows[i].flux[c] *= weight
        found, hit = closest_surface(world, table, texels, texture_rows, origin, d, r2, stack, words)
        rows[i].instance = hit[0] if found else u32(NO_HIT)
        rows[i].primitive = hit[1]
        rows[i].u = hit[2]
        rows[i].v = hit[3]


@jit
def _aimed_direction(light, x, y):
    """Direction at (x, y) in [-1, 1]^2 of an aimed light's map, and the sphere's share there, times 4 pi.

    d = k x right + k y up + forward over its length l; d Omega = k^2 dx dy / l^3.
    """
    k2 = light.spread * light.spread
    d = (
        k2 * x * light.map_x[0] + k2 * y * light.map_y[0] + light.map_z[0],
        k2 * x * light.map_x[1] + k2 * y * light.map_y[1] + light.map_z[1],
        k2 * x * light.map_x[2] + k2 * y * light.map_y[2] + light.map_z[2],
    )
    inv = f32(1) / math.sqrt(dot(d, d))
    return scale(inv, d), k2 * inv * inv * inv * f32(1 / math.pi)
