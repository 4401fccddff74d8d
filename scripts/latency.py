"""Milliseconds from moving the mouse in the page of `ispm view` to the first picture that shows it.

    python scripts/latency.py [SCENE] [--size WxH] [--bursts N] [-- OPTION OF ispm view...]

In a real Chromium: the pointer drags the camera to and fro at 60 moves a second, a second at a time with
rests between. Each move is timed from the browser's own stamp of its event to the moment that a picture is
drawn on the page whose camera has turned as far. Needs playwright and Chromium.
"""

from __future__ import annotations

import argparse
import math
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "tests" / "viewer"))
_STEP = 6  # CSS pixels a move, over the page's threshold of a drag
_WATCH = """() => {
    window.moves = []; window.pictures = [];
    document.getElementById("overlay").addEventListener("pointermove",
        (e) => { if (e.buttons) moves.push([e.timeStamp, e.clientX]); }, true);
    document.getElementById("picture").addEventListener("shown", (e) => {
        const { clip, size, stats } = e.detail;
        pictures.push([performance.now(), clip[12], clip[14], size[0], size[1], stats.ms]); });
}"""


def burst(page, begin: float, y: float, way: int, count: int) -> None:
    """Drag from x = begin for `count` moves, at 60 a second."""
    page.mouse.move(begin, y)
    page.wait_for_timeout(100)
    page.mouse.down()
    page.wait_for_timeout(80)
    due = time.monotonic()
    for k in range(1, count + 1):
        page.mouse.move(begin + way * _STEP * k, y)
        due += 1.0 / 60.0
        time.sleep(max(due - time.monotonic(), 0.0))
    page.wait_for_timeout(300)
    page.mouse.up()
    page.wait_for_timeout(700)


def delays(page, begin: float, height: float) -> tuple[list[float], list[list[float]]]:
    """Milliseconds of each move of the last burst, and the pictures that came."""
    moves, pictures = page.evaluate(
        "() => { const r = [moves, pictures]; moves = []; pictures = []; return r; }"
    )
    angles = np.unwrap([math.atan2(x, z) for _, x, z, *_ in pictures])
    found = []
    before = page.azimuth if hasattr(page, "azimuth") else None
    page.azimuth = angles[-1]
    if before is None:
        return [], pictures
    turned = np.abs(np.unwrap(np.append(before, angles))[1:] - before)
    for stamp, x in moves:
        wanted = math.pi * abs(x - begin) / height
        shown = np.flatnonzero(turned >= wanted - 1e-3)
        if shown.size:
            found.append(pictures[shown[0]][0] - stamp)
        else:
            found.append(math.inf)
    return found, pictures


def main() -> None:
    """Measure, and print a table."""
    import chromium
    from playwright.sync_api import sync_playwright

    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scene", nargs="?", default="cornell-box")
    parser.add_argument("--size", default="1280x720", help="of the browser's window")
    parser.add_argument("--bursts", type=int, default=8)
    args, more = parser.parse_known_args()
    width, height = map(int, args.size.split("x"))
    command = [sys.executable, "-m", "ispm", "view", args.scene, "--web", *(m for m in more if m != "--")]
    server = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    try:
        url = server.stdout.readline().strip()
        with sync_playwright() as playwright, chromium.launched(playwright) as browser:
            tab = chromium.Tab(browser, (width, height)).open(url)
            tab.page.wait_for_timeout(3000)
            tab.page.evaluate(_WATCH)
            box = tab.page.locator("#overlay").bounding_box()
            tall = tab.page.locator("#picture").bounding_box()["height"]
            y, count = box["y"] + 0.8 * box["height"], 60
            ends = (
                box["x"] + 0.5 * box["width"] - 0.5 * count * _STEP,
                box["x"] + 0.5 * box["width"] + 0.5 * count * _STEP,
            )
            found, first, rate, sizes, cost = [], [], [], [], []
            for k in range(args.bursts + 2):
                burst(tab.page, ends[k % 2], y, 1 - 2 * (k % 2), count)
                tab.page.wait_for_timeout([200, 1500][k % 2])
                each, pictures = delays(tab.page, ends[k % 2], tall)
                if k < 2:
                    continue
                found += each
                first.append(each[0])
                sizes += [p[3:5] for p in pictures]
                cost += [p[5] for p in pictures]
                during = [p[0] for p in pictures if p[0] - pictures[0][0] < 1000.0]
                rate.append((len(during) - 1) / max(during[-1] - during[0], 1e-9) * 1000.0)
    finally:
        server.send_signal(2)
        server.wait(20)
    middle, late = np.percentile(found, 50), np.percentile(found, 95)
    print(
        f"{args.scene}: {len(found)} moves; ms from a move to its picture: "
        f"median {middle:.0f}, 95 % {late:.0f}"
    )
    print(f"  the first move of each drag, after rest: median {np.median(first):.0f}, most {max(first):.0f}")
    size = np.median(sizes, axis=0).astype(int)
    print(
        f"  {np.median(rate):.1f} pictures a second of {size[0]}x{size[1]}, "
        f"{np.median(cost):.0f} ms each (median)"
    )
    print(f"  load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores, browser included")


if __name__ == "__main__":
    main()
