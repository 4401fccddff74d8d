"""The hall of the iron works: eight bays of columns and trusses, a furnace, a crane, a catwalk, pipes."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from ispm.library.finishes import Finishes, pieces
from ispm.library.forms import beveled_box, pipe, placed, pose, prism, refined
from ispm.library.masonry import arch
from ispm.library.pipework import cable, clamp, duct, flanged, valve, vessel
from ispm.library.shapes import box, lathe, merge, polygons, sheet
from ispm.library.steelwork import (
    beam,
    bolts,
    brace,
    catwalk,
    channel,
    column,
    corrugated,
    railing,
    stairs,
    truss,
)
from ispm.scene.material import Material
from ispm.scene.scene import Node, Part, Scene

BAY, BAYS = 6.0, 8  # m
HALF_X, HALF_Z = 24.0, 9.3  # m, to the inner faces of the walls
COLUMN_Z, EAVES, RISE = 9.0, 8.6, 2.6  # m
WALK, WALK_Z = 3.4, -8.0  # height and middle of the catwalk, m
COLUMNS = [(BAY * (k - 4), side * COLUMN_Z) for k in range(BAYS + 1) for side in (-1.0, 1.0)]
"""x and z of the columns that carry the roof."""


def hall(scene: Scene, finishes: Finishes) -> None:
    """Build the hall, but not its floor and stock: 48 x 18.6 x 11.5 m about the origin, up from y = 0."""
    _bays(scene, finishes)
    _roof(scene, finishes)
    _gables(scene, finishes)
    _crane(scene, finishes)
    _catwalk(scene, finishes)
    _pipes(scene, finishes)
    _furnace(scene, finishes)


def floor(scene: Scene, finishes: Finishes, triangles: int) -> Node:
    """Lay the floor, of so many triangles: the scene's number of triangles comes out by it."""
    x, z = np.linspace(-HALF_X - 0.3, HALF_X + 0.3, 25), np.linspace(-HALF_Z - 0.3, HALF_Z + 0.3, 11)
    grid = np.zeros((len(z), len(x), 3))
    grid[..., 0], grid[..., 2] = x, z[:, None]
    collected = pieces()
    collected["concrete"].append(refined(sheet(grid), triangles))
    return finishes.add(scene, "floor", collected)


def _bays(scene: Scene, finishes: Finishes) -> None:
    """Walls of brick, sheet and windows between columns on plinths."""
    wall = pieces()
    wall["brick"].append(box((-3.0, -0.1, -0.3), (3.0, 1.6, 0.0)))
    wall["concrete wall"].append(beveled_box((-3.0, 1.56, -0.3), (3.0, 1.72, 0.06), 0.02))
    for low, high in ((1.7, 5.3), (7.3, EAVES + 1.0)):
        wall["corrugated"].append(placed(corrugated(6.0, high - low, 0.3, 0.05), pose(y=low, z=-0.06)))
    for y in (2.9, 4.1, 5.3, 7.2):
        wall["rust"].append(placed(channel(6.0, 0.16, 0.07), pose(y=y - 0.08, z=0.0, yaw=-90.0)))
    for k in range(6):
        x = -2.7 + 1.08 * k
        wall["rust"].append(box((x - 0.03, 5.38, -0.06), (x + 0.03, 7.22, 0.0)))
    for y in (5.85, 6.35, 6.85):
        wall["rust"].append(box((-2.72, y - 0.02, -0.055), (2.72, y + 0.02, -0.005)))
    wall["dark metal"].append(box((-3.0, 5.3, -0.10), (3.0, 7.3, -0.05)))
    places = [
        pose(BAY * (k - 3.5), z=side * HALF_Z, yaw=90.0 + 90.0 * side)
        for k in range(BAYS)
        for side in (-1, 1)
    ]
    finishes.add(scene, "wall", wall, places)

    post = pieces()
    post["steel"].append(placed(column(EAVES - 0.75, 0.36), pose(y=0.75, yaw=90.0)))
    post["concrete wall"].append(beveled_box((-0.38, -0.1, -0.38), (0.38, 0.76, 0.38), 0.03))
    post["yellow paint"].append(box((-0.187, 0.80, 0.176), (0.187, 2.0, 0.188)))
    corbel = prism([(0.0, 0.0), (0.55, 0.42), (0.55, 0.6), (0.0, 0.6)], -0.12, 0.12)
    post["steel"].append(placed(corbel, pose(y=5.4, z=0.17, yaw=-90.0)))
    places = [pose(x, 0.0, z, yaw=0.0 if z < 0.0 else 180.0) for x, z in COLUMNS]
    finishes.add(scene, "column", post, places)


def _roof(scene: Scene, finishes: Finishes) -> None:
    """Trusses, purlins and a corrugated roof with a ridge light."""
    frame = pieces()
    frame["steel"].append(placed(truss(2.0 * COLUMN_Z + 0.3, RISE, 0.7, 6), pose(y=EAVES)))
    finishes.add(scene, "truss", frame, [pose(BAY * (k - 4), yaw=90.0) for k in range(BAYS + 1)])
    above = pieces()
    pitch = float(np.degrees(np.arctan2(RISE, COLUMN_Z)))
    length = float(np.hypot(RISE, COLUMN_Z)) + 0.5
    top = EAVES + 0.82 + RISE
    for side in (-1.0, 1.0):
        # a wall laid over: its top comes to the ridge, its front looks down
        lay = pose(y=top + 0.22, yaw=90.0 + 90.0 * side) @ pose(pitch=90.0 - pitch) @ pose(y=-length)
        above["roofing"].append(placed(corrugated(2 * HALF_X + 0.6, length, 0.4, 0.06), lay))
        for s in np.linspace(0.06, 0.97, 7):
            z, y = side * s * COLUMN_Z, top - s * RISE + 0.06
            purlin = placed(channel(2.0 * HALF_X, 0.18, 0.07), pose(yaw=90.0))
            above["rust"].append(placed(purlin, pose(y=y - 0.09, z=z)))
    finishes.add(scene, "roof", above)


def _gables(scene: Scene, finishes: Finishes) -> None:
    """End walls of brick: a gate in the east, both with a door of 2.1 m."""
    end = pieces()
    x = HALF_X
    outline = [
        (-HALF_Z - 0.3, -0.1),
        (HALF_Z + 0.3, -0.1),
        (HALF_Z + 0.3, EAVES + 0.9),
        (0.0, EAVES + RISE + 1.3),
        (-HALF_Z - 0.3, EAVES + 0.9),
    ]
    slab = prism(outline, 0.0, 0.3)
    end["brick"] += [placed(slab, pose(x=x, yaw=90.0)), placed(slab, pose(x=-x, yaw=-90.0))]
    for z in (-9.1, -6.0, 6.0, 9.1):
        end["brick"] += [
            box((s * x - 0.15, -0.1, z - 0.3), (s * x + 0.15, EAVES + 0.5, z + 0.3)) for s in (-1, 1)
        ]
    for s in (-1, 1):
        end["concrete wall"].append(box((s * x - 0.12, 7.0, -9.3), (s * x + 0.12, 7.4, 9.3)))
        end["concrete wall"].append(box((s * x - 0.1, -0.1, -9.3), (s * x + 0.1, 0.5, 9.3)))
    gate = placed(corrugated(5.0, 5.0, 0.16, 0.05), pose(x=x - 0.02, z=-0.0, yaw=-90.0))
    end["galvanized"].append(gate)
    for z in (-2.7, 2.5):
        end["hazard"].append(beveled_box((x - 0.25, 0.0, z), (x + 0.1, 5.2, z + 0.2), 0.01))
    end["dark metal"].append(beveled_box((x - 0.55, 5.0, -2.75), (x + 0.1, 5.6, 2.75), 0.05))
    end["white paint"].append(box((x - 0.57, 5.12, -0.9), (x - 0.54, 5.48, 0.9)))
    for s, z in ((1, 4.5), (-1, -7.4)):
        end["dark metal"].append(box((s * x - 0.08, 0.0, z - 0.56), (s * x + 0.08, 2.2, z + 0.56)))
        end["green paint"].append(box((s * x - 0.11, 0.02, z - 0.45), (s * x + 0.11, 2.1, z + 0.45)))
        end["galvanized"].append(box((s * x - 0.14, 1.0, z + 0.3), (s * x + 0.14, 1.05, z + 0.42)))
    finishes.add(scene, "gables", end)


def _crane(scene: Scene, finishes: Finishes) -> None:
    """Rails on corbels and a bridge crane with its trolley, block and hook."""
    crane = pieces()
    for side in (-1.0, 1.0):
        rail = placed(beam(2.0 * HALF_X - 0.2, 0.5, 0.3), pose(y=6.25, z=side * 8.45, yaw=90.0))
        crane["steel"].append(rail)
        crane["rust"].append(
            box((0.1 - HALF_X, 6.5, side * 8.45 - 0.04), (HALF_X - 0.1, 6.6, side * 8.45 + 0.04))
        )
    x = 9.0
    for a in (x - 0.9, x + 0.9):
        crane["yellow paint"].append(placed(beam(16.4, 0.8, 0.34), pose(x=a, y=7.08)))
        crane["yellow paint"].append(
            merge(
                [
                    box((a - 0.15, 6.74, z - 0.01), (a + 0.15, 7.42, z + 0.01))
                    for z in np.arange(-7.5, 8.0, 1.5)
                ]
            )
        )
    for side in (-1.0, 1.0):
        z = side * 8.45
        crane["yellow paint"].append(beveled_box((x - 1.6, 6.66, z - 0.2), (x + 1.6, 7.15, z + 0.2), 0.03))
        wheel = placed(lathe([(0, -0.05), (0.2, -0.05), (0.2, 0.05), (0, 0.05)], 20), pose(pitch=90.0))
        crane["dark metal"] += [
            placed(wheel, pose(a, 6.79, z + 0.23 * s)) for a in (x - 1.2, x + 1.2) for s in (-1, 1)
        ]
    crane["orange paint"] += [
        beveled_box((x - 1.1, 7.5, -1.9), (x + 1.1, 7.75, 0.4), 0.03),
        beveled_box((x - 0.8, 7.75, -1.6), (x + 0.1, 8.35, 0.1), 0.05),
    ]
    crane["dark metal"].append(
        placed(
            lathe([(0, -0.7), (0.3, -0.7), (0.3, 0.7), (0, 0.7)], 24), pose(x + 0.5, 7.95, -0.75, pitch=90.0)
        )
    )
    crane["dark metal"] += [
        pipe([(x + 0.5 + a, 7.7, -0.75 + b), (x + 0.5 + 0.4 * a, 4.9, -0.75 + b)], 0.012, 6)
        for a in (-0.2, 0.2)
        for b in (-0.08, 0.08)
    ]
    crane["yellow paint"].append(
        placed(beveled_box((-0.28, -0.25, -0.16), (0.28, 0.3, 0.16), 0.06), pose(x + 0.5, 4.75, -0.75))
    )
    angle = np.linspace(0.5 * np.pi, -1.15 * np.pi, 15)
    curve = np.stack([0.16 * np.cos(angle), 0.16 * np.sin(angle) - 0.30, 0.0 * angle], axis=1)
    hook = pipe(np.concatenate([[(0.0, 0.12, 0.0)], curve]), 0.045, 10)
    crane["dark metal"].append(placed(hook, pose(x + 0.5, 4.45, -0.75)))
    finishes.add(scene, "crane", crane)


def _catwalk(scene: Scene, finishes: Finishes) -> None:
    """A walk along the north wall on brackets, with stairs at its west end."""
    walk = pieces()
    deck, sides = catwalk(BAY, 1.4)
    walk["galvanized"].append(deck)
    walk["rust"].append(sides)
    walk["yellow paint"].append(placed(railing(BAY), pose(z=0.66)))
    walk["rust"] += [placed(brace(1.5, 1.1), pose(x, -0.2, -0.98, yaw=-90.0)) for x in (-2.0, 2.0)]
    finishes.add(scene, "walk", walk, [pose(-15.0 + BAY * k, WALK, WALK_Z) for k in range(6)])
    ends = pieces()
    treads, strings = stairs(WALK, 1.0)
    ends["galvanized"].append(placed(treads, pose(-23.2, 0.0, WALK_Z + 0.1)))
    ends["yellow paint"].append(placed(strings, pose(-23.2, 0.0, WALK_Z + 0.1)))
    ends["yellow paint"].append(placed(railing(1.36), pose(18.0, WALK, WALK_Z, yaw=90.0)))
    finishes.add(scene, "stairs", ends)


def _pipes(scene: Scene, finishes: Finishes) -> None:
    """Headers along the south wall with valves and vessels; a duct, and cables from truss to truss."""
    run = pieces()
    z = 8.25
    run["teal paint"].append(
        flanged([(-22.0, 0.0, z), (-22.0, 4.6, z), (21.0, 4.6, z), (21.0, 0.0, z)], 0.17, 18, 0.5, 6.0)
    )
    run["red paint"].append(flanged([(-20.5, 5.05, z), (19.5, 5.05, z), (19.5, 9.3, z)], 0.11, 14, 0.35, 6.0))
    run["copper"].append(pipe([(-23.5, 3.9, 8.7), (23.5, 3.9, 8.7)], 0.05, 10))
    run["copper"].append(pipe([(-23.5, 3.75, 8.7), (6.0, 3.75, 8.7), (6.0, 0.0, 8.7)], 0.05, 10, 0.2))
    body, wheel = valve(0.17)
    for x in (-19.0, -6.0, 7.0):
        run["dark metal"].append(placed(body, pose(x, 4.6, z, pitch=90.0)))
        run["red paint"].append(placed(wheel, pose(x, 4.6, z, pitch=90.0)))
    run["rust"] += [placed(clamp(0.17, 0.1), pose(x, 4.6, z)) for x in np.arange(-21.0, 21.0, BAY) + 1.2]
    run["rust"] += [
        placed(brace(1.1, 0.7), pose(float(x), 4.42, 9.25, yaw=90.0)) for x in np.arange(-18.0, 19.0, BAY)
    ]
    tank = vessel(1.15, 4.0)
    for x, finish in ((-15.0, "white paint"), (-12.0, "orange paint")):
        run[finish].append(placed(tank, pose(x, 0.0, 7.5, yaw=180.0)))
        run["teal paint"].append(flanged([(x, 3.9, 7.5), (x, 4.6, 7.5), (x, 4.6, z)], 0.1, 12, 0.2, 9.0))
    run["galvanized"].append(duct([(-23.7, 7.6, 6.6), (23.7, 7.6, 6.6)], 0.8, 0.6))
    for k in range(3):
        for x in np.arange(-HALF_X, HALF_X, BAY):
            a, b = (float(x), EAVES + 0.05, -6.2 + 0.12 * k), (float(x) + BAY, EAVES + 0.05, -6.2 + 0.12 * k)
            run["rubber"].append(cable(a, b, 0.22 + 0.07 * k, 0.018, 10, 4))
    finishes.add(scene, "pipes", run)


def _furnace(scene: Scene, finishes: Finishes) -> None:
    """A brick hearth with an arch, in which embers glow, and a hood that leads to the roof."""
    west = pieces()
    x = 0.25 - HALF_X
    west["brick"].append(beveled_box((-HALF_X - 0.1, -0.1, -3.0), (x + 2.6, 1.0, 3.0), 0.04))
    wall, ring = arch(6.0, 3.3, 0.9, 1.55, 1.9, 0.08, 15, "hearth")
    west["brick"].append(placed(wall, pose(x + 2.1, 1.0, 0.0, yaw=90.0)))
    west["dark stone"].append(placed(ring, pose(x + 2.1, 1.0, 0.0, yaw=90.0)))
    west["brick"] += [
        box((-HALF_X - 0.1, 0.9, s * 2.6 - 0.4), (x + 1.7, 4.3, s * 2.6 + 0.4)) for s in (-1, 1)
    ]
    west["rust"] += [box((x + 2.5, 0.9, s * 2.9 - 0.05), (x + 2.72, 4.3, s * 2.9 + 0.07)) for s in (-1, 1)]
    rings = []
    for y, half, reach in ((4.25, 3.1, 2.8), (4.6, 3.1, 2.8), (6.9, 0.8, 1.6), (EAVES + 3.2, 0.8, 1.6)):
        rings.append([(x - 0.15, y, -half), (x - 0.15, y, half), (x + reach, y, half), (x + reach, y, -half)])
    hood = [
        polygons([np.array([a[k], a[(k + 1) % 4], b[(k + 1) % 4], b[k]])])
        for a, b in pairwise(rings)
        for k in range(4)
    ]
    hood.append(polygons([np.array(rings[0][::-1])]))
    west["rust"] += hood
    for a in (-3.0, -1.0, 1.0, 3.0):
        west["dark metal"].append(bolts([(x + 2.72, y, a) for y in (4.3, 4.42, 4.54)], 0.03, "x"))
    node = finishes.add(scene, "furnace", west)
    embers = Material((1.0, 0.22, 0.03), unlit=True, name="embers")
    random = np.random.default_rng(3)
    coals = [
        placed(
            beveled_box((-s, -s, -s), (s, s, s), 0.3 * s),
            pose(x + 0.2 + 1.7 * a, 1.0 + 0.5 * s, -1.3 + 2.6 * b, *random.uniform(0, 90, 3)),
        )
        for a, b, s in np.column_stack([random.random((90, 2)), random.uniform(0.05, 0.13, 90)])
    ]
    node.parts.append(Part(merge(coals, "embers"), embers))
