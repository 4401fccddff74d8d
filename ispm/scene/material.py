"""The metallic-roughness surface of glTF 2.0 and its textures."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass, field
from enum import IntEnum
from pathlib import Path

import numpy as np

from ispm.errors import SceneError, warn_caller
from ispm.scene.pixels import rgba_of
from ispm.scene.values import BRIGHTEST, LEAST, Strict, array_of, as_code, member_of, require

IDENTITY_UV = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))


class Wrap(IntEnum):
    """What a texture shows outside [0, 1)."""

    REPEAT = 0
    CLAMP = 1
    MIRROR = 2


class AlphaMode(IntEnum):
    """What a material's opacity means."""

    OPAQUE = 0
    MASK = 1
    BLEND = 2


@dataclass(frozen=True, eq=False)
class TextureState:
    """What was read of a texture, to be compared with what it has become."""

    pixels: np.ndarray
    version: int
    srgb: bool
    mipmaps: bool

    def __eq__(self, other: object) -> bool:
        return isinstance(other, TextureState) and (
            self.pixels is other.pixels
            and (self.version, self.srgb, self.mipmaps) == (other.version, other.srgb, other.mipmaps)
        )


@dataclass(eq=False)
class Texture(Strict):
    """A picture and how it is sampled. Compared by identity.

    pixels  a picture file (.png .jpg .webp), or an array, row 0 on top: (height, width) gray or (height,
            width, 1 to 4): gray, gray and alpha, RGB, RGBA. uint8 and uint16 are encoded as `srgb` says,
            floats are linear, 0 to 1. Kept as (height, width, 4) uint8.
    srgb    whether RGB is kept sRGB-encoded, as glTF has colors (base color, emission), or linear, as it has
            data (normals, metallic and roughness, transmission); alpha is always linear
    wrap_u, wrap_v   what is seen outside of 0 to 1
    mipmaps  whether smaller levels may be used
    linear   whether texels are interpolated or the nearest one is taken
    name    default, of a file: its name without the ending
    version counts calls of `touch`
    Other pixels may be given at any time; call `touch` after editing them in place.
    Raises SceneError for pixels, or a file, that cannot be used.
    """

    pixels: np.ndarray
    srgb: bool
    wrap_u: Wrap
    wrap_v: Wrap
    linear: bool
    mipmaps: bool
    name: str
    version: int

    def __init__(
        self,
        pixels: np.ndarray | str | os.PathLike[str],
        srgb: bool = True,
        wrap_u: Wrap = Wrap.REPEAT,
        wrap_v: Wrap = Wrap.REPEAT,
        linear: bool = True,
        mipmaps: bool = True,
        name: str = "",
    ) -> None:
        self.srgb, self.wrap_u, self.wrap_v = srgb, wrap_u, wrap_v
        self.linear, self.mipmaps, self.name, self.version = linear, mipmaps, name, 0
        if isinstance(pixels, str | os.PathLike):
            from ispm.io.texture_file import read_pixels

            self.name, self.pixels = name or Path(pixels).stem, read_pixels(pixels)
        else:
            self.pixels = pixels
        self.check()

    def __repr__(self) -> str:
        height, width = self.pixels.shape[:2]
        return f"<Texture '{self.name}': {width}x{height}, {'sRGB' if self.srgb else 'linear'}>"

    @property
    def state(self) -> TextureState:
        """What its appearance depends on."""
        return TextureState(self.pixels, self.version, bool(self.srgb), bool(self.mipmaps))

    def touch(self) -> None:
        """Say that pixels were edited in place, so that renderers read them again."""
        self.version += 1

    def check(self) -> None:
        """Bring pixels to the form they are kept in. Raises SceneError where a field cannot be used."""
        where = f"texture '{self.name}'"
        self.pixels = rgba_of(where, self.pixels, bool(self.srgb))
        self.wrap_u = member_of(f"{where}: wrap_u", self.wrap_u, Wrap)
        self.wrap_v = member_of(f"{where}: wrap_v", self.wrap_v, Wrap)


@dataclass(frozen=True)
class TextureUse:
    """A texture in one slot of a material.

    uv_set     0 or 1
    transform  two rows of a matrix on (u, v, 1), from KHR_texture_transform
    """

    texture: Texture
    uv_set: int = 0
    transform: tuple[tuple[float, float, float], tuple[float, float, float]] = IDENTITY_UV

    def __post_init__(self) -> None:
        if not isinstance(self.texture, Texture):
            raise SceneError(f"a TextureUse takes a Texture, not a {type(self.texture).__name__}")
        where = f"texture '{self.texture.name}'"
        require(f"{where}: uv_set", self.uv_set, 0, 1)
        array_of(f"{where}: transform", self.transform, (2, 3))


# least, most, and how many numbers where not one: others would create energy, or leave float32
RANGES: dict[str, tuple[float, float, *tuple[int, ...]]] = {
    "base_color": (0.0, 1.0, 3, 4),
    "metallic": (0.0, 1.0),
    "roughness": (0.0, 1.0),
    "specular": (0.0, 1.0),
    "specular_color": (0.0, 1e4, 3),
    "ior": (1.0, 100.0),
    "transmission": (0.0, 1.0),
    "thickness": (0.0, 1e9),
    "attenuation_color": (0.0, 1.0, 3),
    "attenuation_distance": (LEAST, math.inf),
    "emission": (0.0, BRIGHTEST, 3),
    "alpha_cutoff": (0.0, 1e6),
    "normal_scale": (-1e3, 1e3),
    "clearcoat": (0.0, 1.0),
    "clearcoat_roughness": (0.0, 1.0),
    "clearcoat_normal_scale": (-1e3, 1e3),
    "sheen_color": (0.0, 1.0, 3),
    "sheen_roughness": (0.0, 1.0),
    "anisotropy": (0.0, 1.0),
    "anisotropy_rotation": (-1e3, 1e3),
    "diffuse_transmission": (0.0, 1.0),
    "diffuse_transmission_color": (0.0, 1.0, 3),
    "dispersion": (0.0, 20.0),  # at most an Abbe number of 1: at 40 red light would not be bent at all
    "double_sided": (False, True),
    "unlit": (False, True),
}
TEXTURES = (
    "base_color_texture",
    "metallic_roughness_texture",
    "normal_texture",
    "emission_texture",
    "transmission_texture",
    "clearcoat_texture",
    "clearcoat_roughness_texture",
    "clearcoat_normal_texture",
    "specular_texture",
    "specular_color_texture",
    "sheen_color_texture",
    "sheen_roughness_texture",
    "anisotropy_texture",
    "diffuse_transmission_texture",
    "diffuse_transmission_color_texture",
)


DATA = (
    "metallic_roughness_texture",
    "normal_texture",
    "transmission_texture",
    "clearcoat_texture",
    "clearcoat_roughness_texture",
    "clearcoat_normal_texture",
    "anisotropy_texture",
)
"""Those of TEXTURES whose RGB holds numbers, not colors: kept linear, as glTF has them."""


@dataclass
class Material(Strict):
    """Factors as glTF names them, linear; each texture multiplies its factor.

    base_color        (3,) or (4,), with opacity
    metallic, roughness   0..1; alpha of the microfacet model is roughness squared
    specular, specular_color   KHR_materials_specular
    ior               KHR_materials_ior: 1 or more, or 0: a mirror from all sides
    transmission      KHR_materials_transmission: share of light below the reflection that goes through
    thickness         KHR_materials_volume: above 0 the mesh bounds a solid, light refracts and what is inside
                      attenuates it; 0: a thin sheet, light goes straight through
    attenuation_color, attenuation_distance   of what is inside: the color that white light has after
                      this many metres
    emission          (3,) cd/m2 per channel, strength included
    alpha_mode        what opacity below 1 means: nothing, a hole where it is below alpha_cutoff, or a share
    double_sided      whether the back is seen and lit as well
    unlit             shows its base color as it is, whatever the light
    normal_scale      factor on the normal map's x and y
    base_color_texture, emission_texture   colors: `Texture(picture)`
    normal_texture    data: `Texture(picture, srgb=False)`; so are the following
    metallic_roughness_texture   G roughness, B metallic
    transmission_texture         R
    clearcoat, clearcoat_roughness   KHR_materials_clearcoat: share of the surface under a clear coat of index
                      1.5, not over glass; roughness as that of the base
    clearcoat_normal_scale   factor on the x and y of the coat's normal map
    clearcoat_texture            R
    clearcoat_roughness_texture  G
    clearcoat_normal_texture     of the coat alone; without it the coat is smooth whatever is under it
    specular_texture             A, of one kept linear or not;  specular_color_texture   a color
    sheen_color, sheen_roughness   KHR_materials_sheen: fibers on the surface, not over glass; black: none
    sheen_color_texture          a color;  sheen_roughness_texture   A, of one kept linear or not
    anisotropy        KHR_materials_anisotropy, not of glass: along the tangent alpha goes from that of the
                      roughness, which it is across, to 1 with the square of this strength, 0..1; tangents of
                      a mesh that has none, nor uv0, go around its Y axis
    anisotropy_rotation   radians, of that direction, counterclockwise from the tangent
    anisotropy_texture    RG its direction before, from -1 to 1 along tangent and bitangent, B strength
    diffuse_transmission, diffuse_transmission_color   KHR_materials_diffuse_transmission: share of
                      diffuse light that leaves a thin sheet, as a leaf or paper, on the other side, where
                      this color takes the place of the base color; not of glass, and with no inside
    diffuse_transmission_texture   A, of one kept linear or not;  diffuse_transmission_color_texture   a color
    dispersion        KHR_materials_dispersion: 20 over the Abbe number of a solid, by which the index of red
                      light is lower and of blue light higher than ior; 0: glass bends all alike
    Raises SceneError for a value out of range, as it is made and, if changed since, as it is rendered; warns
    where data is given as sRGB.
    """

    base_color: tuple[float, ...] = (1.0, 1.0, 1.0, 1.0)
    metallic: float = 0.0
    roughness: float = 1.0
    specular: float = 1.0
    specular_color: tuple[float, float, float] = (1.0, 1.0, 1.0)
    ior: float = 1.5
    transmission: float = 0.0
    thickness: float = 0.0
    attenuation_color: tuple[float, float, float] = (1.0, 1.0, 1.0)
    attenuation_distance: float = math.inf
    emission: tuple[float, float, float] = (0.0, 0.0, 0.0)
    alpha_mode: AlphaMode = AlphaMode.OPAQUE
    alpha_cutoff: float = 0.5
    double_sided: bool = False
    unlit: bool = False
    normal_scale: float = 1.0
    base_color_texture: TextureUse | Texture | None = None
    metallic_roughness_texture: TextureUse | Texture | None = None
    normal_texture: TextureUse | Texture | None = None
    emission_texture: TextureUse | Texture | None = None
    transmission_texture: TextureUse | Texture | None = None
    clearcoat: float = 0.0
    clearcoat_roughness: float = 0.0
    clearcoat_normal_scale: float = 1.0
    clearcoat_texture: TextureUse | Texture | None = None
    clearcoat_roughness_texture: TextureUse | Texture | None = None
    clearcoat_normal_texture: TextureUse | Texture | None = None
    specular_texture: TextureUse | Texture | None = None
    specular_color_texture: TextureUse | Texture | None = None
    sheen_color: tuple[float, float, float] = (0.0, 0.0, 0.0)
    sheen_roughness: float = 0.0
    sheen_color_texture: TextureUse | Texture | None = None
    sheen_roughness_texture: TextureUse | Texture | None = None
    anisotropy: float = 0.0
    anisotropy_rotation: float = 0.0
    anisotropy_texture: TextureUse | Texture | None = None
    diffuse_transmission: float = 0.0
    diffuse_transmission_color: tuple[float, float, float] = (1.0, 1.0, 1.0)
    diffuse_transmission_texture: TextureUse | Texture | None = None
    diffuse_transmission_color_texture: TextureUse | Texture | None = None
    dispersion: float = 0.0
    name: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        self.check()
        for name in DATA:
            use = getattr(self, name)
            texture = use.texture if isinstance(use, TextureUse) else use
            if texture is not None and texture.srgb:
                warn_caller(
                    f"material '{self.name}': {name} is read as sRGB colors, though it is data; "
                    "make it by Texture(picture, srgb=False)"
                )

    def check(self) -> None:
        """Raise SceneError where a field is of another kind or out of its range in RANGES."""
        where = f"material '{self.name}'"
        for name, limits in RANGES.items():
            if name != "ior" or self.ior != 0.0:
                value = getattr(self, name)
                require(f"{where}: {name}", value, *limits)
                if isinstance(value, list | np.ndarray):  # compared and shown as tuples are
                    setattr(self, name, tuple(np.asarray(value).tolist()))
        if self.clearcoat > 0.0 and self.transmission > 0.0:
            raise SceneError(f"{where}: a clear coat over glass is not supported; set one of the two to 0")
        if max(self.sheen_color) > 0.0 and self.transmission > 0.0:
            raise SceneError(
                f"{where}: sheen over glass is not supported; set sheen_color or transmission to 0"
            )
        if self.anisotropy > 0.0 and self.transmission > 0.0:
            raise SceneError(f"{where}: anisotropy of glass is not supported; set one of the two to 0")
        if self.diffuse_transmission > 0.0 and self.transmission > 0.0:
            raise SceneError(
                f"{where}: diffuse transmission of glass is not supported; set one of the two to 0"
            )
        self.alpha_mode = member_of(f"{where}: alpha_mode", self.alpha_mode, AlphaMode)
        for name in TEXTURES:
            use = getattr(self, name)
            if use is None:
                continue
            if not isinstance(use, (Texture, TextureUse)):
                hint = f"; write Texture({'...' if isinstance(use, np.ndarray) else repr(use)})"
                hint *= isinstance(use, np.ndarray | str | os.PathLike)
                raise SceneError(f"{where}: {name} must be a Texture, not a {type(use).__name__}{hint}")
            (use.texture if isinstance(use, TextureUse) else use).check()

    def __repr__(self) -> str:
        return as_code(self)

    @property
    def casts_caustics(self) -> bool:
        """Whether the surface is a mirror or glass, smooth enough to gather light into patterns."""
        shiny = self.metallic > 0.5 or self.transmission > 0.0
        alpha = self.roughness**2
        widest = alpha + (1.0 - alpha) * self.anisotropy**2
        return shiny and not self.unlit and widest < 0.05

    @property
    def hides_photons(self) -> bool:
        """Whether photons that arrive are seen nowhere on the surface: it is a perfect mirror, or glass, or
        unlit, or reflects nothing, as lamps do, in all places."""
        mirror = self.metallic == 1.0 and self.roughness == 0.0 and self.metallic_roughness_texture is None
        glass = self.transmission == 1.0 and self.metallic == 0.0 and self.transmission_texture is None
        others = self.translucent or max(self.sheen_color) > 0.0
        shiny = max(self.specular, self.metallic, self.transmission, self.clearcoat) > 0.0
        black = max(self.base_color[:3]) == 0.0 and not shiny
        return self.unlit or (not others and (mirror or glass or black))

    @property
    def translucent(self) -> bool:
        """Whether the surface is a thin sheet that lets light through diffusely."""
        return self.diffuse_transmission > 0.0

    @property
    def dispersive(self) -> bool:
        """Whether the surface bounds a solid that bends each band of light by another angle."""
        bends = self.transmission > 0.0 and self.thickness > 0.0 and self.ior > 0.0
        return bends and self.dispersion > 0.0 and not self.unlit

    @property
    def emissive(self) -> bool:
        """Whether the surface glows."""
        return max(self.emission) > 0.0
