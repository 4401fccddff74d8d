"""Render scenes and keep all their layers, to be compared with another driver's by `agreement`.

python -m drivers.pictures FOLDER                       # in tests/; FOLDER/SCENE.npz and .png
python -m drivers.pictures FOLDER --size 320x180 SCENE...  # names of built-ins, or files
python -m drivers.pictures FOLDER --aside 0.0625  # pixels that a driver may move edges by; or --seed 1
python -m drivers.pictures FOLDER --maps          # as cards do, where programs may take rays

What is kept is the mean of several pictures, each with a seed of its own: the mean irradiance of one alone
has nearly as much noise as two drivers may differ by. VK_DRIVER_FILES chooses the driver.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
import warnings
from pathlib import Path

import numpy as np

import ispm
from ispm.gpu import open_gpu

SCENES = ("cornell-box", "glass-sphere", "caustic-ring", "atrium")
LEVEL = "scenes/level_zdm2_lit.glb"  # of the test assets
_PICTURES = 8  # of each scene
_BESIDE = Path(__file__).resolve().parents[3] / "shared" / "assets"


def main() -> int:
    """Render; return the exit code: 1 where a scene failed."""
    parser = argparse.ArgumentParser(description="Render scenes and keep all their layers.")
    parser.add_argument("folder", type=Path)
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help=f"default: {', '.join(SCENES)}, a level")
    parser.add_argument("--size", default="640x360", metavar="WxH")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--aside", type=float, default=0.0, help="pixels right and up that the view moves")
    parser.add_argument("--maps", action="store_true", help="shadows and photons by maps, not rays")
    given = parser.parse_intermixed_args()
    warnings.simplefilter("ignore")
    given.folder.mkdir(parents=True, exist_ok=True)
    width, height = size = tuple(map(int, given.size.split("x")))
    failed = False
    gpu = open_gpu()
    for name in given.scenes or default_scenes():
        started = time.perf_counter()
        try:
            scene = ispm.load(name) if Path(name).suffix else ispm.builtin(name)
            camera = scene.default_camera(size)
            x, y = camera.principal
            camera.principal = x + 2.0 * given.aside / width, y + 2.0 * given.aside / height
            by = "map" if given.maps else "auto"
            settings = ispm.Settings(size=size, emission=by, shadows=by)
            with ispm.Renderer(scene, settings, camera, gpu=gpu) as renderer:
                frame, layers = _render(renderer, given.seed)
        except ispm.IspmError as error:
            failed = True
            print(f"{name}: {error}", flush=True)
            continue
        frame.save(given.folder / f"{Path(name).stem}.png")
        np.savez_compressed(given.folder / f"{Path(name).stem}.npz", **layers)
        print(f"{Path(name).stem}: {time.perf_counter() - started:.1f} s on {gpu.name}", flush=True)
    return int(failed)


def _render(renderer: ispm.Renderer, seed: int) -> tuple[ispm.Frame, dict[str, np.ndarray]]:
    """Return the first picture, and the mean of all layer by layer; ids are the first picture's."""
    frames = []
    for number in range(_PICTURES):
        renderer.settings = renderer.settings.replace(seed=seed * _PICTURES + number)
        frames.append(renderer.render())
    return frames[0], {
        name: layer if layer.dtype.kind in "iu" else np.mean([each.layers[name] for each in frames], axis=0)
        for name, layer in frames[0].layers.items()
    }


def default_scenes() -> list[str]:
    """Return the built-ins that tell drivers apart, and a level of the test assets where these are."""
    level = Path(os.environ.get("ISPM_ASSETS") or _BESIDE) / LEVEL
    if not level.is_file():
        print(f"left out: no {level}; ISPM_ASSETS says where it is", file=sys.stderr)
        return [*SCENES]
    return [*SCENES, str(level)]


if __name__ == "__main__":
    sys.exit(main())
