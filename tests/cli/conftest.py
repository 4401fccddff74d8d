"""A folder for each test of the command line, and a way to give it a line."""

import pytest
from fake import FakeRenderer

import ispm.renderer
from ispm.cli.main import main


@pytest.fixture(autouse=True)
def place(tmp_path, monkeypatch):
    """Each test in a folder of its own, with the renderer replaced."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(ispm.renderer, "Renderer", FakeRenderer, raising=False)
    monkeypatch.setattr(FakeRenderer, "made", [])
    monkeypatch.setattr(FakeRenderer, "error", None)
    for name in ("PHOTONS", "SIZE", "PRESET", "MAX_TEXTURE"):
        monkeypatch.delenv("ISPM_" + name, raising=False)
    return tmp_path


@pytest.fixture
def ispm_command(capsys):
    """Return a function that runs a command line and returns (exit code, stdout, stderr)."""

    def run(line):
        code = main(line.split())
        out, err = capsys.readouterr()
        return code, out, err

    return run
