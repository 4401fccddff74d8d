"""All shaders, in all variants."""

import logging
from pathlib import Path

import pytest
from drivers.grammar import faults
from drivers.pipelines import all_entries, all_pipelines

from ispm.gpu import open_gpu

ROOT = Path(__file__).parents[2]
SHADERS = sorted(
    p.relative_to(ROOT).as_posix() for folder in ("ispm", "tests") for p in (ROOT / folder).rglob("*.wgsl")
)


@pytest.fixture(scope="module")
def pipelines():
    return all_pipelines()


def test_every_entry_point_is_among_the_pipelines(pipelines):
    assert all_entries() == {(each.path, entry) for each in pipelines for entry in each.entries}


def test_every_variant_compiles_without_a_warning(pipelines, caplog):
    gpu = open_gpu()  # which has none yet
    with caplog.at_level(logging.WARNING):
        for each in pipelines:
            each.make(gpu)
    gpu.close()
    assert not caplog.records


@pytest.mark.parametrize("path", SHADERS)
def test_shaders_are_of_the_grammar_that_naga_is_lax_about(path):
    assert faults((ROOT / path).read_text("utf-8")) == []


@pytest.mark.parametrize(
    "bad",
    [
        "a | b << 2u", "a << 2u | b", "a + b << 2u", "a << b << c", "a & b | c", "a & b == c", "a && b || c",
        "a & b && c", "f(a, b || c && d)", "x[a | b >> 1u]", "-a << b * c",
    ],
)  # fmt: skip
def test_what_needs_parentheses_is_found(bad):
    assert faults(f"fn f() {{\n    let x = {bad};\n}}") and faults(f"fn f() -> u32 {{ return {bad}; }}")


@pytest.mark.parametrize(
    "good",
    [
        "a | (b << 2u)", "(a & b) == c", "a | b | c", "(a && b) || c", "a << 2u < b", "a << 2u == b && c",
        "-a * b - -c", "f(&a, &b) && !c", "array<vec4<f32>, 4>()", "bitcast<u32>(a) >> 1u", "a < b || c >= d",
    ],
)  # fmt: skip
def test_what_needs_none_is_let_pass(good):
    assert faults(f"fn f() {{\n    let x = {good};\n}}") == faults(f"fn f() {{ return {good}; }}") == []


def test_a_variable_without_a_value_is_found():
    assert faults("@group(0) @binding(1) var t: texture_2d<f32>;\nfn f() {\n var x: array<f32, 4>;\n}") == [
        "3: 'var x: array<f32, 4>;' has no value"
    ]
