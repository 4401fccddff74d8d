"""What stands at which node of a scene, numbered, wherever the nodes stand."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import chain, count
from operator import attrgetter, is_
from typing import Any, NamedTuple, get_args

import numpy as np

from ispm.scene.camera import Camera
from ispm.scene.lamp import lamp_material, lamp_mesh
from ispm.scene.light import Light, has_surface, light_called
from ispm.scene.material import Material
from ispm.scene.mesh import Mesh
from ispm.scene.names import Names, Place, Run
from ispm.scene.node import Node, Part
from ispm.scene.placing import Tree
from ispm.scene.pose import Shape, is_posed, is_skinned, joint_matrices, joint_rows

_NONE = type(None)
_KINDS = {
    "parts": {list},
    "light": {_NONE, *get_args(Light)},
    "camera": {_NONE, Camera},
    "instances": {_NONE},
}


class Posed(NamedTuple):
    """A row of a Layout whose mesh deforms.

    key     the number of its node, its mesh by identity, and how often that was met before
    shape   its mesh, which takes its shape of a moment by `Layout.pose`
    joints  (J,) int64 numbers of the nodes that it follows; None: it has no skin
    """

    row: int
    key: tuple[int, int, int]
    shape: Shape
    joints: np.ndarray | None


@dataclass(frozen=True, eq=False)
class Layout:
    """The parts and lamps that are shown, a row for each: not where, and not what they look like.

    nodes      of the tree, in order
    meshes, materials   each once, in the order met; of materials, those of parts that are shown, and lamps,
               which are made of one of their own
    mesh, material, node, copies   (R,) int64 of each row the number of its mesh, material and node, and how
               often it is placed
    instanced  rows whose node has instances;  lamps  rows that are a lamp
    lights     numbers of the nodes that hold a light without a surface
    posed      rows whose mesh deforms, each with one of its own in `meshes`
    names      what ids stand for
    """

    nodes: list[Node]
    meshes: list[Mesh]
    materials: list[Material | Light]
    mesh: np.ndarray
    material: np.ndarray
    node: np.ndarray
    copies: np.ndarray
    instanced: list[int]
    lamps: list[int]
    lights: list[int]
    posed: list[Posed]
    names: Names
    _things: Sequence[object]
    _values: Sequence[object]

    def lamp(self, row: int) -> Light:
        """Return the lamp of one of the rows `lamps`."""
        lamp: Material | Light = self.materials[self.material[row]]
        assert not isinstance(lamp, Material)
        return lamp

    def looks(self) -> list[Material]:
        """Return the materials with what lamps look like in their places, as they are at this moment.

        Raises SceneError for a lamp with a value out of range.
        """
        looks = [each if isinstance(each, Material) else None for each in self.materials]
        for row in self.lamps:
            lamp, node = self.lamp(row), self.nodes[self.node[row]]
            looks[self.material[row]] = lamp_material(lamp, light_called(lamp, node.name))
        return [each for each in looks if each is not None]

    def pose(self, worlds: np.ndarray) -> None:
        """Give meshes that deform the shapes they have where nodes stand so.

        worlds  (n, 4, 4) float64 node-to-world matrices
        Raises SceneError for weights and vertices that do not fit, or cannot be used.
        """
        for each in self.posed:
            node, matrices = self.nodes[self.node[each.row]], None
            if each.joints is not None:
                assert node.skin is not None
                matrices = joint_matrices(node.skin, worlds[each.joints])
            each.shape.take(node.morph_weights(), matrices)

    def _is_of(self, things: Sequence[object], values: Sequence[object]) -> bool:
        """Whether it is of these very objects, and of values like these."""
        same = len(things) == len(self._things) and all(map(is_, things, self._things))
        return same and values == self._values


def layout_of(tree: Tree, before: Layout | None = None) -> Layout:
    """Return the layout of a tree: `before` itself where nothing came, went or was renamed.

    Raises SceneError where something that cannot be drawn stands at a node.
    """
    nodes, parents = tree
    deform = [k for k, node in enumerate(nodes) if node.skin is not None or node.weights is not None]
    _require_drawable(nodes, deform)
    parts = list(chain.from_iterable(map(attrgetter("parts"), nodes)))
    part_counts = [len(node.parts) for node in nodes]
    row_meshes, row_looks = ([getattr(part, name) for part in parts] for name in ("mesh", "material"))
    copies = [1 if node.instances is None else len(node.instances) for node in nodes]
    lights = list(map(attrgetter("light"), nodes))
    lit = [index for index, light in enumerate(lights) if light is not None]
    lamp_nodes = [index for index in lit if has_surface(lights[index])]
    row_meshes += [lamp_mesh(lights[index]) for index in lamp_nodes]
    row_looks += [lights[index] for index in lamp_nodes]
    met = {id(mesh): mesh for mesh in row_meshes}
    hollow = {key for key, mesh in met.items() if not len(mesh.triangles)}
    names = [[item.name for item in items] for items in (nodes, row_meshes, row_looks)]
    skins = [nodes[index].skin for index in deform]
    joints = [joint for skin in skins if skin is not None for joint in skin.joints]
    joint_counts = [0 if skin is None else len(skin.joints) for skin in skins]
    posed = _posed_parts(nodes, part_counts, deform)
    things = [*nodes, *row_meshes, *row_looks, *skins, *joints]
    values = [parents, part_counts, copies, lit, lamp_nodes, hollow, deform, joint_counts, posed, *names]
    if before is not None and before._is_of(things, values):
        return before

    node = np.repeat(np.arange(len(nodes)), part_counts)
    part = np.arange(len(parts)) - np.repeat(np.cumsum(part_counts) - part_counts, part_counts)
    placed = np.array(copies, np.int64)[node]
    is_lamp = np.arange(len(row_meshes)) >= len(parts)
    if lamp_nodes:  # each behind the parts of its node
        node = np.concatenate([node, lamp_nodes])
        part = np.concatenate([part, np.array(part_counts)[lamp_nodes]])
        placed = np.concatenate([placed, np.ones(len(lamp_nodes), np.int64)])
    shown = (placed > 0) & np.array([id(mesh) not in hollow for mesh in row_meshes], bool)
    rows = np.flatnonzero(shown)
    rows = rows[np.argsort(node[rows], kind="stable")]
    shapes = _shapes(nodes, node, rows, row_meshes, posed, before)
    for each in shapes:
        row_meshes[rows[each.row]] = each.shape.mesh
    node, part, placed, is_lamp = node[rows], part[rows], placed[rows], is_lamp[rows]
    meshes, mesh = _numbered(map(row_meshes.__getitem__, rows.tolist()))
    materials, material = _numbered(map(row_looks.__getitem__, rows.tolist()))
    mesh_names = map(names[1].__getitem__, rows.tolist())
    runs = map(Run, node.tolist(), part.tolist(), mesh_names, material.tolist(), placed.tolist())
    return Layout(
        nodes,
        meshes,
        materials,
        mesh,
        material,
        node,
        placed,
        [
            row
            for row, index in enumerate(node.tolist())
            if nodes[index].instances is not None and not is_lamp[row]
        ],
        np.flatnonzero(is_lamp).tolist(),
        sorted(set(lit) - set(lamp_nodes)),
        shapes,
        Names(tuple(runs), tuple(each.name for each in materials), tuple(map(Place, names[0], parents))),
        things,
        values,
    )


def _posed_parts(nodes: Sequence[Node], part_counts: Sequence[int], deform: Sequence[int]) -> list[int]:
    """Of all parts of all nodes, the numbers of those that deform; `deform`: of the nodes that may."""
    if not deform:
        return []
    first = np.cumsum(part_counts) - part_counts
    return [
        int(first[index]) + k
        for index in deform
        for k, part in enumerate(nodes[index].parts)
        if is_posed(nodes[index], part.mesh)
    ]


def _shapes(
    nodes: Sequence[Node],
    node: np.ndarray,
    rows: np.ndarray,
    meshes: Sequence[Mesh],
    posed: Sequence[int],
    before: Layout | None,
) -> list[Posed]:
    """The rows of a Layout that deform, with the shapes that they had before, if they were there.

    node, meshes  of each part, node by node;  rows  the parts that are shown;  posed  those that deform
    """
    if not posed:
        return []
    known = {each.key: each.shape for each in before.posed} if before else {}
    row_of = dict(zip(rows.tolist(), count()))
    met, found = Counter[tuple[int, int]](), list[tuple[int, tuple[int, int, int], Shape, Node]]()
    for part in posed:
        if part not in row_of:
            continue
        mesh, own = meshes[part], (int(node[part]), id(meshes[part]))
        key = (*own, met[own])
        met[own] += 1
        shape = known.get(key)
        if shape is None or shape.source is not mesh:
            shape = Shape.of(mesh)
        found.append((row_of[part], key, shape, nodes[own[0]]))
    bent = [owner for *_, shape, owner in found if is_skinned(owner, shape.source)]
    joints = iter(joint_rows(nodes, bent))
    return [
        Posed(row, key, shape, next(joints) if is_skinned(owner, shape.source) else None)
        for row, key, shape, owner in found
    ]


def _require_drawable(nodes: Sequence[Node], deform: Sequence[int]) -> None:
    """Raise SceneError as `Node.check`, which is asked of each only where kinds are not the usual ones, and
    of those that may `deform`, by their numbers."""
    usual = all(set(map(type, map(attrgetter(name), nodes))) <= kinds for name, kinds in _KINDS.items())
    if usual:
        parts = list(chain.from_iterable(map(attrgetter("parts"), nodes)))
        usual = set(map(type, parts)) <= {Part}
        usual = usual and {type(part.mesh) for part in parts} <= {Mesh}
        usual = usual and {type(part.material) for part in parts} <= {Material}
    for node in nodes if not usual else map(nodes.__getitem__, deform):
        node.check()


def _numbered(items: Iterable[Any]) -> tuple[list[Any], np.ndarray]:
    """The items, each once in the order met, and of all, (n,) int64, which of those it is; by identity."""
    every = list(items)
    keys = list(map(id, every))
    each = dict(zip(reversed(keys), reversed(every), strict=True))
    numbers = dict(zip(dict.fromkeys(keys), count()))
    return [each[key] for key in numbers], np.array([numbers[key] for key in keys], np.int64)
