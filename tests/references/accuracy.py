"""Measure how far pictures are from those of a path tracer, and write docs/accuracy.md with its chart.

python -m references.accuracy              # in tests/; all references, some minutes on two cores
python -m references.accuracy NAME...      # those alone; nothing is written
python -m references.accuracy --passes 4   # as far as 4 passes; nothing is written

ISPM_REFS says where the larger references are, ../shared/refs by default; without them they are left out.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import time
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from ispm import Renderer, Scene, Settings, load
from ispm.bench.metrics import compare
from ispm.gpu import Gpu, open_gpu
from ispm.renderer.picture import Frame
from ispm.settings import PRESETS
from references import Reference, larger, names, outside, stored
from references.page import PAGE, table, write_between
from references.scenes import pictured

_CHART = PAGE.parent / "pictures" / "accuracy.svg"
_SETTINGS: dict[str, dict[str, Any]] = {
    "default": {},
    "fast": {"preset": "fast"},
    "best": {"preset": "best"},
}
_SIZE = 640, 360  # of pictures; small references are compared with the mean over each of their pixels
_PASSES = 4, 16, 64
_SMALL_MOST = 16  # passes
_SPLITS = "-direct", "-one-bounce", "-caustic"
_REPEATS = 3
_LARGER = {"A": "A, box", "B": "B, glass ball", "C": "C, mirror ring"}
_HEADINGS = ("scene", "setting", "seconds", "over", "bias", "relMSE", "FLIP")


@dataclass(frozen=True)
class Row:
    """One line of the table; seconds of rendering, kernels compiled before."""

    scene: str
    setting: str
    seconds: float
    over: str
    bias: float
    relmse: float
    flip: float

    def cells(self) -> list[str]:
        """Return it as text."""
        numbers = (
            f"{self.seconds:.2f}",
            self.over,
            f"{self.bias:+.2%}",
            f"{self.relmse:.4f}",
            f"{self.flip:.3f}",
        )
        return [self.scene, self.setting, *numbers]


def main() -> int:
    """Measure, print and write; return the exit code."""
    parser = argparse.ArgumentParser(description="Measure pictures against a path tracer's.")
    parser.add_argument("names", nargs="*", metavar="NAME", help="references; default: all")
    parser.add_argument("--passes", type=int, default=_PASSES[-1], metavar="N", help="at most")
    given = parser.parse_args()
    warnings.simplefilter("ignore")
    rows, gpu = [], open_gpu()
    print(*_HEADINGS, sep="\t")
    small = [name for name in names() if not name.endswith("-caustic")]  # roulette spoils dimmed scenes
    for name in given.names or [*small, *_larger_names()]:
        for row in measure(name, gpu, given.passes):
            print(*row.cells(), sep="\t", flush=True)
            rows.append(row)
    if not given.names and given.passes == _PASSES[-1]:
        write_page(rows)
        _CHART.write_text(chart(rows), "utf-8")
    return 0


def _larger_names() -> list[str]:
    try:
        outside()
    except FileNotFoundError as error:
        print(f"left out: {', '.join(_LARGER)}: {error}", file=sys.stderr)
        return []
    return list(_LARGER)


def measure(name: str, gpu: Gpu, most: int) -> Iterator[Row]:
    """Yield the rows of one reference: the presets, then means of up to `most` passes."""
    reference = larger(name) if name in _LARGER else stored(name)
    scene, factor = (load(outside() / f"scene_{name}.glb"), 1.0) if name in _LARGER else pictured(name)
    title = _LARGER.get(name, name)
    limit = {} if reference.bounces is None else {"bounces": reference.bounces}
    for setting, knobs in _SETTINGS.items():
        if knobs.get("preset", "default") in PRESETS:
            settings = Settings(**knobs, **limit, size=_SIZE)
            frame, seconds = _timed(scene, settings, gpu)
            yield from _compared(title, setting, seconds, frame, reference, factor)
    most = min(most, 1 if name.endswith(_SPLITS) else most if name in _LARGER else _SMALL_MOST)
    wanted = [n for n in _PASSES if n <= most]
    settings = Settings(size=_SIZE, **limit)
    for passes, frame, seconds in _converging(scene, settings, gpu, wanted):
        yield from _compared(title, f"{passes} passes", seconds, frame, reference, factor)


def _timed(scene: Scene, settings: Settings, gpu: Gpu) -> tuple[Frame, float]:
    with Renderer(scene, settings, gpu=gpu) as renderer:
        seconds = []
        for _ in range(_REPEATS + 1):  # the first compiles, builds trees
            started = time.perf_counter()
            frame = renderer.render()
            seconds.append(time.perf_counter() - started)
        return frame, statistics.median(seconds[1:])


def _converging(
    scene: Scene, settings: Settings, gpu: Gpu, wanted: list[int]
) -> Iterator[tuple[int, Frame, float]]:
    if not wanted:
        return
    with Renderer(scene, settings, gpu=gpu) as renderer:
        renderer.render()
        started = time.perf_counter()
        for passes, frame in enumerate(renderer.converge(wanted[-1]), 1):
            if passes in wanted:
                yield passes, frame, time.perf_counter() - started


def _compared(
    scene: str, setting: str, seconds: float, frame: Frame, reference: Reference, factor: float
) -> Iterator[Row]:
    width, height = reference.size
    blocks = frame.radiance.reshape(height, _SIZE[1] // height, width, _SIZE[0] // width, 3)
    radiance = blocks.mean(axis=(1, 3)) / np.float32(factor)
    for over, mask in reference.masks.items():
        found = compare(radiance, reference.radiance, mask, reference_error=reference.own_errors[over])
        yield Row(scene, setting, seconds, over, found.bias, found.relmse, found.flip)


def write_page(rows: list[Row]) -> None:
    """Replace the tables of the page."""
    kept = []
    for name in names():
        reference = stored(name)
        share, own = reference.masks["whole"].mean(), reference.own_errors["whole"]
        cells = name, f"{reference.samples:,}", reference.bounces, f"{own:.1e}", f"{share:.0%}"
        kept.append([str(cell) for cell in cells])
    headings = ["reference", "paths per pixel", "bounces", "own relMSE", "compared"]
    write_between("references", table(headings, kept, "lrrrr"))
    write_between("accuracy", table(list(_HEADINGS), [row.cells() for row in rows], "llrlrrr"))


_WIDTH, _HEIGHT = 760, 440
_LEFT, _RIGHT, _TOP, _BOTTOM = 64, 600, 16, 392  # of the plot, pixels
_COLORS = (
    "#1f77b4", "#d62728", "#2ca02c", "#9467bd", "#8c564b", "#e377c2", "#17becf", "#7f7f7f", "#bcbd22",
    "#ff7f0e", "#393b79", "#637939",
)  # fmt: skip


def chart(rows: list[Row]) -> str:
    """Return an SVG: relMSE against seconds, one line per scene from the default to the most passes."""
    lines: dict[str, list[tuple[float, float]]] = {}
    for row in rows:
        measured = row.setting == "default" or "passes" in row.setting
        if row.over == "whole" and measured and not row.scene.endswith(_SPLITS):
            lines.setdefault(row.scene, []).append((row.seconds, max(row.relmse, 1e-5)))
    x = _Axis([p[0] for line in lines.values() for p in line], _LEFT, _RIGHT)
    y = _Axis([p[1] for line in lines.values() for p in line], _BOTTOM, _TOP)
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {_HEIGHT}" width="{_WIDTH}" '
        f'height="{_HEIGHT}" font-family="sans-serif" font-size="12" fill="#333">',
        f'<rect width="{_WIDTH}" height="{_HEIGHT}" fill="#fff"/>',
        *_grid(x, y),
    ]
    ends = sorted((y(line[-1][1]), name) for name, line in lines.items())
    labels, last = {}, -1e9
    for end, name in ends:  # names below each other where lines end together
        labels[name] = last = max(end, last + 14)
    for color, (name, line) in zip(_COLORS, lines.items(), strict=False):
        places = [(x(seconds), y(error)) for seconds, error in line]
        path = " ".join(f"{px:.1f},{py:.1f}" for px, py in places)
        parts.append(f'<polyline points="{path}" fill="none" stroke="{color}" stroke-width="1.5"/>')
        parts += [f'<circle cx="{px:.1f}" cy="{py:.1f}" r="3" fill="{color}"/>' for px, py in places]
        (px, py), at = places[-1], labels[name]
        parts.append(
            f'<path d="M{px:.1f} {py:.1f} L{_RIGHT + 8} {at:.1f}" stroke="{color}" stroke-width="0.5"/>'
            f'<text x="{_RIGHT + 12}" y="{at + 4:.1f}" fill="{color}">{name}</text>'
        )
    return "\n".join([*parts, "</svg>\n"])


class _Axis:
    """Whole decades round values, logarithmic, between two places of the picture."""

    def __init__(self, values: list[float], first: float, last: float) -> None:
        self.low, self.high = np.floor(np.log10(min(values))), np.ceil(np.log10(max(values)))
        self.first, self.last = first, last

    def __call__(self, value: float) -> float:
        share = (np.log10(value) - self.low) / (self.high - self.low)
        return float(self.first + share * (self.last - self.first))

    @property
    def decades(self) -> list[float]:
        return [float(10.0**k) for k in np.arange(self.low, self.high + 1)]


def _grid(x: _Axis, y: _Axis) -> Iterator[str]:
    for value in x.decades:
        at = x(value)
        yield f'<path d="M{at:.1f} {_TOP} V{_BOTTOM}" stroke="#ddd"/>'
        yield f'<text x="{at:.1f}" y="{_BOTTOM + 18}" text-anchor="middle">{value:g}</text>'
    for value in y.decades:
        at = y(value)
        yield f'<path d="M{_LEFT} {at:.1f} H{_RIGHT}" stroke="#ddd"/>'
        yield f'<text x="{_LEFT - 8}" y="{at + 4:.1f}" text-anchor="end">{value:g}</text>'
    yield f'<text x="{(_LEFT + _RIGHT) / 2}" y="{_HEIGHT - 10}" text-anchor="middle">seconds</text>'
    yield f'<text transform="translate(14 {_HEIGHT / 2}) rotate(-90)" text-anchor="middle">relMSE</text>'


if __name__ == "__main__":
    raise SystemExit(main())
