"""The iron works by night: a car with its lamps on drives round what is stored in the hall."""

from __future__ import annotations

import math

import numpy as np

from ispm.library import ironworks
from ispm.library.car import WHEEL, car
from ispm.library.cargo import container, crate, drums, pile, rack
from ispm.library.common import add_camera, closed_path, turns_about
from ispm.library.finishes import Finishes, Pieces, pieces
from ispm.library.forms import pipe, placed, pose
from ispm.library.pipework import coil
from ispm.library.shapes import box, merge
from ispm.library.steelwork import beam
from ispm.scene.animation import Animation
from ispm.scene.scene import Scene

STILL = 141_492  # triangles
PERIOD = 16.0  # s
_HALF_X, _HALF_Z, _CORNER = 15.5, 4.3, 4.0  # m, of the way
_START = 0.92  # share of the way at which the car begins: it turns before the gate, and lights what is near


def ironworks_car() -> Scene:
    """A hall of an iron works by night, lit by a car that drives through it: 161,612 triangles.

    48 x 18.6 x 11.5 m. The car, of 20 moving parts, goes once round in 16 s; its headlights are the only
    lights.
    """
    scene, finishes = Scene(name="ironworks-car"), Finishes()
    ironworks.hall(scene, finishes)
    _containers(scene, finishes)
    _stock(scene, finishes)
    ironworks.floor(scene, finishes, STILL - scene.triangle_count)
    _drive(scene, finishes)
    for name, eye, target, fov in (
        ("turn", (19.4, 2.3, 5.4), (12.3, 2.45, -5.0), 54.0),
        ("catwalk", (-16.5, 5.0, -7.7), (2.0, 1.0, 2.5), 58.0),
        ("aisle", (-3.0, 1.7, 5.4), (15.0, 2.2, 0.4), 56.0),
        ("hearth", (-11.0, 1.7, -4.2), (-21.0, 2.0, 2.6), 60.0),
    ):
        add_camera(scene, eye, target, math.radians(fov)).name = name
    return scene


def _containers(scene: Scene, finishes: Finishes) -> None:
    """Freight containers in a row down the middle, some on others, and crossways at the ends."""
    sheets, frame = container()
    rows = {
        "blue paint": [(-7.9, 0.0, 0.1, 2), (7.2, 2.62, 0.0, -3)],
        "orange paint": [(-1.2, 0.0, -0.05, -1), (20.6, 0.0, -4.4, 88)],
        "green paint": [(7.4, 0.0, 0.05, 1), (-20.8, 0.0, 5.2, 92)],
        "white paint": [(-7.6, 2.62, 0.0, -2), (20.7, 0.0, 2.6, 91)],
        "red paint": [(20.8, 2.62, -4.0, 90)],
    }
    for finish, stood in rows.items():
        collected = pieces()
        collected[finish] += [sheets, frame]
        finishes.add(
            scene, f"containers, {finish}", collected, [pose(x, y, z, yaw) for x, y, z, yaw in stood]
        )


def _stock(scene: Scene, finishes: Finishes) -> None:
    """Crates, drums, coils, beams and racks along the walls, none on the way."""
    south, north = pieces(), pieces()
    for k, x in enumerate((-8.4, -5.9, 1.8, 4.6, 11.2)):
        sizes = [
            (1.5, 1.1, 1.2, "wood", "dark metal"),
            (1.3, 0.9, 1.1, "green paint", "steel"),
            (0.9, 0.7, 0.8, "yellow paint", "dark metal"),
        ]
        sizes = [
            (*s[:3], p, f)
            for s, (p, f) in zip(
                sizes, (_PAINTS[k % 5], _PAINTS[(k + 2) % 5], _PAINTS[(k + 3) % 5]), strict=True
            )
        ]
        pile(south, pose(x, 0.0, 7.2, yaw=6.0 * (k % 3) - 5.0), sizes[: 3 - (k % 2)], k)
    for k, x in enumerate((-10.2, 8.4, 15.6)):
        drums(south, pose(x, 0.0, 7.1, yaw=4.0 * k), 2, 2, ["blue paint", "rust", "yellow paint"], 20 + k)
    finishes.add(scene, "south stock", south)
    posts, shelves = rack(2.8, 1.0, 3, 0.98)
    for x in (-14.0, -11.1, 5.0, 7.9):
        north["blue paint"].append(placed(posts, pose(x, 0.0, -7.9)))
        north["orange paint"].append(placed(shelves, pose(x, 0.0, -7.9)))
        _shelved(north, x)
    roll = coil(0.72, 1.25)
    for x in (-6.6, -4.9, -3.2, -1.5):
        north["galvanized"].append(placed(roll, pose(x, 0.0, -7.2, yaw=90.0)))
        north["wood"] += [
            box((x - 0.55, 0.0, -7.6), (x - 0.4, 0.14, -6.8)),
            box((x + 0.4, 0.0, -7.6), (x + 0.55, 0.14, -6.8)),
        ]
    north["galvanized"].append(placed(roll, pose(-5.75, 1.24, -7.2, yaw=90.0)))
    for k in range(4):
        for i in range(5 - k):
            z = -8.2 + 0.34 * i + 0.17 * k
            north["rust"].append(placed(beam(5.5, 0.3, 0.28), pose(14.2, 0.30 + 0.31 * k, z, yaw=90.0)))
    north["wood"] += [box((x - 0.07, 0.0, -8.5), (x + 0.07, 0.145, -6.6)) for x in (12.0, 14.2, 16.4)]
    tube = pipe([(-2.6, 0.0, 0.0), (2.6, 0.0, 0.0)], 0.15, 20)
    for k in range(3):
        for i in range(4 - k):
            north["copper"].append(placed(tube, pose(1.2, 0.15 + 0.262 * k, -8.2 + 0.305 * i + 0.1525 * k)))
    lanes = [box((-15.0, -0.02, s * 5.75 - 0.05), (16.0, 0.004, s * 5.75 + 0.05)) for s in (-1, 1)]
    lanes += [box((-11.0, -0.02, s * 2.1 - 0.05), (10.8, 0.004, s * 2.1 + 0.05)) for s in (-1, 1)]
    north["yellow paint"].append(merge(lanes))
    for x, z in ((-11.6, 0.7), (11.3, 0.0)):
        pile(north, pose(x, 0.0, z, yaw=20.0 * z), [(1.0, 0.9, 1.0, "red paint", "dark metal")], 31)
    finishes.add(scene, "north stock", north)


_PAINTS = (
    ("wood", "dark metal"),
    ("red paint", "steel"),
    ("blue paint", "steel"),
    ("yellow paint", "dark metal"),
    ("green paint", "steel"),
)


def _shelved(into: Pieces, x: float) -> None:
    """Crates on the shelves of a rack."""
    random = np.random.default_rng(int(100 + x))
    for level in range(3):
        for dx in (-0.9, 0.0, 0.9):
            if random.random() < 0.2 or level == 3:
                continue
            panel, frame = _PAINTS[int(random.integers(5))]
            w, h, d = random.uniform((0.6, 0.4, 0.6), (0.82, 0.72, 0.85))
            turn = pose(
                x + dx, 0.02 + 0.98 * level if level else 0.0, -7.9, yaw=float(random.uniform(-5.0, 5.0))
            )
            for finish, mesh in zip((panel, frame), crate(float(w), float(h), float(d)), strict=True):
                into[finish].append(placed(mesh, turn))


def _drive(scene: Scene, finishes: Finishes) -> None:
    """The car, and the animation that drives it round: a rectangle with round corners, at an even speed."""
    body, wheels = car(scene, finishes)
    straight_x, straight_z = 2.0 * (_HALF_X - _CORNER), 2.0 * (_HALF_Z - _CORNER)
    arc = 0.5 * math.pi * _CORNER
    length = 2.0 * (straight_x + straight_z) + 4.0 * arc
    turns = round(length / (2.0 * math.pi * WHEEL))
    keys = 8 * turns
    s = (np.arange(keys) / keys + _START) % 1.0 * length
    place, heading = np.zeros((keys, 3)), np.zeros(keys)
    begin, corner = 0.0, np.array([_HALF_X - _CORNER, 0.0, _HALF_Z - _CORNER])
    # westwards along the south side, then north, east and south again; clockwise seen from above
    for leg, (run, yaw) in enumerate(
        ((straight_x, 180.0), (straight_z, 90.0), (straight_x, 0.0), (straight_z, -90.0))
    ):
        a = math.radians(yaw)
        ahead, out = np.array([math.cos(a), 0.0, -math.sin(a)]), np.array([-math.sin(a), 0.0, -math.cos(a)])
        start = corner * [(1, 1, 1), (-1, 1, 1), (-1, 1, -1), (1, 1, -1)][leg]
        on = (s >= begin) & (s < begin + run)
        place[on] = start + _CORNER * out + (s[on, None] - begin) * ahead
        heading[on] = a
        begin += run
        on = (s >= begin) & (s < begin + arc)
        phi = (s[on] - begin) / _CORNER
        end = start + run * ahead
        place[on] = end + _CORNER * (np.sin(phi)[:, None] * ahead + np.cos(phi)[:, None] * out)
        heading[on] = a - phi
        begin += arc
    roll = turns_about((0.0, 0.0, 1.0), -2.0 * np.pi * turns * np.arange(keys) / keys)
    channels = [
        closed_path(body, "translation", place, PERIOD),
        closed_path(body, "rotation", turns_about((0.0, 1.0, 0.0), heading), PERIOD),
        *(closed_path(wheel, "rotation", roll, PERIOD) for wheel in wheels),
    ]
    scene.animations.append(Animation(channels, "drive"))
