"""Compare pictures with those of before, number by number.

python -m guard --write      # in tests/: keep what is rendered as it is, in .guard/
python -m guard              # compare with it; exit code 1 where a number differs
python -m guard --keep       # write tests/guard/kept.npz, which `make test` compares with by means

The first two are `make guard WRITE=1` and `make guard`.

within   how far numbers may be off, relative to the mean of their array; without: exactly the same bytes
without  arrays left out of the comparison, as of files: photons.height 'view.*'
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

from guard import exact, summary
from guard.arrays import arrays, open_renderer
from guard.scenes import cases

_FILE = Path(__file__).parents[2] / ".guard" / "arrays.npz"


def main() -> int:
    """Render, then write or compare; return the exit code."""
    parser = argparse.ArgumentParser(description="Compare pictures with those of before, number by number.")
    parser.add_argument("--write", action="store_true", help="keep them")
    parser.add_argument("--keep", action="store_true", help=f"write {summary.KEPT.name}")
    parser.add_argument("--file", type=Path, default=_FILE, help="where they are kept; default: %(default)s")
    parser.add_argument("--within", type=float, default=0.0, metavar="X", help="of the mean of an array")
    parser.add_argument("--without", nargs="+", default=[], metavar="ARRAY")
    parser.add_argument("--only", default="", metavar="TEXT", help="cases whose name has it")
    given = parser.parse_args()
    if given.keep:
        return _keep()
    if not given.write and not given.file.is_file():
        print(f"guard: no {given.file}; keep pictures of before by `make guard WRITE=1`", file=sys.stderr)
        return 2
    started = time.perf_counter()
    chosen = [case for case in cases() if given.only in case.name]
    found = exact.render(chosen)
    seconds = time.perf_counter() - started
    count = sum(map(len, found.values()))
    if given.write:
        exact.write(given.file, found)
        print(f"guard: {count} arrays of {len(found)} cases kept in {given.file}, {seconds:.0f} s")
        return 0
    kept = {name: a for name, a in exact.read(given.file).items() if given.only in name}
    off = list(exact.differences(kept, found, given.within, given.without))
    print(*exact.table(off), sep="\n", end="\n" if off else "")
    differing = len({each.case for each in off})
    print(
        f"guard: {len(off)} of {count} arrays differ, in {differing} of {len(found)} cases, {seconds:.0f} s"
    )
    return int(bool(off))


def _keep() -> int:
    with open_renderer() as renderer:
        kept = {case.name: summary.summary(arrays(case, renderer)) for case in cases() if case.steady}
    summary.write(kept)
    print(f"guard: {len(kept)} cases in {summary.KEPT}, {summary.KEPT.stat().st_size / 1e3:.0f} KB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
