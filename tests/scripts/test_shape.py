"""scripts/shape.py on a package made for it: what it counts, and what not."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[2] / "scripts" / "shape.py"
FILES = {
    "__init__.py": '"""Nothing."""\n',
    "low.py": '"""Ground."""\n\nfrom __future__ import annotations\n',
    "attic/__init__.py": "",
    "attic/light.wgsl": "// A comment.\n\nfn light() -> f32 {  // and another\n    return 1.0;\n}\n",
    "attic/light.py": '''"""Lights."""

from typing import TYPE_CHECKING

import numpy as np

from made import low

if TYPE_CHECKING:
    from made.cellar import walk

_ETA, _THIN = 3, 4  # places
EPSILON = 1.5


@jit
def shine(b, scene, color, rows, u, *rest):
    """Return what shines.

    rows  (n, 3) float32, m
    """
    made = np.zeros(3)
    made[0] = color[0] + color[1] + color[2]  # an array, and a vector
    return b[_ETA] + b[7] + scene[6][1] + u[0] + rows[0] + rows[-1] + b["eta"] + u.shape[0] + b[EPSILON]


class Lamp:
    def __init__(self, a, b, c, d, e, f, g, h):
        self.size = a

    def far(self, values: list[int], b, c, d, e, f, g, h, *, i):
        return self.size[0] + values[1] + self.pair[1]  # fmt: skip
''',
    "cellar/__init__.py": "",
    "cellar/walk.py": '''def _late(x):
    from made.attic import light

    def inner(y):
        return y[0]

    return light, inner


def soon():
    """Go on."""
''',
}


@pytest.fixture(scope="module")
def package(tmp_path_factory):
    root = tmp_path_factory.mktemp("shape") / "made"
    for name, text in FILES.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)
    return root


def run(*arguments):
    command = [sys.executable, str(SCRIPT), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def test_what_is_counted(package):
    found = json.loads(run(package, "--json"))
    assert sorted(each.split(" ", 2)[2] for each in found["numbered_in_kernels"]) == [
        "b[7]",
        "b[_ETA]",
        "scene[6]",
        "scene[6][1]",
        "u[0]",
    ]
    assert [each.rsplit(" ", 1)[1] for each in found["numbered_elsewhere"]] == ["self.pair[1]", "y[0]"]
    assert found["vectors"] == 3
    assert [[count, name] for count, name, _ in found["arguments"]] == [[9, "Lamp.far"]]
    assert (found["functions"], found["kernels"], found["fmt_skip"]) == (5, 1, 1)
    assert found["stated"] == {"public": [1, 3], "kernels": [1, 1]}
    assert found["rooms"]["attic"]["files"] == 3
    assert found["rooms"]["attic"]["wgsl"] == 3 and found["rooms"]["cellar"]["py"] == 6


def test_circles_are_told_with_and_without_lazy_imports(package):
    found = json.loads(run(package, "--json"))
    assert (found["circles"], found["lazy_circles"]) == ([], [])  # what types alone need is not imported
    light = package / "attic" / "light.py"
    text = light.read_text()
    try:
        light.write_text("from made.cellar.walk import soon\n" + text)
        assert json.loads(run(package, "--json"))["lazy_circles"] == ["cellar -> attic"]
        (package / "cellar" / "walk.py").write_text("import made.attic.light\n")
        assert json.loads(run(package, "--json"))["circles"] == ["attic cellar"]
    finally:
        light.write_text(text)
        (package / "cellar" / "walk.py").write_text(FILES["cellar/walk.py"])


def test_the_package_itself_is_measured_as_a_table_and_to_read():
    table = run()
    assert "| functions of more than 8 arguments |" in table and "| imports within functions" in table
    assert len(run("--sample", 5).splitlines()) == 5 and run("--sample", 5) == run("--sample", 5)
