"""The talk's table: what its rows ask for, and what is told of them."""

import pytest

from ispm.bench.talk import ROWS, measure_talk, summary, talk_table


def test_rows_are_as_many_as_the_talk_has():
    assert len(ROWS) == 20
    assert sum(row.added_ms for row in ROWS) == pytest.approx(1430.6, abs=0.1)


def test_measured_rows_have_their_photons_and_ratios():
    row = next(row for row in ROWS if row.scene == "caustic-ring")
    (measured,) = measure_talk(quick=True, frames=2, rows=[row])
    stats = measured.times.stats
    assert (stats.width, stats.height, stats.subsampling) == (256, 192, 1)
    assert stats.emitted_photons == pytest.approx(row.photons, rel=0.02)
    full, direct = measured.times.columns["total_ms"].median, measured.times.no_bounces.median
    assert (measured.added_ms, measured.ratio) == (full - direct, full / direct)
    assert len({len(cells) for cells in talk_table([measured])}) == 1
    assert "of 1 rows" in summary([measured])
