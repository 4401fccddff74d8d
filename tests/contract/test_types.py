"""Type checkers read the examples without a complaint, and find the mistakes of a day in them."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("mypy", reason="mypy is not installed")

ROOT = Path(__file__).parents[2]

MISTAKES = """\
import numpy as np

import ispm

frame = ispm.render("cornell-box")
frame.dpth
frame.names.find(3)
frame.instance.items()
frame.save("a.png", layers="depth")
ispm.Settings(kernel="foo")
ispm.Settings(photon=3)
ispm.Settings(size=640)
ispm.Settings().replace(estimator="grids")
ispm.Settings().replace(photon=3)
ispm.render("cornell-box", tonemap="agxx")
ispm.render("cornell-box", photons="many")
ispm.render("cornell-box", camra="eye")
scene = ispm.Scene()
scene.add(ispm.shapes.sphere("big"))
scene.add(ispm.Material())
scene.add(ispm.PointLight(), translation=(0.0, 2.0))
scene["lamp"].lok_at((0.0, 0.0, 0.0))
scene.find(["lamp"])
scene.merge("room.glb")
scene.bounds()
ispm.Texture(3)
ispm.Material(base_color_texture="wood.png")
ispm.Material(rougness=0.3)
ispm.euler(ordr="xyz")
camera = ispm.Camera.look_at((0.0, 0.0, 1.0), (0.0, 0.0, 0.0))
camera.intrinsics(640)
camera.extrinsics("opencl")
ispm.Renderer("cornell-box")
ispm.shapes.cube()
"""
RIGHT = {1, 2, 3, 4, 5, 18, 30}  # lines of it without a mistake


def mypy(*paths):
    """Lines of mypy --strict about files."""
    command = [sys.executable, "-m", "mypy", "--strict", "--config-file", "pyproject.toml", *map(str, paths)]
    run = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=280)
    assert run.returncode in (0, 1), run.stdout + run.stderr
    return run.stdout.splitlines()


def test_examples_are_well_typed_and_planted_mistakes_are_found(tmp_path):
    planted = tmp_path / "planted.py"
    planted.write_text(MISTAKES, "utf-8")
    examples = sorted((ROOT / "examples").rglob("*.py"))
    lines = mypy(planted, *examples)
    errors = [line for line in lines if ": error:" in line]
    found = {int(m[1]) for line in errors if (m := re.match(r".*planted\.py:(\d+): error:", line))}
    assert [line for line in errors if "planted.py" not in line] == []
    missed = set(range(1, MISTAKES.count("\n") + 1)) - RIGHT - found
    assert [MISTAKES.splitlines()[k - 1] for k in sorted(missed)] == []
    assert found & RIGHT == set()
