"""Materials and textures as records of glTF; what is glTF's default is left out."""

from __future__ import annotations

import itertools
import math
import warnings
from collections.abc import Iterator, Sequence
from hashlib import sha256
from typing import Any

import numpy as np

from ispm.errors import SceneError, SceneWarning
from ispm.io.gltf_image import MAG_LINEAR, MIN_MIPMAPS, WRAPS, Rows, uv_rows
from ispm.io.gltf_schema_material import TextureTransform
from ispm.io.gltf_write import Document
from ispm.io.image import srgb_to_linear
from ispm.scene.color import encoded
from ispm.scene.material import IDENTITY_UV, Material, Texture, TextureUse

_WRAP_CODES = {wrap: code for code, wrap in WRAPS.items()}
_MAG_CODES = {linear: code for code, linear in MAG_LINEAR.items()}
_MIN_CODES = {(False, False): 9728, (True, False): 9729, (False, True): 9984, (True, True): 9987}
assert all(MIN_MIPMAPS[code] == mipmaps for (_, mipmaps), code in _MIN_CODES.items())
_NEAR = 24  # doubles on either side that are tried for the one that was there


class MaterialWriter:
    """Writes each material, texture and picture once; pictures of one name with equal pixels are one."""

    def __init__(self, document: Document) -> None:
        self._document = document
        self._materials: dict[int, int] = {}
        self._textures: dict[tuple[int, int], int] = {}
        self._images: dict[tuple[bytes, str], int] = {}
        self._digests: dict[int, bytes] = {}
        self._samplers: dict[tuple[int, ...], int] = {}
        self._encoded: dict[tuple[int, bool], np.ndarray] = {}

    def number(self, material: Material) -> int:
        """Return a material's number, the same for the same object."""
        key = id(material)
        if key not in self._materials:
            material.check()
            self._materials[key] = self._document.put("materials", self._record(material))
        return self._materials[key]

    def _record(self, m: Material) -> dict[str, Any]:
        slots = {
            "normalTexture": self._normals(m.normal_texture, m.normal_scale),
            "emissiveTexture": self._slot(m.emission_texture, srgb=True),
        }
        factor, strength = split(m.emission)
        if max(factor) <= 0.0:
            strength = 1.0
        elif strength <= 1.0:  # as exporters write it
            factor, strength = numbers(m.emission), 1.0
        return given(
            {
                "name": m.name,
                "pbrMetallicRoughness": self._base(m),
                **slots,
                "emissiveFactor": factor,
                "alphaMode": m.alpha_mode.name,
                "alphaCutoff": float(m.alpha_cutoff),
                "doubleSided": bool(m.double_sided),
                "extensions": self._extensions(m, strength),
            },
            {
                "name": "",
                "pbrMetallicRoughness": {},
                "emissiveFactor": [0.0] * 3,
                "alphaMode": "OPAQUE",
                "alphaCutoff": 0.5,
                "doubleSided": False,
                "extensions": {},
            },
        )

    def _base(self, m: Material) -> dict[str, Any]:
        return given(
            {
                "baseColorFactor": [*numbers(m.base_color), 1.0][:4],
                "metallicFactor": float(m.metallic),
                "roughnessFactor": float(m.roughness),
                "baseColorTexture": self._slot(m.base_color_texture, srgb=True),
                "metallicRoughnessTexture": self._slot(m.metallic_roughness_texture, srgb=False),
            },
            {"baseColorFactor": [1.0] * 4, "metallicFactor": 1.0, "roughnessFactor": 1.0},
        )

    def _extensions(self, m: Material, strength: float) -> dict[str, Any]:
        white = [1.0] * 3
        volume = {
            "thicknessFactor": float(m.thickness),
            "attenuationColor": numbers(m.attenuation_color),
            "attenuationDistance": None
            if math.isinf(m.attenuation_distance)
            else float(m.attenuation_distance),
        }
        parts = {
            "anisotropy": self._anisotropy(m),
            "clearcoat": self._coat(m),
            "diffuse_transmission": self._translucence(m),
            "dispersion": given({"dispersion": float(m.dispersion)}, {"dispersion": 0.0}),
            "emissive_strength": given({"emissiveStrength": strength}, {"emissiveStrength": 1.0}),
            "ior": given({"ior": float(m.ior)}, {"ior": 1.5}),
            "sheen": self._sheen(m),
            "specular": self._specular(m),
            "transmission": given(
                {
                    "transmissionFactor": float(m.transmission),
                    "transmissionTexture": self._slot(m.transmission_texture, srgb=False),
                },
                {"transmissionFactor": 0.0},
            ),
            "volume": given(volume, {"thicknessFactor": 0.0, "attenuationColor": white}),
        }
        found = {self._document.use(f"KHR_materials_{name}"): part for name, part in parts.items() if part}
        if m.unlit:
            found[self._document.use("KHR_materials_unlit")] = {}
        return found

    def _sheen(self, m: Material) -> dict[str, Any]:
        return given(
            {
                "sheenColorFactor": numbers(m.sheen_color),
                "sheenRoughnessFactor": float(m.sheen_roughness),
                "sheenColorTexture": self._slot(m.sheen_color_texture, srgb=True),
                "sheenRoughnessTexture": self._slot(m.sheen_roughness_texture, srgb=None),
            },
            {"sheenColorFactor": [0.0] * 3, "sheenRoughnessFactor": 0.0},
        )

    def _anisotropy(self, m: Material) -> dict[str, Any]:
        return given(
            {
                "anisotropyStrength": float(m.anisotropy),
                "anisotropyRotation": float(m.anisotropy_rotation),
                "anisotropyTexture": self._slot(m.anisotropy_texture, srgb=False),
            },
            {"anisotropyStrength": 0.0, "anisotropyRotation": 0.0},
        )

    def _translucence(self, m: Material) -> dict[str, Any]:
        return given(
            {
                "diffuseTransmissionFactor": float(m.diffuse_transmission),
                "diffuseTransmissionColorFactor": numbers(m.diffuse_transmission_color),
                "diffuseTransmissionTexture": self._slot(m.diffuse_transmission_texture, srgb=None),
                "diffuseTransmissionColorTexture": self._slot(
                    m.diffuse_transmission_color_texture, srgb=True
                ),
            },
            {"diffuseTransmissionFactor": 0.0, "diffuseTransmissionColorFactor": [1.0] * 3},
        )

    def _specular(self, m: Material) -> dict[str, Any]:
        return given(
            {
                "specularFactor": float(m.specular),
                "specularColorFactor": numbers(m.specular_color),
                "specularTexture": self._slot(m.specular_texture, srgb=None),
                "specularColorTexture": self._slot(m.specular_color_texture, srgb=True),
            },
            {"specularFactor": 1.0, "specularColorFactor": [1.0] * 3},
        )

    def _coat(self, m: Material) -> dict[str, Any]:
        return given(
            {
                "clearcoatFactor": float(m.clearcoat),
                "clearcoatRoughnessFactor": float(m.clearcoat_roughness),
                "clearcoatTexture": self._slot(m.clearcoat_texture, srgb=False),
                "clearcoatRoughnessTexture": self._slot(m.clearcoat_roughness_texture, srgb=False),
                "clearcoatNormalTexture": self._normals(m.clearcoat_normal_texture, m.clearcoat_normal_scale),
            },
            {"clearcoatFactor": 0.0, "clearcoatRoughnessFactor": 0.0},
        )

    def _normals(self, use: TextureUse | Texture | None, strength: float) -> dict[str, Any] | None:
        """A normal map where a material uses it."""
        slot = self._slot(use, srgb=False)
        if slot is not None and strength != 1.0:
            slot["scale"] = float(strength)
        return slot

    def _slot(self, use: TextureUse | Texture | None, *, srgb: bool | None) -> dict[str, Any] | None:
        """A texture where a material uses it; srgb: whether the slot holds colors, None: alpha alone."""
        if use is None:
            return None
        use = TextureUse(use) if isinstance(use, Texture) else use
        record: dict[str, Any] = {"index": self._texture(use.texture, srgb)}
        if use.uv_set:
            record["texCoord"] = use.uv_set
        if use.transform != IDENTITY_UV:
            record["extensions"] = {self._document.use("KHR_texture_transform"): transform(use.transform)}
        return record

    def _texture(self, texture: Texture, srgb: bool | None) -> int:
        pixels = texture.pixels if srgb in (texture.srgb, None) else self._as_stored(texture)
        if id(pixels) not in self._digests:
            self._digests[id(pixels)] = sha256(repr(pixels.shape).encode() + pixels.tobytes()).digest()
        image_key = self._digests[id(pixels)], texture.name
        if image_key not in self._images:
            self._images[image_key] = self._document.picture(pixels, texture.name)
        source, sampler = key = self._images[image_key], self._sampler(texture)
        if key not in self._textures:
            record = {"source": source, "sampler": sampler}
            self._textures[key] = self._document.put("textures", record)
        return self._textures[key]

    def _sampler(self, t: Texture) -> int:
        filters = _MAG_CODES[bool(t.linear)], _MIN_CODES[bool(t.linear), bool(t.mipmaps)]
        key = *filters, _WRAP_CODES[t.wrap_u], _WRAP_CODES[t.wrap_v]
        if key not in self._samplers:
            names = ("magFilter", "minFilter", "wrapS", "wrapT")
            self._samplers[key] = self._document.put("samplers", dict(zip(names, key, strict=True)))
        return self._samplers[key]

    def _as_stored(self, texture: Texture) -> np.ndarray:
        """Pixels in the encoding that glTF's slot has, which is not the texture's."""
        key = id(texture.pixels), texture.srgb
        if key not in self._encoded:
            codes = np.arange(256, dtype=np.uint8)
            if texture.srgb:
                table = np.rint(srgb_to_linear(codes) * 255.0).astype(np.uint8)
            else:
                table = np.rint(encoded(codes / 255.0) * 255.0).astype(np.uint8)
            pixels = texture.pixels.copy()
            pixels[..., :3] = table[pixels[..., :3]]
            self._encoded[key] = pixels
            kept = ("linear values", "sRGB colors")
            warnings.warn(
                f"texture '{texture.name}' is written as {kept[not texture.srgb]}, as glTF has them in its "
                f"place, not as {kept[texture.srgb]}; its pixels are rounded",
                SceneWarning,
                stacklevel=2,
            )
        return self._encoded[key]


def split(color: Sequence[float]) -> tuple[list[float], float]:
    """Return a color within 0..1 and a strength whose product, in doubles, is `color` exactly."""
    values = numbers(color)
    strength = max(values)
    if strength <= 0.0:
        return values, 1.0
    exact = [value / strength for value in values]
    if [strength * value for value in exact] == values:
        return exact, strength
    strength = math.ldexp(1.0, math.frexp(strength)[1])  # a power of 2: dividing by it rounds nothing
    return [value / strength for value in values], strength


def transform(rows: Rows) -> dict[str, Any]:
    """Return KHR_texture_transform of two rows of a matrix on (u, v, 1).

    The numbers are those from which `uv_rows` makes `rows` again, where such are to be found near.
    Raises SceneError for a matrix with shear, which the extension has no word for.
    """
    (a, b, x), (c, d, y) = rows
    sx, sy = math.hypot(a, c), math.hypot(b, d)
    if abs(a * b + c * d) > 1e-6 * sx * sy:
        raise SceneError("a texture's transform has shear, which glTF cannot hold; put it into the uv sets")
    angle = math.atan2(-c, a) if sx else math.atan2(b, d)
    if math.cos(angle) * d + math.sin(angle) * b < 0.0:
        sy = -sy
    for turn in itertools.chain(*(_near(angle + whole) for whole in (0.0, math.tau, -math.tau))):
        cos, sin = math.cos(turn), math.sin(turn)
        wide = next((s for s in _near(sx) if (cos * s, -sin * s) == (a, c)), None)
        high = next((s for s in _near(sy) if (sin * s, cos * s) == (b, d)), None)
        if wide is not None and high is not None:
            angle, sx, sy = turn, wide, high
            break
    made = TextureTransform((float(x), float(y)), angle, (sx, sy))
    if not np.allclose(uv_rows(made), rows, rtol=1e-6, atol=1e-12):
        raise SceneError("a texture's transform cannot be held by glTF; put it into the uv sets")
    return given(
        {"offset": list(made.offset), "rotation": angle, "scale": [sx, sy]},
        {"offset": [0.0, 0.0], "rotation": 0.0, "scale": [1.0, 1.0]},
    )


def _near(value: float) -> Iterator[float]:
    """Doubles near `value`: short decimals first, as people write them, then its neighbours."""
    yield from (float(f"{value:.{digits}g}") for digits in (6, 9, 16))
    yield value
    up, down = value, value
    for _ in itertools.repeat(None, _NEAR):
        up, down = math.nextafter(up, math.inf), math.nextafter(down, -math.inf)
        yield from (up, down)


def numbers(values: Sequence[float] | np.ndarray) -> list[float]:
    """Return plain floats."""
    return [float(value) for value in values]


def given(record: dict[str, Any], defaults: dict[str, Any]) -> dict[str, Any]:
    """Return `record` without what is None or has its default."""
    return {
        key: value
        for key, value in record.items()
        if value is not None and not (key in defaults and value == defaults[key])
    }
