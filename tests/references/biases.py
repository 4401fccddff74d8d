"""Measure each bias of the estimate by itself, in a scene made for it; its tables go to docs/accuracy.md.

python -m references.biases            # in tests/; all, some minutes on two cores
python -m references.biases NAME...    # those alone (edges, leaks, ...); nothing is written
"""

from __future__ import annotations

import argparse
import math
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from transport import Tracer

from ispm import Renderer, Scene, Settings
from ispm.accel.surface import SurfaceTable, scene_tables
from ispm.gpu import Gpu, open_gpu
from ispm.kernels.threads import thread_count
from ispm.optics.texture import TextureTable
from ispm.reference.paths import path_light
from ispm.renderer.picture import Frame
from ispm.stages.camera import CameraView
from references.bias_scenes import BOUNCES, Case, Seen, cases
from references.page import table, write_between

_TABLES = {
    "biases": (("bias", "case", "over", "default", "fast", "16 passes", "±", "treated by"), "lllrrrrl"),
    "boiling": (("bias", "case", "default, median", "95 %", "fast, median", "95 %"), "llrrrr"),
}
_SIZE = 640, 360
_SEEDS, _FLICKER_SEEDS, _PASSES = 4, 16, 16
_PATHS = 250_000  # of a region
_SHARP = 1e-6  # of the diagonal, over which paths see textures averaged
_LOOKS = 16  # paths of each pixel where contrast is wanted


@dataclass(frozen=True)
class Known:
    """The true value over a region and its standard error."""

    value: float
    error: float


def main() -> int:
    """Measure, print and write; return the exit code."""
    everything = cases()
    parser = argparse.ArgumentParser(description="Measure each bias by itself.")
    parser.add_argument("names", nargs="*", choices=[*everything, []], metavar="NAME", help="default: all")
    names = parser.parse_args().names
    warnings.simplefilter("ignore")
    gpu, rows = open_gpu(), {title: [] for title in _TABLES}
    for name in names or everything:
        for case in everything[name]:
            for title, row in measure(name, case, gpu):
                print(*row, sep="\t", flush=True)
                rows[title].append(row)
    if not names:
        for title, (headings, sides) in _TABLES.items():
            write_between(title, table(list(headings), rows[title], sides))
    return 0


def measure(name: str, case: Case, gpu: Gpu) -> Iterator[tuple[str, list[str]]]:
    """Yield rows of the table of biases and of that of flicker, with the table's name."""
    scene = case.scene()
    settings = Settings(size=_SIZE, bounces=BOUNCES, **case.knobs)
    seeds = range(_FLICKER_SEEDS if case.flicker else _SEEDS)
    with Renderer(scene, settings, gpu=gpu) as renderer:
        first = renderer.render()
        default = _pictures(renderer, settings, seeds)
        fast = _pictures(renderer, settings.replace(preset="fast", gather=0), seeds)
        renderer.settings = settings
        *_, last = renderer.converge(_PASSES)
    pictures = [default, fast, last.indirect.mean(axis=-1)[None]]
    for over, mask, truth in _regions(case, first):
        unit = case.unit or truth.value
        measured = [_contrast(p, mask) if case.contrast else p[:, mask].mean(axis=1) for p in pictures]
        spread = measured[0].std(ddof=1) / math.sqrt(len(measured[0])) if len(measured[0]) > 1 else 0.0
        figures = [f"{(m.mean() - truth.value) / unit:+.2%}" for m in measured]
        error = math.hypot(truth.error, spread) / unit
        yield "biases", [name, case.title, over, *figures, f"{error:.2%}", case.treated]
    if case.flicker:
        shares = [share for p in (default, fast) for share in _flicker(p)]
        yield "boiling", [name, case.title, *(f"{share:.1%}" for share in shares)]


def _pictures(renderer: Renderer, settings: Settings, seeds: range) -> np.ndarray:
    """(n, h, w) cd/m2 of indirect light, mean of the channels, by seed."""
    found = []
    for seed in seeds:
        renderer.settings = settings.replace(seed=seed)
        found.append(renderer.render().indirect.mean(axis=-1))
    return np.array(found)


def _view(scene: Scene) -> CameraView:
    camera = scene.default_camera(_SIZE)
    assert camera.pose is not None
    return CameraView(_SIZE, camera.pose, camera.yfov, camera.ymag)


def _regions(case: Case, frame: Frame) -> Iterator[tuple[str, np.ndarray, Known]]:
    """Yield the name, the mask and the truth of each."""
    regions = case.regions(_seen(frame, _view(case.scene())))
    for k, (over, mask) in enumerate(regions.items()):
        if over in case.exact:
            yield over, mask, Known(case.exact[over], 0.0)
            continue
        yield over, mask, _truth(case, case.scene, mask)
        if k == 0 and case.finest:
            yield f"{over}, finest truth", mask, _truth(case, case.finest, mask)


def _seen(frame: Frame, view: CameraView) -> Seen:
    origins, directions = view.rays()
    there = np.isfinite(frame.depth)
    along = np.where(there, frame.depth, 0.0) / (directions @ view.forward)
    return Seen(origins + directions * along[..., None], frame.normal)


def _truth(case: Case, build: Callable[[], Scene], mask: np.ndarray) -> Known:
    """What paths through the pixels of a region bring: the mean, or the contrast."""
    scene = build()
    y, x = np.nonzero(mask)
    if case.contrast:
        halves = [_indirect(scene, x + 0.5, y + 0.5, _LOOKS, k * _LOOKS) for k in (0, 1)]
        return Known(_contrast_of(np.array(halves)), 0.0)
    count = -(-_PATHS // len(x)) * len(x)
    jitter = np.random.default_rng(1).random((2, count))
    light = _indirect(scene, np.resize(x, count) + jitter[0], np.resize(y, count) + jitter[1], 1, 0)
    return Known(float(light.mean()), float(light.std() / math.sqrt(count)))


def _indirect(scene: Scene, x: np.ndarray, y: np.ndarray, samples: int, first: int) -> np.ndarray:
    """(n,) cd/m2 that paths through places of the picture bring, less what one without a scatter would."""
    tracer, view = Tracer(scene), _view(scene)
    textures = TextureTable.pack(tracer.packed.textures, tracer.packed.colors)
    surfaces = SurfaceTable(tracer.packed, textures, _SHARP * tracer.packed.diagonal)
    tables = scene_tables(tracer.packed, tracer.world, surfaces)
    rays = view.rays_through(x, y)
    every, straight = (
        path_light(
            tables, *rays, samples=range(first, first + n), bounces=bounces, threads=thread_count(None)
        )
        for n, bounces in ((samples, BOUNCES), (1, 0))
    )
    return (every - straight).mean(axis=-1)


def _contrast(pictures: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Contrast of each two pictures that follow each other; of one: of itself."""
    values = pictures[:, mask]
    pairs = [values[k : k + 2] for k in range(len(values) - 1)] or [values]
    return np.array([_contrast_of(pair) for pair in pairs])


def _contrast_of(pictures: np.ndarray) -> float:
    """Standard deviation over mean of what pictures, (2, n), have in common: without the noise of each."""
    away = pictures - pictures.mean(axis=1, keepdims=True)
    return math.sqrt(max(float((away[0] * away[-1]).mean()), 0.0)) / float(pictures.mean())


def _flicker(pictures: np.ndarray) -> tuple[float, float]:
    """Median and 95th percentile over the pixels of standard deviation over mean among pictures."""
    mean = pictures.mean(axis=0)
    share = (pictures.std(axis=0, ddof=1)[mean > 0.0]) / mean[mean > 0.0]
    return float(np.median(share)), float(np.quantile(share, 0.95))


if __name__ == "__main__":
    raise SystemExit(main())
