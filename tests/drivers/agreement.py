"""Compare the pictures of two drivers, layer by layer.

python -m drivers.agreement FOLDER REFERENCE   # in tests/; what `drivers.pictures` wrote
python -m drivers.agreement FOLDER REFERENCE --aside FOLDER --seed FOLDER

A layer agrees where its mean is within .5 % and at most .2 % of its blocks of 8 x 8 pixels are off by more
than 5 %, or no more of them than drivers may differ in, which the reference's driver shows by itself:

aside  its pictures, moved by 1/16 of a pixel: as far as Vulkan lets rasterisers move any edge
seed   its pictures of another seed. A pixel or a photon that falls on the other side of an edge sends other
       paths, a sample of its own; where a tenth of the blocks do, a tenth as many are off as between seeds.

The exit code is 1 where a layer does not agree.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from references.page import table

_BLOCK = 8  # pixels
_MEAN, _OFF, _SHARE = 0.005, 0.05, 0.002
_FLOOR = 1e-3  # of the squared mean, as in relMSE: what dark blocks are relative to
_INDEPENDENT = 0.1  # of the blocks, that may have samples of their own
_IDS = ("instance", "material")


@dataclass(frozen=True)
class Agreement:
    """How near a layer is to another driver's.

    mean   relative difference of the means
    off    share of blocks whose mean is off by more than 5 %
    worst  relative difference of the worst block
    bound  share of blocks that may be
    """

    mean: float
    off: float
    worst: float
    bound: float = _SHARE

    @property
    def holds(self) -> bool:
        """Whether it is near enough."""
        return abs(self.mean) <= _MEAN and self.off <= self.bound

    def cells(self) -> list[str]:
        """Return it as text."""
        shares = [f"{self.off:.2%}", f"{self.bound:.2%}", f"{self.worst:.1%}"]
        return [f"{self.mean:+.3%}", *shares, "" if self.holds else "**no**"]


def agreement(name: str, a: np.ndarray, b: np.ndarray) -> Agreement:
    """Compare layer `name` of a picture with the same of a reference, (h, w) or (h, w, c).

    Depths are compared by their inverses, normals as pictures show them, ids by whether they are the same.
    """
    a, b = (_comparable(name, layer) for layer in ((a == b, np.ones_like(b)) if name in _IDS else (a, b)))
    blocks_a, blocks_b = _blocks(a), _blocks(b)
    mean = b.mean()
    if not mean:
        return Agreement(*(float(x) for x in (np.inf if a.any() else 0.0, (blocks_a != 0).mean(), a.max())))
    off = np.abs(blocks_a - blocks_b) / np.sqrt(blocks_b**2 + _FLOOR * mean**2)
    return Agreement(float(a.mean() / mean - 1.0), float((off > _OFF).mean()), float(off.max()))


def main() -> int:
    """Compare and print; return the exit code."""
    parser = argparse.ArgumentParser(description="Compare the pictures of two drivers.")
    parser.add_argument("folder", type=Path)
    parser.add_argument("reference", type=Path)
    parser.add_argument("--aside", type=Path)
    parser.add_argument("--seed", type=Path)
    given = parser.parse_args()
    rows, agree = [], True
    names = sorted({path.name for folder in (given.folder, given.reference) for path in folder.glob("*.npz")})
    for name in names:
        scene = Path(name).stem
        found = compare(name, given.folder, given.reference, given.aside, given.seed)
        rows += [[scene, layer, *each.cells()] for layer, each in found.items()]
        if not found:
            rows.append([scene, "of one alone", "", "", "", "", "**no**"])
        agree &= bool(found) and all(each.holds for each in found.values())
    headings = ["scene", "layer", "mean", "blocks off by 5 %", "may be", "worst block", "agrees"]
    print(table(headings, rows, "llrrrrl"))
    return int(not agree or not names)


def compare(
    name: str, folder: Path, reference: Path, aside: Path | None = None, seed: Path | None = None
) -> dict[str, Agreement]:
    """Compare a scene's layers, each with the share of blocks that may be off; empty where one lacks it."""
    if not all((each / name).is_file() for each in (folder, reference)):
        return {}
    a, b = np.load(folder / name), np.load(reference / name)
    found = {layer: agreement(layer, a[layer], b[layer]) for layer in b.files}
    for other, share in ((aside, 1.0), (seed, _INDEPENDENT)):
        if other is not None:
            c = np.load(other / name)
            for layer, each in found.items():
                bound = max(each.bound, share * agreement(layer, c[layer], b[layer]).off)
                found[layer] = replace(each, bound=bound)
    return found


def _comparable(name: str, layer: np.ndarray) -> np.ndarray:
    layer = layer.astype(np.float64).reshape(*layer.shape[:2], -1)
    if name == "depth":
        return 1.0 / layer
    return 0.5 + 0.5 * layer if name == "normal" else layer


def _blocks(layer: np.ndarray) -> np.ndarray:
    """The mean of each block and channel together; blocks at the right and the bottom may be smaller."""
    bounds = [np.arange(0, side, _BLOCK) for side in layer.shape[:2]]
    sums = np.add.reduceat(np.add.reduceat(layer.mean(axis=2), bounds[0], axis=0), bounds[1], axis=1)
    sizes = [np.diff([*b, side]) for b, side in zip(bounds, layer.shape[:2], strict=True)]
    return np.asarray(sums / np.outer(*sizes))


if __name__ == "__main__":
    sys.exit(main())
