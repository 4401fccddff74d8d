"""The script that renders many scenes to be looked at."""

import subprocess
import sys
from pathlib import Path

from PIL import Image

SCRIPT = Path(__file__).parents[2] / "scripts/contact_sheet.py"


def run(*arguments, cwd):
    return subprocess.run([sys.executable, SCRIPT, *arguments], cwd=cwd, capture_output=True, text=True)


def test_it_leaves_a_picture_of_each_and_a_sheet_of_all(tmp_path):
    knobs = ("size=64x36", "photons=1k")
    words = [word for knob in knobs for word in ("--set", knob)]
    made = run("cornell-box", "nothing.glb", "integrating-sphere", "--width", "32", *words, cwd=tmp_path)
    assert made.returncode == 1 and "nothing.glb" in made.stderr and "Traceback" not in made.stderr
    folder = tmp_path / "out/contact"
    names = {"cornell-box.png", "integrating-sphere.png", "sheet.png"}
    assert {path.name for path in folder.iterdir()} == names
    assert Image.open(folder / "cornell-box.png").size == (64, 36)
    with Image.open(folder / "sheet.png") as sheet:
        assert sheet.size == (2 * 32, 18 + 14)
        small = (
            Image.open(folder / "cornell-box.png").convert("RGB").resize((32, 18), Image.Resampling.LANCZOS)
        )
        assert sheet.crop((0, 0, 32, 18)).tobytes() == small.tobytes()


def test_folders_fill_pages_and_files_of_one_name_are_told_apart(tmp_path):
    text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
    for name in ("a.obj", "b.obj", "below/a.obj", "notes.txt"):
        path = tmp_path / "models" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    made = run(
        "models", "--columns", "2", "--rows", "1", "--width", "20", "--set", "photons=1k", cwd=tmp_path
    )
    assert made.returncode == 0, made.stderr
    found = {path.name for path in (tmp_path / "out/contact").iterdir()}
    pictures = {"models-a.obj.png", "models-below-a.obj.png", "b.png"}
    assert found == pictures | {"sheet-1.png", "sheet-2.png"}
    sizes = []
    for name in ("sheet-1.png", "sheet-2.png"):
        with Image.open(tmp_path / "out/contact" / name) as sheet:
            sizes.append(sheet.size)
    assert sizes == [(40, 15 + 14), (20, 15 + 14)]
    with Image.open(tmp_path / "out/contact/b.png") as picture:
        assert picture.size == (320, 240)


def test_mistakes_are_told_in_a_line(tmp_path):
    for words, says in (
        ([], "no scenes were named"),
        (["a.glb", "--set", "sizes=3x3"], "did you mean 'size'"),
        (["a.glb", "--set", "size"], "size"),
        (["a.glb", "--columns", "0"], "1 or more"),
    ):
        found = run(*words, cwd=tmp_path)
        assert found.returncode == 2 and says in found.stderr and "Traceback" not in found.stderr
