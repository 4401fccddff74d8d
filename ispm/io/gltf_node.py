"""Nodes of a glTF file: their transforms and their hierarchy."""

from __future__ import annotations

import math

import numpy as np

from ispm.errors import SceneError
from ispm.io import gltf_schema as schema
from ispm.io.gltf_file import GltfFile, item, label
from ispm.scene.scene import Node
from ispm.scene.values import FARTHEST

NODE_BYTES = 1024  # of a node with its lists


def chosen_scene(file: GltfFile) -> schema.Scene:
    """Return the file's default scene, else its first, else one of all nodes that have no parent."""
    scenes, index = file.gltf.scenes, file.gltf.scene or 0
    if scenes and index >= len(scenes):
        file.notes.add(f"scene {index} does not exist; the first of {len(scenes)} is shown")
        index = 0
    if scenes:
        return scenes[index]
    children = {child for node in file.gltf.nodes for child in node.children}
    return schema.Scene([i for i in range(len(file.gltf.nodes)) if i not in children])


def build_tree(file: GltfFile, scene: schema.Scene) -> tuple[list[Node], list[Node]]:
    """Return all nodes as the file numbers them, their children linked, and the roots of `scene`.

    A node that several claim as a child stays with the first, with a note.
    Raises SceneError where a node does not exist or is its own ancestor.
    """
    records = file.gltf.nodes
    file.budget.take(f"{len(records)} nodes", memory=NODE_BYTES * len(records))
    nodes = [_node(file, i, record) for i, record in enumerate(records)]
    parents = [-1] * len(records)
    for i, record in enumerate(records):
        for child in record.children:
            item(records, child, f"{label('node', i, record.name)}: child")
            if child == i:
                raise SceneError(f"{label('node', i, record.name)} is its own child")
            if parents[child] >= 0:
                called = label("node", child, records[child].name)
                file.notes.add(f"{called} has two parents; the first is kept")
                continue
            parents[child] = i
            nodes[i].children.append(nodes[child])
    _refuse_cycles(file, parents)
    roots = []
    for i in dict.fromkeys(scene.nodes):
        item(records, i, "node of the scene")
        if parents[i] >= 0:
            file.notes.add(f"{label('node', i, records[i].name)} has a parent, so it is no root of the scene")
        else:
            roots.append(nodes[i])
    return nodes, roots


def _refuse_cycles(file: GltfFile, parents: list[int]) -> None:
    """Raise SceneError where a node is its own ancestor."""
    climbed_from = [-1] * len(parents)
    for start in range(len(parents)):
        i = start
        while i >= 0 and climbed_from[i] < 0:
            climbed_from[i] = start
            i = parents[i]
        if i >= 0 and climbed_from[i] == start:
            raise SceneError(f"{label('node', i, file.gltf.nodes[i].name)} is its own ancestor")


def _node(file: GltfFile, index: int, record: schema.Node) -> Node:
    """A node with its transform and name, without children or contents."""
    where = label("node", index, record.name)
    if max(map(abs, (*record.translation, *record.scale, *(record.matrix or ())))) > FARTHEST:
        raise SceneError(f"{where}: its place or size is beyond {FARTHEST:g} m")
    node = Node(record.name, record.translation, record.rotation, record.scale)
    if record.matrix is not None:
        node.matrix = np.array(record.matrix).reshape(4, 4).T.copy()
        if node.matrix[3].tolist() != [0.0, 0.0, 0.0, 1.0]:
            file.notes.add(f"{where}: the last row of its matrix counts as 0, 0, 0, 1")
            node.matrix[3] = 0.0, 0.0, 0.0, 1.0
        if not node.matrix[:3, :3].any():
            file.notes.add(f"{where}: its matrix is zero, which hides it")
    if not 1e-3 < math.hypot(*record.rotation) < 1e3:
        file.notes.add(f"{where}: its rotation, no unit quaternion, counts as none")
        node.rotation = (0.0, 0.0, 0.0, 1.0)
    return node


def reached(nodes: list[Node], roots: list[Node]) -> list[int]:
    """Return the numbers of the nodes under `roots`, parents before children."""
    number = {id(node): i for i, node in enumerate(nodes)}
    found, stack = [], roots[::-1]
    while stack:
        node = stack.pop()
        found.append(number[id(node)])
        stack.extend(reversed(node.children))
    return found
