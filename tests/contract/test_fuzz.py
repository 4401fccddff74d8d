"""Damaged and harmful files: a few of those that `make fuzz` loads, under the same bounds."""

from itertools import islice
from pathlib import Path

import pytest
from fuzz.__main__ import Report, mutated, run, seeds
from fuzz.attacks import attacks


@pytest.fixture(scope="module")
def few() -> Report:
    """How 130 damaged files, seed 1, and 70 harmful ones end."""
    harmful = [
        case
        for case in attacks()
        if case[0].startswith(("OBJ with", "MTL with", "PLY", "STL at", "HDR", "gltf asks"))
    ]
    return run([*islice(mutated(130, 1, seeds(None)), 130), *harmful[::3][:70]], workers=2)


def test_damaged_and_harmful_files_end_as_a_scene_or_in_a_line(few: Report) -> None:
    assert few.ends.total() == 200
    assert few.faults == []
    assert min(few.ends["ok"], few.ends["warn"], few.ends["error"]) > 10  # some of each


def test_a_file_that_ends_otherwise_is_reported(tmp_path: Path) -> None:
    report = Report()
    good = {"end": "ok", "said": [], "seconds": 1.0, "bytes": 1 << 20}
    assert report.add("a", good)
    for bad in ({"end": "ValueError"}, {"end": "signal 9"}, {"seconds": 21.0}, {"bytes": 2 << 30}):
        assert not report.add("b", good | bad)
    assert len(report.faults) == 4 and any("4 faults" in line for line in report.lines())
