"""Write the measured parts of docs/benchmarks.md, and their charts, from what `ispm bench -o` wrote.

python scripts/benchmark_page.py out/frame.json out/talk.json out/growth.json   # any of the three
python scripts/benchmark_page.py --folder FOLDER talk.json                      # of another copy of the page

Parts of the page whose report is not given stay as they are.
"""

from __future__ import annotations

import argparse
import json
import re
import statistics
import sys
import textwrap
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from benchmark_charts import STAGES, Report, growth_chart, talk_chart

DOCS = Path(__file__).parents[1] / "docs"
FORMAT = 2
UNITS = {
    "photons_per_s": "photons/s",
    "ns_per_stored_photon": "ns",
    "fps_full": "1/s",
    "fps_direct": "1/s",
}


def main() -> int:
    """Rewrite the page; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("reports", nargs="+", type=Path)
    parser.add_argument("--folder", type=Path, default=DOCS, help="that holds benchmarks.md")
    asked = parser.parse_args()
    page = asked.folder / "benchmarks.md"
    text = page.read_text("utf-8")
    for path in asked.reports:
        report = read(path)
        kind = report["kind"]
        body, chart = PARTS[kind](report)
        pattern = rf"(<!-- {kind}: .*? -->\n).*?(<!-- /{kind} -->)"
        text, count = re.subn(pattern, lambda m, body=body: m[1] + body + "\n" + m[2], text, flags=re.DOTALL)
        if count != 1:
            sys.exit(f"{page}: has no part for a report of the kind '{kind}'")
        if chart:
            pictures = asked.folder / "pictures"
            pictures.mkdir(exist_ok=True)
            (pictures / f"benchmark-{kind}.svg").write_text(chart, "utf-8")
    page.write_text(text, "utf-8")
    return 0


def read(path: Path) -> Report:
    """Return a report; ends the program with a line where it is none."""
    try:
        report = json.loads(path.read_text("utf-8"))
    except (OSError, ValueError) as error:
        sys.exit(f"{path}: cannot be read as a report: {error}")
    if not isinstance(report, dict) or report.get("format") != FORMAT or report.get("kind") not in PARTS:
        sys.exit(f"{path}: is no report of ispm bench of format {FORMAT}; measure again with -o")
    return report


def machine(report: Report, frames: set[int]) -> str:
    """Return a paragraph on what was measured on, and how alone."""
    about = report["machine"]
    versions = ", ".join(f"{name} {version}" for name, version in about["versions"].items())
    others = about["others"]
    busy = "unknown" if others is None else f"{max(others, 0.0):.2f} cores"
    return prose(
        f"{about['processor']}, {about['cores']} cores; adapter {about['adapter']}; {about['system']}; "
        f"{versions}. Medians of {' or '.join(map(str, sorted(frames)))} frames. Kept busy by other "
        f"processes: {busy}."
    )


def talk_part(report: Report) -> tuple[str, str]:
    """The talk's table."""
    rows, rates = report["rows"], report["yardsticks"]
    yardsticks = [
        ("additive fill, rgba16float", f"{rates['fill'] / 1e6:,.0f} million pixels/s"),
        ("upload", f"{rates['upload'] / 1e9:.1f} GB/s"),
        ("readback", f"{rates['readback'] / 1e9:.1f} GB/s"),
        ("memory, read and written by a copy", f"{rates['memory'] / 1e9:.1f} GB/s"),
        ("Embree, rays of the rows' photons, all threads", embree(rows)),
    ]
    headings = (
        "row, scene, pixels, K, photons emitted, stored, the talk's, direct ms, all light ms, added ms, "
        "floor ms, the talk's added, all / direct, the talk's"
    )
    stages = "row, " + ", ".join(STAGES) + ", the talk's direct, " + ", ".join(STAGES[1:5])
    added = [each["added_ms"] <= talk_added(each["talk"]) for each in rows]
    ratios = [each["ratio"] for each in rows]
    return "\n\n".join(
        [
            machine(report, {each["times"]["frames"] for each in rows}),
            table("yardstick, rate", yardsticks, "-:"),
            table(headings, map(talk_row, rows), ":--" + 11 * ":"),
            prose(
                f"Indirect light adds no more ms than in the talk in {sum(added)} of {len(rows)} rows; a "
                f"whole frame takes at most twice one of direct light in {sum(r <= 2.0 for r in ratios)}, "
                f"and {statistics.median(ratios):.2f} times as long in the median. Packing what moved and "
                f"fitting trees to it takes {span(each['times']['prepare'] for each in rows)} ms before a "
                f"frame, which no column counts."
            ),
            "Stages, ms. They overlap here, so that they may sum to more than the frame.",
            table(stages, map(stage_row, rows), 13 * ":"),
            "![Stages row by row, beside the talk's](pictures/benchmark-talk.svg)",
        ]
    ), talk_chart(report)


def talk_row(each: Report) -> list[object]:
    """Return the cells of a row: here and there."""
    talk, times, stats = each["talk"], each["times"], each["times"]["stats"]
    return [
        talk["number"],
        f"`{talk['scene']}`",
        f"{stats['width']}x{stats['height']}",
        talk["subsampling"],
        f"{stats['emitted_photons']:,}",
        f"{stats['stored_photons']:,}",
        f"{talk['stored']:,}",
        with_spread(times["no_bounces"]),
        with_spread(times["columns"]["total_ms"]),
        figure(each["added_ms"]),
        floor(each),
        figure(talk_added(talk)),
        f"{each['ratio']:.2f}",
        f"{talk['fps_direct'] / talk['fps_full']:.2f}",
    ]


def stage_row(each: Report) -> list[object]:
    """Return the cells of a row's stages: here and there."""
    columns = each["times"]["columns"]
    ours = [figure(columns[f"{name.replace(' ', '_')}_ms"]["median"]) for name in STAGES]
    return [each["talk"]["number"], *ours, *(f"{value:g}" for value in each["talk"]["stages"])]


def talk_added(talk: Report) -> float:
    """Return what indirect light added in a row of the talk, ms."""
    return float(1e3 / talk["fps_full"] - 1e3 / talk["fps_direct"])


def growth_part(report: Report) -> tuple[str, str]:
    """The growth curves."""
    rows, faster = [], []
    for curve in report["curves"]:
        for each in curve["series"]:
            (power, error), (last, last_error) = each["power"], each["last"]
            rows.append(
                [
                    curve["name"],
                    f"{curve['amounts'][0]:,}",
                    f"{curve['amounts'][-1]:,}",
                    each["name"],
                    *(figure(each["times"][k]["median"]) for k in (0, -1)),
                    f"{power:.2f} ± {error:.2f}",
                    f"{last:.2f} ± {last_error:.2f}",
                    f"{each['limit']:.2f}",
                ]
            )
            if max(power - error, last - last_error) > each["limit"]:
                faster.append(f"{each['name']} with {curve['name']}")
    headings = "curve, from, to, time, first ms, last ms, exponent, of the last step, limit"
    return "\n\n".join(
        [
            machine(report, {curve["frames"] for curve in report["curves"]}),
            table(headings, rows, "-::-:::::"),
            f"Faster than their limit: {', '.join(faster) or 'none'}.",
            "![Growth with photons, pixels, triangles, lights, instances](pictures/benchmark-growth.svg)",
        ]
    ), growth_chart(report)


def frame_part(report: Report) -> tuple[str, None]:
    """One frame of one scene."""
    frame, stats = report["frame"], report["frame"]["stats"]
    times = [
        [
            name.removesuffix("_ms").replace("_", " "),
            *(figure(values[key]) for key in ("median", "low", "high")),
            UNITS.get(name, "ms"),
        ]
        for name, values in {**frame["columns"], "total at 0 bounces": frame["no_bounces"]}.items()
    ]
    parts = [
        machine(report, {frame["frames"]}),
        prose(
            f"{stats['width']}x{stats['height']}, {stats['emitted_photons']:,} photons emitted, "
            f"{stats['stored_photons']:,} stored, light estimated on one pixel in "
            f"{stats['subsampling'] ** 2}. Peak memory {report['peak_memory'] / 1e6:,.0f} MB, the compiler's "
            f"and Embree's included."
        ),
        table("stage, median, 5 %, 95 %, unit", times, "-:::-"),
    ]
    if report["rates"]:
        rates = [
            [
                rate["threads"],
                *(f"{rate[name] / 1e6:.2f}" for name in ("walk", "own", "embree")),
                *(f"{rate[name] / rate['embree']:.2f}" for name in ("walk", "own")),
            ]
            for rate in report["rates"]
        ]
        headings = "threads, walk, traversal alone, Embree, walk / Embree, traversal / Embree"
        parts += ["Millions of rays per second:", table(headings, rates, 6 * ":")]
    return "\n\n".join(parts), None


PARTS: dict[str, Any] = {"frame": frame_part, "talk": talk_part, "growth": growth_part}


def embree(rows: list[Report]) -> str:
    """Return the least and the largest of the rows' rates."""
    rates = [each["embree"] / 1e6 for each in rows if each["embree"]]
    return f"{min(rates):.1f} to {max(rates):.1f} million/s" if rates else "not installed"


def floor(each: Report) -> str:
    """Return a row's floor, ms."""
    parts = [each["floor"][name] for name in ("rays", "transfers", "upsample")]
    return "-" if None in parts else f"{sum(parts):,.0f}"


def span(spreads: Any) -> str:
    """Return the least and the largest of some medians."""
    medians = [each["median"] for each in spreads]
    return f"{figure(min(medians))} to {figure(max(medians))}"


def with_spread(times: Report) -> str:
    """Return a median with its 5th and 95th percentile."""
    return f"{figure(times['median'])} ({figure(times['low'])} to {figure(times['high'])})"


def table(headings: str, rows: Iterable[Iterable[object]], columns: str) -> str:
    """Return a table of Markdown; columns: `-` of each on the left, `:` of each on the right."""
    lines = [headings.split(", "), [{"-": "---", ":": "---:"}[column] for column in columns], *rows]
    return "\n".join(f"| {' | '.join(map(str, cells))} |" for cells in lines)


def prose(text: str) -> str:
    """Return a paragraph in lines of the page's width."""
    return "\n".join(textwrap.wrap(text, 118))


def figure(value: float) -> str:
    """Return a number with as many digits as are worth reading."""
    return f"{value:,.0f}" if value >= 100.0 else f"{value:.1f}" if value >= 10.0 else f"{value:.2f}"


if __name__ == "__main__":
    raise SystemExit(main())
