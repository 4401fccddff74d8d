"""How good and how steady live frames are, beside frames from scratch: `make live`.

Sequences of moving pictures; the truth of some of their frames is the mean of many passes. Errors are of the
indirect light of pixels on no edge, over the square of all their light: direct light is the same for both.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ispm.library.builtin import builtin
from ispm.library.shapes import box
from ispm.optics.vector import LUMINANCE
from ispm.renderer import Frame, Renderer
from ispm.scene.camera import look_at_pose
from ispm.scene.light import PointLight
from ispm.scene.material import Material
from ispm.scene.rotation import quaternion
from ispm.scene.scene import Node, Scene
from ispm.settings import Settings

sys.path.insert(0, str(Path(__file__).parents[1]))
from references.page import table, write_between
from references.scenes import door

_PASSES = 24  # of a truth
_DARK = 1e-3  # of the square of the mean: as in relMSE
_SIZE = 640, 360


@dataclass
class Sequence:
    """A scene and what happens in it.

    step    puts it at frame t
    truths  of some frames, the frame whose truth theirs is;  rests  the first from which nothing changes
    """

    name: str
    scene: Scene
    step: Callable[[int], None]
    frames: int
    truths: dict[int, int]
    rests: int = 10_000
    made: dict[int, np.ndarray] = field(default_factory=dict)


def _own(*frames: int) -> dict[int, int]:
    return {t: t for t in frames}


def camera_of(scene: Scene) -> Node:
    """Return the first node with a camera."""
    return next(node for node in scene.nodes if node.camera is not None)


def lamp_of(scene: Scene) -> Node:
    """Return the first node with a light."""
    return next(node for node in scene.nodes if node.light is not None)


def s1() -> Sequence:
    """The camera walks and turns in `atrium`."""
    scene = builtin("atrium", time=0.0)
    eye_node = camera_of(scene)

    def step(t: int) -> None:
        eye = np.array([-10.4 + 0.1 * t, 1.75, -1.5 + 0.03 * t])
        yaw = math.atan2(2.0, 16.4) - math.radians(1.2 * t)
        target = eye + np.array([math.cos(yaw), 0.09, math.sin(yaw)])
        eye_node.translation, eye_node.rotation = tuple(eye), quaternion(look_at_pose(eye, target)[:3, :3])

    return Sequence("S1 atrium, camera", scene, step, 45, _own(8, 20, 32, 44))


def s2() -> Sequence:
    """The light of the Cornell box moves, then rests."""
    scene = builtin("cornell-box")
    lamp = lamp_of(scene)
    start = np.array(lamp.translation)

    def step(t: int) -> None:
        k = max(min(t, 28) - 4, 0)
        lamp.translation = tuple(start - np.array([0.06 * k, 0.03 * k, 0.0]) * (start[1] / 5.5))

    return Sequence("S2 Cornell box, light", scene, step, 40, _own(10, 16, 22, 28), 28)


def s3() -> Sequence:
    """A red box moves through `door`, then rests."""
    scene = door()
    red = Material(base_color=(0.75, 0.04, 0.03), roughness=1.0)
    mover = scene.add(box((-0.4, 0.0, -0.4), (0.4, 0.9, 0.4)), material=red, name="mover")

    def step(t: int) -> None:
        k = min(t, 28)
        mover.translation = (6.1 + 0.012 * k, 0.02, 2.5 + 0.055 * k)

    return Sequence("S3 door, box", scene, step, 40, _own(10, 16, 22, 28), 28)


def s4() -> Sequence:
    """A second light goes on in the Cornell box, then off."""
    scene = builtin("cornell-box")
    _, high = scene.bounds
    lamp = scene.add(PointLight((3.0, 6.0, 9.0)), translation=tuple(np.array([0.18, 0.22, 0.15]) * high))

    def step(t: int) -> None:
        scale = float(10 <= t < 22)
        lamp.light = PointLight((3.0 * scale, 6.0 * scale, 9.0 * scale))

    return Sequence(
        "S4 Cornell box, switch", scene, step, 36, {9: 9, 10: 10, 11: 10, 21: 10, 22: 9, 23: 9}, 22
    )


def s5() -> Sequence:
    """The camera goes round the caustic of a ring."""
    scene = builtin("caustic-ring")
    node = camera_of(scene)
    pose = next(world for each, world in scene.placed() if each is node)
    middle = 0.5 * (np.array(scene.bounds[0]) + np.array(scene.bounds[1]))

    def step(t: int) -> None:
        turn = np.eye(3)
        a = math.radians(0.8 * t)
        turn[0, 0], turn[0, 2], turn[2, 0], turn[2, 2] = math.cos(a), math.sin(a), -math.sin(a), math.cos(a)
        node.translation = tuple(middle + turn @ (pose[:3, 3] - middle))
        node.rotation = quaternion(turn @ pose[:3, :3])

    return Sequence("S5 caustic-ring, camera", scene, step, 30, _own(8, 18, 28))


def s6() -> Sequence:
    """A light moves above a ball of glass, then rests."""
    scene = builtin("glass-sphere")
    lamp = lamp_of(scene)
    start = np.array(lamp.translation)

    def step(t: int) -> None:
        lamp.translation = tuple(start + np.array([0.02, 0.0, 0.01]) * min(t, 20))

    return Sequence("S6 glass-sphere, light", scene, step, 34, _own(8, 14, 20), 20)


SEQUENCES = {f.__name__: f for f in (s1, s2, s3, s4, s5, s6)}


def truth(sequence: Sequence, size: tuple[int, int], folder: Path) -> None:
    """Find the truth of some frames, or read what was found before."""
    for t, same in sequence.truths.items():
        path = folder / f"{sequence.name.split()[0]}-{size[0]}-{same}.npz"
        if not path.exists():
            sequence.step(same)
            settings = Settings(size=size, exposure=0.0, antialias=False, seed=900 + t)
            with Renderer(sequence.scene, settings) as renderer:
                *_, mean = renderer.converge(_PASSES)
            path.parent.mkdir(parents=True, exist_ok=True)
            np.savez(path, full=mean["full"], indirect=mean["indirect"], edges=_edges(mean))
        sequence.made[t] = np.load(path)


def _edges(frame: Frame) -> np.ndarray:
    """(h, w) bool: pixels beside another instance, or another orientation."""
    out = np.zeros(frame["depth"].shape, bool)
    for axis in (0, 1):
        ids, n = frame["instance"], frame["normal"]
        other = np.diff(ids, axis=axis) != 0
        first = tuple(slice(None, -1) if k == axis else slice(None) for k in (0, 1))
        second = tuple(slice(1, None) if k == axis else slice(None) for k in (0, 1))
        other |= (n[first] * n[second]).sum(-1) < 0.9
        out[first] |= other
        out[second] |= other
    return out


def error(frame: Frame, true: np.ndarray) -> float:
    """The relative mean squared error of indirect light."""
    used = ~true["edges"]
    wrong = ((frame["indirect"] - true["indirect"]) ** 2).mean(-1)[used]
    full = true["full"].mean(-1)[used]
    return float((wrong / (full * full + _DARK * full.mean() ** 2)).mean())


@dataclass(frozen=True)
class Found:
    """Errors by frame, ms of a frame's processor time, flicker in percent of the pixels at rest."""

    errors: dict[int, float]
    cpu: float
    flicker: float


def run(sequence: Sequence, settings: Settings, scratch: bool) -> Found:
    """Render it frame by frame; from scratch: each with random numbers of its own."""
    errors, cpu, flicker, before = {}, [], [], None
    with Renderer(sequence.scene, settings) as renderer:
        for t in range(sequence.frames):
            sequence.step(t)
            if scratch:
                renderer.settings = settings.replace(seed=t)
            started = time.process_time()
            frame = renderer.render()
            _ = frame.image  # what a viewer shows
            cpu.append(time.process_time() - started)
            if t in sequence.made:
                errors[t] = error(frame, sequence.made[t])
            luminance = frame["full"] @ np.array(LUMINANCE, np.float32)
            if before is not None and t > sequence.rests + 1:
                flicker.append(np.median(np.abs(luminance - before) / np.maximum(before, 1e-9)))
            before = luminance
    steady = cpu[3 : min(sequence.rests, sequence.frames)]
    return Found(errors, 1e3 * float(np.median(steady)), 100.0 * float(np.median(flicker or [math.nan])))


VARIANTS: dict[str, dict[str, object]] = {
    "live": dict(preset="live"),
    "default": {},
    "default, 10,000 photons": dict(photons=10_000),
}
_HEADINGS = ["sequence", "frames", "CPU ms", "error, median", "worst", "flicker at rest"]


def main() -> None:
    """Measure, print and write to docs/accuracy.md if all of it was measured."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", default=list(SEQUENCES), help=", ".join(SEQUENCES))
    parser.add_argument("--size", default=f"{_SIZE[0]}x{_SIZE[1]}")
    parser.add_argument("--truths", type=Path, default=Path("../out/live"), help="where they are kept")
    parser.add_argument("--only", nargs="*", default=list(VARIANTS), help="of these variants")
    given = parser.parse_args()
    width, height = map(int, given.size.split("x"))
    rows = []
    for name in given.names:
        sequence = SEQUENCES[name]()
        truth(sequence, (width, height), given.truths)
        for variant in given.only:
            shown: dict[str, Any] = dict(size=(width, height), exposure=0.0, antialias=False)
            settings = Settings(**shown, **VARIANTS[variant])  # type: ignore[arg-type]  # of their kinds
            found = run(sequence, settings, not settings.live)
            errors = list(found.errors.values())
            steady = "" if math.isnan(found.flicker) else f"{found.flicker:.2f}%"
            row = [sequence.name, variant, f"{found.cpu:.0f}", f"{np.median(errors):.5f}"]
            rows.append([*row, f"{max(errors):.5f}", steady])
            print("  ".join(rows[-1]), " ".join(f"{t}:{e:.5f}" for t, e in found.errors.items()), flush=True)
    if len(rows) == len(SEQUENCES) * len(VARIANTS) and (width, height) == _SIZE:
        write_between("live", table(_HEADINGS, rows, "llrrrr"))


if __name__ == "__main__":
    main()
