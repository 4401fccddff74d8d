"""The examples run, at a size that takes no time."""

import re
import sys
from pathlib import Path

import pytest
from PIL import ImageShow

FOLDER = Path(__file__).parents[2] / "examples"
EXAMPLES = sorted(FOLDER.glob("*.py"))
FILMS = sorted((FOLDER / "films").glob("*.py"))


@pytest.mark.filterwarnings("ignore:there is no display")
@pytest.mark.parametrize("path", [*EXAMPLES, *FILMS], ids=lambda path: path.stem)
def test_example_runs(path, tmp_path, monkeypatch, capsys):
    if "trimesh" in path.stem:
        pytest.importorskip("trimesh", reason="trimesh is not installed")
    if path in FILMS:
        pytest.importorskip("av", reason="PyAV is not installed")
    if "ispm.view(" in path.read_text("utf-8"):
        pytest.importorskip("uvicorn", reason="uvicorn is not installed")
        pytest.importorskip("websockets", reason="websockets is not installed")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(ImageShow, "_viewers", [])  # no windows while tests run
    text, sizes = re.subn(r"^SIZE = .*$", "SIZE = (64, 48)", path.read_text("utf-8"), flags=re.MULTILINE)
    text = re.sub(r"^(STEPS|PICTURES|PASSES|FRAMES) = .*$", r"\1 = 2", text, flags=re.MULTILINE)
    assert sizes == 1
    monkeypatch.setattr(sys, "argv", [path.name, *(["--frames", "3"] if "--frames" in text else [])])
    exec(compile(text, str(path), "exec"), {"__name__": "__main__"})
    assert list(tmp_path.glob("*.*")), "it writes a file"
    if path.stem == "save_and_load":
        assert "same picture: True" in capsys.readouterr().out


def test_examples_are_short():
    long = {path.name: n for path in EXAMPLES if (n := len(path.read_text("utf-8").splitlines())) > 40}
    assert len(EXAMPLES) >= 8
    assert long == {}
