"""scripts/benchmark_page.py on reports that are made up, and on a copy of the page."""

import json
import math
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from ispm.bench.growth import Curve, GrowthReport, series
from ispm.bench.suite import STAGES, FrameTimes, Machine, Report, TraceRate, spread
from ispm.bench.talk import TalkReport, TalkTimes
from ispm.bench.talk_rows import ROWS
from ispm.bench.yardsticks import Floor, Yardsticks
from ispm.cli.console import to_json
from ispm.gpu.traffic import Traffic
from ispm.renderer import Stats

ROOT = Path(__file__).parents[2]
SCRIPT = ROOT / "scripts/benchmark_page.py"
MACHINE = Machine("A processor", 2, math.nan, "an adapter", "a system", {"ispm": "1.0"})


def frame_times(full):
    stats = Stats(width=1920, height=1080, subsampling=4, emitted_photons=8449, stored_photons=3333)
    columns = {name: spread([full / 8.0]) for name in STAGES} | {"total_ms": spread([full])}
    nothing = Traffic(), Traffic()
    return FrameTimes("made up", 20, stats, columns, spread([30.0]), spread([1.5]), *nothing, 1.0)


def talk_report():
    rates = Yardsticks("an adapter", 2.5e8, 3e9, 2e9, 2e10)
    rows = [
        TalkTimes(ROWS[0], frame_times(50.0), 20.0, 50.0 / 30.0, 9e6, Floor(4.0, 0.5, 0.5)),
        TalkTimes(ROWS[7], frame_times(5000.0), 4970.0, 166.7, math.nan, Floor(math.nan, 0.5, 0.5)),
    ]
    return TalkReport(rates, MACHINE, rows)


def growth_report():
    amounts = [4**k for k in range(5)]
    curves = []
    for name, p in (("photons", 0.5), ("pixels", 1.3), ("triangles", 0.1), ("lights", 1.0)):
        times = [spread([20.0 * n**p] * 3) for n in amounts]
        made = [series("frame", amounts, times, 3, 1.0), series("trace", amounts, times, 3, 1.0)]
        curves.append(Curve(name, amounts, 3, made, "an adapter"))
    return GrowthReport(MACHINE, curves)


def frame_report():
    return Report(MACHINE, frame_times(50.0), 1000, [TraceRate(2, 1e6, 4e6, 5e6)], 10**9)


@pytest.fixture
def page(tmp_path):
    """A function that writes reports and has the script put them into a copy of the page."""
    shutil.copy(ROOT / "docs/benchmarks.md", tmp_path)

    def write(**reports):
        paths = []
        for name, report in reports.items():
            paths.append(tmp_path / f"{name}.json")
            paths[-1].write_text(report if isinstance(report, str) else to_json(report))
        run = subprocess.run(
            [sys.executable, SCRIPT, "--folder", tmp_path, *paths],
            capture_output=True,
            text=True,
            env={"PYTHONPATH": str(ROOT)},
        )
        return run, (tmp_path / "benchmarks.md").read_text("utf-8")

    return write


def test_all_reports_are_written_between_their_marks(page, tmp_path):
    before = (ROOT / "docs/benchmarks.md").read_text("utf-8")
    run, after = page(talk=talk_report(), growth=growth_report(), frame=frame_report())
    assert run.returncode == 0, run.stderr
    row = next(line for line in after.splitlines() if line.startswith("| 1 | `ironworks-car` |"))
    cells = [cell.strip() for cell in row.strip("|").split("|")]
    assert cells[2:7] == ["1920x1080", "4", "8,449", "3,333", "3,450"]
    # 1000 / 26.5 - 1000 / 121.8 = 29.5, and 121.8 / 26.5 = 4.60
    assert cells[9:] == ["20.0", "5", "29.5", "1.67", "4.60"]
    assert "| 8 | `cargo-map` |" in after and "| 4,970 | - |" in after
    assert "in 1 of 2 rows" in " ".join(after.split())
    assert "| pixels | 1 | 256 | frame | 20.0 | 27,024 | 1.30 ± 0.00 | 1.30 ± 0.00 | 1.00 |" in after
    assert "Faster than their limit: frame with pixels, trace with pixels." in after
    assert (
        "| total | 50.0 | 50.0 | 50.0 | ms |" in after and "| 2 | 1.00 | 4.00 | 5.00 | 0.20 | 0.80 |" in after
    )
    for text in (before, after):
        assert [text.count(f"<!-- {mark}") for mark in ("talk:", "/talk", "growth:", "/frame")] == [1] * 4
    assert all(line in after for line in before.splitlines() if line.startswith("#"))
    tables = [line.count("|") for line in after.splitlines() if line.startswith("|")]
    assert min(tables) >= 3
    for name, count in (("talk", 7 + 2 * 12), ("growth", 0)):
        root = ET.fromstring((tmp_path / f"pictures/benchmark-{name}.svg").read_text("utf-8"))
        bars = [
            each for each in root.iter() if each.tag.endswith("rect") and each.get("fill", "").startswith("#")
        ]
        assert len(bars) == 1 + count


def test_parts_without_a_report_stay(page):
    before = (ROOT / "docs/benchmarks.md").read_text("utf-8")
    run, after = page(growth=growth_report())
    assert run.returncode == 0, run.stderr
    mark = before.index("<!-- growth:")
    assert after[:mark] == before[:mark]
    again, same = page(growth=growth_report())
    assert again.returncode == 0 and same == after


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("{", "x.json: cannot be read as a report"),
        ("[]", "x.json: is no report of ispm bench of format 2"),
        (json.dumps({"format": 1, "kind": "talk"}), "is no report of ispm bench of format 2"),
        (json.dumps({"format": 2, "kind": "other"}), "is no report"),
    ],
)
def test_what_is_no_report_is_told_in_a_line(page, text, told):
    run, after = page(x=text)
    assert run.returncode == 1 and told in run.stderr and run.stderr.count("\n") == 1
    assert after == (ROOT / "docs/benchmarks.md").read_text("utf-8")
