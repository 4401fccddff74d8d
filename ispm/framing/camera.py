"""A camera for scenes that bring none: the same for all moments of their animations."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import product

import numpy as np

from ispm.accel.world import World
from ispm.errors import SceneError, SettingsError
from ispm.framing.interior import interior_viewpoint
from ispm.optics.records import NO_HIT
from ispm.scene.camera import Camera, look_at_pose
from ispm.scene.extent import enclosing_diameter
from ispm.scene.light import has_surface
from ispm.scene.packed import Packed, farthest_points, pack, to_world
from ispm.scene.placing import Tree
from ispm.scene.pose import is_posed, shown_shapes
from ispm.scene.scene import Scene
from ispm.settings import Settings

_FROM = np.array([0.45, 0.35, 1.0])  # where an object is seen from: front, a little right and above
_VERTICES = 20_000  # that a camera is fitted to
_CLEARANCE = 0.02  # of the diagonal, between the eye and the scene
_MARGIN = 1.08  # about what is framed
_MOMENTS = 24  # evenly over animations, at which meshes that deform are looked at
_HORIZONTAL = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]])
NO_POINTS = np.zeros((0, 3))
_FAR_OFF = (
    1e4  # times its size that a scene may stand from the origin; at 3e4 it has lost 5 % of its indirect light
)
_SMALLEST, _LARGEST = 1e-6, 1e9  # m that a scene may be across: beyond, its squares' squares leave float32
_YFOV = math.radians(50.0)
_ROOM_YFOV = math.radians(70.0)


def find_camera(
    scene: Scene, wanted: str | int | None, tree: Tree | None = None
) -> tuple[Camera, np.ndarray] | None:
    """Return the camera called `wanted`, or of that index, or the first, and its (4, 4) pose.

    tree  the scene's, where it is at hand
    ->  None where the scene has no camera and none was asked for
    Raises SceneError where there is no such camera.
    """
    tree = scene.tree() if tree is None else tree
    placed = [(node, tree.world(k)) for k, node in enumerate(tree.nodes) if node.camera is not None]
    for node, _ in placed:
        node.check()
    if wanted is None:
        chosen = placed[:1]
    else:
        text = str(wanted)
        chosen = [(n, w) for n, w in placed if n.camera and text in (n.name, n.camera.name)]
        if not chosen and text.isdigit() and int(text) < len(placed):
            chosen = [placed[int(text)]]
        if not chosen:
            names = ", ".join(f"{i} '{node.name}'" for i, (node, _) in enumerate(placed))
            those = f"those of the scene are: {names}" if names else "the scene has none"
            raise SceneError(f"there is no camera '{wanted}'; {those}")
    if not chosen:
        return None
    node, world = chosen[0]
    assert node.camera is not None
    node.camera.check()
    pose = node.camera.pose if node.camera.pose is not None else rigid(world)
    return node.camera, pose


def given_camera(
    scene: Scene, camera: Camera | str | int | None, tree: Tree | None = None
) -> tuple[Camera, np.ndarray] | None:
    """Return the camera to look through and its (4, 4) pose: the one asked for, or the scene's first.

    tree  the scene's, where it is at hand
    ->  None where the scene has no camera and none was asked for
    Raises SettingsError for a camera without a pose, SceneError for one that the scene does not have.
    """
    if isinstance(camera, Camera):
        if camera.pose is None:
            raise SettingsError("camera: it has no pose; give one, or add it to the scene")
        camera.check()
        return camera, np.asarray(camera.pose, np.float64)
    if camera is not None and not isinstance(camera, (str, int)):
        raise SettingsError(
            f"camera: must be a Camera, or the name or index of one of the scene's, not {camera!r}"
        )
    return find_camera(scene, camera, tree)


def camera_of(scene: Scene, size: tuple[int, int]) -> Camera:
    """Return what `Scene.default_camera` promises."""
    found = given_camera(scene, None)
    if found is None:
        packed, world = pack(without_lamps(scene)), World()
        require_visible(scene, packed)
        world.update(packed)
        width, height = Settings(size=size).size
        found = default_camera(packed, world, width / height, passed_points(scene))
    camera, pose = found
    return replace(camera, pose=pose)


def require_visible(scene: Scene, packed: Packed) -> None:
    """Raise SceneError for a scene of nothing to see, or one of a size that float32 cannot serve."""
    if not packed.triangle_count:
        if scene.environment is not None:
            return
        raise SceneError(
            f"{scene.name or 'the scene'}: has no surface to render; add a mesh, or an environment to see"
        )
    if not _SMALLEST < packed.diagonal < _LARGEST:
        raise SceneError(
            f"{scene.name or 'the scene'}: is {packed.diagonal:.3g} m across; scale it to between "
            f"{_SMALLEST:g} and {_LARGEST:g} m, and its lights' intensity by the square"
        )


def far_off(packed: Packed) -> str:
    """Return a line about a scene that stands where float32 is too coarse for it; else an empty one."""
    away = float(np.abs(packed.bounds).max())
    if away <= _FAR_OFF * packed.diagonal:
        return ""
    step = float(np.spacing(np.float32(away)))
    return (
        f"the scene is {packed.diagonal:.3g} m across and stands {away:.3g} m from the origin, where places "
        f"are rounded to {step:.2g} m: light is lost and edges are rough; move it to the origin"
    )


def without_lamps(scene: Scene) -> Scene:
    """Return the scene at rest as cameras frame it: without lamps, unless there is nothing else to see.

    Raises SceneError where something that cannot be drawn stands at a node.
    """
    rest = scene.at_rest()
    for node in rest.nodes:
        node.check()
    if any(len(part.mesh.triangles) and node.copies for node in rest.nodes for part in node.parts):
        for node in rest.nodes:
            if has_surface(node.light):
                node.light = None
    return rest


def passed_points(scene: Scene) -> np.ndarray:
    """Return (n, 3) points, m in world space, near the hull of where animations take things."""
    found = [np.zeros((0, 3))]
    for node, worlds in scene.trajectories():
        still = [part.mesh for part in node.parts if not is_posed(node, part.mesh)]
        hulls = [farthest_points(mesh) for mesh in still if len(mesh.triangles)]
        if not hulls or not node.copies:
            continue
        points = np.concatenate(hulls)
        if node.instances is not None:
            points = _box_corners(_moved(points, node.instances))
        found.append(_moved(points, worlds))
    return np.concatenate([*found, *_bent_points(scene)])


def _bent_points(scene: Scene) -> Iterator[np.ndarray]:
    """(n, 3) points near the hulls of meshes that deform, at moments of the animations in play."""
    if not any(is_posed(node, part.mesh) for node in scene.nodes for part in node.parts):
        return
    playing = [a for a in scene.animations if scene.playing in (None, a.name)]
    ends = [float(channel.times[k]) for a in playing for channel in a.channels for k in (0, -1)]
    for time in np.linspace(min(ends), max(ends), _MOMENTS) if ends else ():
        tree = scene.at(float(time), scene.playing).tree()
        rows = [
            k for k, node in enumerate(tree.nodes) if any(is_posed(node, part.mesh) for part in node.parts)
        ]
        for mesh, places in shown_shapes(tree.nodes, tree.worlds(), rows):
            points = farthest_points(mesh)
            if len(places) > 1:
                points = _box_corners(points)
            yield _moved(points, places)


def _moved(points: np.ndarray, matrices: np.ndarray) -> np.ndarray:
    """Return (n, 3) points moved by each of (m, 4, 4) matrices, (m n, 3)."""
    placed: np.ndarray = points @ matrices[:, :3, :3].swapaxes(1, 2) + matrices[:, None, :3, 3]
    return placed.reshape(-1, 3)


def _box_corners(points: np.ndarray) -> np.ndarray:
    """(8, 3) corners of the box along the axes round (n, 3) points."""
    return np.array(list(product(*zip(points.min(axis=0), points.max(axis=0), strict=True))))


def rigid(matrix: np.ndarray) -> np.ndarray:
    """Return the pose in `matrix`: its translation, and its rotation without scale (glTF 2.0, 3.10.2)."""
    pose = np.eye(4)
    pose[:3, 3] = matrix[:3, 3]
    back = matrix[:3, 2] / max(float(np.linalg.norm(matrix[:3, 2])), 1e-30)
    right = np.cross(matrix[:3, 1], back)
    right /= max(float(np.linalg.norm(right)), 1e-30)
    pose[:3, 0], pose[:3, 1], pose[:3, 2] = right, np.cross(back, right), back
    return pose


def default_camera(
    packed: Packed, world: World, aspect: float, passed: np.ndarray = NO_POINTS
) -> tuple[Camera, np.ndarray]:
    """Return a camera that frames the scene from outside, or from within where it is a room.

    aspect  width over height of the picture
    passed  (n, 3) m, points that moving things pass
    """
    if not packed.triangle_count:  # what surrounds it is seen, towards its middle
        return Camera(yfov=_ROOM_YFOV), np.eye(4)
    viewpoint = interior_viewpoint(packed, world)
    if viewpoint is not None:
        return _camera_of_room(packed, world, viewpoint, aspect)
    low, high, diagonal = extent(packed, passed)
    center = (low + high) / 2.0
    back = _FROM / np.linalg.norm(_FROM)
    pose = look_at_pose(center + back, center)
    offsets = np.concatenate([_some_vertices(packed), passed]) - center
    across, depth = offsets @ pose[:3, :2], offsets @ back
    half = math.tan(_YFOV / 2.0) / _MARGIN * np.array([aspect, 1.0])
    # The eye at (s, d) sees a point (u, z) where |u - s| <= half (d - z): the least d that suits them all.
    ahead = (across + half * depth[:, None]).max(axis=0)
    behind = (half * depth[:, None] - across).max(axis=0)
    fits = float(((ahead + behind) / (2.0 * half)).max())
    distance = max(fits, float(depth.max()) + _CLEARANCE * diagonal)
    pose[:3, 3] = center + distance * back + pose[:3, :2] @ ((ahead - behind) / 2.0)
    return Camera(yfov=_YFOV), pose


def extent(packed: Packed, passed: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """The corners of the box round a scene and what passes, and the diameter of both, m."""
    low, high = packed.bounds
    if not len(passed):
        return low, high, packed.diagonal
    low, high = np.minimum(low, passed.min(axis=0)), np.maximum(high, passed.max(axis=0))
    return low, high, enclosing_diameter(np.concatenate([packed.boxes.reshape(-1, 3), passed]))


def _camera_of_room(
    packed: Packed, world: World, viewpoint: np.ndarray, aspect: float
) -> tuple[Camera, np.ndarray]:
    """A camera that looks through a room in its longest horizontal direction, at eye height; or that sees
    the whole of its open side, from in front of it."""
    low, high = packed.bounds
    size = high - low
    up, down = np.minimum(free_way(world, viewpoint, np.array([[0.0, 1.0, 0.0], [0.0, -1.0, 0.0]])), size[1])
    eye = viewpoint + np.array([0.0, 0.45 * (up + down) - down, 0.0])
    free = np.minimum(free_way(world, eye, _HORIZONTAL), np.abs(_HORIZONTAL) @ size)
    longest = int((free + 0.5 * np.roll(free, 2)).argmax())  # an open side is one to look in by
    back, aside = _HORIZONTAL[longest], np.abs(_HORIZONTAL[longest - 1])
    eye = eye + 0.9 * free[longest] * back
    depth = float(size @ np.abs(back))
    if (eye < low).any() or (eye > high).any():
        distance = _MARGIN * max(size[1], float(size @ aside) / aspect) / 2.0 / math.tan(_YFOV / 2.0)
        center = (low + high) / 2.0
        return Camera(yfov=_YFOV), look_at_pose(center + (0.5 * depth + distance) * back, center)
    target = eye - 0.5 * depth * back - np.array([0.0, 0.05 * (up + down), 0.0])
    return Camera(yfov=_ROOM_YFOV), look_at_pose(eye, target)


def free_way(world: World, origin: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Return (n,) m free from a point in (n, 3) directions; infinite where nothing is met."""
    hits = world.trace(
        np.tile(origin, (len(directions), 1)).astype(np.float32), directions.astype(np.float32)
    )
    return np.where(hits["instance"] == NO_HIT, np.inf, hits["t"]).astype(np.float64)


def _some_vertices(packed: Packed) -> np.ndarray:
    """(n, 3) vertices of the scene in world space, evenly thinned where there are very many."""
    share = max(1, packed.triangle_count // _VERTICES)
    found: list[np.ndarray] = []
    for row in packed.instances:
        first, count = int(row["first_index"]), 3 * int(row["triangle_count"])
        indices = packed.geometry.indices[first : first + count : min(share, max(count // 8, 1))]
        matrix = to_world(row).astype(np.float64)
        points = packed.geometry.vertices["position"][indices]
        found.append(points @ matrix[:, :3].T + matrix[:, 3])
    return np.concatenate(found)
