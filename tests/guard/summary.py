"""What pictures are on any machine that draws by llvmpipe: means that rounding does not move.

kept.npz holds means of blocks of 8 x 8 pixels, ids of pixels, means of photons, and statistics.

Machines round products, sums and roots otherwise. That moves colors by 1e-3 at most (halves have 11 bits),
and now and then it decides: a photon at an edge goes another way, a pixel there shows another triangle. What
is compared must stand a few such decisions:

often    what nine tenths of a layer's blocks keep below: a decision moves few blocks, a change most
mean     of a layer: decisions make it brighter as often as darker
ids      the share of pixels whose id differs
numbers  means over some thousand photons, and statistics

Measured (docs/notes.md): Mesa 22.3 and 25.0, vectors of 128 to 512 bits, numpy and BLAS for the smallest
processors: often 1.2e-4, mean 7e-5, numbers 6e-6. Kernels without fused multiply and add, on processors that
have none: 1e-2, so that these get twenty times the bounds (`metals`, 4e-2, are further away there). Drivers
that snap corners to 1/16 pixel are further away, and not compared; nor are scenes that are not `steady`.
"""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np

from ispm.kernels import library

KEPT = Path(__file__).parent / "kept.npz"
Summary = dict[str, np.ndarray]
BLOCK = 8  # pixels
OFTEN, MEAN, IDS, NUMBERS = 1e-3, 3e-3, 0.005, 3e-3
_BLOCKS = 0.9  # that keep below OFTEN
_FLOOR = 0.1  # of a layer's mean: what dark blocks are relative to
_IDS = ("instance", "material")
_MATRICES = ("pose", "clip_from_world", "intrinsics")
_SUMS = ("full", "view.overdraw")  # others add up to these, or show them in steps


def summary(arrays: dict[str, np.ndarray]) -> Summary:
    """Return of the arrays of a case what is kept: int16 ids, words, and numbers."""
    kept: Summary = {}
    for name, array in arrays.items():
        if name in _SUMS:
            continue
        if name in _IDS:
            kept[name] = array.astype(np.int16)
        elif array.ndim >= 2 and name not in _MATRICES and not name.startswith("photons."):
            kept[name] = _blocks(_comparable(name, array))
        elif name.startswith("photons."):
            values = array.astype(np.float64)
            kept[name] = np.append(values.mean(axis=0), np.abs(values).mean()) if len(values) else np.zeros(1)
        elif array.dtype.kind == "U":
            kept[name] = array
        elif np.isfinite(array).all():
            kept[name] = array.astype(np.float64)
    return kept


def slack() -> float:
    """Return what bounds are multiplied by: above 1 where kernels are compiled for this very processor."""
    return 1.0 if library.cpu()[0] == library.BASELINE else 20.0


def differences(kept: Summary, found: Summary, slack: float = 1.0) -> list[str]:
    """Return a line for each of a case's summaries that is off by more than rounding explains."""
    lines = []
    for name in sorted({*kept, *found}):
        if name not in kept or name not in found:
            lines.append(f"{name}: {'gone' if name in kept else 'new'}")
            continue
        old, new = kept[name], found[name]
        if old.shape != new.shape:
            lines.append(f"{name}: {old.shape} became {new.shape}")
        elif old.dtype.kind == "U":
            lines += [f"{name}: {old} became {new}"] * bool(old != new)
        elif name in _IDS:
            share = float((old != new).mean())
            lines += [f"{name}: {share:.2%} of the pixels differ"] * (share > slack * IDS)
        elif name.startswith("photons.") or old.ndim < 2 or name in _MATRICES:
            scale = np.abs(old).max()  # of photons the mean of |values| is among them
            off = float(np.abs(new - old).max() / scale) if scale else float(np.abs(new).max())
            lines += [f"{name}: off by {off:.1e}"] * (off > slack * NUMBERS)
        else:
            lines += _blocks_off(name, old.astype(np.float64), new.astype(np.float64), slack)
    return lines


def write(summaries: dict[str, Summary]) -> None:
    """Write the summaries of cases to KEPT: all numbers in one array, all ids in another, a table in JSON."""
    about: dict[str, dict[str, object]] = {}
    numbers, ids = [np.zeros(0, np.float32)], [np.zeros(0, np.int16)]
    for case, arrays in summaries.items():
        about[case] = {n: str(a) if a.dtype.kind == "U" else a.shape for n, a in arrays.items()}
        ids += [a.ravel() for n, a in arrays.items() if n in _IDS]
        numbers += [a.ravel() for n, a in arrays.items() if n not in _IDS and a.dtype.kind != "U"]
    bits = np.concatenate(numbers).astype(np.float32).view(np.uint32)
    rounded = (bits + 0x200 & 0xFFFFFC00).view(np.float32)  # 14 bits, 6e-5, which files pack well
    np.savez_compressed(KEPT, about=json.dumps(about), numbers=rounded, ids=np.concatenate(ids))


def read() -> dict[str, Summary]:
    """Return what `write` wrote."""
    with np.load(KEPT) as file:
        about, rest = json.loads(str(file["about"])), {True: file["ids"], False: file["numbers"]}
    found: dict[str, Summary] = {}
    for case, shapes in about.items():
        found[case] = {}
        for name, shape in shapes.items():
            if isinstance(shape, str):
                found[case][name] = np.array(shape)
                continue
            count, kind = math.prod(shape), name in _IDS
            found[case][name], rest[kind] = rest[kind][:count].reshape(shape), rest[kind][count:]
    return found


def _blocks_off(name: str, old: np.ndarray, new: np.ndarray, slack: float) -> list[str]:
    mean = np.abs(old).mean()
    if not mean:
        return [f"{name}: was 0"] * bool(new.any())
    scale = np.sqrt((old**2).mean(axis=2) + (_FLOOR * mean) ** 2)
    often = float(np.quantile(np.abs(new - old).max(axis=2) / scale, _BLOCKS))
    shift = float(np.abs((new - old).mean(axis=(0, 1))).max() / mean)
    lines = [f"{name}: its mean is off by {shift:.1e}"] * (shift > slack * MEAN)
    return lines + [f"{name}: a tenth of its blocks is off by {often:.1e}"] * (often > slack * OFTEN)


def _comparable(name: str, layer: np.ndarray) -> np.ndarray:
    layer = layer.astype(np.float64).reshape(*layer.shape[:2], -1)
    if name == "depth":
        return 1.0 / layer
    return 0.5 + 0.5 * layer if name == "normal" else layer


def _blocks(layer: np.ndarray) -> np.ndarray:
    """(h / 8, w / 8, c): the mean of each block; what is left over at the right and the bottom is cut off."""
    h, w, c = layer.shape
    h, w = h // BLOCK, w // BLOCK
    cut = layer[: h * BLOCK, : w * BLOCK].reshape(h, BLOCK, w, BLOCK, c)
    return np.asarray(cut.mean(axis=(1, 3)))
