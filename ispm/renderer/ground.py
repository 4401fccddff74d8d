"""The ground beneath a model as its picture shows it: what is behind, darker or brighter as it is lit.

The ground is a matt disk of the scene, lit and traced as all else. Where the eye sees it, what it reflects is
taken as a share of what it would reflect if nothing stood on it, and the picture shows that share of its
background: shadows darken it, caustics and bounced light brighten it, and where the model changes nothing
the background stays as it is. Near the rim the share fades to 1. On black, where no shadow shows, the ground
itself is seen, as far as it fades out.
Source: the ratio is that of Debevec, Rendering Synthetic Objects into Real Scenes, SIGGRAPH 1998, section 6.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ispm.accel.surface import Tables, scene_tables
from ispm.accel.world import World
from ispm.frame import GBuffer
from ispm.gpu import Gpu, Texture
from ispm.lights.openings import Openings
from ispm.optics.environment import environment_irradiance, has_environment
from ispm.optics.jit import jit
from ispm.optics.light import light_arriving
from ispm.optics.vector import add, vec3
from ispm.renderer.backdrop import background_color, shows_environment
from ispm.renderer.one_pass import Pass
from ispm.scene.packed import pack
from ispm.scene.scene import Scene
from ispm.stages.area_light import area_light
from ispm.stages.pixels import read_pixels

f32 = np.float32

_FULL = 0.5  # of the ground's radius, within which it is wholly there
_SIDE = 65  # places a side, between which the light of lamps with a surface is interpolated


class _Disk(NamedTuple):
    """The ground: middle, (3,) m, radius, m, and the row of its instance."""

    middle: np.ndarray
    radius: float
    row: int


def catch_shadows(
    this: Pass,
    gpu: Gpu,
    gbuffer: GBuffer,
    openings: Openings,
    light: tuple[Texture, Texture],
    pixels: np.ndarray,
    added: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Return pixels and what to add there, as `patch` of stages/specular.py takes them, with what turns the
    pixels of the ground to what they show.

    openings  that guided direct light
    light     direct and indirect
    """
    disk = _ground(this)
    ids, direct, indirect = gpu.read_many(
        [(gbuffer.ids, np.uint32, 2), (light[0], np.float32, 4), (light[1], np.float32, 4)]
    )
    mine = np.flatnonzero(ids[..., 0].reshape(-1) == disk.row + 1)
    if not len(mine):
        return pixels, added
    brought = np.zeros((ids.shape[0] * ids.shape[1], added.shape[1]), np.float32)
    brought[pixels] = added
    before = [each.reshape(-1, 4)[mine, :3] for each in (direct, indirect)]
    reflected = before[0] + before[1] + brought[mine, :3] + brought[mine, 3:6]
    points = _points(this, disk, mine)
    there = _fade(np.linalg.norm(points - disk.middle, axis=1) / disk.radius)[:, None]
    if background_color(this.settings) is None and not _shows_through(this):
        kept = there * [before[0] + brought[mine, :3], before[1] + brought[mine, 3:6]]
        shares = np.zeros_like(reflected)
    else:
        kept = np.zeros((2, *reflected.shape), np.float32)
        alone, drawn = (
            open_radiance(this, disk, points),
            _drawn_radiance(this, gpu, gbuffer, openings, disk, mine),
        )
        if drawn is not None:
            reflected = reflected + (alone - drawn)
        shares = 1.0 + there * (np.where(alone > 0.0, reflected / np.maximum(alone, 1e-30), 1.0) - 1.0)
    brought[mine, :3], brought[mine, 3:6] = kept[0] - before[0], kept[1] - before[1]
    brought[mine, 9:12] = shares
    shown = np.zeros(len(brought), np.bool_)  # numpy's union takes many times as long
    shown[pixels] = shown[mine] = True
    return np.flatnonzero(shown), brought[shown]


def _shows_through(this: Pass) -> bool:
    """Whether the environment is seen behind, or nothing, which is transparent."""
    return shows_environment(this) or this.settings.background == "transparent"


def _ground(this: Pass) -> _Disk:
    """The ground, which is the last of a scene's copies."""
    packed = this.packed
    row = int(np.argmax(packed.ids))
    low, high = packed.boxes[row].astype(np.float64)
    return _Disk((low + high) / 2.0, float((high - low)[0] / 2.0), row)


def _points(this: Pass, disk: _Disk, pixels: np.ndarray) -> np.ndarray:
    """(n, 3) float64 m, where the rays of (n,) pixels meet the ground."""
    origins, directions = this.view.pixel_rays(pixels)
    down = np.minimum(directions[:, 1], -1e-12)
    t = (disk.middle[1] - origins[:, 1]) / down
    return np.asarray(origins + t[:, None] * directions)


def _fade(away: np.ndarray) -> np.ndarray:
    """How much of the ground is there so far from its middle, of its radius: 1, falling smoothly to 0."""
    x = np.clip((1.0 - away) / (1.0 - _FULL), 0.0, 1.0)
    return np.asarray(x * x * (3.0 - 2.0 * x))


def _drawn_radiance(
    this: Pass, gpu: Gpu, gbuffer: GBuffer, openings: Openings, disk: _Disk, pixels: np.ndarray
) -> np.ndarray | None:
    """Return `open_radiance` in (n,) pixels of the ground by the random numbers of direct light, (n, 3): what
    both have too much of cancels, so that the ground is free of noise where nothing shades it.

    None where that is not to be had: surfaces glow that are no lamps, whose light the ground is to show.
    """
    packed, triangles = this.packed, scene_tables(this.packed, this.world, this.surfaces).emitters.triangles
    if len(triangles) > len(_of_lamps(this, triangles)):
        return None
    albedo = packed.materials["base_color"][packed.instances["material"][disk.row], :3]
    points = _points(this, disk, pixels)
    light = np.zeros((len(pixels), 3), np.float32)
    tables = scene_tables(packed, this.world, this.surfaces)
    _irradiance(tables, points.astype(np.float32), False, light)
    light *= albedo / np.float32(math.pi)
    if len(triangles) or len(packed.environment.rows):
        empty = World(this.threads)
        empty.update(pack(Scene()))
        shown = read_pixels(gpu, gbuffer, this.view, this.settings.seed)
        smoothing = this.settings.smoothing
        light += area_light(*shown, packed, empty, this.surfaces, openings, smoothing)[pixels, :3]
    return light


def _of_lamps(this: Pass, triangles: np.ndarray) -> np.ndarray:
    """Those EMITTER that are of lamps with a surface."""
    layout = this.packed.placed.layout
    first = np.cumsum(layout.copies) - layout.copies
    lamps = np.flatnonzero(np.isin(this.packed.ids, first[layout.lamps]))
    return np.asarray(triangles[np.isin(triangles["instance"], lamps)])


def open_radiance(this: Pass, disk: _Disk, points: np.ndarray) -> np.ndarray:
    """Return what the ground would reflect at (n, 3) points if nothing stood on it, (n, 3) float64 cd/m2: of
    punctual lights, the environment and lamps with a surface, not of what else glows."""
    tables = scene_tables(this.packed, this.world, this.surfaces)
    out = np.zeros((len(points), 3), np.float32)
    _irradiance(tables, points.astype(np.float32), True, out)
    material = this.packed.instances["material"][disk.row]
    albedo = this.packed.materials["base_color"][material, :3].astype(np.float64)
    return np.asarray(albedo / math.pi * (out + _lamp_irradiance(this, tables, disk, points)))


@jit
def _irradiance(tables, points, by_environment, out):
    """Write the irradiance, lx RGB, of (n, 3) float32 points that face up, by lights without a surface and,
    if asked for, by the environment."""
    around = (f32(0), f32(0), f32(0))
    if by_environment and has_environment(tables.environment):
        around = add(*environment_irradiance(tables.environment, (f32(0), f32(1), f32(0))))
    for i in range(len(points)):
        for c in range(3):
            out[i, c] = around[c]
        for k in range(len(tables.lights)):
            irradiance, _, wi = light_arriving(tables.lights[k], vec3(points[i]))
            for c in range(3):
                out[i, c] += irradiance[c] * max(wi[1], f32(0))


def _lamp_irradiance(this: Pass, tables: Tables, disk: _Disk, points: np.ndarray) -> np.ndarray:
    """(n, 3) lx of lamps with a surface at points of the ground, interpolated on a grid."""
    triangles = _of_lamps(this, tables.emitters.triangles)
    if not len(triangles):
        return np.zeros((len(points), 3))
    steps = disk.radius * np.linspace(-1.0, 1.0, _SIDE)
    x, z = np.meshgrid(steps, steps)
    grid = disk.middle + np.stack([x, np.zeros_like(x), z], axis=-1)
    light = np.stack([_triangle_light(triangles, row) for row in grid])
    place = ((points - disk.middle)[:, ::2] / disk.radius + 1.0) * (_SIDE - 1) / 2.0
    cell = np.clip(place.astype(np.int64), 0, _SIDE - 2)
    (u, v), (column, row) = (np.clip(place - cell, 0.0, 1.0).T[..., None], cell.T)
    near = light[row, column] * (1.0 - u) + light[row, column + 1] * u
    far = light[row + 1, column] * (1.0 - u) + light[row + 1, column + 1] * u
    return np.asarray(near * (1.0 - v) + far * v)


def _triangle_light(triangles: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(n, 3) lx that EMITTER triangles bring to (n, 3) points that face up; what of them is below counts as
    at the horizon.

    Source: Lambert's formula for polygons (Baum, Rushmeier and Winget, SIGGRAPH 1989, equation 7).
    """
    total = np.zeros((len(points), 3))
    for each in triangles:
        corner = each["corner"].astype(np.float64)
        corners = np.stack([corner, corner + each["edge1"], corner + each["edge2"]]) - points[:, None]
        corners[..., 1] = np.maximum(corners[..., 1], 0.0)
        unit = corners / np.maximum(np.linalg.norm(corners, axis=-1, keepdims=True), 1e-30)
        following = np.roll(unit, -1, axis=1)
        across = np.cross(unit, following)
        sine = np.linalg.norm(across, axis=-1)
        angle = np.arctan2(sine, (unit * following).sum(axis=-1))
        facing = ((points - corner) @ each["normal"].astype(np.float64) > 0.0) | bool(each["two_sided"])
        factor = np.abs((angle * across[..., 1] / np.maximum(sine, 1e-30)).sum(axis=1)) / 2.0
        total += (facing * factor)[:, None] * each["radiance"].astype(np.float64)
    return total
