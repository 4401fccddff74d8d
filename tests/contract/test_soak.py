"""Pictures again and again take no more mappings, descriptors or memory; `make soak` is the long run."""

import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[2] / "scripts/soak.py"


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_nothing_grows():
    """Mesa 22.3 kept 12 mappings more of each call: 360 in the second half of these."""
    counts = ["--calls", "60", "--frames", "0", "--live", "100", "--renderers", "6", "--cargo", "10"]
    run = subprocess.run([sys.executable, SCRIPT, *counts], capture_output=True, text=True)
    assert run.returncode == 0, run.stdout + run.stderr
    assert "nothing grew" in run.stdout and "calls          60" in run.stdout
    assert "cargo: memory" in run.stdout
