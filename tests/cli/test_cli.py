"""The command line: what goes where, and what is said."""

import json
import re
import runpy
import shlex
import subprocess
import sys
import tomllib
from dataclasses import fields
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest
from fake import SMALL, FakeRenderer, FakeStats

import ispm.renderer
from ispm.cli.main import main
from ispm.io.image import write_npy, write_npz
from ispm.library.builtin import builtin
from ispm.settings import LoadLimits, Settings


def test_render_writes_the_path_alone_to_stdout_and_the_table_to_stderr(ispm_command, place):
    code, out, err = ispm_command(SMALL + "-o made/room.png")
    assert (code, out) == (0, "made/room.png\n")
    assert (place / "made" / "room.png").is_file()
    assert "rendering 8x6, 40,000 photons" in err
    assert "stored_photons  123,456" in err and "flux" not in err


def test_all_statistics_are_shown_on_demand(ispm_command, place):
    code, out, err = ispm_command(SMALL + "-o a.png --stats -")
    assert (code, out, [f.name for f in place.iterdir()]) == (0, "a.png\n", ["a.png"])
    shown = [line.split()[0] for line in err.splitlines()[-len(fields(FakeStats)) :]]
    assert shown == [f.name for f in fields(FakeStats)]


def test_render_names_the_picture_after_the_scene(ispm_command, place):
    assert ispm_command(SMALL)[1] == "cornell-box.png\n"


def test_quiet_says_nothing_but_the_path(ispm_command):
    assert ispm_command(SMALL + "--quiet") == (0, "cornell-box.png\n", "")


def test_json_is_one_object_with_null_for_what_is_not_finite(ispm_command):
    code, out, _ = ispm_command(SMALL + "--json")
    assert code == 0
    assert json.loads(out) == {
        "output": "cornell-box.png",
        "stats": {"stored_photons": 123_456, "total_ms": 12.5, "flux": None},
    }


def test_statistics_go_to_a_file(ispm_command, place):
    assert ispm_command(SMALL + "--stats s.json")[1] == "cornell-box.png\ns.json\n"
    assert json.loads((place / "s.json").read_text())["stored_photons"] == 123_456


def test_options_reach_the_renderer(ispm_command):
    line = (
        "--photons 2M --no-antialias --exposure -1.5 --background 0,.5,1 --adapter llvm --threads 2 --seed 7"
    )
    assert ispm_command(SMALL + line)[0] == 0
    made = FakeRenderer.made[0]
    assert made.settings == Settings(
        size=(8, 6), photons=2_000_000, antialias=False, exposure=-1.5, background=(0.0, 0.5, 1.0), seed=7
    )
    assert (made.options["adapter"], made.options["threads"]) == ("llvm", 2)
    assert made.options["camera"] is None


def test_look_from_places_a_camera(ispm_command):
    assert ispm_command(SMALL + "--look-from -1,2,3 --look-at 0,0,0 --fov 90")[0] == 0
    camera = FakeRenderer.made[0].options["camera"]
    assert camera.yfov == pytest.approx(np.pi / 2)
    np.testing.assert_allclose(camera.pose[:3, 3], (-1, 2, 3))


def test_fov_alone_changes_the_scenes_camera_and_keeps_its_place(ispm_command):
    assert ispm_command(SMALL + "--fov 30")[0] == 0
    made = FakeRenderer.made[0]
    place = next(world for node, world in made.scene.placed() if node.camera)
    assert made.options["camera"].yfov == pytest.approx(np.radians(30))
    np.testing.assert_allclose(made.options["camera"].pose, place, atol=1e-9)


def test_precedence_is_flag_environment_file_default(ispm_command, monkeypatch, place):
    (place / "s.toml").write_text('photons = "1k"\nbounces = 1\nseed = 1\nmax-texture = 64\nsize = [4, 4]')
    monkeypatch.setenv("ISPM_PHOTONS", "2k")
    monkeypatch.setenv("ISPM_BOUNCES", "2")
    code, out, _ = ispm_command("render --config s.toml --print-config --photons 3k")
    settings = tomllib.loads(out)
    assert code == 0
    assert [settings[name] for name in ("photons", "bounces", "seed", "subsampling")] == [3000, 2, 1, 4]


def test_print_config_can_be_read_back(ispm_command, place):
    line = "render --print-config --size 64x48 --exposure 2 --background transparent --no-antialias"
    _, out, _ = ispm_command(line)
    (place / "s.toml").write_text(out)
    assert ispm_command("render --config s.toml --print-config")[1] == out
    assert json.loads(ispm_command("render --config s.toml --print-config --json")[1])["size"] == [64, 48]


@pytest.mark.parametrize(
    "command", ["", "render ", "animate ", "compare ", "info ", "scenes ", "doctor ", "bench "]
)
def test_every_command_has_help_with_an_example(ispm_command, command):
    code, out, _ = ispm_command(command + "--help")
    assert code == 0
    assert "Example: ispm " + command.strip() in out or not command


def test_render_help_names_every_setting_with_its_default(ispm_command):
    _, out, _ = ispm_command("render --help")
    for name in ("--photons", "--no-antialias", "--shadow-resolution", "--max-texture", "1280x720", "40000"):
        assert name in out


def test_a_picture_is_never_written_over_an_input(ispm_command, place):
    (place / "room.gltf").write_text('{"asset":{"version":"2.0"},"images":[{"uri":"room.png"}]}')
    (place / "room.png").write_text("a texture")
    code, _, err = ispm_command("render room.gltf")
    assert code == 2
    assert "room.png: belongs to the scene room.gltf; name another file with -o" in err
    assert (place / "room.png").read_text() == "a texture"
    assert "belongs to the scene" in ispm_command("render room.gltf --stats room.gltf -o b.png")[2]


def test_scenes_lists_every_built_in(ispm_command):
    from ispm.io.download import DOWNLOADS
    from ispm.library.builtin import BUILTINS

    code, out, err = ispm_command("scenes")
    assert (code, out) == (0, "")
    assert all(name in err for name in BUILTINS)
    listed = json.loads(ispm_command("scenes --json")[1])["scenes"]
    assert {scene["name"] for scene in listed} == {*BUILTINS, *DOWNLOADS}
    assert all("download" in scene["about"] for scene in listed if scene["name"] in DOWNLOADS)
    assert all(len(scene["about"]) > 10 for scene in listed)


def test_info_counts_what_the_scene_holds(ispm_command):
    code, out, _ = ispm_command("info cornell-box --json")
    contents = json.loads(out)
    assert code == 0
    assert (contents["triangles"], contents["textures"]) == (30, 0)
    np.testing.assert_allclose(contents["bounds_low"], 0.0, atol=1e-6)
    assert contents["lights"] == ["light"]


def test_info_lists_nodes(ispm_command, place):
    code, out, _ = ispm_command("info glass-sphere --json")
    listed = json.loads(out)["nodes"]
    scene = builtin("glass-sphere")
    assert (code, [node["name"] for node in listed]) == (0, [node.name for node in scene.nodes])
    assert sum(node["triangles"] * node["copies"] for node in listed) == scene.triangle_count
    assert [node["name"] for node in listed if node["light"]] == [node.name for node in scene.lights]


def test_info_shows_what_hangs_on_what_and_counts_what_it_does_not_show(ispm_command, place):
    children = [{"name": f"leg {k}"} for k in range(60)]
    table = {"name": "table", "children": list(range(1, 61)), "mesh": 0}
    points = {"componentType": 5126, "type": "VEC3", "count": 6}
    file = {"asset": {"version": "2.0"}, "accessors": [points], "nodes": [table, *children],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}]}  # fmt: skip
    (place / "t.gltf").write_text(json.dumps(file))
    code, _, err = ispm_command("info t.gltf")
    lines = err.splitlines()
    assert code == 0
    assert re.search(r"^table +2 triangles, 60 children$", err, re.MULTILINE)
    assert sum("· leg" in line for line in lines) == 39
    assert lines[-1] == "and 21 more nodes; --json lists all"
    assert len(json.loads(ispm_command("info t.gltf --json")[1])["nodes"]) == 61


def test_info_takes_the_options_of_loading(ispm_command, place):
    (place / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 2 3\nf 1 2 3\n")
    bounds = [json.loads(ispm_command(f"info a.obj --json {option}")[1])["bounds_high"]
              for option in ("", "--up z", "--up y --smooth-normals --crease-degrees 40")]  # fmt: skip
    assert bounds == [[1, 2, 3], [1, 3, 0], [1, 2, 3]]
    code, _, err = ispm_command("info a.obj --up x")
    assert (code, "--up: 'x' is not one of y, z" in err) == (2, True)


def test_variants_are_listed_and_chosen(ispm_command, place):
    looks = [{"emissiveFactor": [0, 0, 0], "name": name} for name in ("plain", "red")]
    mapped = {"KHR_materials_variants": {"mappings": [{"material": 1, "variants": [0]}]}}
    points = {"componentType": 5126, "type": "VEC3", "count": 3}
    primitive = {"attributes": {"POSITION": 0}, "material": 0, "extensions": mapped}
    file = {"asset": {"version": "2.0"}, "accessors": [points], "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": [primitive]}], "materials": looks,
            "extensions": {"KHR_materials_variants": {"variants": [{"name": "warm"}]}}}  # fmt: skip
    (place / "v.gltf").write_text(json.dumps(file))
    for option in ("", "--variant warm"):
        code, out, _ = ispm_command(f"info v.gltf --json {option}")
        assert (code, json.loads(out)["variants"]) == (0, ["warm"])
    code, _, err = ispm_command("render v.gltf --variant cold")
    assert code == 2
    assert err.endswith("v.gltf: there is no variant 'cold'; the scene has 'warm'\n")
    assert ispm_command("render v.gltf --variant warm --size 8x6 -o a.png")[0] == 0
    assert FakeRenderer.made[-1].scene.variant == "warm"
    assert "ispm render v.gltf --size 8x6 --variant warm -o a.png" in ispm_command("info a.png")[2]


def test_doctor_reports_the_machine(ispm_command):
    code, out, _ = ispm_command("doctor --json")
    report = json.loads(out)
    assert code == 0
    assert report["cores"] >= 1
    assert report["adapters"][0]["name"] in report["device"]["name"]
    assert report["packages"]["wgpu"].startswith("0.32")


def test_doctor_without_an_adapter_says_the_cure_and_exits_with_3(ispm_command, monkeypatch):
    import ispm.gpu.device

    monkeypatch.setattr(ispm.gpu.device, "_adapters", list)
    code, _, err = ispm_command("doctor")
    assert code == 3
    assert "apt-get install mesa-vulkan-drivers" in err
    assert json.loads(ispm_command("doctor --json")[1])["adapters"] == []


def test_list_adapters_names_them(ispm_command):
    code, out, err = ispm_command("render --list-adapters")
    assert (code, out) == (0, "")
    assert "Vulkan" in err or "Metal" in err or "D3D12" in err


@pytest.fixture
def pictures(place):
    """a.npy is 1.1 times b.npz:R where the mask m.npz:m is 1, and black elsewhere."""
    reference = np.ones((4, 5, 3), np.float32)
    mask = np.ones((4, 5), np.uint8)
    mask[0] = 0
    write_npz(place / "b.npz", {"R": reference, "other": reference})
    write_npz(place / "m.npz", {"m": mask})
    write_npy(place / "a.npy", reference * 1.1 * mask[..., None])


def test_compare_reports_what_the_library_does(ispm_command, pictures):
    code, out, _ = ispm_command("compare a.npy b.npz:R --mask m.npz:m --json")
    result = json.loads(out)
    assert code == 0
    assert result["pixels"] == 15
    assert result["bias"] == pytest.approx(0.1, abs=1e-6)
    assert result["relmse"] == pytest.approx(0.01 / 1.001, rel=1e-4)


@pytest.mark.parametrize(
    ("bounds", "code"),
    [
        ("--max-relmse 0.02 --max-bias 0.2", 0),
        ("--max-relmse 0.001", 1),
        ("--max-relmse 0.001 --reference-error 0.0095", 0),
        ("--max-bias 0.05", 1),
    ],
)
def test_compare_exits_with_1_over_a_bound(ispm_command, pictures, bounds, code):
    assert ispm_command(f"compare a.npy b.npz:R --mask m.npz:m {bounds}")[0] == code


def test_compare_writes_the_difference(ispm_command, pictures, place):
    assert ispm_command("compare a.npy b.npz:R --diff d.png")[1] == "d.png\n"
    assert (place / "d.png").is_file()


@pytest.mark.parametrize(
    "line", ["scenes --json", "--help", "render --help", "--version", "info cornell-box --json"]
)
def test_a_closed_pipe_is_no_error(line):
    run = subprocess.Popen(
        [sys.executable, "-m", "ispm", *line.split()],
        cwd=Path(ispm.__file__).parents[1],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    run.stdout.close()
    assert b"Traceback" not in (said := run.stderr.read()) and b"Broken" not in said
    assert run.wait() == 0
    run.stderr.close()


def test_work_goes_on_where_nobody_reads_what_is_said(place):
    write_npy("a.npy", np.ones((4, 4, 3), np.float32))
    run = subprocess.Popen(
        [sys.executable, "-m", "ispm", "compare", "a.npy", "a.npy", "--diff", "d.png"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip
    run.stderr.close()
    assert run.stdout.read() == b"d.png\n" and run.wait() == 0
    run.stdout.close()


@pytest.mark.skipif(sys.platform == "win32", reason="Windows cannot send a process SIGINT")
@pytest.mark.parametrize("module", ["cyclopts", "ispm.cli.render", "numpy"])
def test_an_interrupt_while_modules_are_read_is_one_line(module):
    code = (  # what is started in the background may have been told to ignore interrupts
        "import os, signal, sys\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "class Interrupting:\n"
        "    def find_spec(self, name, *_):\n"
        f"        if name == {module!r}: os.kill(os.getpid(), signal.SIGINT)\n"
        "sys.meta_path.insert(0, Interrupting())\n"
        "from ispm.cli.main import main\n"
        "sys.exit(main(['info', 'cornell-box']))"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (run.returncode, run.stdout, run.stderr) == (130, "", "ispm: interrupted\n")


def test_python_m_ispm_is_the_command():
    with patch.object(sys, "argv", ["ispm", "--version"]), pytest.raises(SystemExit) as caught:
        runpy.run_module("ispm", run_name="__main__")
    assert caught.value.code == 0


def made_by(capsys_run, path):
    return json.loads(capsys_run(f"info {path} --json")[1])["command"]


@pytest.mark.parametrize(
    "line",
    [
        "render cornell-box --size 8x6 -o a.png",
        "render cornell-box --size 8x6 --photons 123456 --seed 7 --no-antialias --bits 16 -o a.png",
        "render cornell-box --size 8x6 --exposure -1.5 --background 0.1,0.25,1 --tonemap agx -o a.jpg",
        "render cornell-box --size 8x6 --look-from -1,2,3 --look-at 0,0,0 --fov 33.3 -o a.png",
        "render cornell-box --size 8x6 --camera camera --show direct --max-triangles 4000 -o a.png",
        "render cornell-box --size 8x6 --layers full,depth --float -o a.exr",
        "render cornell-box --size 8x6 --preset talk --bounces 5 --smoothing 0.123456789 -o a.npz",
    ],
)
def test_the_command_in_a_picture_makes_it_again(ispm_command, place, line):
    name = line.split("-o ")[1].split()[0]
    assert ispm_command(line)[0] == 0
    command = made_by(ispm_command, name)
    first = (place / name).read_bytes()
    (place / name).unlink()
    words = shlex.split(command)
    assert words[0] == "ispm"
    assert main(words[1:]) == 0
    one, two = FakeRenderer.made
    assert one.settings == two.settings
    assert (place / name).read_bytes() == first


def test_the_command_has_only_what_is_not_default(ispm_command):
    ispm_command("render cornell-box --size 8x6 --photons 40k --bounces 32 --time 0 --threads 2 -o a.png")
    assert made_by(ispm_command, "a.png") == "ispm render cornell-box --size 8x6 -o a.png"


def test_the_command_keeps_a_time_of_0_where_things_move(ispm_command):
    """They may stand elsewhere in the file than at their first key."""
    ispm_command("render caustic-ring --size 8x6 --time 0 -o a.png")
    assert made_by(ispm_command, "a.png") == "ispm render caustic-ring --time 0.0 --size 8x6 -o a.png"


def test_the_command_holds_what_came_from_the_environment_and_the_file(ispm_command, place, monkeypatch):
    (place / "s.toml").write_text("seed = 3\nmax_nodes = 77")
    monkeypatch.setenv("ISPM_PHOTONS", "2k")
    ispm_command(SMALL + "--config s.toml -o a.png")
    expected = "ispm render cornell-box --size 8x6 --photons 2000 --seed 3 --max-nodes 77 -o a.png"
    assert made_by(ispm_command, "a.png") == expected


def test_names_with_spaces_are_quoted(capsys, place):
    from ispm.io.save import save
    from ispm.library.builtin import builtin

    save(builtin("cornell-box"), place / "my room.glb")
    assert main(["render", "my room.glb", "--size", "8x6", "-o", "a b.png"]) == 0
    capsys.readouterr()
    assert main(["info", "a b.png"]) == 0
    assert "made by: ispm render 'my room.glb' --size 8x6 -o 'a b.png'" in capsys.readouterr().err


@pytest.mark.skipif(sys.platform != "linux", reason="other systems have no such names")
def test_a_scene_whose_name_is_no_text_can_be_rendered(place, capsys):
    from ispm.io.save import save
    from ispm.library.builtin import builtin

    save(builtin("cornell-box"), "room.glb").rename("r\udcffom.glb")
    for ending in ("png", "jpg", "exr", "npz"):
        assert main(["render", "r\udcffom.glb", "--size", "8x6", "-o", f"a.{ending}"]) == 0
        assert main(["info", f"a.{ending}"]) == 0
    assert "r?om.glb" in capsys.readouterr().err


def test_info_of_a_picture_prints_the_command_in_a_line_of_its_own(ispm_command):
    ispm_command(SMALL + "-o a.png")
    code, out, err = ispm_command("info a.png")
    assert (code, out) == (0, "")
    assert "8x6" in err and "R, G, B" in err
    assert err.splitlines()[-1] == "made by: ispm render cornell-box --size 8x6 -o a.png"


def test_info_of_an_array_says_that_it_holds_no_settings(ispm_command):
    ispm_command(SMALL + "-o a.npy")
    assert "no .npy does" in ispm_command("info a.npy")[2]


def test_info_of_kept_passes_tells_them_in_plain_lines(ispm_command):
    kept = json.dumps({"passes": 4, "scene": "room", "made_of": "00ff", "error": 0.25, "stats": {}})
    write_npz("a.npz", {"sum.direct": np.zeros((6, 8, 3))}, {"ispm:progress": kept})
    code, out, err = ispm_command("info a.npz")
    assert (code, out) == (0, "")
    assert [line.split() for line in err.splitlines()[:4]] == [
        ["passes", "4"], ["scene", "room"], ["size", "8x6"], ["error", "0.25"]
    ]  # fmt: skip
    assert "{" not in err and "--resume a.npz" in err
    assert json.loads(ispm_command("info a.npz --json")[1])["passes"] == 4


def test_print_config_holds_the_loading_limits(ispm_command):
    _, out, _ = ispm_command("render --print-config --max-nodes 5")
    printed = tomllib.loads(out)
    assert printed["max_nodes"] == 5
    assert {f.name for f in fields(LoadLimits)} <= set(printed)
