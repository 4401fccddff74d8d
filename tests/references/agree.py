"""Compare references by our own paths with Mitsuba 3's pictures of the same scenes; print and write it.

python -m references.agree              # in tests/; half an hour on two cores
python -m references.agree NAME...      # those alone, and their rows of the page

Both are means of independent parts, whose spread gives their standard errors. Pixels compared are those of
the reference's masks. Needs what `make.py` needs.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator

import mitsuba as mi
import numpy as np

from references import Reference, stored
from references.page import read_between, table, write_between
from references.scenes import TRACED
from references.to_mitsuba import to_mitsuba

_PARTS = 16
_SAMPLES = 256  # per pixel and part
_MORE = {"lamp-behind-glass": 8, "many-lamps": 4, "shade": 2}  # times as many, where there is more noise
_BLOCK = 5  # pixels along a side of what is compared one by one
_HEADINGS = ["reference", "over", "Mitsuba's paths", "more light", "±", "blocks", "worst", "rms"]


def main() -> None:
    """Compare those named, or all."""
    mi.set_variant("llvm_ad_rgb")
    for name in sys.argv[1:] or TRACED:
        started = time.perf_counter()
        rows = list(_compared(name))
        print(*rows, f"{time.perf_counter() - started:.0f} s", sep="\n", flush=True)
        kept = [cells for cells in read_between("agreement") if cells[0] != name]
        write_between("agreement", table(_HEADINGS, sorted(kept + rows), "llrrrrrr"))


def _compared(name: str) -> Iterator[list[str]]:
    reference = stored(name)
    samples = _SAMPLES * _MORE.get(name, 1)
    parts = by_mitsuba(name, reference, samples).mean(axis=-1)
    ours, own = reference.radiance.mean(axis=-1).astype(np.float64), reference.standard_error
    assert own is not None
    for over, mask in reference.masks.items():
        theirs = np.where(mask, parts, 0.0)
        off = np.where(mask, ours, 0.0).sum() / theirs.mean(axis=0).sum() - 1.0
        error = np.hypot(_error(theirs.sum(axis=(1, 2))), np.sqrt((own[mask] ** 2).sum()))
        scores = _scores(theirs, np.where(mask, ours, 0.0), np.where(mask, own, 0.0))
        yield [
            name, over, f"{samples * _PARTS:,}", f"{off:+.2%}", f"{error / theirs.mean(axis=0).sum():.2%}",
            str(len(scores)), f"{np.abs(scores).max():.1f}", f"{np.sqrt((scores**2).mean()):.2f}",
        ]  # fmt: skip


def by_mitsuba(name: str, reference: Reference, samples: int) -> np.ndarray:
    """Return independent pictures of one of TRACED, (parts, h, w, 3) cd/m2, by so many paths a pixel each."""
    assert reference.bounces is not None
    # Mirrors and glass do not count as bounces here, but do there: in the open there is no need of a limit.
    depth = -1 if name == "lamp-behind-glass" else reference.bounces + 2
    integrator = {"type": "path", "max_depth": depth, "rr_depth": 1000 if depth > 0 else 16}
    scene = to_mitsuba(TRACED[name](), reference.size, integrator)
    return np.stack([np.array(mi.render(scene, spp=samples, seed=k), np.float64) for k in range(_PARTS)])


def _scores(theirs: np.ndarray, ours: np.ndarray, own: np.ndarray) -> np.ndarray:
    """Differences of blocks' sums over their standard errors; theirs: (parts, h, w), of others (h, w).

    The spread of so few parts with a few bright paths in them is itself uncertain: no error of theirs is
    taken for less than the median's share of the block's light.
    """
    blocks = _blocks(theirs)
    mean, error = blocks.mean(axis=0), _error(blocks)
    seen = mean > 0.0
    share = np.median(error[seen] / mean[seen])
    error = np.hypot(np.maximum(error, share * mean), np.sqrt(_blocks(own[None] ** 2)[0]))
    return np.asarray((_blocks(ours[None])[0] - mean)[seen] / error[seen])


def _blocks(values: np.ndarray) -> np.ndarray:
    n, height, width = values.shape
    split = values.reshape(n, height // _BLOCK, _BLOCK, width // _BLOCK, _BLOCK)
    return np.asarray(split.sum(axis=(2, 4)).reshape(n, -1))


def _error(parts: np.ndarray) -> np.ndarray:
    """Of the mean over the first axis."""
    return np.asarray(parts.std(axis=0, ddof=1) / np.sqrt(len(parts)))


if __name__ == "__main__":
    main()
