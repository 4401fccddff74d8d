"""Nodes: transforms, one below another, and the parts, light or camera that each holds."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar, NoReturn, TypeVar

import numpy as np

from ispm.errors import SceneError
from ispm.knobs import nearest
from ispm.scene.animation import Channel
from ispm.scene.camera import Camera
from ispm.scene.light import Light
from ispm.scene.material import Material
from ispm.scene.mesh import Mesh
from ispm.scene.rotation import facing, place_matrices, quaternion
from ispm.scene.skin import Skin
from ispm.scene.values import FARTHEST, Point, Strict, array_of, matches, require, shown

if TYPE_CHECKING:
    from ispm.scene.scene import Scene

_Kind = TypeVar("_Kind")
_HELD: dict[str, tuple[Any, str]] = {
    "light": (Light, "an ispm.PointLight or another light"),
    "camera": (Camera, "an ispm.Camera"),
    "skin": (Skin, "an ispm.Skin"),
}  # what a node may hold, and what messages call it
_MOVED = ("translation", "rotation", "scale", "matrix", "weights")


@dataclass(eq=False)
class Part(Strict):
    """A mesh and its material.

    variants  what it wears in each variant of its scene, by name, and in all others under None; see
              `Scene.variant`
    Two parts of one mesh or one material share it: what changes, changes for both.
    """

    mesh: Mesh
    material: Material
    variants: dict[str | None, Material] = field(default_factory=dict)

    def wearing(self, variant: str | None) -> Part:
        """Return this part as it is in one of its scene's variants.

        variant  its name; None: as it is without
        """
        worn = {None: self.material, **self.variants}
        return Part(self.mesh, worn.get(variant, worn[None]), worn)


class Branch:
    """Nodes that are found by name: those of a scene, or those below a node.

    `for node in branch` goes through all of them, parents before children; `name in branch` and
    `node in branch` ask whether one is there; `branch[name]` is the first with that name.
    """

    @property
    def nodes(self) -> list[Node]:
        """All of them, parents before children."""
        raise NotImplementedError  # a scene has roots, a node children

    def __iter__(self) -> Iterator[Node]:
        return iter(self.nodes)

    def __contains__(self, wanted: object) -> bool:
        return any(node is wanted or node.name == wanted for node in self.nodes)

    def __getitem__(self, name: str) -> Node:
        """Return the first node called `name`; KeyError names the nearest."""
        for node in self.nodes:
            if node.name == name:
                return node
        raise KeyError(f"no node is called '{name}'{nearest(name, [n.name for n in self.nodes])}")

    def find(self, pattern: str) -> list[Node]:
        """Return the nodes whose name is `pattern` or matches it, parents before children.

        pattern  as of files: "ball *" with any ending, "ball ?" with one more letter, "[ab]*"; case counts
        """
        return [n for n in self.nodes if matches(n.name, pattern)]


@dataclass(eq=False)
class Node(Branch, Strict):
    """A place in the scene and what stands there. Compared by identity.

    translation, scale   (3,) metres and factors, in the parent's space
    rotation             (4,) quaternion x, y, z, w, of any length but 0; see `axis_angle` and `euler`
    matrix               (4, 4) used instead of the three where given; last row 0 0 0 1
    parts                meshes with their materials
    instances            (n, 4, 4) where the parts stand n times, from each copy to this node; None: once
    light, camera        one of each at most, whatever `instances` says; they look along -Z
    children             nodes in the space of this one; loops, `in`, `find` and `node[name]` reach all below
    skin                 what bends parts whose meshes have `joints`: they stand where its joints do, wherever
                         this node stands
    weights              (K,) of the morph targets of its parts' meshes; None: these stand as they are
    rest                 of a node that `Scene.at` moved: the one it was before, for its place
    """

    ELSEWHERE: ClassVar[Mapping[str, str]] = {
        "material": "its parts have one each: node.parts[0].material",
        "mesh": "its parts have one each: node.parts[0].mesh",
        "position": "it has a translation, or a matrix",
        "visible": "take it out of the scene by scene.remove",
    }

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
    skin: Skin | None = None
    weights: Sequence[float] | np.ndarray | None = None

    def __repr__(self) -> str:
        place = self.translation if self.matrix is None else np.asarray(self.matrix)[:3, 3]
        counts = (len(self.parts), "part"), (self.copies if self.instances is not None else 0, "copies")
        held = [f"{count} {what}" + "s" * (what == "part" and count > 1) for count, what in counts if count]
        held += [type(item).__name__ for item in (self.light, self.camera) if item is not None]
        if self.children:
            held.append(f"{len(self.children)} child{'ren' * (len(self.children) > 1)}")
        return f"<Node '{self.name}' at {', '.join(f'{v:g}' for v in place)}: {', '.join(held) or 'empty'}>"

    @property
    def nodes(self) -> list[Node]:
        """The nodes below this one, parents before children."""
        from ispm.scene.scene import Scene

        return Scene([self]).nodes[1:]

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
        """Raise SceneError where something that cannot be drawn stands here, or it is not of its kind."""
        for part in listed(self, "parts", Part):
            mesh: object = part.mesh
            material: object = part.material
            if not (isinstance(mesh, Mesh) and isinstance(material, Material)):
                held = f"{type(mesh).__name__} and a {type(material).__name__}"
                raise SceneError(f"node '{self.name}': a part must be of a Mesh and a Material, not a {held}")
        for name, (kind, called) in _HELD.items():
            value = getattr(self, name)
            if value is not None and not isinstance(value, kind):
                raise SceneError(f"node '{self.name}': {name} must be {called}, or None, not {shown(value)}")
        if self.instances is not None:
            self.instances = array_of(f"node '{self.name}': instances", self.instances, (None, 4, 4))
        if self.skin is not None:
            self.skin.check()
        self.morph_weights()

    def morph_weights(self) -> np.ndarray:
        """Return (K,) float64 of `weights`; none where these are None.

        Raises SceneError where they are no numbers, or not as many as a part's mesh has morph targets.
        """
        if self.weights is None:
            return np.zeros(0)
        where = f"node '{self.name}'"
        weights = np.asarray(array_of(f"{where}: weights", self.weights, (None,)), np.float64)
        for part in self.parts:
            if len(part.mesh.morphs) not in (0, len(weights)):
                raise SceneError(
                    f"{where}: has {len(weights)} weights for the {len(part.mesh.morphs)} morph targets of "
                    f"mesh '{part.mesh.name}'"
                )
        return weights

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
        result = np.empty((1, 4, 4))
        try:
            counts = len(self.translation), len(self.rotation), len(self.scale)
            if not any(self.rotation):
                self._refuse_place()
            rows = (np.asarray(v, np.float64)[None] for v in (self.translation, self.rotation, self.scale))
            result = place_matrices(*rows)
        except (TypeError, ValueError, ZeroDivisionError):
            counts = 0, 0, 0
        if counts != (3, 4, 3) or not np.abs(result).max() <= FARTHEST:  # NaN is not
            self._refuse_place()
        return np.asarray(result[0])

    def look_at(self, target: Point, up: Point = (0.0, 1.0, 0.0)) -> Node:
        """Turn the node so that its -Z points at `target`, and return it.

        Cameras look and lights shine along -Z; the fronts of things that stand on floors are mostly at +Z.
        target  (3,) metres in the parent's space, as `translation` is: for a node without a parent, the world
        up      (3,) the direction, in the parent's space, that +Y comes to lie as near to as can be
        Raises SceneError where there is no such rotation, or the camera here has a pose of its own.
        """
        for what, values in (("target", target), ("up", up)):
            require(f"node '{self.name}': {what}", values, -FARTHEST, FARTHEST, 3)
        if self.camera is not None and self.camera.pose is not None:
            raise SceneError(
                f"node '{self.name}': its camera has a pose, which counts instead of the node's; set that"
            )
        local = self.local_matrix()
        if self.matrix is not None:  # keep what it scales by
            self.translation, self.matrix = local[:3, 3], None
            self.scale = np.linalg.norm(local[:3, :3], axis=0)
        turn = facing(local[:3, 3] - np.asarray(target, np.float64), np.asarray(up, np.float64))
        self.rotation = quaternion(turn)
        return self

    def stand_as(self, other: Node) -> None:
        """Take the place of the node `other`, and its morph weights."""
        for name in _MOVED:
            setattr(self, name, getattr(other, name))

    def move(self, channels: list[Channel], time: float) -> None:
        """Take the place, and the morph weights, that channels of this node give it at `time`, in seconds."""
        for channel in channels:
            if channel.path != "weights":
                self.matrix = None
            setattr(self, channel.path, channel.at(time))

    def _refuse_place(self) -> NoReturn:
        """Raise SceneError that names what of the place cannot be used."""
        for name, count in (("translation", 3), ("rotation", 4), ("scale", 3)):
            require(f"node '{self.name}': {name}", getattr(self, name), -FARTHEST, FARTHEST, count)
        raise SceneError(f"node '{self.name}': rotation must be a quaternion x, y, z, w, not all 0")


def listed(owner: Scene | Node, name: str, kind: type[_Kind]) -> Sequence[_Kind]:
    """A field that is a list of this kind alone."""
    values: Sequence[_Kind] = getattr(owner, name)
    if type(values) is list and not values:
        return values
    strays = [v for v in values if not isinstance(v, kind)] if isinstance(values, (list, tuple)) else [values]
    if strays:
        what = f"{type(owner).__name__.lower()} '{owner.name}': {name}"
        raise SceneError(f"{what} must be a list of {kind.__name__}, not of {type(strays[0]).__name__}")
    return values
