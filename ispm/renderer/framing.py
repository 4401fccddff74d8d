"""A camera and a light for scenes that bring none."""

from __future__ import annotations

import math

import numpy as np

from ispm.errors import SceneError
from ispm.optics.records import NO_HIT
from ispm.scene.camera import Camera, look_at_pose
from ispm.scene.light import PointLight
from ispm.scene.packed import Packed
from ispm.scene.scene import Node, Scene
from ispm.tracer.world import World

_PROBES = 512  # rays from the scene's centre that tell a room from an object
_FROM = np.array([0.45, 0.35, 1.0])  # where an object is seen from: front, a little right and above
_SUN = np.array([0.6, 1.0, 0.7])
_VERTICES = 20_000  # looked at to frame a scene
_CLEARANCE = 0.02  # of the diagonal, between the eye and the scene
_MARGIN = 1.08  # about what is framed
_YFOV = math.radians(50.0)
_ROOM_YFOV = math.radians(70.0)


def find_camera(scene: Scene, wanted: str | int | None) -> tuple[Camera, np.ndarray] | None:
    """Return the camera called `wanted`, or of that index, or the first, and its pose.

    ->  None where the scene has no camera and none was asked for
    Raises SceneError where there is no such camera.
    """
    placed = [(node, world) for node, world in scene.placed() if node.camera is not None]
    if wanted is None:
        chosen = placed[:1]
    else:
        text = str(wanted)
        chosen = [(n, w) for n, w in placed if n.camera and text in (n.name, n.camera.name)]
        if not chosen and text.isdigit() and int(text) < len(placed):
            chosen = [placed[int(text)]]
        if not chosen:
            names = ", ".join(f"{i}: '{node.name}'" for i, (node, _) in enumerate(placed)) or "none"
            raise SceneError(f"there is no camera '{wanted}'; the scene has {names}")
    if not chosen:
        return None
    node, world = chosen[0]
    assert node.camera is not None
    pose = node.camera.pose if node.camera.pose is not None else rigid(world)
    return node.camera, pose


def rigid(matrix: np.ndarray) -> np.ndarray:
    """Return the pose in `matrix`: its translation, and its rotation without scale (glTF 2.0, 3.10.2)."""
    pose = np.eye(4)
    pose[:3, 3] = matrix[:3, 3]
    back = matrix[:3, 2] / max(float(np.linalg.norm(matrix[:3, 2])), 1e-30)
    right = np.cross(matrix[:3, 1], back)
    right /= max(float(np.linalg.norm(right)), 1e-30)
    pose[:3, 0], pose[:3, 1], pose[:3, 2] = right, np.cross(back, right), back
    return pose


def is_room(packed: Packed, world: World) -> bool:
    """Whether most rays from the middle of the scene meet front faces: a room seen from inside."""
    low, high = packed.bounds
    center = np.broadcast_to(((low + high) / 2.0).astype(np.float32), (_PROBES, 3))
    directions = _sphere(_PROBES)
    hits = world.trace(center, directions)
    hit = hits["instance"] != NO_HIT
    if hit.mean() < 0.8:
        return False
    rows = packed.instances[hits["instance"][hit]]
    first = rows["first_index"].astype(np.int64) + 3 * hits["primitive"][hit]
    corners = [packed.geometry.vertices["position"][packed.geometry.indices[first + k]] for k in range(3)]
    flat = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    matrix = np.stack([rows[f"normal{k}"][:, :3] for k in range(3)], axis=1)
    normals = np.einsum("nij,nj->ni", matrix, flat)
    facing = np.einsum("ni,ni->n", normals, directions[hit])
    return bool((facing < 0.0).mean() > 0.5)


def default_camera(packed: Packed, world: World, aspect: float) -> tuple[Camera, np.ndarray]:
    """Return a camera that frames the scene from outside, or from within where it is a room."""
    low, high = packed.bounds
    center, size = (low + high) / 2.0, high - low
    if is_room(packed, world):
        # from the middle of the shorter horizontal side, looking along the longer one
        axis = 0 if size[0] > size[2] else 2
        eye = center.copy()
        eye[1] = low[1] + 0.45 * size[1]
        back = np.zeros(3)
        back[axis] = 1.0
        free = world.trace(eye[None].astype(np.float32), back[None].astype(np.float32))["t"][0]
        eye[axis] += 0.9 * min(float(free), float(size[axis]))
        target = center.copy()
        target[1] = eye[1] - 0.05 * size[1]
        return Camera(yfov=_ROOM_YFOV), look_at_pose(eye, target)
    back = _FROM / np.linalg.norm(_FROM)
    pose = look_at_pose(center + back, center)
    offsets = _some_vertices(packed) - center
    across, depth = offsets @ pose[:3, :2], offsets @ back
    half = math.tan(_YFOV / 2.0) / _MARGIN * np.array([aspect, 1.0])
    # The eye at (s, d) sees a point (u, z) where |u - s| <= half (d - z): the least d that suits them all.
    ahead = (across + half * depth[:, None]).max(axis=0)
    behind = (half * depth[:, None] - across).max(axis=0)
    fits = float(((ahead + behind) / (2.0 * half)).max())
    distance = max(fits, float(depth.max()) + _CLEARANCE * packed.diagonal)
    pose[:3, 3] = center + distance * back + pose[:3, :2] @ ((ahead - behind) / 2.0)
    return Camera(yfov=_YFOV), pose


def _some_vertices(packed: Packed) -> np.ndarray:
    """(n, 3) vertices of the scene in world space, evenly thinned where there are very many."""
    share = max(1, packed.triangle_count // _VERTICES)
    found: list[np.ndarray] = []
    for row in packed.instances:
        first, count = int(row["first_index"]), 3 * int(row["triangle_count"])
        indices = packed.geometry.indices[first : first + count : min(share, max(count // 8, 1))]
        matrix = np.stack([row["world0"], row["world1"], row["world2"]]).astype(np.float64)
        points = packed.geometry.vertices["position"][indices]
        found.append(points @ matrix[:, :3].T + matrix[:, 3])
    return np.concatenate(found)


def default_light(packed: Packed, world: World, eye: np.ndarray) -> tuple[Node, str]:
    """Return a node with a light for a scene without one, and a line that says so.

    A room gets a lamp near the camera, an object a far lamp like the sun. A white surface facing it
    then has a radiance of about 1 cd/m2, which suits emissive materials of factor 1.
    """
    low, high = packed.bounds
    center = (low + high) / 2.0
    if is_room(packed, world):
        position = eye + 0.15 * (center - eye)
        position[1] += 0.3 * (high[1] - position[1])
        kind = "a lamp near the camera"
        distance = packed.diagonal / 3.0
    else:
        distance = 20.0 * packed.diagonal
        position = center + distance * _SUN / np.linalg.norm(_SUN)
        kind = "a lamp far away, like the sun"
    intensity = math.pi * distance * distance
    node = Node("default light", translation=position, light=PointLight((intensity,) * 3))
    return node, f"the scene has no light; {kind} lights it"


def _sphere(count: int) -> np.ndarray:
    """(count, 3) float32 directions, evenly spread (a Fibonacci lattice)."""
    k = np.arange(count) + 0.5
    y = 1.0 - 2.0 * k / count
    r, phi = np.sqrt(1.0 - y * y), k * (math.pi * (3.0 - math.sqrt(5.0)))
    return np.stack([r * np.cos(phi), y, r * np.sin(phi)], axis=1).astype(np.float32)
