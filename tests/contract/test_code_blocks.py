"""Every block of code in README.md and docs/ runs, at a size and with passes that take no time."""

import re
import shlex
import subprocess
from pathlib import Path

import numpy as np
import pytest
import rgbe
import trimesh
from PIL import ImageShow

import ispm
from ispm.cli.main import main

ROOT = Path(__file__).parents[2]
DOCUMENTS = ["README.md", *sorted(f"docs/{path.name}" for path in (ROOT / "docs").glob("*.md"))]
SMALLER = [
    (r"size=\(\d+, \d+\)", "size=(64, 48)"),
    (r"range\(48\)", "range(2)"),
    (r"target_error=0\.\d+", "target_error=1.0"),
    (r"photons=100_000", "photons=2_000"),
    (r"--passes \d+", "--passes 2"),
    (r"--target-error 0\.\d+", "--target-error 1.0"),
    (r"--turntable 360/\d+", "--turntable 360/2"),
    (r"--frames \d+:\d+", "--frames 0:1"),
]
ELSEWHERE = ("pip install .", "scripts/on_gpu.sh")  # change the machine, or need another


def blocks(document, language):
    """The blocks of a document in a language."""
    text = (ROOT / document).read_text("utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.DOTALL | re.MULTILINE)


def smaller(text):
    for pattern, replacement in SMALLER:
        text = re.sub(pattern, replacement, text)
    return text


@pytest.fixture
def place(tmp_path, monkeypatch):
    """A folder with the files that the documents speak of, and a system that shows no windows."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(ImageShow, "_viewers", [])
    monkeypatch.setenv("ISPM_SIZE", "64x48")
    monkeypatch.setenv("ISPM_PHOTONS", "2000")
    scene = ispm.builtin("cornell-box")
    lamp = scene.lights[0]
    down = [lamp.translation, (2.8, 4.0, 2.8)]
    scene.animations.append(ispm.Animation([ispm.Channel(lamp, "translation", [0.0, 0.1], down)]))
    ispm.save(scene, "room.glb")
    trimesh.creation.box().export("part.stl")
    keys = "[[key]]\ntime = 0\neye = [2, 3, -2]\ntarget = [3, 2, 3]\n"
    Path("walk.toml").write_text(keys + keys.replace("time = 0", "time = 0.05"))
    Path("workshop.hdr").write_bytes(rgbe.hdr(rgbe.texels_of(np.ones((4, 8, 3)))))
    return tmp_path


def test_blocks_are_of_languages_that_are_run():
    for document in DOCUMENTS:
        text = (ROOT / document).read_text("utf-8")
        languages = re.findall(r"^```(\w*)\n.*?^```$", text, re.DOTALL | re.MULTILINE)
        assert set(languages) <= {"python", "sh", ""}, document  # without one: drawings


@pytest.mark.filterwarnings("ignore::ispm.errors.SceneWarning")
@pytest.mark.parametrize("document", [d for d in DOCUMENTS if blocks(d, "python")])
def test_python_of_a_document_is_one_program(document, place):
    names = {"__name__": "__main__"}
    for block in blocks(document, "python"):
        exec(compile(smaller(block), document, "exec"), names)


@pytest.mark.filterwarnings("ignore::ispm.errors.SceneWarning")
@pytest.mark.parametrize("document", [d for d in DOCUMENTS if blocks(d, "sh")])
def test_commands_of_a_document_are_there(document, place, capsys):
    lines = [
        line.partition(" #")[0].strip() for block in blocks(document, "sh") for line in block.splitlines()
    ]
    for line in filter(None, lines):
        words = shlex.split(smaller(line))
        if words[0] == "ispm":
            assert main(words[1:]) == 0, line
        elif words[0] == "make":  # that there is such a target, and what it would do
            subprocess.run(["make", "-n", "-C", ROOT, *words[1:]], check=True, capture_output=True)
        else:
            assert line.startswith(ELSEWHERE), line
            assert words[0] == "pip" or (ROOT / words[0]).is_file()
    capsys.readouterr()
