"""Meshes and scenes of the library trimesh, as ours. trimesh itself is not needed: only what it made.

Metres and axes as they are. Vertices are smooth where trimesh was given normals, flat otherwise. Colors of
vertices and faces count as sRGB, as trimesh's viewer shows them; factors of its PBRMaterial as linear.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ispm.errors import SceneError
from ispm.scene.color import linear
from ispm.scene.material import AlphaMode, Material, Texture
from ispm.scene.mesh import Mesh
from ispm.scene.scene import Node, Part, Scene


def to_mesh(mesh: Any) -> Mesh:
    """Return a copy of a trimesh.Trimesh's arrays. Raises SceneError where they cannot be used."""
    if not hasattr(mesh, "faces") or not hasattr(mesh, "vertices"):
        raise SceneError(f"a {type(mesh).__name__} has no faces; give a trimesh.Trimesh")
    name = str(getattr(mesh, "metadata", {}).get("name") or "")
    points, faces = np.array(mesh.vertices, np.float32), np.asarray(mesh.faces, np.int64)
    visual: Any = getattr(mesh, "visual", None)
    kind = getattr(visual, "kind", None)
    if kind == "face":  # a vertex has one color, so faces must not share them
        _check_range(faces, len(points), name)
        colors = np.repeat(_colors(visual.face_colors), 3, axis=0)
        return Mesh(points[faces.ravel()], np.arange(faces.size).reshape(-1, 3), colors=colors, name=name)
    uvs = np.asarray(visual.uv, np.float32) if kind == "texture" and visual.uv is not None else None
    return Mesh(
        points,
        faces,
        np.array(mesh.vertex_normals, np.float32) if _has_normals(mesh) else None,
        uv0=None if uvs is None else np.stack([uvs[:, 0], 1.0 - uvs[:, 1]], axis=1),  # ours point down
        colors=_colors(visual.vertex_colors) if kind == "vertex" else None,
        name=name,
    )


def to_scene(source: Any) -> Scene:
    """Return the scene of a trimesh.Scene or of one mesh: geometry, places, materials.

    A geometry that several nodes show is one Mesh. Cameras and lights are not taken over.
    Raises SceneError where a geometry cannot be used; points and curves are left out, with a warning.
    """
    if not hasattr(source, "geometry"):
        mesh = to_mesh(source)
        return Scene([Node(mesh.name, parts=[Part(mesh, to_material(source))])], name=mesh.name)
    scene, made, left_out = Scene(), dict[str, Part](), 0
    for name in source.graph.nodes_geometry:
        world, geometry = source.graph[name]
        shape = source.geometry[geometry]
        if not hasattr(shape, "faces"):
            left_out += 1
            continue
        if geometry not in made:
            mesh = to_mesh(shape)
            mesh.name = mesh.name or str(geometry)
            made[geometry] = Part(mesh, to_material(shape))
        part = made[geometry]
        matrix = np.array(world, np.float64)
        scene.roots.append(Node(str(name), matrix=matrix, parts=[Part(part.mesh, part.material)]))
    if left_out:
        scene.warnings.append(f"geometries without triangles are left out: {left_out}")
    return scene


def to_material(mesh: Any) -> Material:
    """Return the material of a trimesh mesh: its PBRMaterial, or one of its other kinds made into it."""
    visual = getattr(mesh, "visual", None)
    material = getattr(visual, "material", None) if getattr(visual, "kind", None) == "texture" else None
    if material is None:
        colored = getattr(visual, "kind", None) in ("vertex", "face")
        return Material((1.0,) * 3 if colored else (0.8,) * 3, double_sided=True)
    metallic = 1.0  # glTF's default; the other kinds know no metal
    if hasattr(material, "to_pbr"):
        material, metallic = material.to_pbr(), 0.0
    mode = AlphaMode.__members__.get(str(material.alphaMode or "OPAQUE"), AlphaMode.OPAQUE)
    red, green, blue = _factor(material.emissiveFactor, (0.0, 0.0, 0.0))[:3]
    return Material(
        base_color=_factor(material.baseColorFactor, (1.0, 1.0, 1.0, 1.0)),
        metallic=_number(material.metallicFactor, metallic),
        roughness=_number(material.roughnessFactor, 1.0),
        emission=(red, green, blue),
        alpha_mode=mode,
        alpha_cutoff=_number(material.alphaCutoff, 0.5),
        double_sided=bool(material.doubleSided),
        base_color_texture=_texture(material.baseColorTexture, srgb=True),
        metallic_roughness_texture=_texture(material.metallicRoughnessTexture, srgb=False),
        normal_texture=_texture(material.normalTexture, srgb=False),
        emission_texture=_texture(material.emissiveTexture, srgb=True),
        name=str(material.name or ""),
    )


def _has_normals(mesh: Any) -> bool:
    """Whether normals were given, rather than to be derived when they are asked for."""
    cache = getattr(mesh, "_cache", None)
    return cache is not None and "vertex_normals" in cache


def _check_range(faces: np.ndarray, count: int, name: str) -> None:
    if faces.size and int(faces.max()) >= count:
        raise SceneError(f"mesh '{name}': index {int(faces.max())} points past the last of {count} vertices")


def _colors(values: Any) -> np.ndarray:
    """(n, 4) linear colors of uint8 sRGB."""
    encoded = np.asarray(values, np.float32) / np.float32(255.0)
    return np.concatenate([linear(encoded[:, :3]), encoded[:, 3:4]], axis=1)


def _factor(values: Any, default: tuple[float, ...]) -> tuple[float, ...]:
    """Factors as floats; trimesh keeps some as bytes."""
    if values is None:
        return default
    array = np.asarray(values)
    scaled = array / 255.0 if array.dtype.kind in "iu" else array
    return tuple(float(v) for v in scaled)


def _number(value: Any, default: float) -> float:
    return default if value is None else float(value)


def _texture(image: Any, *, srgb: bool) -> Texture | None:
    """A Pillow picture as a texture."""
    return None if image is None else Texture(np.array(image.convert("RGBA")), srgb)
