"""KHR_materials_variants: read, chosen, switched, saved."""

import numpy as np
import pytest
from gltf_builder import QUAD, GltfBuilder

import ispm
from ispm.errors import SceneError, SettingsError

COLORS = {"plain": (1.0, 1.0, 1.0, 1.0), "red": (1.0, 0.0, 0.0, 1.0), "blue": (0.0, 0.0, 1.0, 1.0)}
WORN = {None: ("plain", "plain"), "warm": ("red", "plain"), "cold": ("blue", "blue"), "odd": ("red", "plain")}


def dressed() -> GltfBuilder:
    """Two quads: one wears plain, red (warm and odd) or blue (cold), the other plain or blue (cold)."""
    builder = GltfBuilder(extensionsUsed=["KHR_materials_variants"])
    for name, color in COLORS.items():
        builder.put("materials", {"name": name, "pbrMetallicRoughness": {"baseColorFactor": color}})
    names = [{"name": name} for name in WORN if name]
    builder.json["extensions"] = {"KHR_materials_variants": {"variants": names}}
    mappings = [{"material": 1, "variants": [0, 2]}, {"material": 2, "variants": [1]}]
    for some in (mappings, mappings[1:]):
        more = {"material": 0, "extensions": {"KHR_materials_variants": {"mappings": some}}}
        builder.node(mesh=builder.mesh(more=more, POSITION=QUAD), name=f"quad {len(some)}")
    return builder


def worn(scene: ispm.Scene) -> tuple[str, ...]:
    return tuple(part.material.name for node in scene.nodes for part in node.parts)


def test_each_variant_is_worn_and_taken_off(tmp_path):
    scene = dressed().load(tmp_path)
    assert scene.variants == ["warm", "cold", "odd"]
    assert (scene.variant, worn(scene)) == (None, WORN[None])
    for name in ("warm", "cold", "odd", "cold", None, "warm"):
        scene.variant = name
        assert (scene.variant, worn(scene)) == (name, WORN[name])
    assert scene.extensions_honoured == ["KHR_materials_variants"]


@pytest.mark.parametrize("name", ["warm", "cold"])
def test_a_variant_is_chosen_as_the_file_is_loaded(tmp_path, name):
    scene = dressed().load(tmp_path, variant=name)
    assert (scene.variant, worn(scene)) == (name, WORN[name])


def test_an_unknown_variant_is_one_line_that_lists_the_known(tmp_path):
    builder = dressed()
    with pytest.raises(
        SceneError, match=r"^scene.gltf: there is no variant 'hot'; .* 'warm', 'cold', 'odd'$"
    ):
        builder.load(tmp_path, variant="hot")
    scene = builder.load(tmp_path)
    with pytest.raises(SceneError, match="'warm', 'cold', 'odd'"):
        scene.variant = "hot"
    assert worn(scene) == WORN[None]
    with pytest.raises(SceneError, match="the scene has none"):
        ispm.Scene().variant = "hot"
    with pytest.raises(SettingsError, match=r"variant: 3 is no text"):
        builder.load(tmp_path, variant=3)


def test_moments_of_a_scene_wear_their_own(tmp_path):
    scene = dressed().load(tmp_path)
    later = scene.at(1.0)
    later.variant = "cold"
    assert (worn(scene), worn(later)) == (WORN[None], WORN["cold"])
    assert (scene.variant, later.at(2.0).variant) == (None, "cold")


def test_materials_given_by_hand_are_switched_too():
    red, blue = ispm.Material(name="red"), ispm.Material(name="blue")
    scene = ispm.Scene(variants=["cold"])
    node = scene.add(ispm.Mesh(QUAD, np.array([[0, 1, 2]])), material=red)
    node.parts[0].variants["cold"] = blue
    scene.variant = "cold"
    assert worn(scene) == ("blue",)
    scene.variant = None
    assert worn(scene) == ("red",)


def test_a_merged_scene_brings_its_variants(tmp_path):
    scene = ispm.Scene(variants=["other"])
    scene.merge(dressed().load(tmp_path))
    scene.variant = "cold"
    assert scene.variants == ["other", "warm", "cold", "odd"]
    assert worn(scene) == WORN["cold"]


@pytest.mark.parametrize("ending", [".glb", ".gltf"])
def test_variants_are_saved_whichever_is_worn(tmp_path, ending):
    scene = dressed().load(tmp_path, variant="cold")
    again = ispm.load(ispm.save(scene, tmp_path / f"again{ending}"))
    assert again.variants == scene.variants
    for name, materials in WORN.items():
        again.variant = name
        assert worn(again) == materials


def test_a_scene_without_variants_saves_none(tmp_path):
    builder = dressed()
    del builder.json["extensions"], builder.json["extensionsUsed"]
    for mesh in builder.json["meshes"]:
        del mesh["primitives"][0]["extensions"]
    path = ispm.save(builder.load(tmp_path), tmp_path / "again.gltf")
    assert "variants" not in path.read_text()


def test_variants_of_one_name_count_as_one_and_nameless_have_a_number(tmp_path):
    builder = dressed()
    names = [{"name": "same"}, {"name": "same"}, {}]
    builder.json["extensions"]["KHR_materials_variants"]["variants"] = names
    scene = builder.load(tmp_path)
    assert scene.variants == ["same", "variant 2"]
    assert scene.warnings == ["several variants are called 'same'; they count as one"]
    scene.variant = "same"
    assert worn(scene) == ("red", "blue")  # of several mappings the first
    scene.variant = "variant 2"
    assert worn(scene) == ("red", "plain")


def test_a_mapping_to_what_does_not_exist_is_refused(tmp_path):
    for broken, said in (
        ({"material": 9, "variants": [0]}, "material 9"),
        ({"material": 1, "variants": [7]}, "variant 7"),
    ):
        builder = dressed()
        primitive = builder.json["meshes"][0]["primitives"][0]
        primitive["extensions"]["KHR_materials_variants"]["mappings"] = [broken]
        with pytest.raises(SceneError, match=f"{said} does not exist; the file has 3"):
            builder.load(tmp_path)
