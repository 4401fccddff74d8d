"""A benchmark report as tables."""

from __future__ import annotations

from ispm.bench.suite import Report, Spread

Rows = list[tuple[object, ...]]

_UNITS = {"photons_per_s": "photons/s", "ns_per_stored_photon": "ns", "fps_full": "1/s", "fps_direct": "1/s"}


def tables(report: Report) -> list[tuple[str, Rows]]:
    """Return each table's title and rows of cells; all but the first begin with a row of headings."""
    return [
        ("measured", _measured(report)),
        ("times of a frame", _frame(report)),
        ("rays of the photons, per second", _trace(report)),
    ]


def _measured(report: Report) -> Rows:
    machine, frame, stats = report.machine, report.frame, report.frame.stats
    return [
        ("scene", f"{frame.scene}, {stats.polygons:,} triangles, {stats.dynamic_polygons:,} of them moving"),
        ("picture", f"{stats.width}x{stats.height}, indirect light on one pixel in {stats.subsampling**2}"),
        ("photons", f"{stats.emitted_photons:,} emitted, {stats.stored_photons:,} stored"),
        ("frames", f"{frame.frames}, camera, light and an object moving in each"),
        ("timing", stats.timing),
        ("processor", f"{machine.processor}, {machine.cores} cores"),
        ("adapter", machine.adapter),
        ("system", machine.system),
        ("versions", ", ".join(f"{name} {version}" for name, version in machine.versions.items())),
        ("others kept busy", f"{max(machine.others, 0.0):.2f} cores"),
        ("peak memory", f"{report.peak_memory / 1e6:,.0f} MB"),
    ]


def _frame(report: Report) -> Rows:
    rows: Rows = [("stage", "median", "5 %", "95 %", "unit")]
    for name, values in report.frame.columns.items():
        title = name.removesuffix("_ms").replace("_", " ")
        rows.append((title, *_cells(values), _UNITS.get(name, "ms")))
    return [*rows, ("total at 0 bounces", *_cells(report.frame.no_bounces), "ms")]


def _cells(values: Spread) -> tuple[float, float, float]:
    return values.median, values.low, values.high


def _trace(report: Report) -> Rows:
    if not report.rates:
        return [("beside Embree", "skipped: the package embreex is not installed")]
    rows: Rows = [("threads", "walk", "traversal alone", "Embree", "walk / Embree", "traversal / Embree")]
    rows += [
        (rate.threads, rate.walk, rate.own, rate.embree, rate.walk / rate.embree, rate.own / rate.embree)
        for rate in report.rates
    ]
    return rows
