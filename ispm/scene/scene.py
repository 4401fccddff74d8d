"""A scene: nodes that place meshes, lights and cameras, and animations that move them."""

from __future__ import annotations

import copy
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, NoReturn, TypeVar

import numpy as np

from ispm.errors import SceneError
from ispm.scene.animation import Animation, Channel
from ispm.scene.camera import Camera
from ispm.scene.light import DirectionalLight, Light, PointLight, SpotLight
from ispm.scene.material import Material
from ispm.scene.mesh import Mesh
from ispm.scene.values import FARTHEST, array_of, require

_Kind = TypeVar("_Kind")
_PLACE = ("translation", "rotation", "scale", "matrix")
_MOST_AGAIN = 100_000  # places of nodes that hang in another one, too
_MOMENTS = 64  # evenly over an animation, at which it is asked where it takes things
_KEYS = 256  # likewise, of its own


@dataclass(eq=False)
class Part:
    """A mesh with the material it wears."""

    mesh: Mesh
    material: Material


@dataclass(eq=False)
class Node:
    """A place in the scene and what stands there. Compared by identity.

    translation, scale   (3,) metres and factors
    rotation             (4,) quaternion x, y, z, w, of any length but 0
    matrix               (4, 4) used instead of the three where given; last row 0 0 0 1
    instances            (n, 4, 4) where the parts stand n times, from each copy to this node; None: once
    rest                 of a node that `Scene.at` moved: the one it was before, for its place
    """

    name: str = ""
    translation: tuple[float, float, float] | np.ndarray = (0.0, 0.0, 0.0)
    rotation: tuple[float, float, float, float] | np.ndarray = (0.0, 0.0, 0.0, 1.0)
    scale: tuple[float, float, float] | np.ndarray = (1.0, 1.0, 1.0)
    matrix: np.ndarray | None = None
    parts: list[Part] = field(default_factory=list)
    instances: np.ndarray | None = None
    light: Light | None = None
    camera: Camera | None = None
    children: list[Node] = field(default_factory=list)
    rest: Node | None = field(default=None, repr=False)

    @property
    def copies(self) -> int:
        """How many times the parts are placed."""
        return 1 if self.instances is None else len(self.instances)

    def places(self, world: np.ndarray) -> np.ndarray:
        """Return the (copies, 4, 4) matrices that take the parts to the world.

        world  (4, 4), this node's own
        """
        instances = self.instances
        return world[None] if instances is None else world @ instances

    def check(self) -> None:
        """Raise SceneError where something that cannot be drawn stands here."""
        for part in _listed(self, "parts", Part):
            mesh: object = part.mesh
            material: object = part.material
            if not (isinstance(mesh, Mesh) and isinstance(material, Material)):
                held = f"{type(mesh).__name__} and a {type(material).__name__}"
                raise SceneError(f"node '{self.name}': a part must be of a Mesh and a Material, not a {held}")
        _require_kind(self, "light", PointLight | SpotLight | DirectionalLight | None)
        _require_kind(self, "camera", Camera | None)
        if self.instances is not None:
            self.instances = array_of(f"node '{self.name}': instances", self.instances, (None, 4, 4))

    def local_matrix(self) -> np.ndarray:
        """Return the (4, 4) matrix that takes this node's space to its parent's.

        Raises SceneError where there is none.
        """
        if self.matrix is not None:
            matrix = np.asarray(array_of(f"node '{self.name}': matrix", self.matrix, (4, 4)), np.float64)
            if matrix[3].tolist() != [0.0, 0.0, 0.0, 1.0]:
                raise SceneError(
                    f"node '{self.name}': the last row of its matrix must be 0 0 0 1; is it transposed?"
                )
            return matrix
        result = np.eye(4)
        try:
            counts = len(self.translation), len(self.rotation), len(self.scale)
            if not any(self.rotation):
                self._refuse_place()
            result[:3, :3] = rotation_matrix(np.asarray(self.rotation, np.float64)) * np.asarray(
                self.scale, np.float64
            )
            result[:3, 3] = self.translation
        except (TypeError, ValueError, ZeroDivisionError):
            counts = 0, 0, 0
        if counts != (3, 4, 3) or not np.abs(result).max() <= FARTHEST:  # NaN is not
            self._refuse_place()
        return result

    def stand_as(self, other: Node) -> None:
        """Take the place of another node."""
        for name in _PLACE:
            setattr(self, name, getattr(other, name))

    def move(self, channels: list[Channel], time: float) -> None:
        """Take the place that channels of this node give it at `time`, in seconds."""
        self.matrix = None
        for channel in channels:
            setattr(self, channel.path, channel.at(time))

    def _refuse_place(self) -> NoReturn:
        """Raise SceneError that names what of the place cannot be used."""
        for name, count in (("translation", 3), ("rotation", 4), ("scale", 3)):
            require(f"node '{self.name}': {name}", getattr(self, name), -FARTHEST, FARTHEST, count)
        raise SceneError(f"node '{self.name}': rotation must be a quaternion x, y, z, w, not all 0")


@dataclass(eq=False)
class Scene:
    """What is lit. Change anything between frames; nothing is precomputed.

    playing  the name of the animation that `at` played; None: all of them
    """

    roots: list[Node] = field(default_factory=list)
    animations: list[Animation] = field(default_factory=list)
    name: str = ""
    warnings: list[str] = field(default_factory=list)
    extensions_used: list[str] = field(default_factory=list)
    extensions_honoured: list[str] = field(default_factory=list)
    playing: str | None = None

    @classmethod
    def from_trimesh(cls, source: Any) -> Scene:
        """Return the scene of a trimesh.Scene or Trimesh: geometry, places and materials, copied.

        Raises SceneError where a geometry cannot be used.
        """
        from ispm.scene.from_trimesh import to_scene

        return to_scene(source)

    def __repr__(self) -> str:
        counts = (
            (self.triangle_count, "triangle"),
            (len(self.lights), "light"),
            (len(self.cameras), "camera"),
        )
        held = ", ".join(f"{count:,} {what}{'s' * (count != 1)}" for count, what in counts)
        return f"<Scene '{self.name}': {held}>"

    def placed(self) -> Iterator[tuple[Node, np.ndarray]]:
        """Yield each node with its (4, 4) node-to-world matrix, parents before children."""
        worlds = [np.eye(4)]  # of the node and those above it
        for node, depth in self._walk():
            del worlds[depth + 1 :]
            worlds.append(worlds[depth] @ node.local_matrix())
            yield node, worlds[-1]

    @property
    def nodes(self) -> list[Node]:
        """All nodes, parents before children."""
        return [node for node, _ in self._walk()]

    def _walk(self) -> Iterator[tuple[Node, int]]:
        """Yield each node with how many are above it, parents before children.

        A node that hangs in several places is met in each. Raises SceneError where something else stands
        among them, a node hangs below itself, or there are too many places: a few dozen nodes, each twice
        below the next, have more than can ever be visited.
        """
        stack = [(node, 0) for node in reversed(_listed(self, "roots", Node))]
        above: list[int] = []  # ids of the nodes on the way to this one
        inside: set[int] = set()
        met: set[int] = set()
        again = 0
        while stack:
            node, depth = stack.pop()
            inside.difference_update(above[depth:])
            del above[depth:]
            if id(node) in inside:
                raise SceneError(f"node '{node.name}': hangs below itself; take it out of its descendants")
            again += id(node) in met
            if again > _MOST_AGAIN:
                raise SceneError(
                    f"node '{node.name}': nodes that hang in several places multiply, here to more than "
                    f"{_MOST_AGAIN:,}; let each hang in one, with instances where parts repeat"
                )
            met.add(id(node))
            above.append(id(node))
            inside.add(id(node))
            yield node, depth
            children = _listed(node, "children", Node)
            stack.extend((child, depth + 1) for child in reversed(children))

    @property
    def lights(self) -> list[Node]:
        """The nodes that hold a light."""
        return [node for node in self.nodes if node.light is not None]

    @property
    def cameras(self) -> list[Node]:
        """The nodes that hold a camera."""
        return [node for node in self.nodes if node.camera is not None]

    @property
    def materials(self) -> list[Material]:
        """The materials in use, each once, in the order met."""
        seen: dict[int, Material] = {}
        for node in self.nodes:
            for part in node.parts:
                seen.setdefault(id(part.material), part.material)
        return list(seen.values())

    @property
    def triangle_count(self) -> int:
        """Triangles as placed: a mesh counts once for each place where it is shown."""
        return sum(node.copies * len(part.mesh.triangles) for node in self.nodes for part in node.parts)

    def __getitem__(self, name: str) -> Node:
        """Return the first node called `name`; KeyError names the nearest."""
        for node in self.nodes:
            if node.name == name:
                return node
        import difflib

        near = difflib.get_close_matches(str(name), [n.name for n in self.nodes], 1)
        hint = f"; did you mean '{near[0]}'?" if near else ""
        raise KeyError(f"no node is called '{name}'{hint}")

    def add(
        self,
        item: Mesh | Light | Camera,
        *,
        material: Material | None = None,
        name: str = "",
        translation: tuple[float, float, float] = (0.0, 0.0, 0.0),
        rotation: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0),
        scale: tuple[float, float, float] = (1.0, 1.0, 1.0),
        parent: Node | None = None,
    ) -> Node:
        """Place a mesh, light or camera on a new node and return the node.

        Raises SceneError where one of them cannot be used.
        """
        if not isinstance(item, Mesh | Light | Camera):
            raise SceneError(f"cannot add a {type(item).__name__}; give a mesh, a light or a camera")
        node = Node(name or item.name, translation, rotation, scale)
        if isinstance(item, Mesh):
            node.parts.append(Part(item, Material() if material is None else material))
        elif isinstance(item, Light):
            node.light = item
        else:
            node.camera = item
        node.check()
        node.local_matrix()
        if not isinstance(parent, Node | None):
            raise SceneError(f"node '{node.name}': parent must be a Node, not a {type(parent).__name__}")
        (self.roots if parent is None else parent.children).append(node)
        return node

    def at(self, time: float, animation: str | None = None) -> Scene:
        """Return the scene at `time` in seconds; meshes and materials are shared, nodes are not.

        animation  the name of the one to play; None: all
        What is not played stands at rest, also where this scene is itself one that `at` returned.
        Raises SceneError where no animation has that name, or `time` is no number.
        """
        require("time, in seconds,", time)
        if animation is not None and all(a.name != animation for a in self.animations):
            names = ", ".join(repr(a.name) for a in self.animations) or "none"
            raise SceneError(f"no animation is called '{animation}'; the scene has {names}")
        result = self.at_rest()
        result.playing = animation
        for node, channels in result._moving():
            node.rest = copy.copy(node)
            node.move(channels, time)
        return result

    def at_rest(self) -> Scene:
        """Return the scene as it stood before `at` moved it; shared and not as by `at`."""
        clones: dict[int, Node] = {}
        for node in reversed(self.nodes):  # children before parents
            clone = clones[id(node)] = copy.copy(node)
            clone.children = [clones[id(child)] for child in node.children]
            if clone.rest is not None:
                clone.stand_as(clone.rest)
                clone.rest = None
        result = copy.copy(self)
        result.roots = [clones[id(node)] for node in self.roots]
        result.animations = [animation.of(clones) for animation in self.animations]
        return result

    def _moving(self) -> list[tuple[Node, list[Channel]]]:
        """The nodes that what is playing moves, with their channels."""
        found: dict[int, tuple[Node, list[Channel]]] = {}
        for animation in self.animations:
            if self.playing is None or animation.name == self.playing:
                for channel in animation.channels:
                    found.setdefault(id(channel.node), (channel.node, []))[1].append(channel)
        return list(found.values())

    def courses(self) -> Iterator[tuple[Node, np.ndarray]]:
        """Yield each node that what is playing moves, with its (T, 4, 4) node-to-world matrices at T times.

        The times are spread over the animations, and the same whenever the scene is asked.
        """
        moving = {id(node): channels for node, channels in self._moving()}
        times = [channel.times for channels in moving.values() for channel in channels]
        if not times:
            return
        keys = np.unique(np.concatenate(times))
        moments = np.linspace(keys[0], keys[-1], _MOMENTS)
        moments = np.union1d(moments, keys[:: -(-len(keys) // _KEYS)])
        worlds = [np.eye(4)]  # of the node and those above it
        for node, depth in self._walk():
            del worlds[depth + 1 :]
            local = node.local_matrix()
            if id(node) in moving:
                moved, places = copy.copy(node), []
                for time in moments:
                    moved.move(moving[id(node)], float(time))
                    places.append(moved.local_matrix())
                local = np.stack(places)
            worlds.append(worlds[depth] @ local)
            if worlds[-1].ndim == 3:
                yield node, worlds[-1]

    def default_camera(self, size: tuple[int, int] = (1280, 720)) -> Camera:
        """Return the camera, with its pose, that takes a picture of `size` pixels where no other is given.

        It is the scene's first, where it stands now. A scene without one is framed as it stands at rest and
        wherever its animations take it, so that all moments of `at` share one camera.
        Raises SceneError for a scene without a surface.
        """
        from ispm.renderer.framing import camera_of

        return camera_of(self, size)


def _require_kind(owner: Node, name: str, kinds: Any) -> None:
    value = getattr(owner, name)
    if not isinstance(value, kinds):
        raise SceneError(f"node '{owner.name}': {name} must be a {kinds}, not a {type(value).__name__}")


def _listed(owner: Scene | Node, name: str, kind: type[_Kind]) -> Sequence[_Kind]:
    """A field that is a list of this kind alone."""
    values: Sequence[_Kind] = getattr(owner, name)
    strays = [v for v in values if not isinstance(v, kind)] if isinstance(values, (list, tuple)) else [values]
    if strays:
        what = f"{type(owner).__name__.lower()} '{owner.name}': {name}"
        raise SceneError(f"{what} must be a list of {kind.__name__}, not of {type(strays[0]).__name__}")
    return values


def rotation_matrix(quaternion: np.ndarray) -> np.ndarray:
    """Return the (3, 3) matrix of a quaternion x, y, z, w; it need not be unit."""
    x, y, z, w = quaternion / np.linalg.norm(quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
