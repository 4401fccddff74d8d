"""The talk's table: what its rows ask for, and what is told of them."""

import dataclasses
import json
import math

import pytest

from ispm.bench import talk as bench_talk
from ispm.bench import yardsticks
from ispm.bench.suite import STAGES, FrameTimes, spread
from ispm.bench.talk import TalkTimes, measure_talk, row_line, summary, talk_table
from ispm.bench.talk_rows import ROWS, rows_of
from ispm.bench.yardsticks import Floor, Yardsticks, floor_of, measure_yardsticks, rays_of_frame
from ispm.cli.main import main
from ispm.errors import SettingsError
from ispm.gpu.traffic import Traffic
from ispm.optics.records import RECEIVER
from ispm.renderer import Stats
from ispm.settings import Settings

RATES = Yardsticks("made up", 1e8, 2e9, 1e9, 7.2e9)


def frame_times(full=50.0, direct=30.0, **counts):
    """Times of a frame without scatter."""
    stats = Stats(width=64, height=48, subsampling=4, total_ms=full, **counts)
    columns = {name: spread([full] * 4) for name in STAGES}
    traffic = Traffic(3_000_000, 5_000_000), Traffic(1_000_000, 4_500_000)
    return FrameTimes("ring", 4, stats, columns, spread([direct] * 4), spread([1.0] * 4), *traffic, 0.5)


def made(number, full=50.0):
    """A row of the table, made up."""
    return TalkTimes(ROWS[number - 1], frame_times(full), full - 30.0, full / 30.0, math.nan, Floor(1, 2, 3))


def test_rows_are_as_many_as_the_talk_has():
    assert [row.number for row in ROWS] == list(range(1, 21))
    assert sum(row.added_ms for row in ROWS) == pytest.approx(1430.6, abs=0.1)
    assert sum(row.stored for row in ROWS) == 396_963
    assert [round(sum(row.stages[k] for row in ROWS), 1) for k in range(5)] == [
        316.2,
        4.2,
        373.7,
        809.0,
        289.9,
    ]


@pytest.mark.parametrize(
    ("text", "numbers"),
    [("7", [7]), ("1,3-5", [1, 3, 4, 5]), ("20, 2 - 3,2", [2, 3, 20]), ("1-20", list(range(1, 21)))],
)
def test_rows_are_named_by_numbers_and_ranges(text, numbers):
    assert [row.number for row in rows_of(text)] == numbers


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "'' is no row"),
        ("1,,2", "'' is no row"),
        ("x", "'x' is no row; give numbers and ranges, as 1,3-5"),
        ("1-", "'1-' is no row"),
        ("-3", "'-3' is no row"),
        ("1.5", "is no row"),
        ("0", "'0' is not within the rows 1 to 20"),
        ("21", "not within"),
        ("5-3", "'5-3' is not within"),
    ],
)
def test_what_is_no_row_is_told(text, told):
    with pytest.raises(SettingsError, match=f"--rows: .*{told}"):
        rows_of(text)


def test_measured_rows_have_their_photons_and_ratios():
    row = dataclasses.replace(ROWS[17], size=(128, 96), photons=4_000)
    (measured,) = measure_talk(RATES, quick=True, frames=2, rows=[row])
    times, stats = measured.times, measured.times.stats
    assert (stats.width, stats.height, stats.subsampling) == (64, 48, 1)
    assert stats.emitted_photons == pytest.approx(row.photons, rel=0.02)
    full, direct = times.columns["total_ms"].median, times.no_bounces.median
    assert (measured.added_ms, measured.ratio) == (full - direct, full / direct)
    assert times.seen == 1.0 and times.prepare.median > 0.0
    # of each receiver a record comes from the device, and light goes there, 16 float32, be it none
    for moved in (times.traffic, times.traffic_bare):
        assert moved.sent >= 64 * 48 * 16 * 4
        assert moved.read >= 64 * 48 * RECEIVER.itemsize
    assert measured.floor.total > 0.0 or math.isnan(measured.embree)


def test_floor_is_that_of_its_formula():
    settings = Settings(size=(64, 48), subsampling=4, photons=1000, gather=4)
    times = frame_times(photon_hits=2500, emitted_photons=1000, emission="rays")
    # half of the 16 x 12 receivers see something
    assert rays_of_frame(times, settings) == 2500 + 0.5 * 16 * 12 * 4
    floor = floor_of(times, settings, 1e6, RATES)
    assert floor.rays == pytest.approx(1e3 * 2884 / 1e6)
    assert floor.transfers == pytest.approx(1e3 * (2e6 / 2e9 + 0.5e6 / 1e9))
    assert floor.upsample == pytest.approx(1e3 * 64 * 48 * 72 / 7.2e9)
    assert floor.total == pytest.approx(floor.rays + floor.transfers + floor.upsample)
    assert math.isnan(floor_of(times, settings, math.nan, RATES).total)
    drawn = frame_times(photon_hits=2500, emitted_photons=1000, emission="map")
    assert rays_of_frame(drawn, settings) == rays_of_frame(times, settings) - 1000


def test_yardsticks_are_rates_of_the_adapter(monkeypatch):
    monkeypatch.setattr(yardsticks, "_TRANSFER", 1 << 16)
    monkeypatch.setattr(yardsticks, "_FILL_SIZE", (32, 16))
    rates = measure_yardsticks()
    assert rates.adapter
    assert min(rates.fill, rates.upload, rates.readback, rates.memory) > 0.0


def test_table_and_lines_tell_ours_beside_the_talks():
    measured = [made(1, 40.0), made(18, 90.0)]
    assert len({len(cells) for cells in talk_table(measured)}) == 1
    assert summary(measured).startswith("in 1 of 2 rows indirect light adds no more")
    line = row_line(measured[1])
    assert "adds 60 ms (the talk: 31, 6 at least)" in line and "3.00 times; the talk: 7.14" in line


@pytest.fixture
def given(monkeypatch):
    """A function that has the command measure these rows, where one that is an error is raised."""
    monkeypatch.setattr(yardsticks, "measure_yardsticks", lambda: RATES)

    def give(*outcomes):
        def measure(rates, quick, frames, rows, tell):
            for row, outcome in zip(rows, outcomes, strict=False):
                if isinstance(outcome, BaseException):
                    raise outcome
                yield dataclasses.replace(outcome, talk=row)

        monkeypatch.setattr(bench_talk, "measure_talk", measure)

    return give


def test_rows_that_are_measured_are_kept_where_the_rest_is_not(given, tmp_path, capsys):
    given(made(1), made(2), KeyboardInterrupt())
    path = tmp_path / "talk.json"
    assert main(["bench", "--talk", "--rows", "4,7-9", "-o", str(path)]) == 130
    report = json.loads(path.read_text())
    assert [row["talk"]["number"] for row in report["rows"]] == [4, 7]
    assert report["kind"] == "talk" and report["yardsticks"]["fill"] == 1e8
    assert set(report["rows"][0]["times"]["columns"]) == set(STAGES)
    assert "adds 20 ms" in capsys.readouterr().err


def test_tables_are_compared_row_by_row(given, tmp_path, capsys):
    old, new = (str(tmp_path / name) for name in ("old.json", "new.json"))
    given(made(1), made(2), made(3))
    assert main(["bench", "--talk", "--rows", "1-3", "-o", old]) == 0
    given(made(2), made(3, 60.0), made(4))
    capsys.readouterr()
    assert main(["bench", "--talk", "--rows", "2-4", "-o", new, "--compare", old]) == 1
    told = capsys.readouterr().err
    assert "not compared, as they are in one report alone: row 1, row 4" in told
    slower = told.splitlines()[-1]
    assert "row 3: total" in slower and "row 2" not in slower and "row 3: total at 0 bounces" not in slower
    assert main(["bench", new, "--compare", old]) == 1
    assert main(["bench", old, "--compare", new]) == 0
    assert main(["bench", old, "--compare", old, "--json"]) == 0


def test_what_does_not_go_together_is_told_before_it_measures(given, tmp_path, capsys):
    given(RuntimeError("measured"))
    growth, talk = (str(tmp_path / name) for name in ("growth.json", "talk.json"))
    (tmp_path / "growth.json").write_text('{"format": 2, "kind": "growth"}')
    (tmp_path / "talk.json").write_text(
        '{"format": 2, "kind": "talk", "rows": [], "machine": {"processor": "", "cores": 2, "adapter": ""}}'
    )
    for line, told in (
        (["--rows", "1"], "give --talk as well"),
        (["--talk", "--rows", "0"], "not within"),
        (["--talk", "--growth"], "--growth: is measured alone"),
        (["--growth", "--compare", talk], "--growth: is measured alone"),
        (["--compare", growth], "is of ispm bench --growth, which is not compared"),
        (["--compare", talk], "was measured with --talk"),
        ([talk, "--compare", talk], "no row of the talk's table is in both"),
    ):
        assert main(["bench", *line]) == 2, line
        assert told in capsys.readouterr().err
