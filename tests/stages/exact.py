"""Small scenes and their exact answers: every ray against every triangle, in float64."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ispm.lights.lightmap import CUBE_AXES, LightMap, face_directions
from ispm.scene.camera import look_at_pose
from ispm.scene.light import PointLight
from ispm.scene.material import Material
from ispm.scene.mesh import Mesh
from ispm.scene.packed import Packed, pack
from ispm.scene.scene import Scene
from ispm.stages.camera import CameraView


def sphere(rings: int = 8, sectors: int = 12, radius: float = 1.0) -> Mesh:
    """A sphere of triangles with smooth normals."""
    theta, phi = np.meshgrid(
        np.linspace(0.0, np.pi, rings + 1), np.linspace(0.0, 2.0 * np.pi, sectors + 1), indexing="ij"
    )
    n = np.stack([np.sin(theta) * np.cos(phi), np.cos(theta), -np.sin(theta) * np.sin(phi)], -1)
    i, j = np.meshgrid(np.arange(rings), np.arange(sectors), indexing="ij")
    a = i * (sectors + 1) + j
    b = a + sectors + 1
    quads = np.stack([a, b, b + 1, a, b + 1, a + 1], -1).reshape(-1, 3)
    n = n.reshape(-1, 3)
    return Mesh(n * radius, quads[_has_area(n, quads)], n)


def _has_area(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    p = points[triangles]
    return np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1) > 1e-9


def quad(size: float = 1.0) -> Mesh:
    """A square of side 2 `size` about the origin, facing +Y."""
    corners = size * np.array([[-1, 0, -1], [-1, 0, 1], [1, 0, 1], [1, 0, -1]], float)
    uv = np.array([[0, 0], [0, 1], [1, 1], [1, 0]], float)
    return Mesh(corners, [[0, 1, 2], [0, 2, 3]], np.tile([0.0, 1.0, 0.0], (4, 1)), uv0=uv)


def mixed_scene() -> Scene:
    """A floor, a sphere, a mirrored and squashed sphere, and a single-sided quad seen from behind."""
    scene = Scene()
    scene.add(quad(4.0), material=Material(base_color=(0.5, 0.25, 0.75), double_sided=True))
    ball = sphere()
    scene.add(ball, translation=(-1.2, 1.1, 0.0), material=Material(metallic=0.5, roughness=0.3))
    scene.add(ball, translation=(1.2, 0.9, -0.5), scale=(-0.8, 0.5, 1.1), rotation=(0.2, 0.3, 0.1, 0.9))
    backwards = (-(0.5**0.5), 0.0, 0.0, 0.5**0.5)
    scene.add(quad(0.7), translation=(0.0, 1.5, 1.5), rotation=backwards)  # single-sided: not for the eye
    scene.add(PointLight((10.0, 20.0, 30.0)), translation=(0.3, 3.0, 0.8))
    return scene


def view_of(size: tuple[int, int] = (160, 90), **options: Any) -> CameraView:
    """A camera that sees all of `mixed_scene`."""
    pose = look_at_pose(np.array([0.4, 1.6, 5.0]), np.array([0.0, 0.8, 0.0]))
    return CameraView(size, pose, **{"near": 0.01, **options})


@dataclass
class Triangles:
    """All triangles of a scene in world space."""

    corners: np.ndarray  # (T, 3, 3)
    instance: np.ndarray  # (T,)
    primitive: np.ndarray  # (T,) within its mesh
    front: np.ndarray  # (T, 3) unit, out of the side that is counter-clockwise in object space


def triangles_of(packed: Packed) -> Triangles:
    """Place every triangle of `packed`, in float64."""
    corners, instance, primitive, front = [], [], [], []
    for row, record in enumerate(packed.instances):
        first, count = int(record["first_index"]), int(record["triangle_count"])
        rows = packed.geometry.indices[first : first + 3 * count].reshape(-1, 3)
        matrix = np.stack([record["world0"], record["world1"], record["world2"]]).astype(np.float64)
        local = packed.geometry.vertices["position"][rows].astype(np.float64)
        world = local @ matrix[:, :3].T + matrix[:, 3]
        normal = np.cross(world[:, 1] - world[:, 0], world[:, 2] - world[:, 0])
        normal *= np.sign(np.linalg.det(matrix[:, :3])) / np.linalg.norm(normal, axis=1)[:, None]
        corners.append(world)
        instance.append(np.full(count, row))
        primitive.append(np.arange(count))
        front.append(normal)
    return Triangles(*map(np.concatenate, (corners, instance, primitive, front)))


def cast(
    triangles: Triangles, origins: np.ndarray, directions: np.ndarray, visible: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Nearest hits: row of the triangle (-1: none), distance, barycentrics of corners 1 and 2.

    origins, directions  (N, 3);  visible  (N, T) which triangles each ray may meet
    """
    a = triangles.corners[:, 0]
    e1, e2 = triangles.corners[:, 1] - a, triangles.corners[:, 2] - a
    p = np.cross(directions[:, None], e2[None])
    det = np.einsum("ntk,tk->nt", p, e1)
    with np.errstate(divide="ignore", invalid="ignore"):
        s = origins[:, None] - a[None]
        u = np.einsum("ntk,ntk->nt", s, p) / det
        q = np.cross(s, e1[None])
        v = np.einsum("nk,ntk->nt", directions, q) / det
        t = np.einsum("tk,ntk->nt", e2, q) / det
        hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 1e-9)
    if visible is not None:
        hit &= visible
    t = np.where(hit, t, np.inf)
    best = t.argmin(axis=1)
    rows = np.arange(len(best))
    distance = t[rows, best]
    barycentrics = np.stack([u[rows, best], v[rows, best]], -1)
    return np.where(np.isfinite(distance), best, -1), distance, barycentrics


def cube_direction(
    face: np.ndarray | int,
    x: np.ndarray | int,
    y: np.ndarray | int,
    width: int,
    shift: tuple[float, float] = (0.0, 0.0),
) -> np.ndarray:
    """Unit directions, (..., 3), that texels (x, y) of a cube's faces sample."""
    s, t = (2.0 * (np.asarray(k) + 0.5 + d) / width - 1.0 for k, d in zip((x, y), shift, strict=True))
    right, down, axis = np.moveaxis(CUBE_AXES[face], -2, 0)
    way = axis + s[..., None] * right + t[..., None] * down
    return np.asarray(way / np.linalg.norm(way, axis=-1, keepdims=True))


def map_rays(
    map: LightMap, width: int, shift: tuple[float, float] = (0.0, 0.0)
) -> tuple[np.ndarray, np.ndarray]:
    """Origins and unit directions, (F, width, width, 3), of the rays that a map's texels stand for.

    Those of an orthographic map start at its near plane.
    """
    s, t = (2.0 * (np.arange(width) + 0.5 + k) / width - 1.0 for k in shift)
    shape = (len(map.axes), width, width, 3)
    if not map.orthographic:
        directions = np.stack([face_directions(axes, s, t[:, None]) for axes in map.axes])
        return np.broadcast_to(map.origin, shape), directions
    inverse = map.axes[0] / (map.axes[0] ** 2).sum(axis=1, keepdims=True)
    place = np.stack(np.broadcast_arrays(s, t[:, None], -1.0), axis=-1) @ inverse
    axis = inverse[2] / np.linalg.norm(inverse[2])
    return (map.origin + place)[None], np.broadcast_to(axis, shape)


def interior(labels: np.ndarray) -> np.ndarray:
    """Where all eight neighbours have the same label: away from edges, and from the picture's border."""
    padded = np.pad(labels, 1, constant_values=-2)
    h, w = labels.shape
    shifts = [(dy, dx) for dy in range(3) for dx in range(3)]
    return np.all([padded[dy : dy + h, dx : dx + w] == labels for dy, dx in shifts], axis=0)


def packed_mixed() -> Packed:
    """`mixed_scene`, packed."""
    return pack(mixed_scene())
