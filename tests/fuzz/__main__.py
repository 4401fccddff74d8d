"""Damages files, makes harmful ones, loads them all, and reports how they ended."""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import numpy as np

from fuzz.attacks import Attack, attacks
from fuzz.mutate import damaged
from fuzz.seeds import Files, among, small

SECONDS, BYTES = 20.0, 1 << 30
HERE = Path(__file__).parents[1]


@dataclass
class Report:
    """How all files ended: by kind; what broke a bound; and time and memory of each."""

    ends: Counter[str] = field(default_factory=Counter)
    faults: list[str] = field(default_factory=list)
    costs: list[tuple[float, int, str]] = field(default_factory=list)

    def add(self, name: str, end: dict[str, Any]) -> bool:
        """Count an outcome; whether it is as it should be."""
        self.ends[end["end"]] += 1
        self.costs.append((end["seconds"], end["bytes"], name))
        good = end["end"] in ("ok", "warn", "error") and end["seconds"] < SECONDS and end["bytes"] < BYTES
        if not good:
            said = f"{end['end']} {str(end['said'])[:200]}"
            self.faults.append(f"{name}: {said}, {end['seconds']:.1f} s, {end['bytes'] >> 20} MiB")
            print("fault:", self.faults[-1], file=sys.stderr, flush=True)
        return good

    def lines(self) -> Iterator[str]:
        """Yield the report's lines."""
        yield f"{self.ends.total()} files: " + ", ".join(f"{n} {end}" for end, n in self.ends.most_common())
        for seconds, _, name in sorted(self.costs, reverse=True)[:5]:
            yield f"  {seconds:6.2f} s    {name}"
        for _, most, name in sorted(self.costs, key=lambda cost: -cost[1])[:5]:
            yield f"  {most >> 20:6} MiB  {name}"
        yield f"{len(self.faults)} faults"
        yield from self.faults


class Workers:
    """Processes that load files."""

    def __init__(self, count: int) -> None:
        self._idle: SimpleQueue[subprocess.Popen[str]] = SimpleQueue()
        command = [sys.executable, "-m", "fuzz.worker"]
        pipes: dict[str, Any] = dict(stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        self._all = [subprocess.Popen(command, cwd=HERE, text=True, **pipes) for _ in range(count)]
        for worker in self._all:
            self._idle.put(worker)

    def load(self, path: Path | str, options: dict[str, Any]) -> dict[str, Any]:
        """How loading a file ends."""
        worker = self._idle.get()
        try:
            worker.stdin.write(
                json.dumps([os.fspath(path).encode("utf-8", "surrogatepass").hex(), options]) + "\n"
            )
            worker.stdin.flush()
            return dict(json.loads(worker.stdout.readline()))
        finally:
            self._idle.put(worker)

    def close(self) -> None:
        for worker in self._all:
            worker.stdin.close()
            worker.wait()


def mutated(count: int, seed: int, seeds: Sequence[tuple[str, Files]]) -> Iterator[Attack]:
    """Yield so many damaged files, each from a random state of its own: any can be made again alone."""
    for k in range(count):
        main, files = seeds[k % len(seeds)]

        def write(folder: Path, main: str = main, files: Files = files, k: int = k) -> Path:
            for name, data in damaged(files, np.random.default_rng([seed, k])).items():
                (folder / name).write_bytes(data)
            return folder / main

        yield f"damaged {k}, of {main}", write


def run(cases: Iterable[Attack], workers: int, keep: Path | None = None) -> Report:
    """Write, load and remove each case's files; those that break a bound are kept in `keep`."""
    report, pool = Report(), Workers(workers)

    def one(case: Attack, root: Path) -> None:
        name, write = case
        folder = Path(tempfile.mkdtemp(dir=root))
        made = write(folder)
        path, options = made if isinstance(made, tuple) else (made, {})
        if not report.add(name, pool.load(path, options)) and keep is not None:
            kept = keep / "".join(c if c.isalnum() else "-" for c in name[:60])
            kept.mkdir(parents=True, exist_ok=True)
            for file in (f for f in folder.iterdir() if f.is_file()):
                shutil.copy(file, kept)
        shutil.rmtree(folder)

    try:
        with tempfile.TemporaryDirectory() as root, ThreadPoolExecutor(workers) as threads:
            for _ in threads.map(lambda case: one(case, Path(root)), cases):
                pass
    finally:
        pool.close()
    return report


def seeds(assets: Path | None) -> list[tuple[str, Files]]:
    """All files that are damaged: those made here, then those of the assets."""
    with tempfile.TemporaryDirectory() as folder:
        return small(Path(folder)) + (among(assets) if assets else [])


def main(arguments: Sequence[str] | None = None) -> int:
    """Run what is asked for; 1 where a bound is broken."""
    parser = argparse.ArgumentParser("fuzz", description=__doc__)
    parser.add_argument("--count", type=int, default=3000, help="damaged files")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", metavar="TEXT", help="those alone whose name has this")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--keep", type=Path, metavar="FOLDER", help="for files that break a bound")
    given = parser.parse_args(arguments)
    beside = HERE.parents[1] / "shared" / "assets"
    folder = Path(os.environ.get("ISPM_ASSETS") or beside)
    start, failed = time.perf_counter(), False
    every = seeds(folder if folder.is_dir() else None)
    for about, cases in (
        (f"targeted, bounds {SECONDS:g} s of a processor and {BYTES >> 20} MiB", attacks()),
        (
            f"damaged, seed {given.seed}",
            mutated(given.count, given.seed, every),
        ),
    ):
        report = run([c for c in cases if given.only in c[0]], given.workers, given.keep)
        print(f"{about}: ", *report.lines(), sep="\n", flush=True)
        failed = failed or bool(report.faults)
    print(f"{time.perf_counter() - start:.0f} s")
    return int(failed)


if __name__ == "__main__":
    raise SystemExit(main())
