"""What a renderer's pictures are worth: their errors, and the seconds to reach one."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ispm.bench.metrics import compare_light
from references import Reference

GOALS = 0.02, 0.005  # relMSE
_LEAST = 1e-6  # relMSE below which it is that of the reference
_STALLS = 4.0**-0.25  # of the error in four times the time: it takes 16 times to halve


@dataclass(frozen=True)
class Point:
    """A picture: seconds of rendering, and its errors over a mask."""

    seconds: float
    relmse: float
    bias: float


@dataclass
class Run:
    """One renderer on one scene; points by mask, sooner ones first."""

    title: str
    start_up: float
    points: dict[str, list[Point]] = field(default_factory=dict)


def scored(folder: Path, reference: Reference, launched: float) -> Run:
    """Return what a process that was launched then, in seconds of `time.time`, has left in its folder.

    Raises FileNotFoundError where it has not come as far as rendering.
    """
    told = json.loads((folder / "ready.json").read_text("utf-8"))
    start_up = told["at"] - launched if told["start_up"] is None else told["start_up"]
    run = Run(told["title"], start_up, {over: [] for over in reference.masks})
    for path in sorted(folder.glob("*.npz")):
        with np.load(path) as kept:
            seconds, radiance = float(kept["seconds"]), kept["radiance"]
        for over, mask in reference.masks.items():
            own = reference.own_errors[over]
            found = compare_light(radiance, reference.radiance, mask, reference_error=own)
            run.points[over].append(Point(seconds, found.relmse, found.bias))
    for points in run.points.values():
        points.sort(key=lambda point: point.seconds)  # a finer setting may take less
    return run


def reached(points: list[Point], goal: float) -> str:
    """Return the seconds until the error is the goal, between the pictures either side of it.

    `≤`: the first picture is as good already. `>`: none is; `floor`: nor will be, as errors hardly fall now.
    """
    good = [k for k, point in enumerate(points) if point.relmse <= goal]
    if not good:
        return "floor" if _stalled(points) else f"> {_text(points[-1].seconds)}"
    if good[0] == 0:
        return f"≤ {_text(points[0].seconds)}"
    before, after = points[good[0] - 1], points[good[0]]
    share = math.log(before.relmse / goal) / math.log(before.relmse / max(after.relmse, _LEAST))
    return _text(before.seconds * (after.seconds / before.seconds) ** share)


def _stalled(points: list[Point]) -> bool:
    last = points[-1]
    early = [point.relmse for point in points if point.seconds <= last.seconds / 4.0]
    return bool(early) and last.relmse > _STALLS * early[-1]


def _text(seconds: float) -> str:
    return f"{seconds:.2f}" if seconds < 10.0 else f"{seconds:.0f}"
