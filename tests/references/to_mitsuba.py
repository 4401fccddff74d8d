"""Scenes for Mitsuba 3: what both can show exactly alike, and nothing else.

Meshes come from the arrays that our tracer reads, in world space; intensities need no factor: both take cd
and lx per channel.
"""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from ispm.scene.camera import Camera
from ispm.scene.color import linear
from ispm.scene.light import DirectionalLight, PointLight, SpotLight
from ispm.scene.material import Material, Texture, TextureUse
from ispm.scene.packed import Packed, pack
from ispm.scene.scene import Node, Scene
from references.triangles import world_triangles

_CONE_TEXELS = 512  # a side, of the picture that a spot's soft edge is
_FLIP = np.diag([-1.0, 1.0, -1.0, 1.0])  # ours look along -Z, theirs along +Z


def to_mitsuba(
    scene: Scene, size: tuple[int, int], integrator: dict[str, Any], *, plain_mirrors: bool = False
) -> Any:
    """Return the mi.Scene of a scene as its first camera sees it, the mean over each pixel's square.

    size           width and height
    integrator     as mi.load_dict takes it
    plain_mirrors  take colored ones too, the same at all angles where ours whiten towards grazing ones
    Raises ValueError for a material, light or camera that Mitsuba would show otherwise.
    """
    _register()
    packed = pack(scene)
    if len(scene.materials) != len(packed.materials):
        raise ValueError("a part of the scene has no triangles")
    described: dict[str, Any] = {"type": "scene", "integrator": integrator}
    described["sensor"] = _sensor(*_first_camera(scene), size)
    lights = [(node, world) for node, world in scene.placed() if node.light is not None]
    described |= {f"light_{k}": _light(node, world) for k, (node, world) in enumerate(lights)}
    bsdfs = [mi.load_dict(_bsdf(material, plain_mirrors)) for material in scene.materials]
    for k, instance in enumerate(packed.instances):
        described[f"mesh_{k}"] = _mesh(packed, instance, bsdfs[instance["material"]])
    return mi.load_dict(described)


def _first_camera(scene: Scene) -> tuple[Camera, np.ndarray]:
    for node, world in scene.placed():
        if node.camera is not None:
            return node.camera, world
    raise ValueError("the scene has no camera")


def _sensor(camera: Camera, world: np.ndarray, size: tuple[int, int]) -> dict[str, Any]:
    if camera.orthographic or camera.aspect is not None or camera.principal != (0.0, 0.0):
        raise ValueError("only plain perspective cameras are handed over")
    film = {
        "type": "hdrfilm", "width": size[0], "height": size[1], "rfilter": {"type": "box"},
        "pixel_format": "rgb", "component_format": "float32",
    }  # fmt: skip
    return {
        "type": "perspective", "fov": float(np.degrees(camera.yfov)), "fov_axis": "y", "near_clip": 1e-2,
        "far_clip": 1e3, "to_world": mi.ScalarTransform4f(world @ _FLIP), "film": film,
        "sampler": {"type": "independent"},
    }  # fmt: skip


def _light(node: Node, world: np.ndarray) -> dict[str, Any]:
    light, place, along = node.light, world[:3, 3], -world[:3, 2]
    if isinstance(light, DirectionalLight):
        return {"type": "directional", "direction": along.tolist(), "irradiance": _rgb(light.intensity)}
    if isinstance(light, PointLight | SpotLight) and np.isfinite(light.range):
        raise ValueError(f"light '{node.name}' has a range")
    if isinstance(light, PointLight):
        return {"type": "point", "position": place.tolist(), "intensity": _rgb(light.intensity)}
    assert isinstance(light, SpotLight)
    outer = float(np.degrees(light.outer_angle))
    cone = mi.Bitmap(_cone_picture(light))
    return {
        "type": "spot", "to_world": mi.ScalarTransform4f(world @ _FLIP), "intensity": _rgb(light.intensity),
        "cutoff_angle": outer, "beam_width": 0.99999 * outer,
        "texture": {"type": "bitmap", "bitmap": cone, "raw": True, "wrap_mode": "clamp"},
    }  # fmt: skip


def _cone_picture(light: SpotLight) -> np.ndarray:
    """(n, n, 3) float32: the falloff of KHR_lights_punctual over the square round the cone's cut."""
    edge = (2.0 * (np.arange(_CONE_TEXELS) + 0.5) / _CONE_TEXELS - 1.0) * np.tan(light.outer_angle)
    cosine = 1.0 / np.sqrt(1.0 + edge**2 + edge[:, None] ** 2)
    inner, outer = np.cos(light.inner_angle), np.cos(light.outer_angle)
    falloff = np.clip((cosine - outer) / (inner - outer), 0.0, 1.0) ** 2
    return np.repeat(falloff[..., None], 3, axis=-1).astype(np.float32)


def _mesh(packed: Packed, instance: np.void, bsdf: Any) -> Any:
    """The triangles of an INSTANCE in world space; texture coordinates with v upwards."""
    positions, normals, uv, corners = world_triangles(packed, instance)
    properties = mi.Properties()
    properties["bsdf"] = bsdf
    mesh = mi.Mesh("mesh", len(positions), len(corners), properties, True, True)
    arrays = mi.traverse(mesh)
    arrays["vertex_positions"] = positions.astype(np.float32).ravel()
    arrays["vertex_normals"] = normals.astype(np.float32).ravel()
    arrays["vertex_texcoords"] = (uv * (1.0, -1.0) + (0.0, 1.0)).astype(np.float32).ravel()
    arrays["faces"] = corners.ravel()
    arrays.update()
    return mesh


def _bsdf(material: Material, plain_mirrors: bool) -> dict[str, Any]:
    """Lambert, white metal, clear glass, or a plain mirror."""
    color, white = tuple(material.base_color[:3]), (1.0, 1.0, 1.0)
    textures = (material.metallic_roughness_texture, material.emission_texture, material.transmission_texture)
    if any(textures) or material.emissive or material.alpha_mode or material.unlit:
        raise ValueError(f"material '{material.name}' has more than a base color and normals")
    plain = material.base_color_texture is None and material.normal_texture is None
    bare = plain and color == white
    if material.transmission == 1.0 and not material.metallic and bare and material.roughness == 0.0:
        if material.thickness > 0.0 and material.specular == 1.0 and material.attenuation_distance == np.inf:
            return {"type": "dielectric", "int_ior": material.ior, "ext_ior": 1.0}
    elif material.metallic == 1.0 and bare:
        mirror = {"type": "conductor", "material": "none"}
        rough = {"type": "glossy_metal", "alpha": material.roughness**2}
        return {"type": "twosided", "bsdf": rough if material.roughness else mirror}
    elif material.metallic == 1.0 and plain and plain_mirrors and material.roughness == 0.0:
        mirror = {"type": "conductor", "material": "none", "specular_reflectance": _rgb(color)}
        return {"type": "twosided", "bsdf": mirror}
    elif material.metallic == 0.0 and material.transmission == 0.0 and material.specular == 0.0:
        bsdf = {"type": "diffuse", "reflectance": _reflectance(material)}
        if material.normal_texture is not None:
            normals = _texture(material.normal_texture)[..., :3]
            if material.normal_scale != 1.0:
                raise ValueError(f"material '{material.name}' scales its normals")
            bsdf = {"type": "normalmap", "normalmap": _bitmap(normals), "bsdf": bsdf}
        return {"type": "twosided", "bsdf": bsdf}
    raise ValueError(f"material '{material.name}' is not Lambert, white metal or clear glass")


def _reflectance(material: Material) -> dict[str, Any]:
    color = material.base_color[:3]
    if material.base_color_texture is None:
        return _rgb(color)
    return _bitmap(_texture(material.base_color_texture)[..., :3] * np.float32(color))


def _texture(use: TextureUse | Texture) -> np.ndarray:
    """(h, w, 4) float32, linear."""
    texture = use.texture if isinstance(use, TextureUse) else use
    if isinstance(use, TextureUse) and use != TextureUse(texture):
        raise ValueError("a texture is not on the first coordinates as they are")
    values = texture.pixels.astype(np.float32) / np.float32(255)
    return linear(values) if texture.srgb else values


def _bitmap(values: np.ndarray) -> dict[str, Any]:
    """A texture whose first row is on top, where v is 1."""
    upwards = mi.Bitmap(np.ascontiguousarray(values[::-1]))
    return {"type": "bitmap", "bitmap": upwards, "raw": True}


def _rgb(values: tuple[float, ...]) -> dict[str, Any]:
    return {"type": "rgb", "value": [float(v) for v in values]}


def _register() -> None:
    """Make `glossy_metal` known: GGX with shadowing and masking that know of each other, as glTF has it.

    Mitsuba's own takes them as independent, G1 G1, which is darker at grazing angles.
    """

    class GlossyMetal(mi.BSDF):
        def __init__(self, properties: Any) -> None:
            mi.BSDF.__init__(self, properties)
            self._alpha = float(properties.get("alpha"))
            self._facets = mi.load_dict(
                {"type": "roughconductor", "material": "none", "distribution": "ggx", "alpha": self._alpha}
            )
            self.m_components = [self._facets.flags(0)]
            self.m_flags = self._facets.flags()

        def _correction(self, wi: Any, wo: Any) -> Any:
            """G2 / (G1 G1) = (1 + a)(1 + b) / (1 + a + b); a, b: Smith's lambda; Heitz, JCGT 2014."""
            a, b = self._lambda(wi), self._lambda(wo)
            return (1.0 + a) * (1.0 + b) / (1.0 + a + b)

        def _lambda(self, w: Any) -> Any:
            return 0.5 * (dr.sqrt(1.0 + self._alpha**2 * mi.Frame3f.tan_theta_2(w)) - 1.0)

        def sample(self, context: Any, at: Any, one: Any, two: Any, active: Any = True) -> Any:
            drawn, weight = self._facets.sample(context, at, one, two, active)
            return drawn, weight * self._correction(at.wi, drawn.wo)

        def eval(self, context: Any, at: Any, wo: Any, active: Any = True) -> Any:
            return self._facets.eval(context, at, wo, active) * self._correction(at.wi, wo)

        def pdf(self, context: Any, at: Any, wo: Any, active: Any = True) -> Any:
            return self._facets.pdf(context, at, wo, active)

        def eval_pdf(self, context: Any, at: Any, wo: Any, active: Any = True) -> Any:
            return self.eval(context, at, wo, active), self.pdf(context, at, wo, active)

    mi.register_bsdf("glossy_metal", GlossyMetal)
