"""Measure how far pictures are from those of a path tracer, and write docs/accuracy.md with its chart.

python -m references.accuracy              # in tests/; all references, some minutes on two cores
python -m references.accuracy NAME...      # those alone; nothing is written
python -m references.accuracy --write NAME...    # those alone, and their rows of the page
python -m references.accuracy --passes 4   # as far as 4 passes; nothing is written
python -m references.accuracy --flicker NAME...  # how much those flicker; nothing is written

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
from typing import Any, TypeVar

import numpy as np

from ispm import Renderer, Scene, Settings, load
from ispm.bench.metrics import Comparison, compare
from ispm.gpu import Gpu, open_gpu
from ispm.library.builtin import builtin
from ispm.renderer.picture import Frame
from ispm.settings import PRESETS
from references import Reference, larger, names, outside, stored
from references.flicker import HEADINGS as FLICKER_HEADINGS
from references.flicker import Flicker, measure_flicker
from references.page import PAGE, read_between, table, write_between
from references.scenes import TRACED, pictured

_CHART = PAGE.parent / "pictures" / "accuracy.svg"
_SETTINGS: dict[str, dict[str, Any]] = {
    "default": {},
    "fast": {"preset": "fast"},
    "best": {"preset": "best"},
}
_SIZE = 640, 360  # of pictures; small references are compared with the mean over each of their pixels
_PASSES = 4, 16, 64, 256
_SMALL_MOST = 64  # passes
_FINEST = {"A": {"subsampling": 1}, "C": {"subsampling": 1}}
_FINEST_PASSES = 64  # of these settings, too
_SPLITS = "-direct", "-one-bounce", "-caustic"
_REPEATS = 3
_LARGER = {"A": "A, box", "B": "B, glass ball", "C": "C, mirror ring"}
_FLICKERING = "A", "B", "C", "door", "atrium"
_FINER = 2  # pixels of exact direct light to the side of one of the reference's
_FINE_SHADOWS = 4096
_LEAST_SHARE = 0.1  # of the light, from which indirect light is compared
_HEADINGS = ("scene", "setting", "seconds", "over", "bias", "relMSE", "FLIP")


AnyRow = TypeVar("AnyRow", "Row", Flicker)


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


@dataclass(frozen=True)
class Subject:
    """What is rendered, and what it is compared with.

    title      the scene's in the table
    limit      of bounces, and lights, as settings
    factor     what a picture of it is to be divided by
    direct     (h, w, 3) exact direct light, for the indirect light to be compared alone; None: it is not
    """

    title: str
    scene: Scene
    reference: Reference
    limit: dict[str, Any]
    factor: float = 1.0
    direct: np.ndarray | None = None


def main() -> int:
    """Measure, print and write; return the exit code."""
    parser = argparse.ArgumentParser(description="Measure pictures against a path tracer's.")
    parser.add_argument("names", nargs="*", metavar="NAME", help="references; default: all")
    parser.add_argument("--passes", type=int, default=_PASSES[-1], metavar="N", help="at most")
    parser.add_argument("--flicker", action="store_true", help="measure nothing else")
    parser.add_argument("--write", action="store_true", help="the rows of those named")
    given = parser.parse_args()
    warnings.simplefilter("ignore")
    gpu, larger_names = open_gpu(), _larger_names()
    small = [name for name in names() if not name.endswith("-caustic")]  # roulette spoils dimmed scenes
    rows, flickers = [], []
    if not given.flicker:
        print(*_HEADINGS, sep="\t")
        for name in given.names or [*small, *larger_names]:
            rows += _printed(measure(name, gpu, given.passes))
    if given.flicker or not given.names:
        print(*FLICKER_HEADINGS, sep="\t")
        known = [name for name in _FLICKERING if name in larger_names or name not in _LARGER]
        for name in given.names or known:
            settings = {key: Settings(**knobs, size=_SIZE) for key, knobs in _presets().items()}
            flickers += _printed(measure_flicker(_LARGER.get(name, name), _scene(name), settings, gpu))
    if rows and flickers and given.passes == _PASSES[-1]:
        write_page(rows, flickers)
        _CHART.write_text(chart(rows), "utf-8")
    elif given.write and rows:
        write_rows(rows)
    return 0


def _printed(rows: Iterator[AnyRow]) -> list[AnyRow]:
    found = []
    for row in rows:
        print(*row.cells(), sep="\t", flush=True)
        found.append(row)
    return found


def _larger_names() -> list[str]:
    try:
        outside()
    except FileNotFoundError as error:
        print(f"left out: {', '.join(_LARGER)}: {error}", file=sys.stderr)
        return []
    return list(_LARGER)


def _presets() -> dict[str, dict[str, Any]]:
    return {name: knobs for name, knobs in _SETTINGS.items() if knobs.get("preset", "default") in PRESETS}


def _scene(name: str) -> Scene:
    if name in _LARGER:
        return load(outside() / f"scene_{name}.glb")
    return pictured(name)[0] if name in names() else builtin(name)


def subject(name: str, gpu: Gpu) -> Subject:
    """Return what the reference `name` is about."""
    reference = larger(name) if name in _LARGER else stored(name)
    limit: dict[str, Any] = {} if reference.bounces is None else {"bounces": reference.bounces}
    if name in TRACED:
        limit["light"] = "none"  # but what they have; a shade that a texture makes glow does not count as any
    if name not in _LARGER:
        scene, factor = pictured(name)
        return Subject(name, scene, reference, limit, factor)
    scene = _scene(name)
    return Subject(_LARGER[name], scene, reference, limit, direct=exact_direct(scene, gpu))


def exact_direct(scene: Scene, gpu: Gpu) -> np.ndarray:
    """Return direct light, (h, w, 3), the mean over finer pixels on whose edges there are samples too."""
    size = _FINER * _SIZE[0], _FINER * _SIZE[1]
    settings = Settings(size=size, bounces=0, shadow_resolution=_FINE_SHADOWS)
    with Renderer(scene, settings, gpu=gpu) as renderer:
        return _block_means(renderer.render().direct, _SIZE)


def measure(name: str, gpu: Gpu, most: int) -> Iterator[Row]:
    """Yield the rows of one reference: the presets, then means of up to `most` passes."""
    shown = subject(name, gpu)
    for setting, knobs in _presets().items():
        settings = Settings(**knobs, **shown.limit, size=_SIZE)
        frame, seconds = _timed(shown.scene, settings, gpu)
        yield from _compared(shown, setting, seconds, frame)
    most = min(most, 1 if name.endswith(_SPLITS) else most if name in _LARGER else _SMALL_MOST)
    wanted = [n for n in _PASSES if n <= most]
    settings = Settings(size=_SIZE, **shown.limit)
    for passes, frame, seconds in _converging(shown.scene, settings, gpu, wanted):
        yield from _compared(shown, f"{passes} passes", seconds, frame)
    if name in _FINEST and most >= _FINEST_PASSES:
        told = ", ".join(f"{knob} {value}" for knob, value in _FINEST[name].items())
        finest = Settings(size=_SIZE, **_FINEST[name])
        for passes, frame, seconds in _converging(shown.scene, finest, gpu, [_FINEST_PASSES]):
            yield from _compared(shown, f"{passes} passes, {told}", seconds, frame)


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


def _compared(shown: Subject, setting: str, seconds: float, frame: Frame) -> Iterator[Row]:
    reference = shown.reference
    radiance = _block_means(frame.radiance, reference.size) / np.float32(shown.factor)
    for over, mask in reference.masks.items():
        found = compare(radiance, reference.radiance, mask, reference_error=reference.own_errors[over])
        yield Row(shown.title, setting, seconds, over, found.bias, found.relmse, found.flip)
    if shown.direct is not None:
        found = compare_indirect(frame.indirect, reference, shown.direct)
        yield Row(shown.title, setting, seconds, "indirect", found.bias, found.relmse, found.flip)


def compare_indirect(indirect: np.ndarray, reference: Reference, direct: np.ndarray) -> Comparison:
    """Compare indirect light alone with what the reference has beside direct light.

    Where that is a tenth of its light or more: of less, the reference's roundings would be told as errors.
    Its own error is all the indirect light's, and taken to be in proportion to it.
    """
    radiance = reference.radiance.astype(np.float64)
    rest = radiance - direct
    mask = reference.masks["whole"] & (rest.sum(axis=-1) > _LEAST_SHARE * radiance.sum(axis=-1))
    whole = radiance[reference.masks["whole"]]
    share = (rest[mask] ** 2 / (radiance[mask] ** 2 + 1e-3 * whole.mean() ** 2)).mean()
    expected = np.where(mask[..., None], rest, indirect)  # what is left out shall not show in FLIP
    return compare(indirect, expected, mask, reference_error=reference.own_errors["whole"] / share)


def _block_means(picture: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """Means of a picture, (h, w, 3), over blocks: a smaller picture of that size."""
    width, height = size
    tall, wide = picture.shape[0] // height, picture.shape[1] // width
    return np.asarray(picture.reshape(height, tall, width, wide, 3).mean(axis=(1, 3)))


def write_page(rows: list[Row], flickers: list[Flicker]) -> None:
    """Replace the tables of the page."""
    _write_references()
    write_between("accuracy", table(list(_HEADINGS), [row.cells() for row in rows], "llrlrrr"))
    flicker = [row.cells() for row in flickers]
    write_between("flicker", table(list(FLICKER_HEADINGS), flicker, "llrr"))


def write_rows(rows: list[Row]) -> None:
    """Replace the rows of some small references in the page's table, in their places by name."""
    new = {row.scene for row in rows}
    cells = [kept for kept in read_between("accuracy") if kept[0] not in new]
    small = set(names())
    cells += [row.cells() for row in rows]
    cells.sort(key=lambda kept: (kept[0] not in small, kept[0] if kept[0] in small else ""))  # stable
    _write_references()
    write_between("accuracy", table(list(_HEADINGS), cells, "llrlrrr"))


def _write_references() -> None:
    kept = []
    for name in names():
        reference = stored(name)
        share, own = reference.masks["whole"].mean(), reference.own_errors["whole"]
        cells = name, f"{reference.samples:,}", reference.bounces, f"{own:.1e}", f"{share:.0%}"
        kept.append([str(cell) for cell in cells])
    headings = ["reference", "paths per pixel", "bounces", "own relMSE", "compared"]
    write_between("references", table(headings, kept, "lrrrr"))


_WIDTH, _HEIGHT = 760, 440
_LEFT, _RIGHT, _TOP, _BOTTOM = 64, 600, 16, 392  # of the plot, pixels
_COLORS = (
    "#1f77b4", "#d62728", "#2ca02c", "#9467bd", "#8c564b", "#e377c2", "#17becf", "#7f7f7f", "#bcbd22",
    "#ff7f0e", "#393b79", "#637939",
)  # fmt: skip


def chart(rows: list[Row]) -> str:
    """Return an SVG: relMSE against seconds, one line per scene from the default to the most passes.

    Of those that Mitsuba rendered: more lines could not be told apart.
    """
    lines: dict[str, list[tuple[float, float]]] = {}
    for row in rows:
        measured = row.setting == "default" or row.setting.endswith("passes")
        charted = row.scene not in TRACED and not row.scene.endswith(_SPLITS)
        if row.over == "whole" and measured and charted:
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
