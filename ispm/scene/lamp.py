"""What lamps with a surface are drawn as: meshes of measure 1, stretched, and black materials that glow."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache, lru_cache

import numpy as np

from ispm.scene.geodesic import geodesic
from ispm.scene.light import DiskLight, Light, PointLight, RectLight, SpotLight, as_lamp
from ispm.scene.material import Material
from ispm.scene.mesh import Mesh
from ispm.scene.rotation import facing

_CORNERS = 64  # of the polygon that stands for a disk
_CUTS = 8  # of each edge of the icosahedron that stands for a sphere
_MADE = 4096  # materials that are kept


@dataclass
class Glow(Material):
    """What a lamp's surface looks like: black, without reflections, it emits alone.

    beam  scale and offset of the cosine between a direction and the lamp's -Z, see `SpotLight.falloff`;
          without a cone all directions have 1
    """

    beam: tuple[float, float] = (0.0, 1.0)


def lamp_mesh(lamp: Light) -> Mesh:
    """Return the mesh that a lamp's `stretch` makes as large as it is: the same for all lamps of its kind.

    Disks and spheres have the area of what they stand for, as flux is proportional to it.
    """
    if isinstance(lamp, RectLight):
        return _square()
    return _disk() if isinstance(lamp, DiskLight) else _sphere()


def lamp_material(lamp: Light, called: str = "") -> Material:
    """Return what a lamp's surface looks like: the same object for equal lamps, not to be changed.

    called  in messages
    Raises SceneError for a value out of range.
    """
    shown = as_lamp(lamp, called)
    r, g, b = (float(v) for v in shown.intensity)
    beam = lamp.falloff if isinstance(lamp, SpotLight) else Glow.beam
    return _glowing((r, g, b), shown.shines_both_ways, beam)


def lamp_place(lamp: Light, world: np.ndarray) -> np.ndarray:
    """Return the (4, 4) matrix from the space of a lamp's mesh to the world; world: its node's, (4, 4)."""
    if isinstance(lamp, PointLight | SpotLight):  # which their nodes' scale leaves as they are
        turn = _turned(world[:3, 2]) if isinstance(lamp, SpotLight) else np.eye(3)
        world = np.block([[turn, world[:3, 3:]], [np.array([0.0, 0.0, 0.0, 1.0])]])
    return np.asarray(world @ np.diag([*as_lamp(lamp).stretch, 1.0]))


def _turned(back: np.ndarray) -> np.ndarray:
    """(3, 3) a rotation whose +Z lies along `back`."""
    return facing(back, np.array((0.0, 1.0, 0.0))) if back.any() else np.eye(3)


@lru_cache(_MADE)
def _glowing(emission: tuple[float, float, float], both: bool, beam: tuple[float, float]) -> Glow:
    return Glow((0.0, 0.0, 0.0), specular=0.0, emission=emission, double_sided=both, beam=beam)


@cache
def _square() -> Mesh:
    """A square of 1 m that faces -Z."""
    corners = np.array([(-0.5, -0.5, 0.0), (-0.5, 0.5, 0.0), (0.5, 0.5, 0.0), (0.5, -0.5, 0.0)])
    normals = np.tile((0.0, 0.0, -1.0), (4, 1))
    return Mesh(corners, np.array([(0, 1, 2), (0, 2, 3)]), normals, name="rectangle lamp")


@cache
def _disk() -> Mesh:
    """A regular polygon that faces -Z, of the area of the disk of radius 1 m."""
    angles = 2.0 * math.pi * np.arange(_CORNERS) / _CORNERS
    radius = math.sqrt(2.0 * math.pi / (_CORNERS * math.sin(2.0 * math.pi / _CORNERS)))
    rim = np.stack([radius * np.cos(angles), radius * np.sin(angles), np.zeros(_CORNERS)], axis=1)
    here = np.arange(_CORNERS)
    triangles = np.stack([np.full(_CORNERS, _CORNERS), np.roll(here, -1), here], axis=1)  # clockwise from +Z
    normals = np.tile((0.0, 0.0, -1.0), (_CORNERS + 1, 1))
    return Mesh(np.concatenate([rim, np.zeros((1, 3))]), triangles, normals, name="disk lamp")


@cache
def _sphere() -> Mesh:
    """A polyhedron of the area of the sphere of radius 1 m, with the sphere's normals."""
    points, triangles = geodesic(_CUTS)
    a, b, c = (points[triangles[:, k]] for k in range(3))
    area = 0.5 * float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())
    return Mesh(math.sqrt(4.0 * math.pi / area) * points, triangles, points, name="sphere lamp")
