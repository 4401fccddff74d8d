"""What `load` says of files that it cannot read, and how it finds out what a file is."""

import subprocess
import sys
from pathlib import Path

import pytest
from gltf_builder import quad

from ispm.errors import SceneError, SettingsError
from ispm.io.load import load


@pytest.mark.parametrize("name", ["room.blend", "room.off", "room"])
def test_load_names_the_endings_it_reads(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text("x")
    with pytest.raises(SceneError, match=rf"^{name}: .*\.glb \.gltf \.obj \.ply \.stl are; .*from_trimesh"):
        load(tmp_path / name)


def test_load_says_that_a_file_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"^hall\.glb: there is no such file in "):
        load(tmp_path / "hall.glb")
    with pytest.raises(SceneError, match="folder"):
        load(tmp_path)


def test_load_looks_in_the_folder_of_assets_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "assets").mkdir()
    quad().save_glb(tmp_path / "assets" / "hall.glb")
    monkeypatch.setenv("ISPM_ASSETS", str(tmp_path / "assets"))
    assert load("hall.glb").triangle_count == 2
    with pytest.raises(SceneError, match="no such file"):
        load("door.glb")


def test_load_corrects_the_name_of_a_limit(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match="did you mean 'max_texture'"):
        load(quad().save(tmp_path / "a.gltf"), max_textures=12)


@pytest.mark.parametrize("name", ["a.glb", "renamed.gltf", "LOUD.GLB"])
def test_load_knows_a_glb_by_its_first_bytes(tmp_path: Path, name: str) -> None:
    scene = load(quad().save_glb(tmp_path / name))
    assert (scene.triangle_count, scene.warnings) == (2, [])


def test_load_reads_json_under_the_ending_of_a_glb(tmp_path: Path) -> None:
    assert load(quad().save(tmp_path / "a.glb")).triangle_count == 2


def test_load_passes_over_a_byte_order_mark(tmp_path: Path) -> None:
    path = quad().save(tmp_path / "a.gltf")
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    scene = load(path)
    assert scene.triangle_count == 2
    assert "byte order mark" in scene.warnings[0]


def test_load_imports_no_decoder_tracer_or_gpu() -> None:
    code = "import sys, ispm.io.load; print({'PIL', 'trimesh', 'numba', 'wgpu'} & set(sys.modules))"
    ran = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert ran.stdout.strip() == "set()"


def test_load_refuses_required_extensions_by_name(tmp_path: Path) -> None:
    needed = ["KHR_texture_transform", "KHR_xmp_json_ld", "ACME_teleport"]
    builder = quad(extensionsUsed=needed, extensionsRequired=needed)
    with pytest.raises(SceneError, match=r"uses KHR_xmp_json_ld, ACME_teleport, .*export it without") as e:
        builder.load(tmp_path)
    assert "texture_transform" not in str(e.value)


def test_load_says_what_becomes_of_an_extension_that_it_knows(tmp_path: Path) -> None:
    (line,) = quad(extensionsUsed=["KHR_animation_pointer"]).load(tmp_path).warnings
    assert "KHR_animation_pointer (its channels are left out)" in line


def test_load_tells_which_extensions_are_honoured(tmp_path: Path) -> None:
    used = ["KHR_materials_ior", "KHR_materials_iridescence", "ACME_teleport"]
    scene = quad(extensionsUsed=used).load(tmp_path)
    assert scene.extensions_used == used
    assert scene.extensions_honoured == ["KHR_materials_ior"]
    assert scene.warnings == [
        "extensions that are not supported are passed over: KHR_materials_iridescence, ACME_teleport"
    ]


def test_load_shortens_a_flood_of_warnings(tmp_path: Path) -> None:
    builder = quad()
    for _ in range(200):
        builder.node(rotation=[0, 0, 0, 0])
    warnings = builder.load(tmp_path).warnings
    assert len(warnings) == 51
    assert warnings[-1] == "and 150 more faults"
