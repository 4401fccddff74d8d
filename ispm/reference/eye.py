"""What pixels see by way of mirrors and glass, slowly: branches drawn at random, photons counted by hand."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ispm.accel.intersect import STACK_WORDS
from ispm.accel.medium import attenuated, medium, no_medium, spawn_ray
from ispm.accel.records import Scratch
from ispm.accel.surface import SurfaceTable, closest_surface, glow, hit_position, scene_tables, surface
from ispm.accel.world import World
from ispm.kernels.simd import alloca
from ispm.lights.nee import direct_light, times
from ispm.optics.bsdf import Bsdf, has_finite, is_smooth, sample_bsdf, smooth_split, transmits
from ispm.optics.jit import jit
from ispm.optics.records import MATERIAL_UNLIT, NO_HIT
from ispm.optics.rng import random4
from ispm.optics.vector import luminance, scale, sub
from ispm.paths.eye_paths import EyeRays
from ispm.scene.packed import Packed

f32, i64, u32 = np.float32, np.int64, np.uint32

_EVENTS_MAX = 64
_BEFORE = f32(1e-4)  # of the distance that a ray starts before what its pixel shows
_SAME_SURFACE = 0.5  # cosine of two normals
_NONE = (f32(0), f32(0), f32(0))

_END = np.dtype([
    ("slot", "<u4"), ("position", "<f4", 3), ("n", "<f4", 3), ("ng", "<f4", 3), ("wo", "<f4", 3),
    ("weight", "<f4", 3), ("diffuse", "<f4", 3), ("f0", "<f4", 3), ("f90", "<f4"), ("alpha", "<f4"),
    ("dielectric_f0", "<f4"), ("dielectric_f90", "<f4"), ("tint", "<f4", 3),
])  # fmt: skip


def eye_light(
    packed: Packed,
    world: World,
    surfaces: SurfaceTable,
    rays: EyeRays,
    photons: np.ndarray,
    *,
    samples: int,
    neighbors: int,
    seed: int = 0,
) -> np.ndarray:
    """Return what arrives along rays by way of the mirror or glass that each meets first, (n, 3) float64.

    photons    (m,) PHOTON, millions; their radii are of no account
    samples    paths of each ray
    neighbors  photons of which the density at a path's end is made
    At each surface one of what it reflects and lets through is drawn by their luminances, and weighed by
    the inverse of its chance: no limit of branches, but for paths of 64 events. An end is lit by all lights
    through shadow rays, and by the nearest photons of its surface, in a disc just wide enough for them.
    """
    count = len(rays.origins)
    light = np.zeros((count, 3))
    own, foot = surfaces.own_footprint()
    tables = scene_tables(packed, world, surfaces)._replace(surfaces=own)
    tree = _tree(photons)
    for sample in range(samples):
        direct, ends = np.zeros((count, 3)), np.zeros(count * _EVENTS_MAX // 8, _END)
        used = _follow(
            tables, foot, rays.origins, rays.directions, rays.distances, f32(rays.width[1]),
            u32(sample), u32(seed), direct, ends,
        )  # fmt: skip
        light += direct
        if len(photons) and used:
            found = ends[:used]
            np.add.at(light, found["slot"], _reflected(found, photons, tree, neighbors))
    return light / samples


def _reflected(ends: np.ndarray, photons: np.ndarray, tree: Any, neighbors: int) -> np.ndarray:
    """(m, 3) float64: weight times the radiance that the nearest photons of its surface bring to each end."""
    x, n, ng, wo = (ends[k].astype(float) for k in ("position", "n", "ng", "wo"))
    most = min(4 * neighbors, len(photons))  # some lie on other surfaces
    distance, near = tree.query(x, most)
    distance, near = distance.reshape(-1, most), near.reshape(-1, most)
    found = photons[near]
    wi, flux = found["wi"].astype(float), found["flux"].astype(float)
    wi_ng = np.einsum("mkc,mc->mk", wi, ng)
    counts = (np.einsum("mkc,mc->mk", found["normal"], ng) > _SAME_SURFACE) & (wi_ng > 0.0)
    rank = np.cumsum(counts, axis=1)
    within = counts & (rank < neighbors)
    last = np.where(rank[:, -1] >= neighbors, np.argmax(rank >= neighbors, axis=1), most - 1)
    area = math.pi * np.take_along_axis(distance, last[:, None], 1) ** 2
    ratio = np.clip(np.einsum("mkc,mc->mk", wi, n), 0.0, None) / np.where(counts, wi_ng, 1.0)
    f = _lobes(ends, n, wo, wi)
    light = np.einsum("mkc,mkc,mk->mc", f, flux, within * np.minimum(ratio, 10.0)) / area
    return np.asarray(light * ends["weight"])


def _lobes(ends: np.ndarray, n: np.ndarray, wo: np.ndarray, wi: np.ndarray) -> np.ndarray:
    """f(wo, wi), (m, k, 3): Lambert's lobe, and the glossy one of opaque rough surfaces."""
    diffuse, f0, f90, alpha, k0, k90, tint = (
        ends[name].astype(float)
        for name in ("diffuse", "f0", "f90", "alpha", "dielectric_f0", "dielectric_f90", "tint")
    )
    h = wo[:, None] + wi
    h /= np.maximum(np.linalg.norm(h, axis=2, keepdims=True), 1e-30)
    fc = np.clip(1.0 - np.einsum("mc,mkc->mk", wo, h), 0.0, 1.0)[..., None] ** 5
    kept = 1.0 - (k0[:, None, None] * (1.0 - fc) + k90[:, None, None] * fc)
    lambert = diffuse[:, None] / math.pi * kept
    rough = (alpha > 0.0) & (tint.sum(axis=1) == 0.0)
    a2 = np.where(rough, alpha, 1.0)[:, None] ** 2
    nh, nl = np.einsum("mc,mkc->mk", n, h), np.einsum("mc,mkc->mk", n, wi)
    nv = np.einsum("mc,mc->m", n, wo)[:, None]
    d = a2 / (math.pi * (nh * nh * (a2 - 1.0) + 1.0) ** 2)
    nl, nv = np.maximum(nl, 1e-6), np.maximum(nv, 1e-6)
    v = 0.5 / (nl * np.sqrt(nv * nv * (1 - a2) + a2) + nv * np.sqrt(nl * nl * (1 - a2) + a2))
    facets = f0[:, None] * (1.0 - fc) + f90[:, None, None] * fc
    return np.asarray(lambert + (d * v * rough[:, None])[..., None] * facets)


def _tree(photons: np.ndarray) -> Any:
    from scipy.spatial import cKDTree  # of the tests' dependencies

    return cKDTree(photons["position"].astype(float))


@jit
def _follow(tables, foot, origins, directions, distances, spread, sample, seed, light, ends):
    """Follow one path of each ray; return how many ends were written."""
    scratch = Scratch(alloca(STACK_WORDS), alloca(2))
    row = i64(0)
    for i in range(len(origins)):
        near = distances[i] * (f32(1) - _BEFORE)
        d = directions[i, 0], directions[i, 1], directions[i, 2]
        start = origins[i, 0] + near * d[0], origins[i, 1] + near * d[1], origins[i, 2] + near * d[2]
        row = _path(tables, foot, start, d, near, spread, i, sample, seed, scratch, light, ends, row)
    return row


@jit
def _path(tables, foot, start, d, length, spread, i, sample, seed, scratch, light, ends, row):
    """Follow one path; its first surface counts only as what it passes."""
    weight, inside, focus = (f32(1), f32(1), f32(1)), no_medium(), f32(1)
    for event in range(_EVENTS_MAX):
        u1, u2, u3, u4 = random4(u32(i), u32(event), sample, seed)
        found, hit = closest_surface(tables, start, d, u4, scratch)
        if not found:
            return row
        way = sub(hit_position(tables.surfaces, hit), start)
        length += f32(math.sqrt(way[0] * way[0] + way[1] * way[1] + way[2] * way[2]))
        foot[0] = spread * length
        x = surface(tables, hit, d)
        b, n, ng = x.bsdf, x.n, x.ng
        wo = scale(f32(-1), d)
        if event > 0:
            inside = medium(inside, x)
            if inside.instance != u32(NO_HIT):
                weight = attenuated(tables, inside, start, x.position, weight)
            _add(light, i, glow(tables, hit), weight, focus)
            if x.flags & u32(MATERIAL_UNLIT):
                return row
            lit, _ = direct_light(tables, x, wo, u4, scratch, f32(np.inf))
            _add(light, i, lit, weight, focus)
            if has_finite(b):
                _write(ends[row], i, x.position, n, ng, wo, scale(focus, weight), b)
                row += 1
        alive, wi, factor = _draw(b, n, ng, wo, u1, u2, u3)
        if not alive:
            return row
        weight = times(weight, factor)
        if wi[0] * ng[0] + wi[1] * ng[1] + wi[2] * ng[2] < f32(0) and b.thin == f32(0):
            focus = f32(1) / (b.eta * b.eta) if x.entering else f32(1)
        start, inside = spawn_ray(tables, x, inside, wi)
        d = wi
    return row


@jit
def _draw(b, n, ng, wo, u1, u2, u3):
    """One of the directions in which a mirror or glass sends a path, and its weight."""
    if not is_smooth(b):
        if not transmits(b):
            return False, wo, wo
        gloss = Bsdf(_NONE, b.f0, b.f90, b.alpha, b.dielectric_f0, b.dielectric_f90, b.tint, b.eta, b.thin)
        ok, wi, factor, _ = sample_bsdf(gloss, n, ng, wo, u1, u2, u3, False)
        return ok, wi, factor
    reflectance, transmittance, above, beyond, through = smooth_split(b, n, ng, wo)
    reflected, passed = luminance(reflectance), luminance(transmittance) if through else f32(0)
    if reflected + passed <= f32(0):
        return False, wo, wo
    chance = reflected / (reflected + passed)
    if u3 < chance:
        return True, above, scale(f32(1) / chance, reflectance)
    return True, beyond, scale(f32(1) / (f32(1) - chance), transmittance)


@jit
def _add(light, i, value, weight, focus):
    for c in range(3):
        light[i, c] += np.float64(value[c]) * weight[c] * focus


@jit
def _write(end, i, position, n, ng, wo, weight, b):
    end.slot = u32(i)
    for c in range(3):
        end.position[c], end.n[c], end.ng[c] = position[c], n[c], ng[c]
        end.wo[c], end.weight[c] = wo[c], weight[c]
        end.diffuse[c], end.f0[c], end.tint[c] = b.diffuse[c], b.f0[c], b.tint[c]
    end.f90, end.alpha = b.f90, b.alpha
    end.dielectric_f0, end.dielectric_f90 = b.dielectric_f0, b.dielectric_f90
