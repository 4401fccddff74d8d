"""glTF 2.0, as .gltf or .glb: the scene made of all its parts.

Source: Khronos, glTF 2.0 Specification, and the extensions named in SUPPORTED.
"""

from __future__ import annotations

import math
import re
from pathlib import Path

from ispm.errors import SceneError
from ispm.io import gltf_schema as schema
from ispm.io.apart import has
from ispm.io.gltf_animation import read_animations
from ispm.io.gltf_camera import with_extras
from ispm.io.gltf_draco import missing
from ispm.io.gltf_environment import read_environment
from ispm.io.gltf_file import GltfFile, item, label
from ispm.io.gltf_instances import read_instances
from ispm.io.gltf_lamp import read_lamp
from ispm.io.gltf_light import read_light
from ispm.io.gltf_mesh import Meshes
from ispm.io.gltf_node import build_tree, chosen_scene, reached
from ispm.io.gltf_skin import Skins
from ispm.io.gltf_sky import read_sky
from ispm.scene.camera import Camera
from ispm.scene.scene import Node, Scene
from ispm.scene.values import FARTHEST
from ispm.settings import LoadLimits

SUPPORTED = (
    "EXT_lights_image_based",
    "EXT_mesh_gpu_instancing",
    "EXT_meshopt_compression",
    "EXT_texture_webp",
    "KHR_lights_punctual",
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_diffuse_transmission",
    "KHR_materials_dispersion",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_variants",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
)
NARROWEST = 1e-4  # rad, and m for parallel rays: the least a camera may see
INSTEAD = {"KHR_animation_pointer": "its channels are left out"}
DECODED = {"KHR_draco_mesh_compression": "draco", "KHR_texture_basisu": "ktx2"}  # by decoders of `apart`


def read_gltf(path: Path, limits: LoadLimits) -> Scene:
    """Return the scene of a glTF file. Raises SceneError where it cannot be used."""
    with GltfFile(path, limits) as file:
        return _read(file)


def _read(file: GltfFile) -> Scene:
    limits = file.limits
    check_version(file.gltf.asset)
    check_extensions(file)
    if len(file.gltf.nodes) > limits.max_nodes:
        raise SceneError(f"{len(file.gltf.nodes)} nodes are more than max_nodes={limits.max_nodes} allows")
    chosen = chosen_scene(file)
    nodes, roots = build_tree(file, chosen)
    scene = Scene(roots, name=chosen.name)
    scene.variants = _furnish(file, nodes, reached(nodes, roots))
    if chosen.extensions.image_based is not None:
        scene.environment = read_environment(file, chosen.extensions.image_based.light)
    elif (sky := read_sky(file, chosen.extras)) is not None:
        scene.environment = sky
    scene.animations = read_animations(file, nodes)
    scene.extensions_used = list(dict.fromkeys(file.gltf.extensions_used))
    scene.extensions_honoured = [name for name in scene.extensions_used if _supported(name)]
    scene.warnings = file.notes.lines()
    return scene


def check_version(asset: schema.Asset) -> None:
    """Raise SceneError where the file is not glTF 2, or needs more than 2.0."""
    for version, known in ((asset.version, r"2\.\d+"), (asset.min_version or "2.0", r"2\.0")):
        if not re.fullmatch(known, version):
            raise SceneError(f"this is, or needs, version {version[:20]} of glTF; 2.0 is supported")


def check_extensions(file: GltfFile) -> None:
    """Note the extensions that are not supported; raise SceneError where the file requires one."""
    required = _unknown(file.gltf.extensions_required)
    if required:
        raise SceneError(f"it uses {', '.join(required)}, which ispm does not read; export it without")
    for name in file.gltf.extensions_required:
        if not _supported(name):
            raise SceneError(missing(name))
    used = _unknown(file.gltf.extensions_used)
    if used:
        told = (f"{name} ({INSTEAD[name]})" if name in INSTEAD else name for name in used)
        file.notes.add(f"extensions that are not supported are passed over: {', '.join(told)}")


def _unknown(names: list[str]) -> list[str]:
    return [name for name in dict.fromkeys(names) if name not in SUPPORTED and name not in DECODED]


def _supported(name: str) -> bool:
    """Whether an extension is read, its decoder being there where it needs one."""
    return name in SUPPORTED or (name in DECODED and has(DECODED[name]))


def _furnish(file: GltfFile, nodes: list[Node], shown: list[int]) -> list[str]:
    """Put meshes, cameras and lights at the nodes numbered in `shown`; return the names of variants."""
    meshes, skins = Meshes(file), Skins(file, nodes, shown)
    triangles = instances = 0
    for i in shown:
        record, node = file.gltf.nodes[i], nodes[i]
        if record.mesh is not None:
            node.parts = meshes.parts(record.mesh)
            node.light = read_lamp(file, record.extras, label("node", i, node.name))
            if node.light is not None:
                del node.parts[-1:]  # which shows the lamp to other programs
            skins.bend(i, node)
            if record.extensions.instancing is not None and node.parts:
                node.instances = read_instances(
                    file, record.extensions.instancing, label("node", i, node.name)
                )
            instances += node.copies
            triangles += node.copies * sum(len(part.mesh.triangles) for part in node.parts)
        if instances > file.limits.max_nodes:
            raise SceneError(f"more than max_nodes={file.limits.max_nodes} instances are placed")
        if triangles > file.limits.max_triangles:
            raise SceneError(f"more than max_triangles={file.limits.max_triangles} triangles are placed")
        if record.camera is not None:
            node.camera = _camera(file, record.camera)
        if record.extensions.light is not None:
            node.light = read_light(file, record.extensions.light.light, node.name)
    return list(dict.fromkeys(meshes.variants))


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
        if NARROWEST < kind.yfov < math.pi - NARROWEST:
            return with_extras(Camera(kind.yfov, name=record.name), record.extras, file, where)
        file.notes.add(f"{where}: a yfov of {kind.yfov:g} shows nothing; {Camera.yfov:.3g} rad is used")
        return Camera(name=record.name)
    if not NARROWEST < abs(kind.ymag) < FARTHEST:
        file.notes.add(f"{where} is left out: a ymag of {kind.ymag:g} shows nothing")
        return None
    return with_extras(Camera(ymag=abs(kind.ymag), name=record.name), record.extras, file, where)
