"""Measure balls of metal and plastic in a studio, from smooth to rough; print and write it.

python -m references.balls             # in tests/; against our paths, a quarter of an hour on two cores
python -m references.balls --mitsuba   # a dozen, most about alpha .25, against Mitsuba's, likewise

An error that jumps from one roughness to the next is seen as a seam where a texture tells the roughness.
"""

from __future__ import annotations

import sys

import numpy as np
from transport import Tracer

from ispm import Renderer, Settings
from ispm.gpu import Gpu, open_gpu
from ispm.kernels.threads import thread_count
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

_EVEN = np.linspace(0.01, 1.0, 24)
_ABOUT_NARROW = np.sqrt([0.03, 0.05, 0.1, 0.2, 0.22, 0.24, 0.26, 0.28, 0.3, 0.5, 0.7, 1.0])
_COLUMNS = 12
_CELL = 40  # pixels, of 1 m
_RADIUS = 0.36  # m
_INNER = 0.9  # of it, that is looked at
_BOUNCES = 8
_PICTURES, _PASSES = 16, 64  # of one pass, each with a seed of its own; of one picture
_PATHS, _PARTS = 256, 4
_MITSUBA_PATHS, _MITSUBA_PARTS = 128, 8  # of a pixel and part
KINDS = {
    "metal": Material((0.95, 0.93, 0.88), metallic=1.0),
    "plastic": Material((0.5, 0.15, 0.1)),
}
Measured = tuple[np.ndarray, np.ndarray]
"""Mean luminance of each ball, (kinds, n), and its relative standard error."""


def main() -> None:
    """Measure, print and write."""
    beside_mitsuba = "--mitsuba" in sys.argv[1:]
    rough = _ABOUT_NARROW if beside_mitsuba else _EVEN
    truth, own = by_mitsuba(rough) if beside_mitsuba else by_paths(rough)
    gpu, cells = open_gpu(), []
    for setting, passes, pictures in (("default", 1, _PICTURES), (f"{_PASSES} passes", _PASSES, 1)):
        found, noise = by_photons(rough, gpu, passes, pictures)
        error = np.hypot(own, noise)
        for kind, ratio, of_kind in zip(KINDS, found / truth, error, strict=True):
            told = [f"{r:.3f}: {b - 1:+.2%} ± {e:.2%}" for r, b, e in zip(rough, ratio, of_kind, strict=True)]
            print(kind, setting, *told, sep="\n  ", flush=True)
            steps = ratio[1:] / ratio[:-1] - 1.0
            off, step = np.abs(ratio - 1.0).argmax(), np.abs(steps).argmax()
            cells.append(
                [kind, setting, f"{ratio.mean() - 1.0:+.2%}", f"{ratio[off] - 1.0:+.2%} at {rough[off]:.2f}",
                 f"{steps[step]:+.2%} after {rough[step]:.2f}", f"{of_kind.max():.2%}"]
            )  # fmt: skip
    headings = ["balls", "setting", "bias, mean", "worst", "worst step", "±"]
    print(table(headings, cells, "llrrrr"))
    write_between("balls-mitsuba" if beside_mitsuba else "balls", table(headings, cells, "llrrrr"))


def balls(rough: np.ndarray) -> Scene:
    """Rows of balls of each kind, seen from the front of the studio without perspective."""
    scene = Scene(name="balls", environment=Environment(studio_radiance(), name="studio"))
    front = np.array([np.sin(FRONT), 0.0, -np.cos(FRONT)])
    pose = look_at_pose(20.0 * front, np.zeros(3))
    mesh, rows = icosphere(_RADIUS, 32), _rows(rough)
    for k, material in enumerate(KINDS.values()):
        for i, value in enumerate(rough):
            row = k * rows // len(KINDS) + i // _COLUMNS
            right, up = i % _COLUMNS - 0.5 * (_COLUMNS - 1), 0.5 * (rows - 1) - row
            place = pose[:3, 0] * right + pose[:3, 1] * up
            looks = Material(material.base_color, metallic=material.metallic, roughness=float(value))
            scene.add(mesh, material=looks, translation=tuple(place.tolist()))
    turn = quaternion(pose[:3, :3])
    camera = Camera(ymag=0.5 * rows)
    scene.add(camera, name="camera", translation=tuple((20.0 * front).tolist()), rotation=turn)
    return scene


def by_photons(rough: np.ndarray, gpu: Gpu, passes: int, pictures: int) -> Measured:
    """Measure so many pictures of so many passes; the error is 0 where there is one."""
    found = []
    for seed in range(pictures):
        with Renderer(balls(rough), Settings(size=_size(rough), seed=seed), gpu=gpu) as renderer:
            *_, frame = renderer.converge(passes)
        found.append(_means(rough, frame.radiance.mean(axis=-1).astype(np.float64).ravel()))
    return _measured(found)


def by_paths(rough: np.ndarray) -> Measured:
    """Measure our own paths from the eye."""
    scene, (width, height) = balls(rough), _size(rough)
    tracer, camera = Tracer(scene), scene.default_camera(_size(rough))
    view = CameraView(_size(rough), camera.pose, camera.yfov, camera.ymag)
    pixels, random = np.flatnonzero(_numbers(rough) >= 0), np.random.default_rng(5)
    parts, places = [], 16
    each = _PATHS // _PARTS // places
    for part in range(_PARTS):
        light = np.zeros(width * height)
        for place in range(places):
            dx, dy = random.random((2, len(pixels)))
            rays = view.rays_through(pixels % width + dx, pixels // width + dy)
            first = (part * places + place) * each
            samples = range(first, first + each)
            found = path_light(
                tracer.tables, *rays, samples=samples, bounces=_BOUNCES, threads=thread_count(None)
            )
            light[pixels] += found.mean(axis=1)
        parts.append(_means(rough, light / places))
    return _measured(parts)


def by_mitsuba(rough: np.ndarray) -> Measured:
    """Measure Mitsuba's paths. Needs what `make.py` needs."""
    import mitsuba as mi

    mi.set_variant("llvm_ad_rgb")
    from references.to_mitsuba import to_mitsuba  # knows the variant only now

    integrator = {"type": "path", "max_depth": _BOUNCES + 2, "rr_depth": 1000}
    scene = to_mitsuba(balls(rough), _size(rough), integrator)
    pictures = (np.array(mi.render(scene, spp=_MITSUBA_PATHS, seed=k)) for k in range(_MITSUBA_PARTS))
    return _measured([_means(rough, picture.mean(axis=-1, dtype=np.float64).ravel()) for picture in pictures])


def _measured(parts: list[np.ndarray]) -> Measured:
    mean = np.mean(parts, axis=0)
    if len(parts) == 1:
        return mean, np.zeros_like(mean)
    return mean, np.std(parts, axis=0, ddof=1) / np.sqrt(len(parts)) / mean


def _rows(rough: np.ndarray) -> int:
    return len(KINDS) * (len(rough) // _COLUMNS)


def _size(rough: np.ndarray) -> tuple[int, int]:
    return _COLUMNS * _CELL, _rows(rough) * _CELL


def _numbers(rough: np.ndarray) -> np.ndarray:
    """(pixels,) the number of the ball whose inner part each shows, kind by kind; -1: none."""
    width, height = _size(rough)
    x, y = np.meshgrid((np.arange(width) + 0.5) / _CELL, (np.arange(height) + 0.5) / _CELL)
    inner = np.hypot(x % 1.0 - 0.5, y % 1.0 - 0.5) < _INNER * _RADIUS
    return np.where(inner, np.floor(y) * _COLUMNS + np.floor(x), -1).astype(np.int64).ravel()


def _means(rough: np.ndarray, light: np.ndarray) -> np.ndarray:
    """(kinds, n) of a value per pixel."""
    numbers, count = _numbers(rough), len(KINDS) * len(rough)
    inner = numbers >= 0
    sums = np.bincount(numbers[inner], light[inner], count)
    return (sums / np.bincount(numbers[inner])).reshape(len(KINDS), -1)


if __name__ == "__main__":
    main()
