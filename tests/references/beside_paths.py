"""Compare pictures of scenes that nobody tuned for with paths from the eye.

python -m references.beside_paths random 0-19        # in tests/; some 25 s a scene on two cores
python -m references.beside_paths furnished 3 8-11 --passes 64 --pictures FOLDER
python -m references.beside_paths known door street
python -m references.beside_paths asset DamagedHelmet.glb
python -m references.beside_paths random --write     # to the table of docs/accuracy.md, other rows stay

`random` and `furnished` scenes come by their number, `known` ones by their name, all if none is given; an
asset stands in the room or on the ground of a random scene. All pixels count: edges, glass and mirrors, too.
For one pass and after several: bias and relMSE, of means over blocks and of pixels, where grain counts; and
of the blocks that differ by more than noise the worst.
"""

from __future__ import annotations

import argparse
import time
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from transport import Tracer

import ispm
from ispm import Scene, Settings
from ispm.gpu import Gpu, open_gpu
from ispm.kernels.threads import thread_count
from ispm.reference.paths import path_light
from ispm.stages.camera import CameraView
from references.furnished_scenes import furnished_scene
from references.known_scenes import KNOWN
from references.page import read_between, table, write_between
from references.random_scenes import asset_scene, random_scene

_SIZE = 640, 360
_BLOCK = 8  # pixels a side
_PARTS = 16  # independent pictures of the truth, a path for each pixel, but
_MORE = {"door": 32, "egg": 32}  # where most light comes by ways that few paths find
_BOUNCES = 32  # also those within rough glass, which pictures do not count
_FINE = 1e-4  # of the diagonal: textures as sharp as pixels see them
_FLOOR = 1e-3  # of the mean's square, as in all relMSE
_OFF = 0.05  # of a block's light and of the picture's mean, that it differs by
_SURE = 4.0  # standard errors
_WRITTEN = "0-19"  # in the page's tables
_FIGURES = ["bias", "relMSE", "by pixel", "bias, 16 passes", "±", "relMSE", "by pixel"]


class Truth(NamedTuple):
    """The truth, (h, w, 3) cd/m2, by independent paths: the means of two halves of them, for each pixel,
    and of all over blocks, with their standard errors."""

    halves: np.ndarray
    blocks: np.ndarray
    errors: np.ndarray


@dataclass(frozen=True)
class Difference:
    """A picture beside the truth, less the noise of the truth.

    bias, uncertain  share of light that there is too much, and one standard error of it
    relmse, by_pixel as `bench.metrics` has it, of means over blocks and of pixels
    off        share of blocks that differ by more than _OFF and four standard errors
    worst, at  how much the block that is the most so does, and its middle, pixels
    """

    bias: float
    uncertain: float
    relmse: float
    by_pixel: float
    off: float
    worst: float
    at: tuple[int, int]

    def __str__(self) -> str:
        return (
            f"bias {self.bias:+.2%} +- {self.uncertain:.2%}, relMSE {self.relmse:.4f}, by pixel "
            f"{self.by_pixel:.4f}, {self.off:.1%} off by {_OFF:.0%}, worst {self.worst:+.0%} at {self.at}"
        )


def main() -> None:
    """Print a line for each scene and number of passes."""
    parser = argparse.ArgumentParser(description="Compare pictures of scenes with paths.")
    parser.add_argument("kind", choices=("random", "furnished", "known", "asset"))
    parser.add_argument(
        "which", nargs="*", metavar="N", help="numbers; 3-7: those from 3 to 7; names or files"
    )
    parser.add_argument("--passes", type=int, default=16, metavar="N")
    parser.add_argument("--pictures", type=Path, metavar="FOLDER", help="where ours and theirs are kept")
    parser.add_argument("--write", action="store_true", help="the page's table of this kind")
    given = parser.parse_args()
    if given.kind == "known" and set(given.which) - set(KNOWN):
        parser.error(
            f"no known scene {', '.join(set(given.which) - set(KNOWN))}; there are {', '.join(KNOWN)}"
        )
    if given.kind == "asset" and given.write:
        parser.error("assets have no table to write")
    warnings.simplefilter("ignore")
    gpu = open_gpu()
    for name in _names(given.kind, given.which):
        scene = _scene(given.kind, name)
        found = _compared(name, scene, given.passes, given.pictures, gpu)
        if given.write:
            _write(given.kind, _row(name, scene.name, *found))


def _names(kind: str, which: list[str]) -> list[str]:
    if kind == "asset":
        return which
    if kind == "known":
        return which or list(KNOWN)
    names = []
    for words in which or [_WRITTEN]:
        first, _, last = words.partition("-")
        names += [str(number) for number in range(int(first), int(last or first) + 1)]
    return names


def _scene(kind: str, name: str) -> Scene:
    if kind == "asset":
        return asset_scene(Path(name))
    if kind == "known":
        return KNOWN[name]()
    return {"random": random_scene, "furnished": furnished_scene}[kind](int(name))


def _write(kind: str, row: list[str]) -> None:
    """Put a row into the table of its kind, in place of the one of its name."""
    rows = {cells[0]: cells for cells in [*read_between(kind), row]}
    order = list(KNOWN) if kind == "known" else sorted(rows, key=int)
    headings = ["", "place and light", "things", *_FIGURES]
    sides = "l" if kind == "known" else "r"
    kept = [rows[name] for name in order if name in rows]
    write_between(kind, table(headings, kept, sides + "ll" + "r" * len(_FIGURES)))


def _row(name: str, told: str, first: Difference, last: Difference) -> list[str]:
    words = told.split(", ")
    things = 2 if words[1].startswith("floor") else 1
    figures = f"{first.bias:+.2%}", f"{first.relmse:.4f}", f"{first.by_pixel:.4f}", f"{last.bias:+.2%}"
    more = f"{last.uncertain:.2%}", f"{last.relmse:.4f}", f"{last.by_pixel:.4f}"
    return [name, ", ".join(words[:things]), ", ".join(words[things:]), *figures, *more]


def _compared(
    name: str, scene: Scene, passes: int, folder: Path | None, gpu: Gpu
) -> tuple[Difference, Difference]:
    """How one pass and the mean of some differ from paths."""
    started = time.perf_counter()
    print(f"{name}: {scene.name}", flush=True)
    truth = paths_picture(scene, _MORE.get(name, _PARTS))
    first, last = rendered(scene, passes, gpu)
    found = difference(first, truth), difference(last, truth)
    for count, each in zip((1, passes), found, strict=True):
        print(f"  {count:3} passes: {each}", flush=True)
    print(f"  {time.perf_counter() - started:.0f} s", flush=True)
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
        pictures = {"first": first, "last": last, **truth._asdict()}
        np.savez_compressed(folder / f"{Path(name).stem}.npz", **pictures)
    return found


def difference(ours: np.ndarray, truth: Truth) -> Difference:
    """Return the Difference of a picture, (h, w, 3) cd/m2."""
    blocks, mean = _block_means(ours), truth.blocks.mean()
    weight = 1.0 / (truth.blocks**2 + _FLOOR * mean**2)
    relmse = (((blocks - truth.blocks) ** 2 - truth.errors**2) * weight).mean()
    # the noise of two halves has nothing in common: no noise of theirs is left in the mean of the product
    one, other = ours - truth.halves
    by_pixel = (one * other * weight.repeat(_BLOCK, axis=0).repeat(_BLOCK, axis=1)).mean()
    shown = truth.blocks.mean(axis=-1) + _OFF * mean
    away, noise = (blocks - truth.blocks).mean(axis=-1) / shown, truth.errors.mean(axis=-1) / shown
    sure = np.abs(away) - _SURE * noise
    y, x = np.unravel_index(np.argmax(sure), sure.shape)
    return Difference(
        float(blocks.mean() / mean - 1.0),
        float(np.sqrt((truth.errors.mean(axis=-1) ** 2).sum()) / noise.size / mean),
        float(relmse),
        float(by_pixel),
        float((sure > _OFF).mean()),
        float(away[y, x]),
        (int(_BLOCK * x + _BLOCK // 2), int(_BLOCK * y + _BLOCK // 2)),
    )


def rendered(scene: Scene, passes: int, gpu: Gpu) -> tuple[np.ndarray, np.ndarray]:
    """Return pictures, (h, w, 3) cd/m2, of one pass and of the mean of so many."""
    settings = Settings(size=_SIZE, bounces=_BOUNCES, light="none")
    with ispm.Renderer(scene, settings, gpu=gpu) as renderer:
        first = renderer.render().radiance.copy()
        *_, last = renderer.converge(passes)
        return first, last.radiance.copy()


def paths_picture(scene: Scene, paths: int = _PARTS) -> Truth:
    """Return the truth by so many paths from the eye for each pixel; an even number."""
    camera = scene.default_camera(_SIZE)
    view = CameraView(_SIZE, camera.pose, camera.yfov, camera.ymag)
    tracer, random = Tracer(scene, footprint=_FINE), np.random.default_rng(7)
    y, x = np.indices((_SIZE[1], _SIZE[0])).reshape(2, -1)
    parts = np.empty((paths, _SIZE[1], _SIZE[0], 3), np.float32)
    for part in range(paths):
        dx, dy = random.random((2, len(x)))
        origins, directions = view.rays_through(x + dx, y + dy)
        light = path_light(
            tracer.tables, origins, directions, samples=range(part, part + 1), bounces=_BOUNCES, seed=part,
            threads=thread_count(None),
        )  # fmt: skip
        parts[part] = light.reshape(parts.shape[1:])
    blocks = np.array([_block_means(part) for part in parts])
    halves = parts.reshape(paths // 2, 2, *parts.shape[1:]).mean(axis=0)
    return Truth(halves, blocks.mean(axis=0), blocks.std(axis=0, ddof=1) / np.sqrt(paths))


def _block_means(picture: np.ndarray) -> np.ndarray:
    height, width = picture.shape[0] // _BLOCK, picture.shape[1] // _BLOCK
    return np.asarray(picture.reshape(height, _BLOCK, width, _BLOCK, 3).mean(axis=(1, 3)), np.float64)


if __name__ == "__main__":
    main()
