"""The names that `import ispm` hands out."""

import ast
import importlib
import operator
import tomllib
from pathlib import Path

import pytest

import ispm

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("name", ispm.__all__)
def test_public_name_is_there_and_documented(name):
    value = getattr(ispm, name)
    assert name in dir(ispm)
    assert isinstance(value, str) or value.__doc__


def test_every_name_has_a_home_and_editors_see_the_same_names():
    tree = ast.parse((ROOT / "ispm/__init__.py").read_text("utf-8"))
    seen = {
        alias.asname or alias.name: (node.module, alias.name)
        for block in tree.body
        if isinstance(block, ast.If)
        for node in block.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert set(seen) | {"__version__"} == set(ispm.__all__)
    for name, (module, inside) in seen.items():
        assert getattr(ispm, name) is getattr(importlib.import_module(module), inside)


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'Rendrer'"):
        operator.attrgetter("Rendrer")(ispm)


def test_errors_are_also_what_python_expects():
    for name, kind in (("SceneError", ValueError), ("SettingsError", ValueError), ("OutputError", OSError)):
        assert issubclass(getattr(ispm, name), (ispm.IspmError, kind))
        assert issubclass(getattr(ispm, name), kind)


def test_constraints_pin_every_dependency():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    lines = (ROOT / "constraints.txt").read_text("utf-8").lower().splitlines()
    pinned = {line.split("==")[0].replace("_", "-") for line in lines if "==" in line}
    wanted = project["dependencies"] + [
        r for extra in project["optional-dependencies"].values() for r in extra
    ]
    for requirement in wanted:
        name = requirement.split(">=")[0].lower().replace("_", "-")
        assert name in pinned, name
