"""Scenes for Mitsuba 3: what both can show exactly alike, and nothing else.

Meshes come from the arrays that our tracer reads, in world space; intensities need no factor: both take cd,
lx and cd/m2 per channel. What glows shines from its front alone.
"""

from __future__ import annotations

from typing import Any

import mitsuba as mi
import numpy as np

from ispm.scene.camera import Camera
from ispm.scene.color import linear
from ispm.scene.environment import Environment
from ispm.scene.light import DirectionalLight, PointLight, SpotLight, SurfaceLight
from ispm.scene.material import Material, Texture, TextureUse
from ispm.scene.packed import pack
from ispm.scene.scene import Node, Scene
from ispm.scene.sky import dome_of, with_sun
from references.mitsuba_gloss import register_gloss
from references.triangles import Triangles, world_triangles

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
    register_gloss()
    packed = pack(scene)
    materials = packed.placed.layout.looks()
    described: dict[str, Any] = {"type": "scene", "integrator": integrator}
    described["sensor"] = _sensor(*_first_camera(scene), size)
    tree = with_sun(scene.tree(), scene.environment)
    for k, (node, world) in enumerate(zip(tree.nodes, tree.worlds(), strict=True)):
        if node.light is not None and not isinstance(node.light, SurfaceLight):  # those are meshes
            described[f"light_{k}"] = _light(node, world)
    environment = dome_of(scene.environment)
    if environment is not None:
        described["environment"] = _environment(environment)
    bsdfs = [mi.load_dict(_bsdf(material, plain_mirrors)) for material in materials]
    for k, instance in enumerate(packed.instances):
        material, bsdf = materials[instance["material"]], bsdfs[instance["material"]]
        parts = (
            _charts(world_triangles(packed, instance))
            if material.emission_texture is not None
            else [world_triangles(packed, instance)]
        )
        for part, triangles in enumerate(parts):
            described[f"mesh_{k}_{part}"] = _mesh(triangles, bsdf, material)
    return mi.load_dict(described)


def _first_camera(scene: Scene) -> tuple[Camera, np.ndarray]:
    for node, world in scene.placed():
        if node.camera is not None:
            return node.camera, world
    raise ValueError("the scene has no camera")


def _sensor(camera: Camera, world: np.ndarray, size: tuple[int, int]) -> dict[str, Any]:
    if camera.aspect is not None or camera.principal != (0.0, 0.0):
        raise ValueError("only cameras with square pixels that look ahead are handed over")
    film = {
        "type": "hdrfilm", "width": size[0], "height": size[1], "rfilter": {"type": "box"},
        "pixel_format": "rgb", "component_format": "float32",
    }  # fmt: skip
    described: dict[str, Any] = {
        "type": "perspective",
        "fov": float(np.degrees(camera.yfov)),
        "fov_axis": "y",
    }
    pose = world @ _FLIP
    if camera.ymag is not None:
        half = camera.ymag * size[0] / size[1]  # theirs is 2 wide
        described, pose = {"type": "orthographic"}, pose @ np.diag([half, half, 1.0, 1.0])
    return described | {
        "near_clip": 1e-2, "far_clip": 1e3, "to_world": mi.ScalarTransform4f(pose), "film": film,
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


def _environment(environment: Environment) -> dict[str, Any]:
    """Theirs has u 0, not 0.5, along -Z, and its first and last rows at the poles: twice as many rows hold
    the middles between ours too, so that both are the same function."""
    image = environment.image.astype(np.float32) * np.float32(environment.intensity)
    padded = np.concatenate([image[:1], image, image[-1:]])
    rows = np.empty((2 * len(image) + 1, *image.shape[1:]), np.float32)
    rows[::2], rows[1::2] = 0.5 * (padded[:-1] + padded[1:]), image
    turn = mi.ScalarTransform4f().rotate([0, 1, 0], float(np.degrees(environment.rotation)) + 180.0)
    return {"type": "envmap", "bitmap": mi.Bitmap(rows), "to_world": turn}


def _charts(triangles: Triangles) -> list[Triangles]:
    """Triangles by what hangs together: a lamp's points are drawn by place in its texture, which two must not
    share."""
    label = np.arange(len(triangles.positions))
    while True:
        least = label[triangles.corners].min(axis=1)
        before = label.copy()
        np.minimum.at(label, triangles.corners, least[:, None])
        if (label == before).all():
            break
    of = label[triangles.corners[:, 0]]
    return [triangles._replace(corners=triangles.corners[of == each]) for each in np.unique(of)]


def _mesh(triangles: Triangles, bsdf: Any, material: Material) -> Any:
    """Triangles in world space; texture coordinates with v upwards. What glows has flat faces: Mitsuba takes
    the cosine at a lamp by its shading normals."""
    positions, normals, uv, corners = triangles
    properties = mi.Properties()
    properties["bsdf"] = bsdf
    if material.emissive:
        if material.double_sided:
            raise ValueError(f"material '{material.name}' glows from both sides")
        properties["emitter"] = mi.load_dict({"type": "area", "radiance": _emission(material)})
    mesh = mi.Mesh("mesh", len(positions), len(corners), properties, not material.emissive, True)
    arrays = mi.traverse(mesh)
    arrays["vertex_positions"] = positions.astype(np.float32).ravel()
    if not material.emissive:
        arrays["vertex_normals"] = normals.astype(np.float32).ravel()
    arrays["vertex_texcoords"] = (uv * (1.0, -1.0) + (0.0, 1.0)).astype(np.float32).ravel()
    arrays["faces"] = corners.ravel()
    arrays.update()
    return mesh


def _emission(material: Material) -> dict[str, Any]:
    if material.emission_texture is None:
        return _rgb(material.emission)
    return _bitmap(_texture(material.emission_texture)[..., :3] * np.float32(material.emission))


def _bsdf(material: Material, plain_mirrors: bool) -> dict[str, Any]:
    """Lambert, clear glass, a white or plain mirror, or what is rough and has no textures."""
    color, white = tuple(material.base_color[:3]), (1.0, 1.0, 1.0)
    textures = (material.metallic_roughness_texture, material.transmission_texture)
    if any(textures) or material.alpha_mode or material.unlit or material.translucent or material.dispersive:
        raise ValueError(f"material '{material.name}' has more than a base color, normals and emission")
    plain = material.base_color_texture is None and material.normal_texture is None
    bare = plain and color == white
    if material.transmission == 1.0 and not material.metallic and bare and material.roughness == 0.0:
        if material.thickness > 0.0 and material.specular == 1.0 and material.attenuation_distance == np.inf:
            return {"type": "dielectric", "int_ior": material.ior, "ext_ior": 1.0}
    elif material.metallic == 1.0 and material.roughness == 0.0 and plain and (plain_mirrors or bare):
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
    elif material.transmission == 0.0 and material.roughness > 0.0 and plain:
        return {"type": "twosided", "bsdf": _glossy(material)}
    raise ValueError(f"material '{material.name}' is none that Mitsuba can show alike")


def _glossy(material: Material) -> dict[str, Any]:
    if material.metallic not in (0.0, 1.0) or material.specular_color != (1.0, 1.0, 1.0):
        raise ValueError(
            f"material '{material.name}' mixes metal and what is none, or has a colored reflection"
        )
    metal, color = material.metallic == 1.0, tuple(material.base_color[:3])
    clear = material.specular * ((material.ior - 1.0) / (material.ior + 1.0)) ** 2
    described = {
        "diffuse": (0.0, 0.0, 0.0) if metal else color,
        "f0": color if metal else (clear, clear, clear),
        "f90": 1.0 if metal else material.specular,
        "alpha": material.roughness**2,
    }
    return {"type": "glossy", **{key: _rgb(v) if isinstance(v, tuple) else v for key, v in described.items()}}


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
