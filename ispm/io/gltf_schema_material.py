"""The materials in glTF 2.0's JSON, as typed records."""

from __future__ import annotations

from typing import Any

from msgspec import field

from ispm.io.gltf_record import Index, Record, Vec2, Vec3, Vec4


class Image(Record, frozen=True):
    """A picture: a file, a data: URI, or a buffer view."""

    uri: str | None = None
    buffer_view: Index | None = None
    name: str = ""


class Sampler(Record, frozen=True):
    """How a texture is read; OpenGL's numbers."""

    mag_filter: Any = None
    min_filter: Any = None
    wrap_s: Any = 10497
    wrap_t: Any = 10497


class Source(Record, frozen=True):
    """EXT_texture_webp: the picture to show instead."""

    source: Index | None = None


class PictureExtensions(Record, frozen=True):
    """Extensions of a texture."""

    webp: Source | None = field(name="EXT_texture_webp", default=None)
    basisu: Source | None = field(name="KHR_texture_basisu", default=None)


class Texture(Record, frozen=True):
    """A picture and a sampler."""

    source: Index | None = None
    sampler: Index | None = None
    name: str = ""
    extensions: PictureExtensions = PictureExtensions()


class TextureTransform(Record, frozen=True):
    """KHR_texture_transform."""

    offset: Vec2 = (0.0, 0.0)
    rotation: float = 0.0
    scale: Vec2 = (1.0, 1.0)
    tex_coord: Index | None = None


class TextureExtensions(Record, frozen=True):
    """Extensions of a texture slot."""

    transform: TextureTransform | None = field(name="KHR_texture_transform", default=None)


class TextureSlot(Record, frozen=True):
    """A texture where a material uses it."""

    index: Index
    tex_coord: Index = 0
    scale: float = 1.0
    extensions: TextureExtensions = TextureExtensions()


class Pbr(Record, frozen=True):
    """Metallic-roughness factors and textures."""

    base_color_factor: Vec4 = (1.0, 1.0, 1.0, 1.0)
    base_color_texture: TextureSlot | None = None
    metallic_factor: float = 1.0
    roughness_factor: float = 1.0
    metallic_roughness_texture: TextureSlot | None = None


class Specular(Record, frozen=True):
    """KHR_materials_specular."""

    specular_factor: float = 1.0
    specular_color_factor: Vec3 = (1.0, 1.0, 1.0)
    specular_texture: TextureSlot | None = None
    specular_color_texture: TextureSlot | None = None


class Ior(Record, frozen=True):
    """KHR_materials_ior."""

    ior: float = 1.5


class EmissiveStrength(Record, frozen=True):
    """KHR_materials_emissive_strength."""

    emissive_strength: float = 1.0


class Transmission(Record, frozen=True):
    """KHR_materials_transmission."""

    transmission_factor: float = 0.0
    transmission_texture: TextureSlot | None = None


class Volume(Record, frozen=True):
    """KHR_materials_volume; what its thickness texture says matters to flat pictures alone."""

    thickness_factor: float = 0.0
    attenuation_color: Vec3 = (1.0, 1.0, 1.0)
    attenuation_distance: float | None = None


class Clearcoat(Record, frozen=True):
    """KHR_materials_clearcoat."""

    clearcoat_factor: float = 0.0
    clearcoat_roughness_factor: float = 0.0
    clearcoat_texture: TextureSlot | None = None
    clearcoat_roughness_texture: TextureSlot | None = None
    clearcoat_normal_texture: TextureSlot | None = None


class Sheen(Record, frozen=True):
    """KHR_materials_sheen."""

    sheen_color_factor: Vec3 = (0.0, 0.0, 0.0)
    sheen_roughness_factor: float = 0.0
    sheen_color_texture: TextureSlot | None = None
    sheen_roughness_texture: TextureSlot | None = None


class Anisotropy(Record, frozen=True):
    """KHR_materials_anisotropy."""

    anisotropy_strength: float = 0.0
    anisotropy_rotation: float = 0.0
    anisotropy_texture: TextureSlot | None = None


class DiffuseTransmission(Record, frozen=True):
    """KHR_materials_diffuse_transmission."""

    diffuse_transmission_factor: float = 0.0
    diffuse_transmission_color_factor: Vec3 = (1.0, 1.0, 1.0)
    diffuse_transmission_texture: TextureSlot | None = None
    diffuse_transmission_color_texture: TextureSlot | None = None


class Dispersion(Record, frozen=True):
    """KHR_materials_dispersion."""

    dispersion: float = 0.0


class MaterialExtensions(Record, frozen=True):
    """Extensions of a material."""

    specular: Specular | None = field(name="KHR_materials_specular", default=None)
    ior: Ior = field(name="KHR_materials_ior", default=Ior())
    emissive_strength: EmissiveStrength = field(
        name="KHR_materials_emissive_strength", default=EmissiveStrength()
    )
    transmission: Transmission = field(name="KHR_materials_transmission", default=Transmission())
    volume: Volume = field(name="KHR_materials_volume", default=Volume())
    clearcoat: Clearcoat = field(name="KHR_materials_clearcoat", default=Clearcoat())
    sheen: Sheen = field(name="KHR_materials_sheen", default=Sheen())
    anisotropy: Anisotropy = field(name="KHR_materials_anisotropy", default=Anisotropy())
    diffuse_transmission: DiffuseTransmission = field(
        name="KHR_materials_diffuse_transmission", default=DiffuseTransmission()
    )
    dispersion: Dispersion = field(name="KHR_materials_dispersion", default=Dispersion())
    unlit: dict[str, Any] | None = field(name="KHR_materials_unlit", default=None)


class Material(Record, frozen=True):
    """A surface."""

    name: str = ""
    pbr: Pbr = field(name="pbrMetallicRoughness", default=Pbr())
    normal_texture: TextureSlot | None = None
    emissive_texture: TextureSlot | None = None
    emissive_factor: Vec3 = (0.0, 0.0, 0.0)
    alpha_mode: str = "OPAQUE"
    alpha_cutoff: float = 0.5
    double_sided: bool = False
    extensions: MaterialExtensions = MaterialExtensions()
