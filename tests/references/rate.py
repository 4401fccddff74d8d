"""How many live frames a second, and where their time goes: `make live` after the errors.

Wall time of `render()` and the picture's tone mapped bytes, 640x360, of 100 frames after 10.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ispm.library.builtin import builtin
from ispm.renderer import Renderer
from ispm.scene.camera import Camera
from ispm.scene.light import PointLight
from ispm.scene.material import Material
from ispm.scene.scene import Scene
from ispm.settings import Settings

sys.path.insert(0, str(Path(__file__).parents[1]))
from ispm.library.shapes import box
from references.live import camera_of, lamp_of
from references.page import table, write_between

_SIZE = 640, 360
_FRAMES, _FIRST = 100, 10
_STAGES = ("direct", "copy", "trace", "radiance", "upsample", "compose")
_BOXES = 5000


@dataclass(frozen=True)
class Moving:
    """A scene of which something moves in each frame."""

    name: str
    scene: Scene
    step: Callable[[int], None]


def _slide(scene: Scene) -> Callable[[int], None]:
    """Move the camera 1 cm a frame."""
    node = camera_of(scene)
    home = np.array(node.translation)

    def step(t: int) -> None:
        node.translation = tuple(home + np.array([0.01 * t, 0.0, 0.0]))

    return step


def _circle(scene: Scene, radius: float) -> Callable[[int], None]:
    """Move the lamp round, 10 frames a radian."""
    node = lamp_of(scene)
    home = np.array(node.translation)

    def step(t: int) -> None:
        node.translation = tuple(home + radius * np.array([np.sin(0.1 * t), 0.0, np.cos(0.1 * t)]))

    return step


def movements() -> list[Moving]:
    """Return what is measured."""
    first, second, atrium, glass = (
        builtin(name) for name in ("cornell-box",) * 2 + ("atrium", "glass-sphere")
    )
    walk, swing = _slide(atrium), _circle(atrium, 0.3)

    def both(t: int) -> None:
        walk(t)
        swing(t)

    return [
        Moving("Cornell box, camera", first, _slide(first)),
        Moving("Cornell box, light", second, _circle(second, 0.3)),
        Moving("`atrium`, camera and lantern", atrium, both),
        Moving("`glass-sphere`, light", glass, _circle(glass, 0.1)),
    ]


def measured(moving: Moving) -> list[str]:
    """Return a row of the table."""
    settings = Settings(size=_SIZE, preset="live", exposure=0.0)
    spent, stages = played(moving, settings, _FRAMES)
    direct, _ = played(moving, settings.replace(bounces=0), _FRAMES // 4)
    low, middle, high = np.percentile(spent, [25, 50, 75])
    times = f"{middle:.0f} ({low:.0f} to {high:.0f})"
    rates = f"{1e3 / middle:.1f}", f"{1e3 / np.median(direct):.1f}"
    return [moving.name, *rates, times, *(f"{ms:.0f}" for ms in np.median(stages, axis=0))]


def played(moving: Moving, settings: Settings, count: int) -> tuple[list[float], list[list[float]]]:
    """Return the wall ms of each of the last `count` frames, and those of its stages."""
    spent, stages = [], []
    with Renderer(moving.scene, settings) as renderer:
        for t in range(_FIRST + count):
            moving.step(t)
            started = time.perf_counter()
            frame = renderer.render()
            _ = frame.image
            spent.append(1e3 * (time.perf_counter() - started))
            stages.append([getattr(frame.stats, f"{name}_ms") for name in _STAGES])
    return spent[_FIRST:], stages[_FIRST:]


def boxes() -> str:
    """Return what it takes to pack 5,000 boxes that all move, `fast`."""
    random = np.random.default_rng(0)
    scene = Scene()
    scene.add(box((-2.0, -0.1, -2.0), (2.0, 0.0, 2.0)))
    mesh, material = box((0.0, 0.0, 0.0), (0.05, 0.05, 0.05)), Material()
    places = random.uniform(-1.8, 1.8, (_BOXES, 3)) + np.array([0.0, 2.0, 0.0])
    nodes = [scene.add(mesh, material=material, translation=tuple(place)) for place in places]
    scene.add(PointLight((50.0, 50.0, 50.0)), translation=(0.0, 5.0, 2.0))
    camera = Camera.look_at((0.0, 2.0, 7.0), (0.0, 2.0, 0.0))
    matrices = np.tile(np.eye(4), (_BOXES, 1, 1))
    placed, packed, whole = [], [], []
    with Renderer(scene, Settings(size=_SIZE, preset="fast", exposure=0.0), camera) as renderer:
        for t in range(30):
            matrices[:, :3, 3] = places + np.array([0.0, 0.01 * t, 0.0])
            started = time.perf_counter()
            scene.set_transforms(nodes, matrices)
            set_ = time.perf_counter()
            renderer._prepare(0)
            ready = time.perf_counter()
            renderer.render()
            placed.append(set_ - started)
            packed.append(ready - set_)
            whole.append(time.perf_counter() - started)
    a, b, c = (1e3 * float(np.median(each[5:])) for each in (placed, packed, whole))
    times = f"{a:.0f} ms to set, {b:.0f} ms to pack and place, {c:.0f} ms a frame"
    return f"{_BOXES:,} boxes that all move, `fast`: {times}."


def main() -> None:
    """Measure, print and write to docs/accuracy.md."""
    rows: list[list[str]] = []
    for moving in movements():
        rows.append(measured(moving))
        print("  ".join(rows[-1]), flush=True)
    line = boxes()
    print(line)
    headings = ["moving", "frames a second", "without indirect light", "ms (quarters)", *_STAGES]
    write_between("rate", f"{table(headings, rows, 'lrrr' + 'r' * len(_STAGES))}\n\n{line}")


if __name__ == "__main__":
    main()
