"""What lamps with a surface are drawn as: meshes of measure 1, stretched, and black materials that glow."""

from __future__ import annotations

import math
from functools import cache, lru_cache

import numpy as np

from ispm.scene.geodesic import geodesic
from ispm.scene.light import DiskLight, Light, PointLight, RectLight, as_lamp
from ispm.scene.material import Material
from ispm.scene.mesh import Mesh

_CORNERS = 64  # of the polygon that stands for a disk
_CUTS = 8  # of each edge of the icosahedron that stands for a sphere
_MADE = 4096  # materials that are kept


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
    return _glowing((r, g, b), shown.shines_both_ways)


def lamp_place(lamp: Light, world: np.ndarray) -> np.ndarray:
    """Return the (4, 4) matrix from the space of a lamp's mesh to the world; world: its node's, (4, 4)."""
    if isinstance(lamp, PointLight):  # which its node's scale leaves as it is
        world = np.block([[np.eye(3), world[:3, 3:]], [np.array([0.0, 0.0, 0.0, 1.0])]])
    return np.asarray(world @ np.diag([*as_lamp(lamp).stretch, 1.0]))


@lru_cache(_MADE)
def _glowing(emission: tuple[float, float, float], both: bool) -> Material:
    """A surface that emits alone: black, without reflections."""
    return Material((0.0, 0.0, 0.0), specular=0.0, emission=emission, double_sided=both)


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
