"""Materials as the bytes that the tracer and the GPU share."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ispm.optics import records
from ispm.scene.lamp import Glow
from ispm.scene.material import TEXTURES, AlphaMode, Material, Texture, TextureUse
from ispm.scene.values import frozen, kept_value

_UNCHANGING = {float, int, bool, str, tuple, type(None)}


@dataclass(frozen=True, eq=False)
class Looks:
    """A scene's materials.

    rows      (M,) MATERIAL;  textures  what their slots point to
    colors    of each texture that tells metalness, the base color of the same surfaces, where they have one
    made_of   what they were made of, to be compared
    """

    rows: np.ndarray
    textures: list[Texture]
    colors: list[Texture | None]
    made_of: list[object]


def pack_materials(materials: Sequence[Material], before: Looks | None = None) -> Looks:
    """Return materials as kernels and shaders read them: `before` itself if they are as then.

    Raises SceneError for a value out of range.
    """
    if before is not None and _made_of(materials) == before.made_of:
        return before
    textures: list[Texture] = []
    rows = np.zeros(len(materials), records.MATERIAL)
    for index, material in enumerate(materials):
        rows[index] = material_record(material, textures)
    colors = _colors_of_metal(rows, textures)
    return Looks(rows, textures, colors, _made_of(materials))  # as checks have left them


def _colors_of_metal(rows: np.ndarray, textures: list[Texture]) -> list[Texture | None]:
    """The `colors` of Looks: both textures lie alike on all surfaces that show them."""
    metals, colors = rows["metallic_roughness_texture"], rows["base_color_texture"]
    found: list[Texture | None] = []
    for number in range(len(textures)):
        uses = metals["texture"] == number
        others = np.unique(colors["texture"][uses])
        lie_alike = all((metals[name] == colors[name])[uses].all() for name in ("uv_set", "row0", "row1"))
        found.append(textures[others[0]] if len(others) == 1 and others[0] >= 0 and lie_alike else None)
    return found


def _made_of(materials: Sequence[Material]) -> list[object]:
    """What the rows of materials, and the pictures that they show, depend on."""
    return [[_value(value) for value in vars(material).values()] for material in materials]


def _value(value: object) -> object:
    """A field's value, of which nothing can change."""
    if type(value) in _UNCHANGING:  # most are
        return value
    if isinstance(value, TextureUse):
        return _value(value.texture), *frozen(value)
    if isinstance(value, Texture):
        return texture_state(value)
    return kept_value(value)


def texture_state(texture: Texture) -> tuple[object, ...]:
    """Return all that pictures depend on of a texture, to be compared with what it has become."""
    return texture, texture.state, texture.wrap_u, texture.wrap_v, texture.linear


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
    translucent = material.translucent and not material.unlit
    row["transmission"] = material.diffuse_transmission if translucent else material.transmission
    row["diffuse_transmission_color"] = material.diffuse_transmission_color
    row["half_spread"] = _half_spread(material)
    row["beam"] = material.beam if isinstance(material, Glow) else Glow.beam
    row["attenuation"] = _attenuation(material)
    row["clearcoat"] = material.clearcoat
    row["clearcoat_roughness"] = material.clearcoat_roughness
    row["clearcoat_normal_scale"] = material.clearcoat_normal_scale
    row["sheen_color"] = material.sheen_color
    row["sheen_roughness"] = material.sheen_roughness
    row["anisotropy"] = material.anisotropy
    turn = material.anisotropy_rotation
    row["anisotropy_direction"] = math.cos(turn), math.sin(turn)
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
        | records.MATERIAL_COATED * (material.clearcoat > 0.0 and not material.unlit)
        | records.MATERIAL_SHEEN * (max(material.sheen_color) > 0.0 and not material.unlit)
        | records.MATERIAL_ANISOTROPIC * (material.anisotropy > 0.0 and not material.unlit)
        | records.MATERIAL_TRANSLUCENT * translucent
        | records.MATERIAL_DISPERSIVE * material.dispersive
        | records.MATERIAL_HIDES_PHOTONS * material.hides_photons
        | records.MATERIAL_SPECULAR_MAPPED * _has_specular_maps(material)
    )
    for slot in TEXTURES:
        if slot != "diffuse_transmission_texture":
            row[slot] = _texture_use(getattr(material, slot), textures)
    if translucent:
        row["transmission_texture"] = _texture_use(material.diffuse_transmission_texture, textures)
    return row


def _has_specular_maps(material: Material) -> bool:
    return material.specular_texture is not None or material.specular_color_texture is not None


def _attenuation(material: Material) -> np.ndarray:
    """(3,) 1/m; KHR_materials_volume, attenuation."""
    if material.thickness <= 0.0 or not np.isfinite(material.attenuation_distance):
        return np.zeros(3)
    color = np.clip(np.asarray(material.attenuation_color, np.float64), 1e-6, 1.0)
    return np.asarray(-np.log(color) / material.attenuation_distance)


def _half_spread(material: Material) -> float:
    """What blue light's index is above the material's, and red light's below: half of n_F - n_C, which is
    (n - 1) / V; KHR_materials_dispersion has V = 20 / dispersion."""
    return 0.5 * (material.ior - 1.0) * material.dispersion / 20.0 if material.dispersive else 0.0


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
