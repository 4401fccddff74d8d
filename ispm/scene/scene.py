"""A scene: nodes that place meshes, lights and cameras, and animations that move them."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ispm.errors import SceneError
from ispm.scene.animation import Animation
from ispm.scene.camera import Camera
from ispm.scene.light import Light
from ispm.scene.material import Material
from ispm.scene.mesh import Mesh


@dataclass(eq=False)
class Part:
    """A mesh with the material it wears."""

    mesh: Mesh
    material: Material


@dataclass(eq=False)
class Node:
    """A place in the scene and what stands there. Compared by identity.

    translation, scale   (3,) metres and factors
    rotation             (4,) unit quaternion x, y, z, w
    matrix               (4, 4) used instead of the three where given
    instances            (n, 4, 4) where the parts stand n times, from each copy to this node; None: once
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

    @property
    def copies(self) -> int:
        """How many times the parts are placed."""
        return 1 if self.instances is None else len(self.instances)

    def places(self, world: np.ndarray) -> np.ndarray:
        """Return the (copies, 4, 4) matrices that take the parts to the world.

        world  (4, 4), this node's own
        """
        return world[None] if self.instances is None else world @ self.instances

    def local_matrix(self) -> np.ndarray:
        """Return the (4, 4) matrix that takes this node's space to its parent's."""
        if self.matrix is not None:
            return np.asarray(self.matrix, np.float64)
        result = np.eye(4)
        result[:3, :3] = rotation_matrix(np.asarray(self.rotation, np.float64)) * np.asarray(
            self.scale, np.float64
        )
        result[:3, 3] = self.translation
        return result


@dataclass(eq=False)
class Scene:
    """What is lit. Change anything between frames; nothing is precomputed."""

    roots: list[Node] = field(default_factory=list)
    animations: list[Animation] = field(default_factory=list)
    name: str = ""
    warnings: list[str] = field(default_factory=list)
    extensions_used: list[str] = field(default_factory=list)
    extensions_honoured: list[str] = field(default_factory=list)

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
        stack = [(node, np.eye(4)) for node in reversed(self.roots)]
        while stack:
            node, parent = stack.pop()
            world = parent @ node.local_matrix()
            yield node, world
            stack.extend((child, world) for child in reversed(node.children))

    @property
    def nodes(self) -> list[Node]:
        """All nodes, parents before children."""
        found, stack = [], self.roots[::-1]
        while stack:
            node = stack.pop()
            found.append(node)
            stack.extend(reversed(node.children))
        return found

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

        near = difflib.get_close_matches(name, [n.name for n in self.nodes], 1)
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
        """Place a mesh, light or camera on a new node and return the node."""
        if not isinstance(item, Mesh | Light | Camera):
            raise SceneError(f"cannot add a {type(item).__name__}; give a mesh, a light or a camera")
        node = Node(name or item.name, translation, rotation, scale)
        if isinstance(item, Mesh):
            node.parts.append(Part(item, material or Material()))
        elif isinstance(item, Light):
            node.light = item
        else:
            node.camera = item
        (parent.children if parent else self.roots).append(node)
        return node

    def at(self, time: float, animation: str | None = None) -> Scene:
        """Return the scene at `time` in seconds; meshes and materials are shared, nodes are not.

        animation  the name of the one to play; None: all
        Raises SceneError where no animation has that name.
        """
        playing = [a for a in self.animations if animation is None or a.name == animation]
        if animation is not None and not playing:
            names = ", ".join(repr(a.name) for a in self.animations) or "none"
            raise SceneError(f"no animation is called '{animation}'; the scene has {names}")
        clones: dict[int, Node] = {}
        for node in reversed(self.nodes):  # children before parents
            clone = copy.copy(node)
            clone.children = [clones[id(child)] for child in node.children]
            clones[id(node)] = clone
        result = copy.copy(self)
        result.roots = [clones[id(node)] for node in self.roots]
        for channel in (c for a in playing for c in a.channels):
            target = clones.get(id(channel.node))
            if target is not None:
                target.matrix = None
                setattr(target, channel.path, channel.at(time))
        return result


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
