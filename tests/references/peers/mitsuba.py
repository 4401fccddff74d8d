"""Mitsuba 3: passes with new seeds, summed. `path` for A, `ptracer` where there are caustics."""

from __future__ import annotations

import subprocess
import sys
import time
from itertools import count
from typing import Any

import mitsuba as mi
import numpy as np

from ispm import load
from references import outside
from references.peers import SIZE, Recorder, work

_SAMPLES = 8  # per pixel and pass
_TRIAL = (
    "import mitsuba as m; m.set_variant('llvm_ad_rgb'); m.render(m.load_dict(m.cornell_box()), spp=1).numpy()"
)


def render(name: str, recorder: Recorder) -> None:
    """Keep means of ever more passes. Without LLVM, or one too old, it is the scalar variant."""
    trial = subprocess.run([sys.executable, "-c", _TRIAL], capture_output=True)  # an old LLVM aborts
    variant = "scalar_rgb" if trial.returncode else "llvm_ad_rgb"
    mi.set_variant(variant)
    from references.to_mitsuba import to_mitsuba  # knows the variant only now

    kind = "path" if name == "A" else "ptracer"
    integrator = {"type": kind, "max_depth": -1, "rr_depth": 8}
    scene = to_mitsuba(load(outside() / f"scene_{name}.glb"), SIZE, integrator, plain_mirrors=True)
    _pass(scene, 0)  # compiles
    recorder.ready(f"Mitsuba {mi.__version__}, {variant}, {kind}")
    total, seconds = np.zeros((*SIZE[::-1], 3)), 0.0
    for seed in count(1):
        started = time.perf_counter()
        total += _pass(scene, seed)
        seconds += time.perf_counter() - started
        if recorder.due(seconds):
            recorder.add(seconds, total / seed)
        if seconds >= recorder.limit:
            return


def _pass(scene: Any, seed: int) -> np.ndarray:
    return np.array(mi.render(scene, spp=_SAMPLES, seed=seed))


if __name__ == "__main__":
    work(render)
