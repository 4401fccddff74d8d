"""Materials and textures of a file."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from assets import assets
from gltf_builder import CHECKS, QUAD, QUAD_INDICES, QUAD_UV, GltfBuilder, only_material, quad
from PIL import Image

from ispm.io.load import load
from ispm.scene.material import AlphaMode, Material, TextureUse, Wrap
from ispm.scene.scene import Scene


def textured(pixels: np.ndarray = CHECKS, slot: dict[str, Any] | None = None, **json: Any) -> GltfBuilder:
    """A quad whose base color is a picture."""
    builder = quad({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0, **(slot or {})}}}, **json)
    builder.picture(pixels)
    return builder


def base_texture(scene: Scene) -> TextureUse:
    use = only_material(scene).base_color_texture
    assert use is not None
    return use


def transformed(use: TextureUse, u: float, v: float) -> np.ndarray:
    return np.array(use.transform) @ (u, v, 1.0)


def test_primitives_without_material_share_the_default_one(tmp_path: Path) -> None:
    builder = quad()
    builder.node(mesh=builder.mesh(None, POSITION=QUAD[:3]))
    assert only_material(builder.load(tmp_path)) == Material(metallic=1.0)


def test_factors_and_extensions_are_read(tmp_path: Path) -> None:
    record = {
        "name": "lacquer",
        "pbrMetallicRoughness": {
            "baseColorFactor": [0.1, 0.2, 0.3, 0.4], "metallicFactor": 0.5, "roughnessFactor": 0.6
        },
        "emissiveFactor": [0, 0.5, 1],
        "alphaMode": "MASK",
        "alphaCutoff": 0.7,
        "doubleSided": True,
        "extensions": {
            "KHR_materials_specular": {"specularFactor": 0.8, "specularColorFactor": [1, 2, 0]},
            "KHR_materials_ior": {"ior": 1.33},
            "KHR_materials_emissive_strength": {"emissiveStrength": 20},
            "KHR_materials_unlit": {},
        },
    }  # fmt: skip
    scene = quad(record).load(tmp_path)
    material = only_material(scene)
    assert scene.warnings == []
    assert material.name == "lacquer"
    assert material == Material(
        base_color=(0.1, 0.2, 0.3, 0.4), metallic=0.5, roughness=0.6, specular=0.8,
        specular_color=(1.0, 2.0, 0.0), ior=1.33, emission=(0.0, 10.0, 20.0), alpha_mode=AlphaMode.MASK,
        alpha_cutoff=0.7, double_sided=True, unlit=True,
    )  # fmt: skip


def test_factors_out_of_range_are_clamped(tmp_path: Path) -> None:
    pbr = {"baseColorFactor": [7, -1, 0.5, 1], "metallicFactor": -3, "roughnessFactor": 12}
    record = {"pbrMetallicRoughness": pbr, "extensions": {"KHR_materials_ior": {"ior": 0.5}}}
    scene = quad(record).load(tmp_path)
    expected = Material(base_color=(1.0, 0.0, 0.5, 1.0), metallic=0.0, roughness=1.0, ior=1.5)
    assert only_material(scene) == expected
    assert len(scene.warnings) == 4


def test_blend_is_told_once(tmp_path: Path) -> None:
    builder = quad({"alphaMode": "BLEND"})
    builder.node(mesh=builder.mesh(more={"material": builder.put("materials", {"alphaMode": "BLEND"})}))
    scene = builder.load(tmp_path)
    assert scene.warnings == ["2 materials with alphaMode BLEND are drawn as stochastic masks"]
    assert {m.alpha_mode for m in scene.materials} == {AlphaMode.BLEND}


@pytest.mark.parametrize(
    ("pixels", "kind", "expected"),
    [
        (CHECKS, "PNG", np.dstack([CHECKS, np.full((2, 2), 255, np.uint8)])),
        (np.array([[0, 127, 255]], np.uint8), "PNG", [[[0, 0, 0, 255], [127, 127, 127, 255], [255] * 4]]),
        (
            np.array([[0, 0x7FFF, 0xFFFF]], np.uint16),
            "PNG",
            [[[0, 0, 0, 255], [127, 127, 127, 255], [255] * 4]],
        ),
        (np.full((1, 1, 4), (9, 8, 7, 6), np.uint8), "PNG", [[[9, 8, 7, 6]]]),
        (np.full((8, 8, 3), 100, np.uint8), "JPEG", np.full((8, 8, 4), (100, 100, 100, 255))),
    ],
)
def test_pictures_become_rgba(tmp_path: Path, pixels: np.ndarray, kind: str, expected: Any) -> None:
    builder = quad({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}})
    builder.picture(pixels, kind)
    assert base_texture(builder.load(tmp_path)).texture.pixels.tolist() == np.asarray(expected).tolist()


def test_slots_say_which_textures_hold_colors(tmp_path: Path) -> None:
    slot = {"index": 0}
    record = {
        "pbrMetallicRoughness": {"baseColorTexture": slot, "metallicRoughnessTexture": slot},
        "normalTexture": slot | {"scale": 0.5},
        "emissiveTexture": slot,
    }
    builder = quad(record)
    builder.picture(CHECKS)
    material = only_material(builder.load(tmp_path))
    colors = {material.base_color_texture.texture, material.emission_texture.texture}
    data = {material.metallic_roughness_texture.texture, material.normal_texture.texture}
    assert [t.srgb for t in (*colors, *data)] == [True, False]  # one object for each encoding
    assert material.normal_scale == 0.5


def test_a_texture_is_made_once_for_each_picture_and_way_to_show_it(tmp_path: Path) -> None:
    builder = textured(samplers=[{}, {"wrapS": 33071}])
    for sampler in (None, 0, 0, 1):
        record = {"source": 0} | ({} if sampler is None else {"sampler": sampler})
        index = builder.put("textures", record)
        material = builder.put("materials", {"pbrMetallicRoughness": {"baseColorTexture": {"index": index}}})
        builder.node(mesh=builder.mesh(more={"material": material}))
    uses = [m.base_color_texture.texture for m in builder.load(tmp_path).materials]
    assert len({id(texture) for texture in uses}) == 2  # a sampler that says nothing is none
    assert len({id(texture.pixels) for texture in uses}) == 1


@pytest.mark.parametrize(
    ("sampler", "expected"),
    [
        ({}, (Wrap.REPEAT, Wrap.REPEAT, True, True)),
        ({"wrapS": 33071, "wrapT": 33648}, (Wrap.CLAMP, Wrap.MIRROR, True, True)),
        ({"magFilter": 9728, "minFilter": 9728}, (Wrap.REPEAT, Wrap.REPEAT, False, False)),
        ({"magFilter": 9729, "minFilter": 9729}, (Wrap.REPEAT, Wrap.REPEAT, True, False)),
        ({"magFilter": 9728, "minFilter": 9985}, (Wrap.REPEAT, Wrap.REPEAT, False, True)),
        (
            {"magFilter": [], "minFilter": "x", "wrapS": 1, "wrapT": True},
            (Wrap.REPEAT, Wrap.REPEAT, True, True),
        ),
    ],
)
def test_samplers_are_read(tmp_path: Path, sampler: dict[str, Any], expected: tuple[Any, ...]) -> None:
    builder = textured(samplers=[sampler])
    builder.json["textures"][0]["sampler"] = 0
    scene = builder.load(tmp_path)
    texture = base_texture(scene).texture
    assert (texture.wrap_u, texture.wrap_v, texture.linear, texture.mipmaps) == expected
    assert len(scene.warnings) == (4 if "x" in sampler.values() else 0)


def test_texture_transform_matches_its_test_model(tmp_path: Path) -> None:
    """The arrow's tip is at uv (x, y) of the marker that TextureTransformTest calls NotSupported; a
    viewer that turns the right way shows it at the marker called Correct (positions from that model)."""
    angle = math.pi / 8
    extension = {"KHR_texture_transform": {"rotation": angle}}
    use = base_texture(textured(slot={"extensions": extension}).load(tmp_path))
    tip, correct = (
        (0.5 + 0.27781745930520227, 0.5 + 0.27781745930520227),
        (0.5 - 0.0790482244, 0.5 + 0.5162674858),
    )
    np.testing.assert_allclose(transformed(use, *correct), tip, atol=1e-9)


def test_texture_transform_scales_turns_then_moves(tmp_path: Path) -> None:
    """v points down: a quarter turn counter-clockwise takes (u, v) = (1, 0) up, to (0, -1)."""
    extension = {
        "KHR_texture_transform": {"offset": [10, 20], "rotation": math.pi / 2, "scale": [2, 3], "texCoord": 1}
    }
    builder = textured(slot={"texCoord": 0, "extensions": extension})
    builder.node(mesh=builder.mesh(QUAD_INDICES, POSITION=QUAD, TEXCOORD_1=QUAD_UV, more={"material": 0}))
    use = builder.load(tmp_path).nodes[1].parts[0].material.base_color_texture
    assert use.uv_set == 1
    np.testing.assert_allclose(transformed(use, 1, 0), (10, 18), atol=1e-12)
    np.testing.assert_allclose(transformed(use, 0, 1), (13, 20), atol=1e-12)


@pytest.mark.parametrize("name", ["Rotation", "Scale"])
def test_texture_transform_asset_points_at_its_correct_marker(name: str) -> None:
    """Where the marker called Correct stands, the texture shows the arrow's tip."""
    scene = load(assets() / "scenes" / "TextureTransformTest" / "TextureTransformTest.gltf")
    use = scene[name].parts[0].material.base_color_texture
    x, y, _ = scene[f"{name} - Correct"].translation
    tip = 0.5 + 0.27781745930520227  # as in the test above; u = 0.5 + x, v = 0.5 - y on this quad
    np.testing.assert_allclose(transformed(use, 0.5 + x, 0.5 - y), (tip, tip), atol=1e-6)


@pytest.mark.parametrize(("size", "expected"), [((64, 32), (16, 8)), ((17, 5), (8, 2)), ((16, 16), (16, 16))])
def test_large_textures_are_halved_until_they_fit(
    tmp_path: Path, size: tuple[int, int], expected: tuple[int, int]
) -> None:
    builder = textured(np.zeros((size[1], size[0], 3), np.uint8))
    pixels = base_texture(builder.load(tmp_path, max_texture=16)).texture.pixels
    assert pixels.shape == (expected[1], expected[0], 4)


def test_halving_averages_light(tmp_path: Path) -> None:
    """Half black, half white: 0.5 of white's light, 188 as an sRGB byte; 128 where the bytes are data."""
    checks = np.zeros((4, 4, 3), np.uint8)
    checks[::2, ::2] = checks[1::2, 1::2] = 255
    record = {
        "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicRoughnessTexture": {"index": 0}}
    }
    builder = quad(record)
    builder.picture(checks)
    material = only_material(builder.load(tmp_path, max_texture=2))
    assert (material.base_color_texture.texture.pixels[..., :3] == 188).all()
    assert (material.metallic_roughness_texture.texture.pixels[..., :3] == 128).all()


def test_pictures_of_too_many_pixels_are_not_decoded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(self: Image.Image) -> None:
        raise AssertionError("decoded")

    builder = textured(np.zeros((20, 20, 3), np.uint8))
    assert base_texture(builder.load(tmp_path, max_image_pixels=400)).texture.pixels.shape == (20, 20, 4)
    monkeypatch.setattr("PIL.ImageFile.ImageFile.load", fail)
    scene = builder.load(tmp_path, max_image_pixels=399)
    assert only_material(scene).base_color_texture is None
    assert "20 x 20 pixels; max_image_pixels=399 is the most" in scene.warnings[0]


@pytest.mark.parametrize(
    "image",
    [
        {"uri": "missing.png"},
        {"uri": "../outside.png"},
        {"uri": "data:image/png;base64,AAAA"},
        {"uri": "data:image/png;base64,A"},
        {"uri": "cut.png"},
        {"uri": "gif.png"},
        {"bufferView": 99},
        {},
    ],
)
def test_pictures_that_cannot_be_shown_leave_the_factors(tmp_path: Path, image: dict[str, Any]) -> None:
    folder = tmp_path / "inside"
    folder.mkdir()
    noise = Image.fromarray(np.random.default_rng(1).integers(0, 256, (50, 50, 3), np.uint8))
    noise.save(tmp_path / "outside.png")
    noise.save(folder / "gif.png", "GIF")  # not one of glTF's formats
    (folder / "cut.png").write_bytes((tmp_path / "outside.png").read_bytes()[:3000])
    builder = textured()
    builder.json["images"][0] = image
    builder.json["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] = [1, 0, 0, 1]
    scene = builder.load(folder)
    material = only_material(scene)
    assert material.base_color_texture is None
    assert material.base_color == (1.0, 0.0, 0.0, 1.0)
    assert len(scene.warnings) == 1
    assert "left out" in scene.warnings[0]


def test_textures_need_the_coordinates_they_ask_for(tmp_path: Path) -> None:
    builder = textured()
    builder.node(mesh=builder.mesh(QUAD_INDICES, POSITION=QUAD, more={"material": 0}))  # no TEXCOORD_0
    scene = builder.load(tmp_path)
    with_uv, without = (node.parts[0].material for node in scene.nodes)
    assert with_uv.base_color_texture is not None
    assert without.base_color_texture is None
    assert "texture coordinates" in scene.warnings[0]


def test_third_uv_set_is_told(tmp_path: Path) -> None:
    scene = textured(slot={"texCoord": 2}).load(tmp_path)
    assert only_material(scene).base_color_texture is None
    assert "TEXCOORD" in scene.warnings[0]


def webp(**texture: Any) -> GltfBuilder:
    """A quad with a texture whose WebP is white and whose plain picture is black."""
    builder = quad({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}})
    builder.picture(np.full((4, 4, 3), 255, np.uint8), "WEBP")
    builder.picture(np.zeros((4, 4, 3), np.uint8))
    builder.json["textures"] = [texture | {"extensions": {"EXT_texture_webp": {"source": 0}}}]
    return builder


@pytest.mark.parametrize("texture", [{}, {"source": 1}])
def test_webp_is_shown_where_a_texture_has_one(tmp_path: Path, texture: dict[str, Any]) -> None:
    scene = webp(**texture).load(tmp_path)
    assert (base_texture(scene).texture.pixels == 255).all()
    assert scene.warnings == []


def test_a_broken_webp_leaves_the_plain_picture(tmp_path: Path) -> None:
    builder = webp(source=1)
    builder.json["images"][0] = {"uri": "data:image/webp;base64,AAAA"}
    scene = builder.load(tmp_path)
    assert (base_texture(scene).texture.pixels[..., :3] == 0).all()
    assert "left out" in scene.warnings[0]
