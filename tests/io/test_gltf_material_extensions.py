"""What extensions say of materials: glass, layers above a surface, diffuse transmission, anisotropy."""

import math
from pathlib import Path
from typing import Any

import pytest
from gltf_builder import CHECKS, QUAD, QUAD_INDICES, only_material, quad

from ispm.errors import SceneError
from ispm.scene.material import Material


def glass(**volume: Any) -> dict[str, Any]:
    return {
        "extensions": {
            "KHR_materials_transmission": {"transmissionFactor": 0.75},
            "KHR_materials_ior": {"ior": 1.4},
            "KHR_materials_volume": volume,
        }
    }


def test_glass_is_read(tmp_path: Path) -> None:
    volume = {"thicknessFactor": 0.5, "attenuationColor": [0.1, 0.5, 1], "attenuationDistance": 2}
    scene = quad(glass(**volume, thicknessTexture={"index": 9})).load(tmp_path)
    assert scene.warnings == []  # the thickness texture is for renderers that trace no rays
    expected = Material(
        metallic=1.0, ior=1.4, transmission=0.75, thickness=0.5, attenuation_color=(0.1, 0.5, 1.0),
        attenuation_distance=2.0,
    )  # fmt: skip
    assert only_material(scene) == expected


def test_dispersion_of_glass_is_read(tmp_path: Path) -> None:
    record = glass(thicknessFactor=0.5)
    record["extensions"]["KHR_materials_dispersion"] = {"dispersion": 0.3}
    scene = quad(record).load(tmp_path)
    assert scene.warnings == [] and scene.extensions_honoured == scene.extensions_used
    assert only_material(scene).dispersion == 0.3 and only_material(scene).dispersive


@pytest.mark.parametrize(("given", "kept"), [(-1, 0), (1e9, 20)])
def test_dispersion_out_of_range_is_clamped_in_one_line(tmp_path: Path, given: float, kept: float) -> None:
    scene = quad({"extensions": {"KHR_materials_dispersion": {"dispersion": given}}}).load(tmp_path)
    assert only_material(scene).dispersion == kept
    (line,) = scene.warnings
    assert line.endswith(f": dispersion {given:g} is clamped to 0..20")


def test_dispersion_that_is_no_number_is_refused_in_one_line(tmp_path: Path) -> None:
    with pytest.raises(SceneError) as refused:
        quad({"extensions": {"KHR_materials_dispersion": {"dispersion": "much"}}}).load(tmp_path)
    assert "dispersion" in str(refused.value) and "\n" not in str(refused.value)


@pytest.mark.parametrize("volume", [{}, {"thicknessFactor": 0}])
def test_glass_without_thickness_is_thin(tmp_path: Path, volume: dict[str, Any]) -> None:
    material = only_material(quad(glass(**volume)).load(tmp_path))
    assert (material.transmission, material.thickness) == (0.75, 0.0)
    assert material.attenuation_distance == math.inf


def test_glass_with_wrong_numbers_is_mended(tmp_path: Path) -> None:
    record = glass(thicknessFactor=-1, attenuationDistance=0, attenuationColor=[2, 0, -1])
    record["extensions"]["KHR_materials_transmission"]["transmissionFactor"] = 3
    scene = quad(record).load(tmp_path)
    material = only_material(scene)
    assert (material.transmission, material.thickness, material.attenuation_distance) == (1.0, 0.0, math.inf)
    assert material.attenuation_color == (1.0, 0.0, 0.0)
    assert len(scene.warnings) == 4


def test_transmission_textures_hold_data_and_need_coordinates(tmp_path: Path) -> None:
    record = glass()
    record["extensions"]["KHR_materials_transmission"]["transmissionTexture"] = {"index": 0}
    builder = quad(record)
    builder.picture(CHECKS)
    builder.node(mesh=builder.mesh(QUAD_INDICES, POSITION=QUAD, more={"material": 0}))  # no TEXCOORD_0
    with_uv, without = (node.parts[0].material for node in builder.load(tmp_path).nodes)
    assert with_uv.transmission_texture.texture.srgb is False
    assert without.transmission_texture is None


def test_textures_of_specular_reflection_are_read(tmp_path: Path) -> None:
    slots = {"specularTexture": {"index": 0}, "specularColorTexture": {"index": 0}}
    builder = quad({"extensions": {"KHR_materials_specular": slots}})
    builder.picture(CHECKS)
    scene = builder.load(tmp_path)
    material = only_material(scene)
    assert scene.warnings == [] and scene.extensions_honoured == scene.extensions_used
    assert material.specular_color_texture is not None and material.specular_texture is not None
    assert material.specular_color_texture.texture.srgb is True
    assert material.specular_texture.texture is material.specular_color_texture.texture  # of one picture


def coat(**more: Any) -> dict[str, Any]:
    return {"extensions": {"KHR_materials_clearcoat": {"clearcoatFactor": 0.75, **more}}}


def test_a_clear_coat_is_read(tmp_path: Path) -> None:
    slots = {
        "clearcoatTexture": {"index": 0},
        "clearcoatRoughnessTexture": {"index": 0},
        "clearcoatNormalTexture": {"index": 0, "scale": 0.5},
    }
    builder = quad(coat(clearcoatRoughnessFactor=0.25, **slots))
    builder.picture(CHECKS)
    scene = builder.load(tmp_path)
    material = only_material(scene)
    assert scene.warnings == [] and scene.extensions_honoured == scene.extensions_used
    assert (material.clearcoat, material.clearcoat_roughness) == (0.75, 0.25)
    assert material.clearcoat_normal_scale == 0.5
    for use in (
        material.clearcoat_texture,
        material.clearcoat_roughness_texture,
        material.clearcoat_normal_texture,
    ):
        assert use is not None and use.texture.srgb is False


def test_a_clear_coat_with_wrong_numbers_is_mended(tmp_path: Path) -> None:
    scene = quad(coat(clearcoatFactor=7, clearcoatRoughnessFactor=-1)).load(tmp_path)
    material = only_material(scene)
    assert (material.clearcoat, material.clearcoat_roughness) == (1.0, 0.0)
    assert [line.partition(": ")[2] for line in scene.warnings] == [
        "clearcoatFactor 7 is clamped to 0..1", "clearcoatRoughnessFactor -1 is clamped to 0..1",
    ]  # fmt: skip


def test_a_clear_coat_over_glass_is_left_out_in_one_line(tmp_path: Path) -> None:
    record = coat()
    record["extensions"] |= glass()["extensions"]
    scene = quad(record).load(tmp_path)
    assert (only_material(scene).clearcoat, only_material(scene).transmission) == (0.0, 0.75)
    (line,) = scene.warnings
    assert line.endswith("a clear coat over glass is not supported; it is left out")


def translucent(**more: Any) -> dict[str, Any]:
    record = {"diffuseTransmissionFactor": 0.5, **more}
    return {"extensions": {"KHR_materials_diffuse_transmission": record}}


def test_diffuse_transmission_is_read(tmp_path: Path) -> None:
    slots = {f"diffuseTransmission{name}Texture": {"index": 0} for name in ("", "Color")}
    builder = quad(translucent(diffuseTransmissionColorFactor=[0.5, 0.25, 1.0], **slots))
    builder.picture(CHECKS)
    scene = builder.load(tmp_path)
    material = only_material(scene)
    assert scene.warnings == [] and scene.extensions_honoured == scene.extensions_used
    assert (material.diffuse_transmission, material.diffuse_transmission_color) == (0.5, (0.5, 0.25, 1.0))
    share, color = material.diffuse_transmission_texture, material.diffuse_transmission_color_texture
    assert share is not None and color is not None
    assert color.texture.srgb is True and share.texture is color.texture


def test_diffuse_transmission_with_wrong_numbers_is_mended(tmp_path: Path) -> None:
    record = translucent(diffuseTransmissionFactor=3, diffuseTransmissionColorFactor=[2, 0, 0])
    scene = quad(record).load(tmp_path)
    material = only_material(scene)
    assert (material.diffuse_transmission, material.diffuse_transmission_color) == (1.0, (1.0, 0.0, 0.0))
    assert [line.partition(": ")[2] for line in scene.warnings] == [
        "diffuseTransmissionFactor 3 is clamped to 0..1",
        "diffuseTransmissionColorFactor 2, 0, 0 is clamped to 0..1",
    ]


def test_diffuse_transmission_of_glass_is_left_out_in_one_line(tmp_path: Path) -> None:
    record = translucent()
    record["extensions"] |= glass()["extensions"]
    scene = quad(record).load(tmp_path)
    material = only_material(scene)
    assert (material.diffuse_transmission, material.transmission) == (0.0, 0.75)
    (line,) = scene.warnings
    assert line.endswith("diffuse transmission of glass is not supported; it is left out")


def test_a_volume_in_diffuse_transmission_is_a_thin_sheet_in_one_line(tmp_path: Path) -> None:
    record = translucent()
    record["extensions"] |= {"KHR_materials_volume": {"thicknessFactor": 0.1, "attenuationDistance": 1.0}}
    scene = quad(record).load(tmp_path)
    material = only_material(scene)
    assert (material.diffuse_transmission, material.thickness) == (0.5, 0.0)
    (line,) = scene.warnings
    assert line.endswith("a volume within diffuse transmission is not supported; it is shown as a thin sheet")


def sheen(**more: Any) -> dict[str, Any]:
    return {"extensions": {"KHR_materials_sheen": {"sheenColorFactor": [0.5, 0.25, 1.0], **more}}}


def test_sheen_is_read(tmp_path: Path) -> None:
    slots = {"sheenColorTexture": {"index": 0}, "sheenRoughnessTexture": {"index": 0}}
    builder = quad(sheen(sheenRoughnessFactor=0.25, **slots))
    builder.picture(CHECKS)
    scene = builder.load(tmp_path)
    material = only_material(scene)
    assert scene.warnings == [] and scene.extensions_honoured == scene.extensions_used
    assert (material.sheen_color, material.sheen_roughness) == ((0.5, 0.25, 1.0), 0.25)
    assert material.sheen_color_texture is not None and material.sheen_roughness_texture is not None
    assert material.sheen_color_texture.texture.srgb is True
    assert material.sheen_roughness_texture.texture is material.sheen_color_texture.texture


def test_sheen_with_wrong_numbers_is_mended(tmp_path: Path) -> None:
    scene = quad(sheen(sheenColorFactor=[2, 0, 0], sheenRoughnessFactor=-1)).load(tmp_path)
    material = only_material(scene)
    assert (material.sheen_color, material.sheen_roughness) == ((1.0, 0.0, 0.0), 0.0)
    assert [line.partition(": ")[2] for line in scene.warnings] == [
        "sheenColorFactor 2, 0, 0 is clamped to 0..1", "sheenRoughnessFactor -1 is clamped to 0..1",
    ]  # fmt: skip


def test_sheen_over_glass_is_left_out_in_one_line(tmp_path: Path) -> None:
    record = sheen()
    record["extensions"] |= glass()["extensions"]
    scene = quad(record).load(tmp_path)
    assert (only_material(scene).sheen_color, only_material(scene).transmission) == ((0.0, 0.0, 0.0), 0.75)
    (line,) = scene.warnings
    assert line.endswith("sheen over glass is not supported; it is left out")


def brushed(**more: Any) -> dict[str, Any]:
    return {"extensions": {"KHR_materials_anisotropy": {"anisotropyStrength": 0.5, **more}}}


def test_anisotropy_is_read(tmp_path: Path) -> None:
    builder = quad(brushed(anisotropyRotation=0.25, anisotropyTexture={"index": 0}))
    builder.picture(CHECKS)
    scene = builder.load(tmp_path)
    material = only_material(scene)
    assert scene.warnings == [] and scene.extensions_honoured == scene.extensions_used
    assert (material.anisotropy, material.anisotropy_rotation) == (0.5, 0.25)
    assert material.anisotropy_texture is not None and material.anisotropy_texture.texture.srgb is False


def test_anisotropy_with_wrong_numbers_is_mended(tmp_path: Path) -> None:
    scene = quad(brushed(anisotropyStrength=2, anisotropyRotation=-1e9)).load(tmp_path)
    material = only_material(scene)
    assert (material.anisotropy, material.anisotropy_rotation) == (1.0, -1000.0)
    assert [line.partition(": ")[2] for line in scene.warnings] == [
        "anisotropyStrength 2 is clamped to 0..1", "anisotropyRotation -1e+09 is clamped to -1000..1000",
    ]  # fmt: skip


def test_anisotropy_of_glass_is_left_out_in_one_line(tmp_path: Path) -> None:
    record = brushed()
    record["extensions"] |= glass()["extensions"]
    scene = quad(record).load(tmp_path)
    assert (only_material(scene).anisotropy, only_material(scene).transmission) == (0.0, 0.75)
    (line,) = scene.warnings
    assert line.endswith("anisotropy of glass is not supported; it is left out")
