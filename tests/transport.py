"""Scenes for the tests of light transport, the photons in them, and their pictures."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ispm.accel.surface import SurfaceTable, scene_tables
from ispm.accel.world import World
from ispm.gpu import Gpu
from ispm.library.common import lambert
from ispm.library.shapes import polygons
from ispm.lights.emission import emit_rays
from ispm.lights.openings import NO_WAYS, Ways
from ispm.lights.plan import plan_maps
from ispm.optics.records import EMITTED
from ispm.optics.texture import TextureTable
from ispm.photons.walk import Walk, walk
from ispm.renderer.picture import Frame
from ispm.renderer.renderer import Renderer
from ispm.scene.camera import Camera
from ispm.scene.light import PointLight
from ispm.scene.packed import Packed, pack
from ispm.scene.scene import Scene
from ispm.settings import Settings

SMALL = (160, 90)
SIDES = ("-x", "+x", "-y", "+y", "-z", "+z")


class Tracer:
    """A scene made ready for photons, without a graphics adapter; footprint: over which textures are
    averaged, as a share of its diagonal; part: of an instance's, at most."""

    def __init__(
        self, scene: Scene, threads: int = 2, footprint: float = 0.005, part: float = math.inf
    ) -> None:
        self.packed: Packed = pack(scene)
        self.world = World(threads)
        self.world.update(self.packed)
        textures = TextureTable.pack(self.packed.textures, self.packed.colors)
        self.surfaces = SurfaceTable(self.packed, textures, footprint * self.packed.diagonal, part)
        self.tables = scene_tables(self.packed, self.world, self.surfaces)

    def emit(self, count: int, seed: int = 0) -> np.ndarray:
        """Return EMITTED photons, `count` from each light, drawn as rays."""
        counts = np.full(len(self.packed.lights), count)
        plan = plan_maps(self.packed, counts, 0.0, seed, 0)
        return emit_rays(self.packed, self.world, self.surfaces, plan, seed, 0)

    def walk(
        self, emitted: np.ndarray, bounces: int, seed: int = 0, limit: float = math.inf, ways: Ways = NO_WAYS
    ) -> Walk:
        """Follow photons from their first hits; limit, ways: as of `walk`."""
        return walk(self.packed, self.world, self.surfaces, emitted, bounces, seed, 0, limit, ways)


def trace(scene: Scene, count: int, bounces: int, seed: int = 0, threads: int = 2) -> Walk:
    """Return what becomes of `count` photons from each light."""
    tracer = Tracer(scene, threads)
    return tracer.walk(tracer.emit(count, seed), bounces, seed)


def render(
    gpu: Gpu, scene: Scene, camera: Camera | None = None, *, threads: int | None = None, **settings: Any
) -> tuple[Frame, np.ndarray]:
    """Return a small picture and its photons."""
    settings = {"size": SMALL, **settings}
    with Renderer(scene, Settings(**settings), camera, threads=threads, gpu=gpu) as renderer:
        return renderer.render(), renderer.photons()


def box_room(
    low: tuple[float, ...] = (-0.5,) * 3, high: tuple[float, ...] = (0.5,) * 3, albedo: float = 0.5
) -> Scene:
    """A closed Lambert room whose walls are nodes of their own, in the order of SIDES. Black ones keep no
    photons; those of an albedo of a millionth do, and send none on."""
    scene = Scene(name="room")
    corner = np.array([[(low, high)[i >> k & 1][k] for k in range(3)] for i in range(8)])
    faces = ([0, 2, 6, 4], [1, 5, 7, 3], [0, 4, 5, 1], [2, 3, 7, 6], [0, 1, 3, 2], [4, 6, 7, 5])
    for name, face in zip(SIDES, faces, strict=True):
        scene.add(polygons([corner[face]], name), material=lambert((albedo,) * 3, name))
    return scene


def lit(
    scene: Scene, position: tuple[float, ...] = (0.0, 0.0, 0.0), flux: float = 4.0 * np.pi, **light: Any
) -> Scene:
    """Add a white point light of `flux` lm per channel; return the scene."""
    scene.add(PointLight((flux / (4.0 * np.pi),) * 3, **light), name="light", translation=position)
    return scene


def on_instance(packed: Packed, instance: int, count: int, seed: int, flux: float = 1.0) -> np.ndarray:
    """Return `count` EMITTED photons of `flux` lm together, even over one instance of equal triangles."""
    random = np.random.default_rng(seed)
    rows = np.zeros(count, EMITTED)
    u, v = random.random((2, count), np.float32)
    folded = u + v > 1.0
    rows["u"], rows["v"] = np.where(folded, 1 - u, u), np.where(folded, 1 - v, v)
    rows["instance"] = instance
    rows["primitive"] = random.integers(0, packed.instances["triangle_count"][instance], count)
    rows["flux"] = flux / count
    rows["key"] = np.arange(count)
    return rows


def aim(tracer: Tracer, origins: np.ndarray, directions: np.ndarray, flux: float = 1.0) -> np.ndarray:
    """Return EMITTED photons of the first light along rays, (N, 3) each, of `flux` lm together."""
    hits = tracer.world.trace(np.float32(origins), np.float32(directions))
    rows = np.zeros(len(hits), EMITTED)
    for name in ("instance", "primitive", "u", "v"):
        rows[name] = hits[name]
    rows["flux"], rows["key"] = flux / len(hits), np.arange(len(hits))
    return rows


def total(photons: np.ndarray) -> np.ndarray:
    """Return the (3,) float64 flux of photons together."""
    return np.asarray(photons["flux"].astype(np.float64).sum(axis=0))
