"""Measure balls of metal and plastic in a studio, from smooth to rough, against paths; print and write it.

python -m references.balls   # in tests/; some minutes on two cores

An error that jumps from one roughness to the next is seen as a seam where a texture tells the roughness.
"""

from __future__ import annotations

import numpy as np
from transport import Tracer

from ispm import Renderer, Settings
from ispm.gpu import Gpu, open_gpu
from ispm.library.shapes import icosphere
from ispm.library.studio_light import FRONT, studio_radiance
from ispm.reference.paths import path_light
from ispm.scene.camera import Camera, look_at_pose
from ispm.scene.environment import Environment
from ispm.scene.material import Material
from ispm.scene.rotation import quaternion
from ispm.scene.scene import Scene
from ispm.stages.camera import CameraView
from references.page import table, write_between

STEPS, COLUMNS = 24, 12
_SIZE = 480, 160
_RADIUS = 0.36  # m, of cells 1 m wide
_INNER = 0.9  # of it, that is looked at
_PASSES, _PATHS, _PARTS = 64, 256, 4
KINDS = {
    "metal": Material((0.95, 0.93, 0.88), metallic=1.0),
    "plastic": Material((0.5, 0.15, 0.1)),
}


def main() -> None:
    """Measure, print and write."""
    gpu, scene = open_gpu(), balls()
    truth, error = by_paths(scene)
    cells = []
    for passes in (1, _PASSES):
        found = by_photons(scene, gpu, passes) / truth
        for k, kind in enumerate(KINDS):
            ratio, own = found[k], error[k]
            steps = ratio[1:] / ratio[:-1] - 1.0
            off, step = np.abs(ratio - 1.0).argmax(), np.abs(steps).argmax()
            print(kind, passes, [f"{r:.2f}: {b - 1.0:+.2%}" for r, b in zip(roughness(), ratio, strict=True)])
            cells.append(
                [kind, "default" if passes == 1 else f"{passes} passes", f"{ratio.mean() - 1.0:+.2%}",
                 f"{ratio[off] - 1.0:+.2%} at {roughness()[off]:.2f}",
                 f"{steps[step]:+.2%} after {roughness()[step]:.2f}", f"{own.max():.2%}"]
            )  # fmt: skip
    headings = ["balls", "setting", "bias, mean", "worst", "worst step", "±"]
    print(table(headings, cells, "llrrrr"))
    write_between("balls", table(headings, cells, "llrrrr"))


def roughness() -> np.ndarray:
    """Return that of each ball of a kind, (24,)."""
    return np.linspace(0.01, 1.0, STEPS)


def balls() -> Scene:
    """Two rows of balls a kind, seen from the front of the studio without perspective."""
    scene = Scene(name="balls", environment=Environment(studio_radiance(), name="studio"))
    front = np.array([np.sin(FRONT), 0.0, -np.cos(FRONT)])
    pose = look_at_pose(20.0 * front, np.zeros(3))
    mesh = icosphere(_RADIUS, 32)
    for k, material in enumerate(KINDS.values()):
        for i, rough in enumerate(roughness()):
            row = 2 * k + i // COLUMNS
            place = pose[:3, 0] * (i % COLUMNS - 0.5 * (COLUMNS - 1)) + pose[:3, 1] * (1.5 - row)
            looks = Material(material.base_color, metallic=material.metallic, roughness=float(rough))
            scene.add(mesh, material=looks, translation=tuple(place.tolist()))
    turn = quaternion(pose[:3, :3])
    scene.add(Camera(ymag=2.0), name="camera", translation=tuple((20.0 * front).tolist()), rotation=turn)
    return scene


def by_photons(scene: Scene, gpu: Gpu, passes: int) -> np.ndarray:
    """Return the mean luminance of each ball, (kinds, 24), of so many passes."""
    with Renderer(scene, Settings(size=_SIZE), gpu=gpu) as renderer:
        *_, frame = renderer.converge(passes)
    return _means(frame.radiance.mean(axis=-1).astype(np.float64).ravel())


def by_paths(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """Return truth likewise, and its relative standard error."""
    tracer, camera = Tracer(scene), scene.default_camera(_SIZE)
    view = CameraView(_SIZE, camera.pose, camera.yfov, camera.ymag)
    pixels, random = np.flatnonzero(_numbers() >= 0), np.random.default_rng(5)
    parts = []
    for part in range(_PARTS):
        light, places = np.zeros(_SIZE[0] * _SIZE[1]), 16
        for place in range(places):
            dx, dy = random.random((2, len(pixels)))
            rays = view.rays_through(pixels % _SIZE[0] + dx, pixels // _SIZE[0] + dy)
            first = (part * places + place) * (_PATHS // _PARTS // places)
            samples = range(first, first + _PATHS // _PARTS // places)
            light[pixels] += path_light(tracer.tables, *rays, samples=samples, bounces=8, threads=2).mean(
                axis=1
            )
        parts.append(_means(light / places))
    mean = np.mean(parts, axis=0)
    return mean, np.std(parts, axis=0, ddof=1) / np.sqrt(_PARTS) / mean


def _numbers() -> np.ndarray:
    """(pixels,) the number of the ball whose inner part each shows, kind by kind; -1: none."""
    width, height = _SIZE
    cell = width / COLUMNS
    x, y = np.meshgrid((np.arange(width) + 0.5) / cell, (np.arange(height) + 0.5) / cell)
    inner = np.hypot(x % 1.0 - 0.5, y % 1.0 - 0.5) < _INNER * _RADIUS
    return np.where(inner, np.floor(y) * COLUMNS + np.floor(x), -1).astype(np.int64).ravel()


def _means(light: np.ndarray) -> np.ndarray:
    """(kinds, 24) of a value per pixel."""
    numbers = _numbers()
    inner = numbers >= 0
    sums = np.bincount(numbers[inner], light[inner], len(KINDS) * STEPS)
    return (sums / np.bincount(numbers[inner])).reshape(len(KINDS), STEPS)


if __name__ == "__main__":
    main()
