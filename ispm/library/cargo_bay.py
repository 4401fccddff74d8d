"""The modules of a space station's cargo deck: bays, corridors, blast doors and what stands in them."""

from __future__ import annotations

import numpy as np

from ispm.library.cargo import container, crate, drums, pile, rack, strapped_box
from ispm.library.finishes import Finishes, Pieces, pieces
from ispm.library.forms import beveled_box, pipe, placed, pose, prism
from ispm.library.pipework import cable, duct, flanged, valve, vessel
from ispm.library.shapes import box, lathe, merge, sheet
from ispm.library.steelwork import brace, catwalk, i_section, ladder, railing, stairs
from ispm.scene.material import Material
from ispm.scene.mesh import Mesh
from ispm.scene.scene import Part

HALF_X, HALF_Z, HEIGHT = 12.0, 8.0, 8.0  # m, of a bay
LENGTH, HALF_WIDTH, LOW = 12.0, 2.4, 3.8  # m, of a corridor
_DOOR, _LINTEL = 2.4, 3.8  # half the width and the height of doorways, m
_WALK, _WALK_Z = 3.4, -7.2  # m


def bay(finishes: Finishes, glow: Material) -> list[Part]:
    """Return the parts of a bay about the origin, its floor at y = 0, with doorways in all four walls."""
    shell = pieces()
    for yaw, half, reach in (
        (0.0, HALF_X, HALF_Z),
        (180.0, HALF_X, HALF_Z),
        (90.0, HALF_Z, HALF_X),
        (-90.0, HALF_Z, HALF_X),
    ):
        _wall(shell, pose(yaw=yaw) @ pose(z=-reach), half)
    x, z = np.linspace(-HALF_X - 0.4, HALF_X + 0.4, 25), np.linspace(-HALF_Z - 0.4, HALF_Z + 0.4, 17)
    _deck(shell, x, z, 0.0)
    roof = np.zeros((17, 25, 3))
    roof[..., 0], roof[..., 1], roof[..., 2] = x, HEIGHT, -z[:, None]
    shell["dark hull"].append(sheet(roof))
    for a in np.arange(-10.0, 11.0, 4.0):
        frame = prism(i_section(0.5, 0.3, 0.04, 0.05), -HALF_Z, HALF_Z)
        shell["steel"].append(placed(frame, pose(x=float(a), y=HEIGHT - 0.3)))
        for side in (-1.0, 1.0):
            knee = prism([(0.0, 0.0), (0.0, -1.5), (1.5, 0.0)], -0.1, 0.1)
            shell["steel"].append(
                placed(knee, pose(float(a), HEIGHT - 0.5, side * (HALF_Z - 0.05), yaw=90.0 * side))
            )
    shell["galvanized"].append(duct([(-11.7, 7.0, 4.6), (11.7, 7.0, 4.6)], 0.9, 0.7))
    shell["teal paint"].append(flanged([(-11.8, 6.2, 7.4), (11.8, 6.2, 7.4)], 0.16, 16, 0.4, 6.0))
    shell["red paint"].append(
        flanged([(-11.8, 5.75, 7.55), (8.0, 5.75, 7.55), (8.0, 0.0, 7.55)], 0.09, 12, 0.3, 6.0)
    )
    shell["copper"] += [pipe([(-11.8, y, 7.75), (11.8, y, 7.75)], 0.035, 8) for y in (5.35, 5.22, 5.09)]
    body, wheel = valve(0.16, 14)
    shell["dark metal"].append(placed(body, pose(-3.0, 6.2, 7.4, pitch=-90.0)))
    shell["yellow paint"].append(placed(wheel, pose(-3.0, 6.2, 7.4, pitch=-90.0)))
    shell["dark metal"] += [
        placed(brace(0.75, 0.5), pose(float(a), 6.02, 8.0, yaw=90.0)) for a in (-9.0, -3.9, 3.0, 9.0)
    ]
    for k in range(4):
        for a in np.arange(-10.0, 7.0, 4.0):
            start, end = (float(a), 7.35, -5.0 + 0.1 * k), (float(a) + 4.0, 7.35, -5.0 + 0.1 * k)
            shell["rubber"].append(cable(start, end, 0.12 + 0.05 * k, 0.02, 10, 5))
    _walk(shell)
    parts = finishes.parts(shell, "bay")
    strips = [
        box((a - 0.9, HEIGHT - 0.62, s * 2.6 - 0.09), (a + 0.9, HEIGHT - 0.57, s * 2.6 + 0.09))
        for a in (-8.0, 0.0, 8.0)
        for s in (-1, 1)
    ]
    return [*parts, Part(merge(strips, "bay strips"), glow)]


def _deck(into: Pieces, x: np.ndarray, z: np.ndarray, y: float) -> None:
    """A floor between grid lines, seen from above."""
    grid = np.full((len(z), len(x), 3), y)
    grid[..., 0], grid[..., 2] = x, z[:, None]
    into["deck"].append(sheet(grid))


def _wall(into: Pieces, place: np.ndarray, half: float) -> None:
    """A wall of panels along x that faces +z, with a doorway in the middle."""
    door, lintel = _DOOR, _LINTEL
    back = [
        box((-half - 0.4, -0.1, -0.4), (-door, HEIGHT + 0.1, -0.12)),
        box((door, -0.1, -0.4), (half + 0.4, HEIGHT + 0.1, -0.12)),
        box((-door, lintel, -0.4), (door, HEIGHT + 0.1, -0.12)),
    ]
    into["dark hull"] += [placed(mesh, place) for mesh in back]
    columns = int((half - door - 0.5) // 1.6)
    width = (half - door - 0.5) / columns
    random = np.random.default_rng(int(half))
    for side in (-1.0, 1.0):
        for k in range(columns):
            a = door + 0.5 + (k + 0.5) * width
            for low, high in ((0.35, 1.25), (1.32, 3.0), (3.07, 4.7), (4.77, 6.4), (6.47, 7.8)):
                out = float(random.choice([0.0, 0.0, 0.03, 0.06]))
                panel = beveled_box((-0.5 * width + 0.03, low, -0.13), (0.5 * width - 0.03, high, out), 0.03)
                finish = "orange paint" if low < 0.5 else "hull" if random.random() < 0.86 else "teal paint"
                into[finish].append(placed(panel, place @ pose(x=side * a)))
        into["dark metal"].append(
            placed(box((side * half - 0.3, -0.05, -0.2), (side * half + 0.3, 0.35, 0.1)), place)
        )
        a, b = sorted((side * (door + 0.45), side * half))
        into["dark metal"].append(placed(box((a, -0.05, -0.2), (b, 0.3, 0.08)), place))
        jamb = beveled_box(
            (side * (door + 0.22) - 0.22, 0.0, -0.5), (side * (door + 0.22) + 0.22, lintel + 0.4, 0.14), 0.05
        )
        into["steel"].append(placed(jamb, place))
        strip = box((side * (door + 0.22) - 0.1, 0.4, 0.1), (side * (door + 0.22) + 0.1, 2.4, 0.15))
        into["hazard"].append(placed(strip, place))
    into["steel"].append(
        placed(beveled_box((-door - 0.44, lintel, -0.5), (door + 0.44, lintel + 0.5, 0.16), 0.05), place)
    )
    for low, high in ((4.45, 6.0), (6.1, 7.8)):
        into["hull"] += [
            placed(beveled_box((a - 1.12, low, -0.13), (a + 1.12, high, 0.02), 0.03), place)
            for a in (-1.2, 1.2)
        ]


def _walk(into: Pieces) -> None:
    """A walk along the wall at -z with stairs down, and a ladder on the other side."""
    deck, sides = catwalk(17.0, 1.3)
    place = pose(3.2, _WALK, _WALK_Z)
    into["galvanized"].append(placed(deck, place))
    into["dark metal"].append(placed(sides, place))
    into["yellow paint"] += [
        placed(railing(17.0), place @ pose(z=0.62)),
        placed(railing(1.26), pose(11.68, _WALK, _WALK_Z, yaw=90.0)),
    ]
    into["steel"] += [
        placed(brace(1.35, 0.9), pose(float(x), _WALK - 0.2, -8.0, yaw=-90.0)) for x in (-4.0, 3.2, 7.4, 10.8)
    ]
    treads, strings = stairs(_WALK, 1.0)
    into["galvanized"].append(placed(treads, pose(-10.5, 0.0, _WALK_Z + 0.05)))
    into["yellow paint"].append(placed(strings, pose(-10.5, 0.0, _WALK_Z + 0.05)))
    into["yellow paint"].append(placed(ladder(4.6), pose(-9.4, 0.0, 7.78, yaw=180.0)))


def corridor(finishes: Finishes, glow: Material) -> list[Part]:
    """Return the parts of a corridor along x about the origin, open at both ends."""
    way = pieces()
    half = 0.5 * LENGTH
    _deck(
        way,
        np.linspace(-half - 0.02, half + 0.02, 7),
        np.linspace(-HALF_WIDTH - 0.3, HALF_WIDTH + 0.3, 4),
        0.0,
    )
    for side in (-1.0, 1.0):
        turn = pose(yaw=90.0 - 90.0 * side) @ pose(z=-HALF_WIDTH)
        way["dark hull"].append(placed(box((-half, -0.1, -0.3), (half, LOW + 0.2, -0.1)), turn))
        for k in range(8):
            a = -half + 0.75 + 1.5 * k
            way["hull"].append(placed(beveled_box((a - 0.71, 1.0, -0.12), (a + 0.71, 3.0, 0.0), 0.03), turn))
            way["teal paint"].append(
                placed(beveled_box((a - 0.71, 0.25, -0.12), (a + 0.71, 0.94, 0.05), 0.03), turn)
            )
        way["copper"] += [
            placed(pipe([(-half, y, 0.12), (half, y, 0.12)], 0.045, 10), turn) for y in (3.16, 3.3)
        ]
        way["red paint"].append(placed(pipe([(-half, 3.5, 0.14), (half, 3.5, 0.14)], 0.08, 12), turn))
    way["dark hull"].append(box((-half, LOW, -HALF_WIDTH - 0.3), (half, LOW + 0.2, HALF_WIDTH + 0.3)))
    for a in np.arange(-4.5, 5.0, 3.0):
        for s in (-1.0, 1.0):
            rib = prism(
                [(0.0, 0.0), (0.22, 0.0), (0.22, 3.1), (0.7, 3.6), (0.7, LOW), (0.0, LOW)], -0.14, 0.14
            )
            way["steel"].append(placed(rib, pose(float(a), 0.0, -s * HALF_WIDTH, yaw=-90.0 * s)))
        way["steel"].append(box((float(a) - 0.13, 3.6, -1.8), (float(a) + 0.13, LOW, 1.8)))
    parts = finishes.parts(way, "corridor")
    strips = [box((a - 0.6, LOW - 0.06, -0.08), (a + 0.6, LOW - 0.02, 0.08)) for a in (-3.0, 0.0, 3.0)]
    return [*parts, Part(merge(strips, "corridor strips"), glow)]


def blast_door(finishes: Finishes) -> list[Part]:
    """Return the parts of a closed door in a doorway in the plane z = 0 that faces +z."""
    door = pieces()
    for s in (-1.0, 1.0):
        door["dark hull"].append(
            beveled_box((min(0.0, s * _DOOR), 0.0, -0.38), (max(0.0, s * _DOOR), _LINTEL, -0.2), 0.02)
        )
        for y in (0.25, 1.45, 2.65):
            low, high = sorted((s * 0.18, s * (_DOOR - 0.15)))
            door["orange paint"].append(beveled_box((low, y, -0.22), (high, y + 1.0, -0.12), 0.03))
        door["hazard"].append(
            box((min(0.0, s * 0.14) + 0.002 * s, 0.1, -0.21), (max(0.0, s * 0.14), _LINTEL - 0.1, -0.17))
        )
    bar = lathe([(0.0, -0.02), (0.32, -0.02), (0.32, 0.04), (0.24, 0.07), (0.0, 0.07)], 28)
    door["steel"].append(placed(bar, pose(0.0, 1.95, -0.16, pitch=90.0)))
    return finishes.parts(door, "blast door")


def _row(into: Pieces, x: float, z: float, yaw: float, seed: int, paints: list[str]) -> None:
    """A row of three stacks of crates."""
    random = np.random.default_rng(seed)
    for k in range(3):
        sizes = []
        w, d = random.uniform((1.2, 1.1), (1.5, 1.3))
        for _ in range(int(random.integers(1, 3))):
            h = float(random.uniform(0.8, 1.15))
            sizes.append((float(w), h, float(d), paints[int(random.integers(len(paints)))], "dark metal"))
            w, d = 0.88 * w, 0.88 * d
        pile(into, pose(x, 0.0, z, yaw=yaw) @ pose(x=1.75 * (k - 1)), sizes, seed + k)


def cargo(finishes: Finishes, kind: int) -> list[Part]:
    """Return the parts of what stands in a bay, about its middle; `kind` 0 to 2 says how."""
    stock = pieces()
    paints = [
        ["red paint", "yellow paint", "wood"],
        ["blue paint", "green paint", "orange paint"],
        ["red paint", "green paint", "white paint"],
    ][kind]
    sheets, frame = container()
    spots = [
        [(7.2, 0.0, 5.4, 0.0, "red paint"), (7.4, 0.0, -4.4, 2.0, "blue paint")],
        [(-7.0, 0.0, 5.0, 90.0, "green paint"), (7.2, 0.0, 5.2, -3.0, "orange paint")],
        [(7.2, 0.0, 5.3, 3.0, "yellow paint"), (6.8, 0.0, -4.2, 0.0, "green paint")],
    ][kind]
    for x, y, z, yaw, finish in spots:
        stock[finish].append(placed(sheets, pose(x, y, z, yaw)))
        stock[finish].append(placed(frame, pose(x, y, z, yaw)))
    _row(stock, -6.6, -3.6, 4.0, 10 * kind + 1, paints)
    if kind != 1:
        _row(stock, -6.4, 5.4, -3.0, 10 * kind + 4, paints)
        tank = vessel(0.9, 3.0, 32)
        stock["white paint"] += [placed(tank, pose(x, 0.0, 6.4, yaw=180.0)) for x in (0.9 + 2.2, -0.9 - 2.2)]
    else:
        drums(stock, pose(-3.3, 0.0, 6.4), 2, 2, ["yellow paint", "blue paint"], 7)
        drums(stock, pose(3.2, 0.0, -4.6, yaw=20.0), 2, 2, ["red paint", "rust"], 8)
        _row(stock, 7.0, -4.2, 0.0, 17, paints)
    posts, shelves = rack(2.7, 1.0, 2, 1.25)
    for x in (2.0, 4.9):
        stock["blue paint"].append(placed(posts, pose(x, 0.0, -7.2)))
        stock["orange paint"].append(placed(shelves, pose(x, 0.0, -7.2)))
        for level in (0, 1):
            for dx in (-0.72, 0.0, 0.72):
                body, straps = strapped_box(0.62, 0.60 + 0.2 * ((level + round(dx)) % 2), 0.8)
                turn = pose(x + dx, 0.01 + 1.26 * level, -7.2)
                stock[paints[(level + round(dx)) % 3]].append(placed(body, turn))
                stock["rubber"].append(placed(straps, turn))
    stock["yellow paint"] += _markings()
    return finishes.parts(stock, f"cargo {kind}")


def _markings() -> list[Mesh]:
    """Lines on the deck round the landing place."""
    lines = [box((-4.0, -0.02, s * 2.6 - 0.06), (4.0, 0.005, s * 2.6 + 0.06)) for s in (-1.0, 1.0)]
    return lines + [box((s * 3.94 - 0.06, -0.02, -2.54), (s * 3.94 + 0.06, 0.005, 2.54)) for s in (-1.0, 1.0)]


def stack(finishes: Finishes) -> list[Part]:
    """Return the parts of one stack of two crates with a case beside it, that fits anywhere."""
    collected = pieces()
    for y, (w, h, d), finish in ((0.0, (1.0, 0.8, 0.9), "wood"), (0.825, (0.8, 0.65, 0.75), "red paint")):
        panels, frame = crate(w, h, d)
        collected[finish].append(placed(panels, pose(y=y, yaw=3.0 * y)))
        collected["steel"].append(placed(frame, pose(y=y, yaw=3.0 * y)))
    body, straps = strapped_box(0.7, 0.6, 0.5)
    collected["teal paint"].append(placed(body, pose(0.95, 0.0, 0.1, yaw=12.0)))
    collected["rubber"].append(placed(straps, pose(0.95, 0.0, 0.1, yaw=12.0)))
    return finishes.parts(collected, "stack")
