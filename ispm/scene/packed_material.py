"""Materials as the bytes that the tracer and the GPU share."""

from __future__ import annotations

import numpy as np

from ispm.optics import records
from ispm.scene.material import TEXTURES, AlphaMode, Material, Texture, TextureUse


def material_record(material: Material, textures: list[Texture]) -> np.ndarray:
    """Return the MATERIAL of `material`; its pictures are added to `textures` where they are not among them.

    Raises SceneError for a value out of range.
    """
    material.check()
    row = np.zeros((), records.MATERIAL)
    color = tuple(material.base_color)
    row["base_color"] = color if len(color) == 4 else (*color, 1.0)
    row["emission"] = material.emission
    row["metallic"] = material.metallic
    row["specular_color"] = material.specular_color
    row["specular"] = material.specular
    row["roughness"] = material.roughness
    row["f0"] = ((material.ior - 1.0) / (material.ior + 1.0)) ** 2 if material.ior > 0.0 else 1.0
    row["ior"] = material.ior if material.ior > 0.0 else 1.5
    row["transmission"] = material.transmission
    row["attenuation"] = _attenuation(material)
    row["alpha_cutoff"] = material.alpha_cutoff
    row["normal_scale"] = material.normal_scale
    row["flags"] = (
        records.MATERIAL_MASK * (material.alpha_mode == AlphaMode.MASK)
        | records.MATERIAL_BLEND * (material.alpha_mode == AlphaMode.BLEND)
        | records.MATERIAL_DOUBLE_SIDED * material.double_sided
        | records.MATERIAL_UNLIT * material.unlit
        | records.MATERIAL_TRANSMITS * (material.transmission > 0.0)
        | records.MATERIAL_THIN * (material.transmission > 0.0 and material.thickness <= 0.0)
        | records.MATERIAL_CAUSTIC * material.casts_caustics
    )
    for slot in TEXTURES:
        row[slot] = _texture_use(getattr(material, slot), textures)
    return row


def _attenuation(material: Material) -> np.ndarray:
    """(3,) 1/m; KHR_materials_volume, attenuation."""
    if material.thickness <= 0.0 or not np.isfinite(material.attenuation_distance):
        return np.zeros(3)
    color = np.clip(np.asarray(material.attenuation_color, np.float64), 1e-6, 1.0)
    return np.asarray(-np.log(color) / material.attenuation_distance)


def _texture_use(use: TextureUse | Texture | None, textures: list[Texture]) -> np.ndarray:
    row = np.zeros((), records.TEXTURE_USE)
    row["texture"] = -1
    if isinstance(use, Texture):
        use = TextureUse(use)
    if use is not None:
        known = next((i for i, t in enumerate(textures) if t is use.texture), None)
        if known is None:
            known = len(textures)
            textures.append(use.texture)
        row["texture"] = known
        row["uv_set"] = use.uv_set
        row["row0"], row["row1"] = use.transform
    return row
