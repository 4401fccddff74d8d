"""Mean indirect light of scenes that Mitsuba does not take as they are, by paths from the eye.

python -m references.paths [NAME...]   # in tests/; some minutes on two cores
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from assets import assets
from transport import Tracer

from ispm import Scene, builtin, load
from ispm.accel.surface import SurfaceTable, scene_tables
from ispm.kernels.threads import thread_count
from ispm.optics.texture import TextureTable
from ispm.reference.paths import path_light
from ispm.stages.camera import CameraView
from references import FOLDER

SIZE = 640, 360  # of the picture whose pixels are looked at
_PIXELS, _PATHS = 8000, 64  # of each half: two are compared
_BOUNCES = 100  # as many as the setting takes: no limit
_FOOTPRINT = 0.005  # of the diagonal, over which photons see textures averaged

SCENES: dict[str, Callable[[], Scene]] = {
    "atrium": partial(builtin, "atrium"),
    "level_zdm2_lit": lambda: load(assets() / "scenes" / "level_zdm2_lit.glb"),
}
"""Name to function."""


@dataclass(frozen=True)
class Sampled:
    """Indirect light through the centres of some pixels of a picture of `SIZE`.

    pixels    (n,) int, y width + x
    indirect  (n, 3) cd/m2
    error     standard error of their mean over that mean, of the paths' noise alone
    """

    pixels: np.ndarray
    indirect: np.ndarray
    error: float

    def bias(self, indirect: np.ndarray) -> float:
        """Return the light that a picture, (h, w, 3), has too much over these pixels, as a share."""
        return float(indirect.reshape(-1, 3)[self.pixels].mean(dtype=np.float64) / self.indirect.mean() - 1.0)


def stored_paths(name: str) -> Sampled:
    """Return what is kept of one of `SCENES`."""
    with np.load(FOLDER / "paths" / f"{name}.npz") as kept:
        indirect = kept["indirect"].astype(np.float64) * float(kept["unit"])
        return Sampled(kept["pixels"].astype(np.int64), indirect, float(kept["error"]))


def main() -> None:
    """Make those named, or all."""
    for name in sys.argv[1:] or SCENES:
        pixels, halves = _measure(SCENES[name]())
        mean = halves.mean(axis=0)
        unit = mean.mean()
        own = (halves[0] - halves[1]).mean(axis=1) / 2.0
        error = own.std() / np.sqrt(len(own)) / unit
        np.savez_compressed(
            FOLDER / "paths" / f"{name}.npz", pixels=pixels.astype(np.int32), unit=unit, error=error,
            indirect=(mean / unit).astype(np.float16),
        )  # fmt: skip
        print(f"{name}: {unit:.4g} cd/m2, +- {error:.2%}", flush=True)


def _measure(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of pixels, and two independent estimates of the indirect light through them, (2, n, 3)."""
    tracer = Tracer(scene)
    camera = scene.default_camera(SIZE)
    view = CameraView(SIZE, camera.pose, camera.yfov, camera.ymag)
    textures = TextureTable.pack(tracer.packed.textures, tracer.packed.colors)
    surfaces = SurfaceTable(tracer.packed, textures, _FOOTPRINT * tracer.packed.diagonal)
    pixels = np.random.default_rng(3).choice(SIZE[0] * SIZE[1], _PIXELS, replace=False)
    rays = view.rays_through(pixels % SIZE[0] + 0.5, pixels // SIZE[0] + 0.5)
    tables = scene_tables(tracer.packed, tracer.world, surfaces)
    trace = partial(path_light, tables, *rays, threads=thread_count(None))
    parts = range(_PATHS), range(_PATHS, 2 * _PATHS)
    halves = [trace(samples=part, bounces=_BOUNCES) for part in parts]
    return pixels, np.array(halves) - trace(samples=range(4), bounces=0)


if __name__ == "__main__":
    main()
