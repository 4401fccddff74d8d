"""Measure renderers beside each other, one after the other on all cores, and write docs/accuracy.md's table.

python -m references.peers [--luxcore PYTHON] [--mitsuba PYTHON]   # in tests/; seven minutes
python -m references.peers A C --seconds 5                         # those scenes alone; nothing is written

PYTHON is an interpreter that has that package (and for Mitsuba what ispm needs), this one by default.
DRJIT_LIBLLVM_PATH names LLVM 17 or newer, without which Mitsuba is several times slower. What is not
installed is left out. ISPM_REFS says where the scenes and their references are.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from ispm import load
from references import larger, outside
from references.page import table, write_between
from references.peers.describe import describe
from references.peers.score import GOALS, Run, reached, scored

_SECONDS = 30.0  # of rendering, each
_GRACE = 120.0  # seconds for what is not rendering: kernels are compiled where there are none
_AIMS = {  # seconds to each of GOALS, over the mask last in the table
    "A": ("0.10", "0.30"),
    "B": ("0.40", "1.50"),
    "C": ("0.15", "0.40"),
}
_TRUE = 0.02  # relative error of the mean light of renderers without bias
_HEADINGS = ("scene", "renderer", "over", *(f"s to {goal}" for goal in GOALS))
_HEADINGS += ("relMSE", "after s", "bias", "start-up s")


class Peer(NamedTuple):
    """How to start a renderer: its module beside this file, and what else it is told."""

    name: str
    module: str
    told: tuple[str, ...] = ()
    unbiased: bool = False
    scenes: str = "ABC"


_PEERS = (
    Peer("ispm", "ours"),
    Peer("ispm, fewer photons", "ours", ("photons=10000",), scenes="A"),
    Peer("ispm, fast", "ours", ("preset=fast", "photons=15000"), scenes="A"),
    Peer("ispm, more photons", "ours", ("photons=500000",), scenes="C"),
    Peer("Mitsuba", "mitsuba", unbiased=True),
    Peer("LuxCore", "luxcore", unbiased=True),
    Peer("POV-Ray", "povray"),
)


def main() -> int:
    """Measure, print and write; return the exit code."""
    parser = argparse.ArgumentParser(description="Measure renderers beside each other.")
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help="A, B or C; default: all")
    parser.add_argument("--seconds", type=float, default=_SECONDS, metavar="N", help="of rendering, each")
    parser.add_argument("--luxcore", default=sys.executable, metavar="PYTHON", help="that has pyluxcore")
    parser.add_argument("--mitsuba", default=sys.executable, metavar="PYTHON", help="that has mitsuba")
    given = parser.parse_args()
    pythons = {"luxcore": given.luxcore, "mitsuba": given.mitsuba}
    rows: list[list[str]] = []
    light_warnings: list[str] = []
    print(*_HEADINGS, sep="\t")
    for name in given.scenes or _AIMS:
        for peer in _PEERS:
            if name not in peer.scenes:
                continue
            run, remark = measured(peer, name, given.seconds, pythons.get(peer.module, sys.executable))
            if remark:
                light_warnings.append(f"{name}, {peer.name}: {remark}")
                print(light_warnings[-1], flush=True)
            for row in cells(name, run) if run else ():
                print(*row, sep="\t", flush=True)
                rows.append(row)
        rows.append([name, "aim", list(larger(name).masks)[-1], *_AIMS[name], "", "", "", ""])
    if not given.scenes and given.seconds == _SECONDS:
        text = table(list(_HEADINGS), rows, "lllrrrrrr")
        write_between("peers", "\n".join([text, *(f"\n{remark}" for remark in light_warnings)]))
    return 0


def measured(peer: Peer, name: str, seconds: float, python: str) -> tuple[Run | None, str]:
    """Return how a peer did on a scene, and what is to be said of it; nothing it does raises."""
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        described = describe(load(outside() / f"scene_{name}.glb"))
        (folder / "scene.json").write_text(json.dumps(described), "utf-8")
        launched = time.time()
        failed = _started(peer, [name, str(folder), str(seconds), *peer.told], seconds, python)
        if not any(folder.glob("*.npz")):
            return None, f"left out: {failed or 'no picture in time'}"
        run = scored(folder, larger(name), launched)
    bias = run.points["whole"][-1].bias
    if peer.unbiased and abs(bias) > _TRUE:
        return None, f"left out: its light is off by {bias:+.1%}, so that it does not render the same scene"
    return run, failed and f"ended early: {failed}"


def _started(peer: Peer, arguments: list[str], seconds: float, python: str) -> str:
    """Run it; return the last line of what went wrong, or nothing."""
    program = shutil.which(python)
    if program is None:
        return f"no interpreter {python}"
    command = [os.path.abspath(program), "-m", f"references.peers.{peer.module}", *arguments]
    folder = Path(__file__).parents[2]  # that of `references`
    paths = (str(folder.parent), os.environ.get("PYTHONPATH"))  # the same ispm for all interpreters
    known = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths))}
    limit = seconds + _GRACE
    try:
        done = subprocess.run(command, cwd=folder, env=known, capture_output=True, timeout=limit)
    except subprocess.TimeoutExpired:
        return f"stopped after {limit:.0f} s"
    lines = done.stderr.decode(errors="replace").strip().splitlines() or [f"exit code {done.returncode}"]
    return lines[-1].replace("ModuleNotFoundError", "not installed") if done.returncode else ""


def cells(name: str, run: Run) -> Iterator[list[str]]:
    """Yield a row of the table for each mask."""
    for over, points in run.points.items():
        last = points[-1]
        times = [reached(points, goal) for goal in GOALS]
        last_point = [f"{last.relmse:.4f}", f"{last.seconds:.1f}", f"{last.bias:+.1%}"]
        yield [name, run.title, over, *times, *last_point, f"{run.start_up:.1f}"]


if __name__ == "__main__":
    raise SystemExit(main())
