"""A scene: nodes that place meshes, lights and cameras, and animations that move them."""

from __future__ import annotations

import copy
import weakref
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ispm.errors import SceneError
from ispm.scene.animation import Animation, Channel
from ispm.scene.camera import Camera
from ispm.scene.environment import Environment
from ispm.scene.extent import placed_bounds
from ispm.scene.light import Light
from ispm.scene.material import Material
from ispm.scene.mesh import Mesh
from ispm.scene.node import Branch, listed
from ispm.scene.node import Node as Node
from ispm.scene.node import Part as Part
from ispm.scene.placing import Tree, tree_of
from ispm.scene.pose import shown_shapes
from ispm.scene.rotation import Quaternion
from ispm.scene.skin import Skin
from ispm.scene.sky import Sky
from ispm.scene.values import Point, array_of, require, strict_call
from ispm.scene.variants import Varied

_MOMENTS = 64  # evenly over an animation, at which trajectories are sampled
_KEYS = 256  # likewise, of its own


@dataclass(eq=False)
class Scene(Branch, Varied):
    """What is lit: right-handed, +Y up, metres. Change anything between frames; nothing is precomputed.

    `scene[name]` is a node, `name in scene` asks for one, and a loop goes through all of them.

    roots       the nodes without a parent
    environment  the light from all around, an Environment or a Sky; None: there is none
    animations  that `at` plays
    warnings    what is amiss in the file it was loaded from, a line each
    extensions_used, extensions_honoured   of glTF, in that file
    playing     the name of the animation that `at` played; None: all of them
    variants    names of the looks that its parts can have, as of glTF (KHR_materials_variants)
    """

    roots: list[Node] = field(default_factory=list)
    animations: list[Animation] = field(default_factory=list)
    name: str = ""
    warnings: list[str] = field(default_factory=list)
    extensions_used: list[str] = field(default_factory=list)
    extensions_honoured: list[str] = field(default_factory=list)
    playing: str | None = None
    environment: Environment | Sky | None = None
    _hung: weakref.WeakSet[Node] = field(default_factory=weakref.WeakSet, init=False, repr=False)

    @classmethod
    def from_trimesh(cls, source: Any) -> Scene:
        """Return the scene of trimesh's: geometry, places and materials, copied.

        source  a trimesh.Scene or Trimesh; metres, axes as they are
        Raises SceneError where a geometry cannot be used.
        """
        from ispm.scene.from_trimesh import to_scene

        return to_scene(source)

    def __repr__(self) -> str:
        nodes = self.nodes  # once: there may be a million
        counts = (
            (_triangles(nodes), "triangle"),
            (sum(node.light is not None for node in nodes), "light"),
            (sum(node.camera is not None for node in nodes), "camera"),
        )
        held = ", ".join(f"{count:,} {what}{'s' * (count != 1)}" for count, what in counts)
        return f"<Scene '{self.name}': {held}>"

    def __getstate__(self) -> dict[str, Any]:
        """All but what cannot be copied or sent elsewhere, for `copy` and `pickle`."""
        return {name: value for name, value in vars(self).items() if name != "_hung"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state, _hung=weakref.WeakSet())

    def placed(self) -> Iterator[tuple[Node, np.ndarray]]:
        """Yield each node with its (4, 4) node-to-world matrix, parents before children.

        Raises SceneError where a node has no place that can be used.
        """
        tree = self.tree()
        yield from zip(tree.nodes, tree.worlds(), strict=True)

    @property
    def nodes(self) -> list[Node]:
        """All nodes, parents before children; one that hangs in several places is met in each."""
        return self.tree().nodes

    def parents(self) -> list[int]:
        """Return of each of `nodes` the place of its parent among them, -1 where it has none."""
        return self.tree().parents

    def tree(self) -> Tree:
        """Return `nodes` and `parents`. Raises SceneError as `tree_of`."""
        return tree_of(listed(self, "roots", Node))

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
        """Triangles as placed, lamps aside: a mesh counts once for each place where it is shown."""
        return _triangles(self.nodes)

    @strict_call
    def add(
        self,
        item: Mesh | Light | Camera,
        *,
        material: Material | None = None,
        name: str = "",
        translation: Point = (0.0, 0.0, 0.0),
        rotation: Quaternion | np.ndarray = (0.0, 0.0, 0.0, 1.0),
        scale: Point = (1.0, 1.0, 1.0),
        parent: Node | None = None,
    ) -> Node:
        """Place a mesh, light or camera on a new node and return the node.

        item         stands at the node's origin, in its axes
        material     of a mesh; None: white and matt
        translation, rotation, scale   as of `Node`: metres, quaternion x, y, z, w, factors
        parent       the node of this scene in whose space it stands; None: the world
        Raises SceneError where one of them cannot be used.
        """
        given: object = item
        if not isinstance(given, Mesh | Light | Camera):
            others = {Scene: "; scenes are merged", Node: "; nodes are appended to roots or children"}
            hint = others.get(type(given), "")
            raise SceneError(f"cannot add a {type(given).__name__}; give a mesh, a light or a camera{hint}")
        node = Node(name or item.name, translation, rotation, scale)
        if material is not None and not isinstance(item, Mesh):
            raise SceneError(f"node '{node.name}': a {type(item).__name__} takes no material")
        if isinstance(item, Mesh):
            node.parts.append(Part(item, Material() if material is None else material))
        elif isinstance(item, Light):
            node.light = item
        else:
            node.camera = item
        return self._hang(node, parent)

    @strict_call
    def merge(
        self,
        other: Scene,
        *,
        name: str = "",
        translation: Point = (0.0, 0.0, 0.0),
        rotation: Quaternion | np.ndarray = (0.0, 0.0, 0.0, 1.0),
        scale: Point = (1.0, 1.0, 1.0),
        parent: Node | None = None,
    ) -> Node:
        """Place copies of another scene's nodes, with its animations, below a new node; return that node.

        Meshes, materials, lights and cameras are shared with `other`, nodes are not: it stays as it is, and
        may be merged several times. Its environment is not taken.
        name         of the new node; default: the other scene's
        translation, rotation, scale, parent   as in `add`
        Raises SceneError where one of them cannot be used.
        """
        if not isinstance(other, Scene):
            raise SceneError(f"cannot merge a {type(other).__name__}; give a Scene")
        copied = other._copied()
        node = Node(name or other.name, translation, rotation, scale, children=copied.roots)
        self._hang(node, parent)
        self.animations = [*self.animations, *copied.animations]
        for kept in ("warnings", "extensions_used", "extensions_honoured", "variants"):
            setattr(self, kept, list(dict.fromkeys([*getattr(self, kept), *getattr(other, kept)])))
        return node

    def _hang(self, node: Node, parent: Node | None) -> Node:
        """Check a new node and give it its place."""
        node.check()
        node.local_matrix()
        if not isinstance(parent, Node | None):
            raise SceneError(f"node '{node.name}': parent must be a Node, not a {type(parent).__name__}")
        if parent is not None and parent not in self._hung and not any(n is parent for n in self.nodes):
            raise SceneError(
                f"node '{node.name}': its parent '{parent.name}' is not in this scene; hang that in it first"
            )
        self._hung.update({node} if parent is None else {node, parent})  # not looked for again
        (self.roots if parent is None else parent.children).append(node)
        return node

    def remove(self, node: Node | str) -> Node:
        """Take a node out of the scene with all below it, and return it.

        node  itself, or the name of the first that has it
        Raises KeyError where no node has the name, SceneError where the node is not in the scene.
        """
        gone = self._own(node)
        self._hung.clear()
        for held in (self.roots, *(above.children for above in self.nodes)):
            held[:] = [child for child in held if child is not gone]
        return gone

    @property
    def bounds(self) -> np.ndarray:
        """The (2, 3) least and greatest corner of all surfaces as placed, lamps aside, metres, world space.

        Raises SceneError for a scene without a surface.
        """
        tree = self.tree()
        return placed_bounds(shown_shapes(tree.nodes, tree.worlds(), range(len(tree.nodes))))

    def bounds_of(self, node: Node | str) -> np.ndarray:
        """Return likewise the (2, 3) bounds of what stands at a node and below it, metres, world space.

        node  itself, or the name of the first that has it
        Raises SceneError as `bounds` does, and as `world_matrix`.
        """
        own, tree = self._own(node), self.tree()
        first = next(k for k, each in enumerate(tree.nodes) if each is own)
        below = {first}
        for row, parent in enumerate(tree.parents):
            if parent in below:
                below.add(row)
        return placed_bounds(shown_shapes(tree.nodes, tree.worlds(), sorted(below)))

    def world_matrix(self, node: Node | str) -> np.ndarray:
        """Return the (4, 4) matrix from a node's space to the world.

        node  itself, or the name of the first that has it
        Raises KeyError where no node has the name, SceneError where the node is not in the scene.
        """
        own = self._own(node)
        tree = self.tree()
        return tree.world(next(k for k, each in enumerate(tree.nodes) if each is own))

    def _own(self, node: Node | str) -> Node:
        """A node of this scene, given itself or by name."""
        if isinstance(node, str):
            return self[node]
        if not isinstance(node, Node):
            raise SceneError(f"a {type(node).__name__} is no node; give a Node or a name")
        if node not in self:
            raise SceneError(f"node '{node.name}' is not in this scene")
        return node

    def at(self, time: float, animation: str | None = None) -> Scene:
        """Return the scene at `time` in seconds; meshes and materials are shared, nodes are not.

        animation  the name of the one to play; None: all
        What is not played stands at rest, also where this scene is itself one that `at` returned.
        Raises SceneError where no animation has that name, or `time` is no number.
        """
        require("time, in seconds,", time)
        if animation is not None and all(a.name != animation for a in self.animations):
            names = ", ".join(repr(a.name) if a.name else "one without a name" for a in self.animations)
            raise SceneError(f"no animation is called '{animation}'; the scene has {names or 'none'}")
        result = self.at_rest()
        result.playing = animation
        for node, channels in result._moving():
            node.rest = copy.copy(node)
            node.move(channels, time)
        return result

    def at_rest(self) -> Scene:
        """Return the scene as it stood before `at` moved it; shared and not as by `at`."""
        result = self._copied()
        for node in result.nodes:
            if node.rest is not None:
                node.stand_as(node.rest)
                node.rest = None
        return result

    def _copied(self) -> Scene:
        """This scene with nodes and animations of its own."""
        clones: dict[int, Node] = {}
        for node in reversed(self.nodes):  # children before parents
            clone = clones[id(node)] = copy.copy(node)
            clone.children = [clones[id(child)] for child in node.children]
        skins: dict[int, Skin] = {}
        for clone in clones.values():
            if isinstance(clone.skin, Skin):  # what is none is refused where it is used
                clone.skin = skins.setdefault(id(clone.skin), clone.skin.of(clones))
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

    def trajectories(self) -> Iterator[tuple[Node, np.ndarray]]:
        """Yield each node that the animations in play move, with its (T, 4, 4) node-to-world matrices.

        The T times are spread over these animations, whatever moment the scene stands at.
        """
        moving = {id(node): channels for node, channels in self._moving()}
        times = [channel.times for channels in moving.values() for channel in channels]
        if not times:
            return
        keys = np.unique(np.concatenate(times))
        moments = np.linspace(keys[0], keys[-1], _MOMENTS)
        moments = np.union1d(moments, keys[:: -(-len(keys) // _KEYS)])
        tree = self.tree()
        still, above = tree.worlds(), list[int]()  # places of the nodes on the way to this one
        tracks: dict[int, np.ndarray] = {-1: np.eye(4)}
        for index, (node, parent) in enumerate(zip(*tree, strict=True)):
            while above and above[-1] != parent:
                del tracks[above.pop()]
            tracks[index] = still[index]
            above.append(index)
            if id(node) in moving:
                moved, matrices = copy.copy(node), []
                for time in moments:
                    moved.move(moving[id(node)], float(time))
                    matrices.append(moved.local_matrix())
                tracks[index] = tracks[parent] @ np.stack(matrices)
            elif tracks[parent].ndim == 3:
                tracks[index] = tracks[parent] @ node.local_matrix()
            if tracks[index].ndim == 3:
                yield node, tracks[index]

    def set_transforms(self, nodes: Sequence[Node], matrices: np.ndarray) -> None:
        """Give many nodes their places at once; of each, as its `matrix`.

        matrices  (n, 4, 4) from each node's space to its parent's, last rows 0 0 0 1; copied
        Raises SceneError where these are not as many as nodes, or not of numbers, and for what is no Node;
        nothing is changed then.
        """
        strays = [each for each in nodes if not isinstance(each, Node)]
        if strays:
            raise SceneError(f"nodes must be of Node, not of {type(strays[0]).__name__}")
        places = np.array(array_of("matrices", matrices, (len(nodes), 4, 4)), np.float64)
        transposed = np.flatnonzero((places[:, 3] != (0.0, 0.0, 0.0, 1.0)).any(axis=1))
        if len(transposed):
            raise SceneError(
                f"matrices: the last row of each must be 0 0 0 1, but that of number {transposed[0]} is "
                f"{places[transposed[0], 3].tolist()}; is it transposed?"
            )
        for node, place in zip(nodes, places, strict=True):
            node.matrix = place

    def default_camera(self, size: tuple[int, int] = (1280, 720)) -> Camera:
        """Return the camera, with its pose, that takes a picture of `size` pixels where no other is given.

        It is the scene's first, where it stands now. A scene without one is framed as it stands at rest and
        wherever its animations take it, so that all moments of `at` share one camera.
        Raises SceneError for a scene without a surface.
        """
        from ispm.framing.camera import camera_of

        return camera_of(self, size)


def _triangles(nodes: Sequence[Node]) -> int:
    """How many stand at nodes, copy by copy."""
    return sum(node.copies * len(part.mesh.triangles) for node in nodes for part in node.parts)
