"""What importing costs: a graphics adapter, numpy or a compiler only where they are used."""

import ast
import json
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
HEAVY = ("numpy", "numba", "wgpu", "OpenEXR", "PIL", "scipy", "trimesh")
FRESH = """
import json, sys, time
start = time.process_time()
{code}
seconds = time.process_time() - start
print(json.dumps([seconds, [name for name in {heavy!r} if name in sys.modules]]))
"""


def fresh(code):
    """Run code in a new process; return the processor seconds it took and what heavy modules it loaded."""
    script = FRESH.format(code=code, heavy=HEAVY)
    run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    return json.loads(run.stdout.splitlines()[-1])


@pytest.mark.parametrize(
    "arguments", [["--help"], ["--version"], ["render", "--help"], ["render", "--print-config"], ["rendr"]]
)
def test_help_and_mistakes_load_nothing_heavy(arguments):
    assert fresh(f"from ispm.cli.main import main; main({arguments})")[1] == []


def test_importing_ispm_loads_nothing_heavy():
    assert fresh("import ispm; ispm.__version__; ispm.Settings; ispm.SceneError")[1] == []


def test_an_interrupt_is_met_before_much_is_imported():
    """`ispm.cli.main` takes it from there; `-S`: no module that an installation adds."""
    code = "import sys; before = set(sys.modules); import ispm.cli.main; print(set(sys.modules) - before)"
    run = subprocess.run(
        [sys.executable, "-S", "-c", code], capture_output=True, text=True, check=True, cwd=ROOT
    )
    assert not {"typing", "re", "contextlib"} & ast.literal_eval(run.stdout)


def test_command_line_starts_at_once():
    # 0.11 s of processor time on a core of 2023, which a busy machine stretches little
    assert min(fresh("import ispm.cli.main")[0] for _ in range(3)) < 0.3


def test_loading_and_tracing_need_no_graphics():
    code = "import ispm.io.load, ispm.library.builtin, ispm.photons.walk, ispm.bench.metrics"
    assert "wgpu" not in fresh(code)[1]


def test_importing_the_renderer_opens_no_device():
    code = "import wgpu; wgpu.gpu.enumerate_adapters_sync = None; import ispm.renderer, ispm.gpu.device"
    assert "wgpu" in fresh(code)[1]
