"""What the command line says where a kernel must be compiled."""

import json
import os
import shutil
import subprocess
import sys

import pytest

from ispm.kernels import manifest, store
from ispm.kernels.jit import kernel_file

SMALL = ["render", "cornell-box", "--size", "32x18", "--photons", "500", "-o", "a.png"]


@pytest.fixture
def one_missing(tmp_path):
    """An environment whose cache holds what this one's does, all but a small kernel of every picture."""
    kept = tmp_path / "kernels"
    kept.mkdir()
    for line in manifest.lines():
        found = store.find(kernel_file(*manifest.parse(line)))
        if found is not None and "_sum_layers" not in line:
            shutil.copy(found, kept)
    if not any(kept.iterdir()):
        pytest.skip("no kernels are kept here")
    return os.environ | {"ISPM_CACHE": str(tmp_path)}


def render(folder, environment, *words):
    return subprocess.run(
        [sys.executable, "-m", "ispm", *SMALL, *words], cwd=folder, env=environment, capture_output=True,
        text=True, timeout=250, check=True,
    )  # fmt: skip


def test_compiling_is_said_once_on_stderr_and_not_counted(tmp_path, one_missing):
    run = render(tmp_path, one_missing, "--json")
    said = [line for line in run.stderr.splitlines() if "compil" in line]
    assert said[0] == "compiling 1 kernel, once: about 1 s" and len(said) == 2
    assert json.loads(run.stdout)["output"] == "a.png"


def test_quiet_compiles_without_a_word(tmp_path, one_missing):
    run = render(tmp_path, one_missing, "--quiet")
    assert (run.stdout, run.stderr) == ("a.png\n", "")
