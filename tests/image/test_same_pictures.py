"""Pictures of everything are what they were when `guard/kept.npz` was written: `python -m guard --keep`."""

import dataclasses
import subprocess
import sys
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from guard import exact, summary
from guard.arrays import arrays, open_renderer
from guard.scenes import cases

import ispm
from ispm.settings import Emission, Estimator, Kernel, Preset, Settings, Shadows, Tonemap, Unlit

CASES = cases()


@pytest.fixture(scope="module")
def renderer(gpu):
    with open_renderer(gpu) as made:
        yield made


@pytest.fixture(scope="module")
def kept():
    return summary.read()


@pytest.mark.gpu
@pytest.mark.parametrize("case", [case for case in CASES if case.steady], ids=lambda case: case.name)
def test_pictures_are_what_they_were(case, renderer, kept, gpu):
    if "llvmpipe" not in gpu.name:
        pytest.skip(f"{gpu.name}: drivers other than llvmpipe are compared by make drivers")
    found = summary.summary(arrays(case, renderer))
    assert summary.differences(kept[case.name], found, summary.slack()) == []


def test_all_that_can_be_chosen_is_rendered():
    used = [Settings(**case.settings) for case in CASES]
    every = dict(preset=Preset, kernel=Kernel, estimator=Estimator, emission=Emission, tonemap=Tonemap)
    every |= dict(shadows=Shadows, light=Unlit)
    for name, choices in every.items():
        assert {getattr(settings, name) for settings in used} == set(get_args(choices)), name
    fixed = {"size", "photons", "time_limit", "target_error"}
    assert {f.name for f in dataclasses.fields(Settings)} - fixed <= {
        f.name for f in dataclasses.fields(Settings) for s in used if getattr(s, f.name) != f.default
    }


def test_all_that_scenes_are_made_of_is_rendered():
    scenes = [case.scene() for case in CASES]
    assert {type(node.light) for scene in scenes for node in scene.lights} == {
        ispm.PointLight, ispm.SpotLight, ispm.DirectionalLight,
        ispm.RectLight, ispm.DiskLight, ispm.SphereLight,
    }  # fmt: skip
    assert {type(scene.environment) for scene in scenes} == {type(None), ispm.Environment, ispm.Sky}
    materials = [material for scene in scenes for material in scene.materials]
    names = {f.name for f in dataclasses.fields(ispm.Material)} - {"name"}
    plain = ispm.Material()
    assert names == {n for n in names for m in materials if getattr(m, n) != getattr(plain, n)}
    assert {m.alpha_mode for m in materials} == set(ispm.AlphaMode)
    meshes = [part.mesh for scene in scenes for node in scene.nodes for part in node.parts]
    assert all(
        any(getattr(m, name) is not None for m in meshes) for name in ("normals", "uv0", "uv1", "colors")
    )
    assert any(node.instances is not None for scene in scenes for node in scene.nodes)
    assert any(case.camera and case.camera.orthographic for case in CASES)


def test_what_moves_is_told_and_what_rounds_is_not(kept):
    case = {name: array.copy() for name, array in kept["corner/default"].items()}
    assert summary.differences(kept["corner/default"], case) == []
    rounded = {
        n: a if a.dtype.kind == "U" or n in ("instance", "material") else a * 1.0005 for n, a in case.items()
    }
    assert summary.differences(case, rounded) == []
    for name, change in (
        ("indirect", lambda a: a * 1.01),
        ("direct", lambda a: np.roll(a, 1, axis=1)),
        ("instance", lambda a: np.where(a == a[0, 0], 99, a)),
        ("photons.radius", lambda a: a * 1.01),
        ("stats.stored_photons", lambda a: a + 50),
        ("stats.estimator", lambda a: np.array("other")),
        ("emission", lambda a: a + 1.0),
    ):
        (line, *_) = summary.differences(case, {**case, name: change(case[name])})
        assert line.startswith(name)
    assert summary.differences(case, {n: a for n, a in case.items() if n != "alpha"}) == ["alpha: gone"]


def test_exact_comparison_tells_one_bit():
    old = {"a/b": {"full": np.array([[1.0, np.inf]], np.float32), "id": np.array([3]), "kind": np.array("x")}}
    assert list(exact.differences(old, old)) == []
    new = {"a/b": {**old["a/b"], "full": np.nextafter(old["a/b"]["full"], np.float32(0.0))}}
    (found,) = exact.differences(
        {"a/b": {"full": new["a/b"]["full"][:, :1]}}, {"a/b": {"full": old["a/b"]["full"][:, :1]}}
    )
    assert (found.array, found.share) == ("full", 1.0) and found.most < 1e-7
    near = {"a/b": {**old["a/b"], "full": np.array([[1.0 + 1e-5, np.inf]], np.float32)}}
    assert [each.array for each in exact.differences(old, near)] == ["full"]
    assert list(exact.differences(old, near, within=1e-4)) == []
    assert [each.array for each in exact.differences(old, new, within=1e-4)] == [
        "full"
    ]  # infinity is no number
    gone = {"a/b": {"full": old["a/b"]["full"], "id": np.array([3, 3])}}
    assert [(each.array, each.what) for each in exact.differences(old, gone, within=1.0)] == [
        ("id", "int64[1] became int64[2]"), ("kind", "gone")
    ]  # fmt: skip
    assert list(exact.differences(old, gone, without=["id", "k*"])) == []


def test_without_pictures_of_before_the_guard_says_so(tmp_path):
    command = [sys.executable, "-m", "guard", "--file", str(tmp_path / "none.npz")]
    run = subprocess.run(command, cwd=Path(__file__).parents[1], capture_output=True, text=True)
    assert run.returncode == 2 and "make guard WRITE=1" in run.stderr
