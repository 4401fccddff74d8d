"""What is stored in halls, in metres: crates, containers, pallets, racks."""

from __future__ import annotations

import numpy as np

from ispm.library.finishes import Pieces
from ispm.library.forms import beveled_box, pipe, placed, pose
from ispm.library.pipework import drum
from ispm.library.shapes import box, merge
from ispm.library.steelwork import bolts, corrugated
from ispm.scene.mesh import Mesh


def crate(w: float, h: float, d: float) -> tuple[Mesh, Mesh]:
    """A crate on y = 0 about its middle: panels, and a frame of beveled edges with corner blocks."""
    x, z, t = 0.5 * w, 0.5 * d, 0.06 * min(w, h, d) + 0.02
    s = 0.35 * t
    panels = [box((s - x, s, s - z), (x - s, h - s, z - s))]
    ribs = max(1, round(w / 0.7))
    for k in range(1, ribs + 1):
        a = -x + k * w / (ribs + 1)
        panels.append(box((a - 0.04, t, 0.3 * s - z), (a + 0.04, h - t, z - 0.3 * s)))
    frame = [
        *(beveled_box((-x, y, c), (x, y + t, c + t), 0.2 * t) for y in (0.0, h - t) for c in (-z, z - t)),
        *(beveled_box((c, y, -z), (c + t, y + t, z), 0.2 * t) for y in (0.0, h - t) for c in (-x, x - t)),
        *(beveled_box((a, 0, c), (a + t, h, c + t), 0.2 * t) for a in (-x, x - t) for c in (-z, z - t)),
    ]
    u = 1.7 * t
    e = 0.012
    corners = [
        beveled_box(
            (a - e if a < 0 else a + e - u, b - e if b == 0 else b + e - u, c - e if c < 0 else c + e - u),
            (a - e + u if a < 0 else a + e, b - e + u if b == 0 else b + e, c - e + u if c < 0 else c + e),
            0.2 * t,
        )
        for a in (-x, x)
        for b in (0.0, h)
        for c in (-z, z)
    ]
    return merge(panels), placed(merge([*frame, *corners]), pose(y=e))


def strapped_box(w: float, h: float, d: float) -> tuple[Mesh, Mesh]:
    """A smooth case on y = 0 with two straps and buckles: the case, and its straps."""
    x, z = 0.5 * w, 0.5 * d
    body = beveled_box((-x, 0.03, -z), (x, h, z), 0.035)
    e, straps = 0.012, []
    for a in (-0.28 * w, 0.28 * w):
        straps += [
            box((a - 0.04, h - 0.005, 0.03 - z), (a + 0.04, h + e, z - 0.03)),
            *(
                box((a - 0.04, 0.06, side * z - e), (a + 0.04, h - 0.03, side * z + e))
                for side in (-1.0, 1.0)
            ),
            *(
                box((a - 0.06, 0.55 * h, side * z - 2 * e), (a + 0.06, 0.55 * h + 0.1, side * z + 2 * e))
                for side in (-1.0, 1.0)
            ),
        ]
    feet = [
        box((a - 0.06, 0.0, c - 0.06), (a + 0.06, 0.06, c + 0.06))
        for a in (0.1 - x, x - 0.1)
        for c in (0.1 - z, z - 0.1)
    ]
    return body, merge([*straps, *feet])


def container(length: float = 6.06) -> tuple[Mesh, Mesh]:
    """A freight container along x on y = 0, 2.44 m wide, 2.59 m high: its sheets, and the rest."""
    x, h, z = 0.5 * length, 2.59, 1.22
    side = corrugated(length - 0.2, h - 0.3, 0.28, 0.036)
    end = corrugated(2 * z - 0.2, h - 0.3, 0.28, 0.036)
    sheets = [
        placed(side, pose(y=0.17, z=z - 0.05), pose(y=0.17, z=0.05 - z, yaw=180.0)),
        placed(end, pose(y=0.17, x=0.05 - x, yaw=-90.0)),
        box((0.06 - x, h - 0.10, 0.06 - z), (x - 0.06, h - 0.03, z - 0.06)),
        box((0.06 - x, 0.08, 0.06 - z), (x - 0.06, 0.14, z - 0.06)),
        box((x - 0.08, 0.12, 0.08 - z), (x - 0.03, h - 0.1, -0.01)),
        box((x - 0.08, 0.12, 0.01), (x - 0.03, h - 0.1, z - 0.08)),
    ]
    t = 0.15
    frame = [
        *(beveled_box((-x, y, c), (x, y + t, c + t), 0.015) for y in (0.0, h - t) for c in (-z, z - t)),
        *(beveled_box((c, y, -z), (c + t, y + t, z), 0.015) for y in (0.0, h - t) for c in (-x, x - t)),
        *(beveled_box((a, 0, c), (a + t, h, c + t), 0.015) for a in (-x, x - t) for c in (-z, z - t)),
        *(pipe([(x + 0.01, 0.12, c), (x + 0.01, h - 0.12, c)], 0.018, 8) for c in (-0.75, -0.3, 0.3, 0.75)),
        *(
            box((x - 0.04, y, c - 0.05), (x + 0.035, y + 0.09, c + 0.05))
            for y in (0.3, 1.1, 2.1)
            for c in (-0.75, -0.3, 0.3, 0.75)
        ),
    ]
    e = 0.01
    blocks = [
        beveled_box((a - e, b, c - e), (a + 0.18 + e, b + 0.12, c + 0.16 + e), 0.012)
        for a in (-x, x - 0.18)
        for b in (-e + 0.0, h - 0.12 + e)
        for c in (-z, z - 0.16)
    ]
    return merge(sheets), placed(merge([*frame, *blocks]), pose(y=e))


def pallet() -> Mesh:
    """A wooden pallet on y = 0, 1.2 by 0.8 by 0.144 m."""
    boards = [box((-0.6, 0.122, z - 0.07), (0.6, 0.144, z + 0.07)) for z in np.linspace(-0.33, 0.33, 5)]
    cross = [box((x - 0.07, 0.10, -0.4), (x + 0.07, 0.122, 0.4)) for x in (-0.53, 0.0, 0.53)]
    feet = [
        box((x - 0.07, 0.022, z - 0.05), (x + 0.07, 0.10, z + 0.05))
        for x in (-0.53, 0.0, 0.53)
        for z in (-0.35, 0.0, 0.35)
    ]
    soles = [box((-0.6, 0.0, z - 0.05), (0.6, 0.022, z + 0.05)) for z in (-0.35, 0.0, 0.35)]
    return merge([*boards, *cross, *feet, *soles])


def pile(
    into: Pieces, place: np.ndarray, sizes: list[tuple[float, float, float, str, str]], seed: int
) -> None:
    """Stack crates on one another at a place, each turned a little, none wider than the one below.

    sizes  width, height, depth in m, and the surfaces of panels and frame, from below
    """
    random = np.random.default_rng(seed)
    y = 0.0
    for w, h, d, panel, frame in sizes:
        turn = place @ pose(y=y, yaw=float(random.uniform(-4.0, 4.0)))
        for finish, mesh in zip((panel, frame), crate(w, h, d), strict=True):
            into[finish].append(placed(mesh, turn))
        y += h + 0.024


def drums(into: Pieces, place: np.ndarray, rows: int, columns: int, finishes: list[str], seed: int) -> None:
    """Stand drums on pallets, in rows along z and columns along x."""
    random = np.random.default_rng(seed)
    one = drum()
    for i in range(columns):
        for k in range(rows):
            x, z = 0.61 * (i - 0.5 * (columns - 1)), 0.61 * (k - 0.5 * (rows - 1))
            turn = place @ pose(x, 0.144, z, yaw=float(random.uniform(0.0, 360.0)))
            into[finishes[int(random.integers(len(finishes)))]].append(placed(one, turn))
    into["wood"].append(placed(pallet(), place))


def rack(length: float, depth: float, levels: int, step: float) -> tuple[Mesh, Mesh]:
    """A pallet rack along x on y = 0: uprights with feet and bolts, and its beams."""
    half = 0.5 * length
    top = levels * step
    posts = []
    for x in (-half, half):
        for z in (-0.5 * depth, 0.5 * depth):
            posts.append(box((x - 0.05, 0.0, z - 0.045), (x + 0.05, top + 0.3, z + 0.045)))
            posts.append(box((x - 0.11, 0.0, z - 0.1), (x + 0.11, 0.015, z + 0.1)))
            posts.append(bolts([(x + 0.08, 0.015, z + 0.07), (x - 0.08, 0.015, z - 0.07)], 0.02))
        for k in range(2 * levels):
            y = 0.2 + k * 0.5 * step
            posts.append(box((x - 0.02, y, -0.5 * depth), (x + 0.02, y + 0.05, 0.5 * depth)))
    beams = []
    for k in range(1, levels + 1):
        y = k * step
        beams += [box((-half, y - 0.12, z - 0.03), (half, y, z + 0.03)) for z in (-0.5 * depth, 0.5 * depth)]
        beams.append(box((0.06 - half, y, -0.5 * depth), (half - 0.06, y + 0.02, 0.5 * depth)))
    return merge(posts), merge(beams)
