"""What pixels see by way of mirrors and glass, slowly: branches drawn at random, photons counted by hand."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from ispm.accel.bands import in_band, is_dispersive
from ispm.accel.glow import glow
from ispm.accel.intersect import STACK_WORDS
from ispm.accel.layers import (
    coat_point,
    drawn_layer,
    far_side,
    has_sheen,
    is_coated,
    is_translucent,
    sheen_point,
    with_matte_sheen,
    without_diffuse,
)
from ispm.accel.medium import attenuated, medium, no_medium, spawn_ray
from ispm.accel.records import Scratch
from ispm.accel.surface import SurfaceTable, closest_surface, hit_position, inner_side, scene_tables, surface
from ispm.accel.world import World
from ispm.kernels.simd import alloca
from ispm.lights.nee import direct_light, times
from ispm.optics.bsdf import has_finite, is_smooth, reflection_over_lambert, smooth_split, transmits
from ispm.optics.bsdf_sampling import sample_bsdf
from ispm.optics.dispersion import ALL_BANDS
from ispm.optics.environment import environment_radiance, has_environment
from ispm.optics.facets import mean_alpha
from ispm.optics.jit import jit
from ispm.optics.records import INNER, MATERIAL_UNLIT, NO_HIT
from ispm.optics.rng import random4
from ispm.optics.vector import add, dot, luminance, scale, sub, vec3
from ispm.paths.eye_paths import EyeRays
from ispm.reference.paths import one_band
from ispm.scene.packed import Packed

f32, i64, u32 = np.float32, np.int64, np.uint32

_EVENTS_MAX = 64
_BEFORE = f32(1e-4)  # of the distance that a ray starts before what its pixel shows
_SAME_SURFACE = 0.5  # cosine of two normals
_NONE = (f32(0), f32(0), f32(0))

# Where a path ends on a lobe of more than one direction, of which ray (slot), and its Bsdf.
_VECTORS = ("position", "n", "ng", "wo", "weight", "diffuse", "f0", "tint")
_NUMBERS = ("f90", "alpha", "dielectric_f0", "dielectric_f90")
_WORDS = ("slot", "side")
_END = np.dtype(
    [*((w, u32) for w in _WORDS), *((v, f32, 3) for v in _VECTORS), *((n, f32) for n in _NUMBERS)]
)


class _View(NamedTuple):
    """Rays, (n, ...) float32 as EyeRays has them, and what holds for one path of each.

    spread     m that a pixel covers for each m of the path
    footprint  (1,) float32, see `SurfaceTable.own_footprint`
    """

    origins: np.ndarray
    directions: np.ndarray
    distances: np.ndarray
    spread: np.float32
    footprint: np.ndarray
    sample: np.uint32
    seed: np.uint32


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
    _, spread = rays.width
    for sample in range(samples):
        direct, ends = np.zeros((count, 3)), np.zeros(count * _EVENTS_MAX // 8, _END)
        given = rays.origins, rays.directions, rays.distances
        used = _follow(tables, _View(*given, f32(spread), foot, u32(sample), u32(seed)), direct, ends)
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
    counts &= found["instance"] & INNER == ends["side"][:, None]
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
def _follow(tables, view, light, ends):
    """Follow one path of each ray of a _View; return how many ends, (m,) _END, were written.

    light  (n, 3) float64, to which is added what the paths bring on their course
    """
    scratch = Scratch(alloca(STACK_WORDS), alloca(2))
    row = i64(0)
    for i in range(len(view.origins)):
        row = _path(tables, view, i, scratch, light, ends, row)
    return row


@jit
def _path(tables, view, i, scratch, light, ends, row):
    """Follow one path of ray i, whose first surface counts only as what it passes; return the next free row
    of `ends`, (m,) _END."""
    length = view.distances[i] * (f32(1) - _BEFORE)
    d = vec3(view.directions[i])
    start = add(vec3(view.origins[i]), scale(length, d))
    weight, inside, focus, band = (f32(1), f32(1), f32(1)), no_medium(), f32(1), ALL_BANDS
    for event in range(_EVENTS_MAX):
        u1, u2, u3, u4 = random4(u32(i), u32(event), view.sample, view.seed)
        found, hit = closest_surface(tables, start, d, u4, scratch)
        if not found:
            if has_environment(tables.environment):
                _add(light, i, environment_radiance(tables.environment, d), weight, focus)
            return row
        segment = sub(hit_position(tables.surfaces, hit), start)
        length += f32(math.sqrt(dot(segment, segment)))
        view.footprint.fill(view.spread * length)
        x = surface(tables, hit, d)
        if is_dispersive(x):
            band, weight = one_band(band, weight, u32(i), view.sample, view.seed)
            x = in_band(tables, x, band)
        b, ng = x.bsdf, x.ng
        wo = scale(f32(-1), d)
        if event > 0:
            inside = medium(inside, x)
            if inside.instance != u32(NO_HIT):
                weight = attenuated(tables, inside, start, x.position, weight)
            _add(light, i, glow(tables, hit, d), weight, focus)
            if x.flags & u32(MATERIAL_UNLIT):
                return row
            lit, _ = direct_light(tables, x, wo, u4, scratch, f32(np.inf))
            _add(light, i, lit, weight, focus)
            if is_coated(x):
                lit, _ = direct_light(tables, coat_point(x), wo, u4, scratch, f32(np.inf))
                _add(light, i, lit, weight, focus)
            if has_sheen(x):
                lit, _ = direct_light(tables, sheen_point(x), wo, u4, scratch, f32(np.inf))
                _add(light, i, lit, weight, focus)
            if has_finite(b) or has_sheen(x):
                _write(ends[row], i, with_matte_sheen(x), wo, scale(focus, weight))
                row += 1
            if is_translucent(x):
                far, through = far_side(x, wo)
                lit, _ = direct_light(tables, far, through, u4, scratch, f32(np.inf))
                _add(light, i, lit, weight, focus)
                _write(ends[row], i, far, through, scale(focus, weight))
                row += 1
        x, wo, u3, chance = drawn_layer(x, wo, u3)
        alive, wi, factor = _draw(x.bsdf, x.n, x.ng, wo, u1, u2, u3)
        if not alive:
            return row
        weight = times(weight, scale(f32(1) / chance, factor))
        if dot(wi, ng) < f32(0) and b.thin == f32(0):
            focus = f32(1) / (b.eta * b.eta) if x.entering else f32(1)
        start, inside = spawn_ray(tables, x, inside, wi)
        d = wi
    return row


@jit
def _draw(b, n, ng, wo, u1, u2, u3):
    """(whether there is any, wi, weight): one of the directions in which a mirror or glass sends a path,
    unit, drawn by float32 uniform in [0, 1), and its weight, RGB."""
    if not is_smooth(b):
        if not transmits(b):
            return False, wo, wo
        ok, wi, factor, _ = sample_bsdf(without_diffuse(b), n, ng, wo, u1, u2, u3, False)
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
    """Add the radiance `value`, RGB, times `weight`, RGB, and `focus`, float32, to row i of `light`."""
    for c in range(3):
        light[i, c] += np.float64(value[c]) * weight[c] * focus


@jit
def _write(end, i, x, wo, weight):
    """Write the _END of ray i at the SurfacePoint x."""
    b = x.bsdf
    end.slot, end.side = u32(i), inner_side(x)
    for c in range(3):
        end.position[c], end.n[c], end.ng[c] = x.position[c], x.n[c], x.ng[c]
        end.wo[c], end.weight[c] = wo[c], weight[c]
        end.diffuse[c], end.f0[c], end.tint[c] = b.diffuse[c], b.f0[c], b.tint[c]
    end.f90, end.alpha = b.f90, mean_alpha(b)
    end.dielectric_f0, end.dielectric_f90 = reflection_over_lambert(b)
