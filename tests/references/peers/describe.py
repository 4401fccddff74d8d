"""Scenes of Lambert walls, plain mirrors and clear glass under one point light, as plain lists."""

from __future__ import annotations

from typing import Any

import numpy as np

from ispm.scene.light import PointLight
from ispm.scene.material import Material
from ispm.scene.packed import pack
from ispm.scene.scene import Scene
from references.triangles import world_triangles


def describe(scene: Scene) -> dict[str, Any]:
    """Return what json can hold, in world space.

    camera  eye; right, up and forward, unit vectors; yfov in radians
    light   position; intensity, cd per channel
    parts   positions, normals, corners of the triangles; kind, `lambert`, `mirror` or `glass`; color; ior
    Raises ValueError for a material or light that is none of these.
    """
    packed = pack(scene)
    if len(scene.materials) != len(packed.materials):
        raise ValueError("a part of the scene has no triangles")
    described: dict[str, Any] = {"parts": []}
    for node, world in scene.placed():
        if node.camera is not None:
            right, up, back, eye = (world[:3, k] for k in range(4))
            axes = {"eye": eye, "right": right, "up": up, "forward": -back}
            described["camera"] = {key: axis.tolist() for key, axis in axes.items()}
            described["camera"]["yfov"] = node.camera.yfov
        if node.light is not None:
            if not isinstance(node.light, PointLight) or np.isfinite(node.light.range):
                raise ValueError(f"light '{node.name}' is not a point light without a range")
            described["light"] = {"position": world[:3, 3].tolist(), "intensity": node.light.intensity}
    for instance in packed.instances:
        material = scene.materials[instance["material"]]
        positions, normals, _, corners = world_triangles(packed, instance)
        part = {"positions": positions, "normals": normals, "corners": corners}
        listed = {key: values.tolist() for key, values in part.items()}
        described["parts"].append(
            {**listed, "kind": _kind(material), "color": material.base_color[:3], "ior": material.ior}
        )
    return described


def _kind(material: Material) -> str:
    textures = (material.base_color_texture, material.normal_texture, material.transmission_texture)
    if not any(textures) and not material.emissive and not material.alpha_mode:
        if material.transmission == 1.0 and material.roughness == 0.0:
            return "glass"
        if material.metallic == 1.0 and material.roughness == 0.0:
            return "mirror"
        if material.metallic == material.transmission == material.specular == 0.0:
            return "lambert"
    raise ValueError(f"material '{material.name}' is not Lambert, a plain mirror or clear glass")
