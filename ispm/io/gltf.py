"""glTF 2.0, as .gltf or .glb: nodes, cameras and lights, and the scene made of all parts.

Source: Khronos, glTF 2.0 Specification, and the extensions named in SUPPORTED.
"""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np

from ispm.errors import SceneError
from ispm.io import gltf_schema as schema
from ispm.io.gltf_animation import read_animations
from ispm.io.gltf_file import GltfFile, item, label
from ispm.io.gltf_material import BRIGHTEST
from ispm.io.gltf_mesh import Meshes
from ispm.scene.camera import Camera
from ispm.scene.light import PointLight
from ispm.scene.scene import Node, Part, Scene
from ispm.settings import LoadLimits

SUPPORTED = (
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_specular",
    "KHR_materials_unlit",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
)
KNOWN_AS = {
    "KHR_draco_mesh_compression": "Draco compression",
    "EXT_meshopt_compression": "meshopt compression",
    "KHR_meshopt_compression": "meshopt compression",
    "KHR_texture_basisu": "KTX2 textures",
    "EXT_texture_webp": "WebP textures",
}


def read_gltf(path: Path, limits: LoadLimits) -> Scene:
    """Return the scene of a glTF file. Raises SceneError where it cannot be used."""
    file = GltfFile(path, limits)
    check_version(file.gltf.asset)
    check_extensions(file)
    if len(file.gltf.nodes) > limits.nodes:
        raise SceneError(f"{len(file.gltf.nodes)} nodes are more than nodes={limits.nodes} allows")
    chosen = _chosen_scene(file)
    nodes, roots = build_tree(file, chosen)
    scene = Scene(roots, name=chosen.name)
    _furnish(file, nodes, _reached(file, nodes, roots))
    scene.animations = read_animations(file, nodes)
    scene.extensions_used = list(dict.fromkeys(file.gltf.extensions_used))
    scene.extensions_honoured = [name for name in scene.extensions_used if name in SUPPORTED]
    scene.warnings = file.notes.lines()
    return scene


def check_version(asset: schema.Asset) -> None:
    """Raise SceneError where the file is not glTF 2, or needs more than 2.0."""
    for version, known in ((asset.version, r"2\.\d+"), (asset.min_version or "2.0", r"2\.0")):
        if not re.fullmatch(known, version):
            raise SceneError(f"this is, or needs, version {version[:20]} of glTF; 2.0 is supported")


def check_extensions(file: GltfFile) -> None:
    """Note the extensions that are not supported; raise SceneError where the file requires one."""
    required = _unsupported(file.gltf.extensions_required)
    if required:
        raise SceneError(f"it requires {', '.join(required)}, not supported; export it without")
    used = _unsupported(file.gltf.extensions_used)
    if used:
        file.notes.add(f"extensions that are not supported are passed over: {', '.join(used)}")


def _unsupported(names: list[str]) -> list[str]:
    return [
        f"{name} ({KNOWN_AS[name]})" if name in KNOWN_AS else name
        for name in dict.fromkeys(names)
        if name not in SUPPORTED
    ]


def _chosen_scene(file: GltfFile) -> schema.Scene:
    """The file's default scene, else its first, else one of all nodes that have no parent."""
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
    """A node with its place and name, without children or contents."""
    where = label("node", index, record.name)
    node = Node(record.name, record.translation, record.rotation, record.scale)
    if record.matrix is not None:
        node.matrix = np.array(record.matrix).reshape(4, 4).T.copy()
        if node.matrix[3].tolist() != [0.0, 0.0, 0.0, 1.0]:
            file.notes.add(f"{where}: the last row of its matrix counts as 0, 0, 0, 1")
            node.matrix[3] = 0.0, 0.0, 0.0, 1.0
        if not node.matrix[:3, :3].any():
            file.notes.add(f"{where}: its matrix is zero, which hides it")
    if not any(record.rotation):
        file.notes.add(f"{where}: a rotation of 0, 0, 0, 0 counts as none")
        node.rotation = (0.0, 0.0, 0.0, 1.0)
    return node


def _reached(file: GltfFile, nodes: list[Node], roots: list[Node]) -> list[int]:
    """The numbers of the nodes under `roots`."""
    number = {id(node): i for i, node in enumerate(nodes)}
    found, stack = [], roots[::-1]
    while stack:
        node = stack.pop()
        found.append(number[id(node)])
        stack.extend(reversed(node.children))
    return found


def _furnish(file: GltfFile, nodes: list[Node], reached: list[int]) -> None:
    """Put meshes, cameras and lights at the nodes of the scene."""
    meshes = Meshes(file)
    placed = 0
    silent: dict[str, list[str]] = {}
    for i in reached:
        record, node = file.gltf.nodes[i], nodes[i]
        if record.mesh is not None:
            node.parts = [Part(mesh, material) for mesh, material in meshes.parts(record.mesh)]
            placed += sum(len(part.mesh.triangles) for part in node.parts)
        if placed > file.limits.triangles:
            raise SceneError(f"more than triangles={file.limits.triangles} triangles are placed")
        if record.skin is not None:
            file.notes.count("skinned node is drawn in rest pose", "skinned nodes are drawn in rest pose")
        if record.camera is not None:
            node.camera = _camera(file, record.camera)
        if record.extensions.light is not None:
            node.light = _light(file, record.extensions.light.light, node, silent)
    for kind, names in silent.items():
        many = "s are not supported yet and give" if len(names) > 1 else " is not supported yet and gives"
        told = ", ".join(f"'{name}'" for name in names[:5]) + (", ..." if len(names) > 5 else "")
        file.notes.add(f"{len(names)} {kind} light{many} no light: {told}")


def _camera(file: GltfFile, index: int) -> Camera | None:
    """A camera; None, with a note, where its numbers show nothing."""
    record = item(file.gltf.cameras, index, "camera")
    where = label("camera", index, record.name)
    kind = record.perspective if record.type == "perspective" else record.orthographic
    if kind is None:
        file.notes.add(f"{where} is left out: its type '{record.type}' is unknown or not described")
        return None
    if kind.zfar is not None and kind.zfar <= (kind.znear or 0.0):
        file.notes.add(f"{where}: its zfar is not beyond its znear; both are passed over")
    if isinstance(kind, schema.Perspective):
        if 0.0 < kind.yfov < math.pi:
            return Camera(kind.yfov, name=record.name)
        file.notes.add(f"{where}: a yfov of {kind.yfov:g} shows nothing; {Camera.yfov:.3g} is used")
        return Camera(name=record.name)
    if kind.ymag == 0.0:
        file.notes.add(f"{where} is left out: a ymag of 0 shows nothing")
        return None
    return Camera(ymag=abs(kind.ymag), name=record.name)


def _light(file: GltfFile, index: int, node: Node, silent: dict[str, list[str]]) -> PointLight | None:
    """A point light; None for other kinds, which are gathered in `silent` by kind."""
    record = item(file.gltf.extensions.lights.lights, index, "light")
    name = record.name or node.name or str(index)
    if record.type != "point":
        known = record.type in ("spot", "directional")
        silent.setdefault(record.type if known else f"'{record.type}'", []).append(name)
        return None
    given = [record.intensity * c for c in record.color]
    intensity = [min(max(value, 0.0), BRIGHTEST) for value in given]
    if intensity != given:
        file.notes.add(f"light '{name}': its intensity is clamped to 0..{BRIGHTEST:g} cd")
    reach = math.inf if record.range is None else record.range
    if reach <= 0.0:
        file.notes.add(f"light '{name}': a range of {reach:g} lights nothing; it counts as infinite")
        reach = math.inf
    return PointLight((intensity[0], intensity[1], intensity[2]), reach, record.name)
