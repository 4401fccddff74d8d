"""Materials of a glTF file."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from functools import partial
from typing import Any

from ispm.io import gltf_schema_material as schema
from ispm.io.gltf_file import GltfFile, item, label
from ispm.io.gltf_image import Textures
from ispm.scene.material import TEXTURES, AlphaMode, Material, TextureUse
from ispm.scene.mesh import Mesh
from ispm.scene.values import BRIGHTEST, LEAST


class Materials:
    """The materials of a file, each made once."""

    def __init__(self, file: GltfFile) -> None:
        self._file = file
        self._textures = Textures(file)
        self._made: dict[int | None, Material] = {}
        self._bare: dict[tuple[int, tuple[str, ...]], Material] = {}

    def get(self, index: int | None, mesh: Mesh) -> Material:
        """Return a material as `mesh` can wear it: textures that need a missing uv set are left out.

        index  None: glTF's default material
        """
        if index not in self._made:
            self._made[index] = self._make(index)
        material = self._made[index]
        lost = tuple(slot for slot in TEXTURES if _lacks_uv(mesh, getattr(material, slot)))
        if not lost:
            return material
        key = id(material), lost
        if key not in self._bare:
            bare: dict[str, Any] = dict.fromkeys(lost)
            self._bare[key] = dataclasses.replace(material, **bare)
        self._file.notes.add(
            f"mesh '{mesh.name}' lacks the texture coordinates that its material '{material.name}' asks for"
        )
        return self._bare[key]

    def _make(self, index: int | None) -> Material:
        if index is None:
            return Material(metallic=1.0)
        record = item(self._file.gltf.materials, index, "material")
        where = label("material", index, record.name)
        return Material(
            **self._base(record.pbr, where),
            **self._layers(record, where),
            **self._inside(record.extensions, where),
            **self._coat(record.extensions, where),
            **self._sheen(record.extensions, where),
            **self._anisotropy(record.extensions, where),
            **self._translucence(record.extensions, where),
            **self._opacity(record, where),
            normal_scale=self._normal_scale(record.normal_texture, f"{where}: normal scale"),
            normal_texture=self._textures.use(record.normal_texture, srgb=False, where=where),
            double_sided=record.double_sided,
            unlit=record.extensions.unlit is not None,
            name=record.name,
        )

    def _normal_scale(self, slot: schema.TextureSlot | None, what: str) -> float:
        return 1.0 if slot is None else self._within([slot.scale], -1e3, 1e3, what)[0]

    def _base(self, pbr: schema.Pbr, where: str) -> dict[str, Any]:
        return dict(
            base_color=self._within(pbr.base_color_factor, 0.0, 1.0, f"{where}: baseColorFactor"),
            metallic=self._within([pbr.metallic_factor], 0.0, 1.0, f"{where}: metallicFactor")[0],
            roughness=self._within([pbr.roughness_factor], 0.0, 1.0, f"{where}: roughnessFactor")[0],
            base_color_texture=self._textures.use(pbr.base_color_texture, srgb=True, where=where),
            metallic_roughness_texture=self._textures.use(
                pbr.metallic_roughness_texture, srgb=False, where=where
            ),
        )

    def _layers(self, record: schema.Material, where: str) -> dict[str, Any]:
        """What the extensions and the emission say."""
        specular = record.extensions.specular or schema.Specular()
        ior = record.extensions.ior.ior
        if ior != 0.0 and not 1.0 <= ior <= 100.0:  # 0 is the extension's word for F0 = 1
            self._file.notes.add(f"{where}: an ior of {ior:g} is not possible; 1.5 is used")
            ior = 1.5
        strength = record.extensions.emissive_strength.emissive_strength
        factor = self._within(record.emissive_factor, 0.0, 1.0, f"{where}: emissiveFactor")
        strength = self._within([strength], 0.0, BRIGHTEST, f"{where}: emissiveStrength")[0]
        return dict(
            specular=self._within([specular.specular_factor], 0.0, 1.0, f"{where}: specularFactor")[0],
            specular_color=self._within(
                specular.specular_color_factor, 0.0, 1e4, f"{where}: specularColorFactor"
            ),
            specular_texture=self._textures.use(specular.specular_texture, srgb=True, where=where),  # alpha
            specular_color_texture=self._textures.use(
                specular.specular_color_texture, srgb=True, where=where
            ),
            ior=ior,
            emission=tuple(strength * f for f in factor),
            emission_texture=self._textures.use(record.emissive_texture, srgb=True, where=where),
        )

    def _inside(self, extensions: schema.MaterialExtensions, where: str) -> dict[str, Any]:
        """What goes through the surface, and what becomes of it behind: a solid where it has a thickness."""
        glass, volume = extensions.transmission, extensions.volume
        share = self._within([glass.transmission_factor], 0.0, 1.0, f"{where}: transmissionFactor")[0]
        distance = math.inf if volume.attenuation_distance is None else volume.attenuation_distance
        if distance < LEAST:
            self._file.notes.add(f"{where}: an attenuationDistance of {distance:g} counts as infinite")
            distance = math.inf
        thickness = self._within([volume.thickness_factor], 0.0, 1e9, f"{where}: thicknessFactor")[0]
        sheet = extensions.diffuse_transmission.diffuse_transmission_factor > 0.0
        if thickness > 0.0 and sheet and share == 0.0:
            self._file.notes.add(
                f"{where}: a volume within diffuse transmission is not supported; it is shown as a thin sheet"
            )
            thickness = 0.0
        dispersion = extensions.dispersion.dispersion
        return dict(
            transmission=share,
            transmission_texture=self._textures.use(glass.transmission_texture, srgb=False, where=where),
            thickness=thickness,
            attenuation_color=self._within(volume.attenuation_color, 0.0, 1.0, f"{where}: attenuationColor"),
            attenuation_distance=distance,
            dispersion=self._within([dispersion], 0.0, 20.0, f"{where}: dispersion")[0],
        )

    def _coat(self, extensions: schema.MaterialExtensions, where: str) -> dict[str, Any]:
        """The clear coat; what transmits has none here."""
        coat = extensions.clearcoat
        share = self._within([coat.clearcoat_factor], 0.0, 1.0, f"{where}: clearcoatFactor")[0]
        if share > 0.0 and extensions.transmission.transmission_factor > 0.0:
            self._file.notes.add(f"{where}: a clear coat over glass is not supported; it is left out")
            share = 0.0
        roughness = coat.clearcoat_roughness_factor
        use = partial(self._textures.use, srgb=False, where=where)
        return dict(
            clearcoat=share,
            clearcoat_roughness=self._within([roughness], 0.0, 1.0, f"{where}: clearcoatRoughnessFactor")[0],
            clearcoat_texture=use(coat.clearcoat_texture),
            clearcoat_roughness_texture=use(coat.clearcoat_roughness_texture),
            clearcoat_normal_texture=use(coat.clearcoat_normal_texture),
            clearcoat_normal_scale=self._normal_scale(
                coat.clearcoat_normal_texture, f"{where}: scale of the clear coat's normals"
            ),
        )

    def _sheen(self, extensions: schema.MaterialExtensions, where: str) -> dict[str, Any]:
        """The sheen; what transmits has none here."""
        sheen = extensions.sheen
        color = self._within(sheen.sheen_color_factor, 0.0, 1.0, f"{where}: sheenColorFactor")
        if max(color) > 0.0 and extensions.transmission.transmission_factor > 0.0:
            self._file.notes.add(f"{where}: sheen over glass is not supported; it is left out")
            color = (0.0, 0.0, 0.0)
        roughness = sheen.sheen_roughness_factor
        use = partial(self._textures.use, srgb=True, where=where)
        return dict(
            sheen_color=color,
            sheen_roughness=self._within([roughness], 0.0, 1.0, f"{where}: sheenRoughnessFactor")[0],
            sheen_color_texture=use(sheen.sheen_color_texture),
            sheen_roughness_texture=use(sheen.sheen_roughness_texture),  # alpha
        )

    def _anisotropy(self, extensions: schema.MaterialExtensions, where: str) -> dict[str, Any]:
        """The direction in which facets are widest; what transmits has none here."""
        facets = extensions.anisotropy
        strength = self._within([facets.anisotropy_strength], 0.0, 1.0, f"{where}: anisotropyStrength")[0]
        if strength > 0.0 and extensions.transmission.transmission_factor > 0.0:
            self._file.notes.add(f"{where}: anisotropy of glass is not supported; it is left out")
            strength = 0.0
        rotation = self._within([facets.anisotropy_rotation], -1e3, 1e3, f"{where}: anisotropyRotation")[0]
        return dict(
            anisotropy=strength,
            anisotropy_rotation=rotation,
            anisotropy_texture=self._textures.use(facets.anisotropy_texture, srgb=False, where=where),
        )

    def _translucence(self, extensions: schema.MaterialExtensions, where: str) -> dict[str, Any]:
        """The light that leaves a thin sheet on its other side; what transmits has none here."""
        sheet = extensions.diffuse_transmission
        share = sheet.diffuse_transmission_factor
        share = self._within([share], 0.0, 1.0, f"{where}: diffuseTransmissionFactor")[0]
        if share > 0.0 and extensions.transmission.transmission_factor > 0.0:
            self._file.notes.add(f"{where}: diffuse transmission of glass is not supported; it is left out")
            share = 0.0
        color = sheet.diffuse_transmission_color_factor
        use = partial(self._textures.use, srgb=True, where=where)
        return dict(
            diffuse_transmission=share,
            diffuse_transmission_color=self._within(
                color, 0.0, 1.0, f"{where}: diffuseTransmissionColorFactor"
            ),
            diffuse_transmission_texture=use(sheet.diffuse_transmission_texture),  # alpha
            diffuse_transmission_color_texture=use(sheet.diffuse_transmission_color_texture),
        )

    def _opacity(self, record: schema.Material, where: str) -> dict[str, Any]:
        mode = AlphaMode.__members__.get(record.alpha_mode)
        if mode is None:
            self._file.notes.add(f"{where}: alphaMode '{record.alpha_mode}' is unknown; OPAQUE is used")
            mode = AlphaMode.OPAQUE
        if mode == AlphaMode.BLEND:
            self._file.notes.count(
                "material with alphaMode BLEND is drawn as a stochastic mask",
                "materials with alphaMode BLEND are drawn as stochastic masks",
            )
        cutoff = self._within([record.alpha_cutoff], 0.0, 1e6, f"{where}: alphaCutoff")[0]
        return dict(alpha_mode=mode, alpha_cutoff=cutoff)

    def _within(self, values: Sequence[float], low: float, high: float, what: str) -> tuple[float, ...]:
        """Clamp `values`, with a note: factors outside their range would create energy."""
        clamped = tuple(min(max(value, low), high) for value in values)
        if clamped != tuple(values):
            given = ", ".join(f"{value:g}" for value in values)
            self._file.notes.add(f"{what} {given} is clamped to {low:g}..{high:g}")
        return clamped


def _lacks_uv(mesh: Mesh, use: TextureUse | None) -> bool:
    return use is not None and (mesh.uv0, mesh.uv1)[use.uv_set] is None
