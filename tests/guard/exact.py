"""Every number of every case as it was: kept in a file before a change, compared after it, on one machine.

Pictures of one machine are the same bytes from run to run, with any number of threads, and whatever a
renderer rendered before; so whatever differs was changed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from fnmatch import fnmatch
from pathlib import Path

import numpy as np

from guard.arrays import arrays, open_renderer
from guard.scenes import Case

SCALE = 2
Store = dict[str, dict[str, np.ndarray]]
"""Arrays by case and name."""


@dataclass(frozen=True)
class Difference:
    """How an array of a case is not what it was.

    share  of its values; 1 where it came, went, or has another shape or type
    most   the greatest difference, relative to the mean of |kept|; NaN where there is no such number
    """

    case: str
    array: str
    what: str
    share: float = 1.0
    most: float = np.nan


def render(cases: Sequence[Case], said: Callable[[str], None] = lambda line: None) -> Store:
    """Render all cases by one renderer."""
    found = {}
    with open_renderer() as renderer:
        for case in cases:
            said(case.name)
            found[case.name] = arrays(case, renderer, scale=SCALE)
    return found


def write(path: Path, store: Store) -> None:
    """Write arrays to an NPZ."""
    path.parent.mkdir(parents=True, exist_ok=True)
    np.savez(path, **{f"{case} {name}": a for case, named in store.items() for name, a in named.items()})


def read(path: Path) -> Store:
    """Return what `write` wrote."""
    store: Store = {}
    with np.load(path) as file:
        for key in file.files:
            case, _, name = key.partition(" ")
            store.setdefault(case, {})[name] = file[key]
    return store


def differences(
    kept: Store, found: Store, within: float = 0.0, without: Iterable[str] = ()
) -> Iterator[Difference]:
    """Yield what is not as it was.

    within   how far numbers may be off, relative to the mean of |kept| in their array; bytes of pictures by 1
    without  arrays left out, as of files: "photons.height", "view.*"
    """
    for case in sorted({*kept, *found}):
        old, new = kept.get(case, {}), found.get(case, {})
        for name in sorted({*old, *new}):
            if any(fnmatch(name, pattern) for pattern in without):
                continue
            if name not in new or name not in old:
                yield Difference(case, name, "gone" if name in old else "new")
            elif (each := _difference(case, name, old[name], new[name], within)) is not None:
                yield each


def _difference(case: str, name: str, old: np.ndarray, new: np.ndarray, within: float) -> Difference | None:
    if old.shape != new.shape or old.dtype != new.dtype:
        what = f"{old.dtype}{list(old.shape)} became {new.dtype}{list(new.shape)}"
        return Difference(case, name, what)
    if old.tobytes() == new.tobytes():
        return None
    if old.dtype.kind not in "fiu":
        return Difference(case, name, "differs")
    a, b = old.astype(np.float64), new.astype(np.float64)
    equal = (a == b) | (np.isnan(a) & np.isnan(b))
    with np.errstate(invalid="ignore"):
        off = np.where(equal, 0.0, np.abs(a - b))  # NaN where one is not a number, or both infinite
    scale = float(np.abs(a[np.isfinite(a)]).mean()) if np.isfinite(a).any() else 0.0
    bound = {"f": within * scale, "u": float(within > 0.0)}.get(old.dtype.kind, 0.0)
    if within and (off <= bound).all():
        return None
    return Difference(case, name, "differs", float((~equal).mean()), float(off.max()) / (scale or 1.0))


def table(found: Sequence[Difference]) -> list[str]:
    """Return lines: each array with how many cases differ in it, and the worst of them."""
    lines = []
    for name in dict.fromkeys(each.array for each in found):
        mine = [each for each in found if each.array == name]
        worst = max(mine, key=lambda each: (each.what != "differs", np.nan_to_num(each.most, nan=np.inf)))
        about = worst.what
        if worst.what == "differs":
            about = f"{worst.share:.2%} of its values, by {worst.most:.1e} of their mean at most"
        lines.append(f"{name:24} {len(mine):3} cases; worst {worst.case}: {about}")
    return lines
