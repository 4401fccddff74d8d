"""Rooms whose light comes by many bounces, past many edges or through an opening.

Of `scenes.py`, which has the rest.
"""

from __future__ import annotations

import math

import numpy as np

from ispm.library.common import add_camera, add_spot, lambert
from ispm.library.shapes import box
from ispm.scene.light import DirectionalLight, PointLight, SpotLight
from ispm.scene.scene import Scene

Triple = tuple[float, float, float]

_WHITE, _CREAM, _GREY = (0.8, 0.8, 0.8), (0.75, 0.7, 0.6), (0.5, 0.5, 0.5)
_RED, _BLUE, _GREEN, _WOOD = (0.65, 0.2, 0.15), (0.2, 0.3, 0.65), (0.3, 0.55, 0.25), (0.55, 0.35, 0.2)
_SUNK = 0.02  # m that a thing is below what it stands on
_THICK = 0.2  # m, of walls


def steps() -> Scene:
    """A flight of narrow steps and a rack of shelves: hardly a surface is wider than 20 cm."""
    scene = Scene(name="steps")
    _shell(scene, (4.0, 3.0, 5.0), floor=_GREY, low_x=_BLUE)
    for i in range(12):
        z, y = 2.0 + 0.18 * i, 0.15 * (i + 1)
        _box(scene, (0.4, y - 0.15 - _SUNK, z), (1.9, y, z + 0.18 + (0.01 if i < 11 else 0.5)), _CREAM)
    for side in (2.3, 3.58):
        _box(scene, (side, -_SUNK, 3.6), (side + 0.04, 2.2, 3.9), _WOOD)
    for i in range(9):
        y = 0.15 + 0.24 * i
        _box(scene, (2.33, y, 3.6), (3.59, y + 0.03, 3.88), _WOOD)
        for k in range(i % 3, 8, 3):
            x, color = 2.4 + 0.15 * k, (_RED, _GREEN, _WHITE)[k % 3]
            _box(scene, (x, y + 0.02, 3.65), (x + 0.05, y + 0.16 + 0.01 * k, 3.83), color)
    for i in range(10):  # a railing
        _box(scene, (1.95, -_SUNK, 1.95 + 0.21 * i), (1.98, 0.9 + 0.175 * i, 1.98 + 0.21 * i), _WHITE)
    _lamp(scene, (2.6, 2.5, 1.6), 8.0)
    add_camera(scene, (3.4, 1.7, 0.3), (1.7, 0.9, 3.6), math.radians(55.0))
    return scene


def level() -> Scene:
    """Twelve rooms with a lamp each, joined by doors: pilasters, ledges and skirtings along all walls."""
    scene = Scene(name="level")
    width, depth, height, columns, rows = 4.0, 3.6, 2.8, 4, 3
    _shell(scene, (columns * width, height, rows * depth), floor=_GREY, ceiling=_CREAM)
    for i in range(1, columns):
        for j in range(rows):
            gap = j * depth + 0.9 + 0.7 * ((i + j) % 2)
            _wall_with_door(scene, i * width, (j * depth, (j + 1) * depth), gap, height, across=False)
    for j in range(1, rows):
        for i in range(columns):
            gap = i * width + 1.0 + 0.8 * ((i + 2 * j) % 2)
            _wall_with_door(scene, j * depth, (i * width, (i + 1) * width), gap, height, across=True)
    random = np.random.default_rng(5)
    for i in range(columns):
        for j in range(rows):
            x, z = i * width, j * depth
            color = (_RED, _BLUE, _GREEN, _CREAM)[(i + j) % 4]
            for k in range(4):  # crates
                at = x + 0.5 + 2.6 * random.random(), z + 0.5 + 2.2 * random.random()
                size = 0.15 + 0.35 * random.random(), 0.15 + 0.35 * random.random()
                high = (at[0] + size[0], size[1] + 0.01 * k, at[1] + size[0])
                _box(scene, (at[0], -_SUNK, at[1]), high, color)
            for k in range(6):  # pilasters and a ledge along the far wall
                px, far = x + 0.3 + 0.58 * k, z + depth
                _box(scene, (px, -_SUNK, far - 0.22), (px + 0.12, height + _SUNK, far - 0.08), _CREAM)
            _box(scene, (x + 0.12, 2.0, z + depth - 0.26), (x + width - 0.12, 2.08, z + depth - 0.05), _WOOD)
            _box(scene, (x + 0.12, -_SUNK, z + 0.05), (x + 0.18, 0.12, z + depth - 0.05), _WOOD)
            place = x + 1.3 + 1.4 * random.random(), 2.3, z + 1.2 + random.random()
            _lamp(scene, place, 3.0 + 4.0 * random.random())
    add_camera(scene, (0.6, 1.6, 0.5), (7.0, 1.1, 5.0), math.radians(62.0))
    return scene


def sunlit() -> Scene:
    """A room lit by the sun through one window, and a corner of it behind a partition."""
    scene = Scene(name="sunlit")
    x, y, z = 5.0, 2.8, 4.0
    _box(scene, (-_THICK, -_THICK, -_THICK), (x + _THICK, 0.0, z + _THICK), _WOOD)
    _box(scene, (-_THICK, y, -_THICK), (x + _THICK, y + _THICK, z + _THICK), _WHITE)
    _box(scene, (-_THICK, -0.1, z), (x + _THICK, y + 0.1, z + 0.15), _WHITE)
    _box(scene, (-_THICK, -0.1, -0.15), (x + _THICK, y + 0.1, 0.0), _WHITE)
    _box(scene, (-0.15, -0.1, -0.1), (0.0, y + 0.1, z + 0.1), _BLUE)
    for low, high in (  # the wall with the window, 1.2 m wide, 1.1 m high
        ((x, -0.1, -0.1), (x + 0.15, y + 0.1, 1.6)),
        ((x, -0.1, 2.8), (x + 0.15, y + 0.1, z + 0.1)),
        ((x, -0.1, 1.5), (x + 0.14, 1.0, 2.9)),
        ((x, 2.1, 1.5), (x + 0.14, y + 0.1, 2.9)),
    ):
        _box(scene, low, high, _WHITE)
    _box(scene, (1.8, -_SUNK, 2.3), (1.9, y + _SUNK, z + _SUNK), _CREAM)  # the partition
    _box(scene, (2.6, -_SUNK, 2.9), (3.6, 0.45, 3.6), _RED)
    for k in range(5):
        _box(scene, (0.3, 0.3 + 0.35 * k, 3.75), (1.5, 0.33 + 0.35 * k, 4.0 + _SUNK), _WOOD)
    node = add_spot(scene, SpotLight(), "sun", (0.0, 0.0, 0.0), (-0.75, -0.6, 0.12))
    node.light = DirectionalLight((40.0,) * 3)
    add_camera(scene, (4.6, 1.6, 0.35), (1.2, 1.0, 3.2), math.radians(62.0))
    return scene


def two_rooms() -> Scene:
    """Two white rooms: a lamp behind a screen in one, the eye in the other."""
    scene = Scene(name="two-rooms")
    _shell(scene, (8.0, 2.6, 4.0), floor=_CREAM, high_x=_GREEN)
    _wall_with_door(scene, 4.0, (0.0, 4.0), 2.5, 2.6, across=False)
    _box(scene, (2.4, -_SUNK, 0.9), (2.5, 1.9, 2.6), _WHITE)
    _box(scene, (6.2, -_SUNK, 0.5), (7.1, 0.75, 1.2), _RED)
    _box(scene, (5.2, 0.9, -_SUNK), (7.6, 0.95, 0.25), _WOOD)
    _box(scene, (5.2, 1.4, -_SUNK), (7.6, 1.45, 0.25), _WOOD)
    _lamp(scene, (1.4, 1.4, 1.6), 40.0)
    add_camera(scene, (4.5, 1.6, 3.7), (7.2, 0.9, 0.6), math.radians(62.0))
    return scene


def _shell(
    scene: Scene,
    size: Triple,
    floor: Triple,
    ceiling: Triple = _WHITE,
    low_x: Triple = _WHITE,
    high_x: Triple = _WHITE,
) -> None:
    """Walls, floor and ceiling about a room from the origin to `size`, sunk into each other."""
    (x, y, z), t, s = size, _THICK, 0.5 * _THICK
    _box(scene, (-t, -t, -t), (x + t, 0.0, z + t), floor)
    _box(scene, (-t, y, -t), (x + t, y + t, z + t), ceiling)
    _box(scene, (-t * 0.9, -s, -s), (0.0, y + s, z + s), low_x)
    _box(scene, (x, -s, -s), (x + 0.9 * t, y + s, z + s), high_x)
    _box(scene, (-s, -0.9 * s, -0.9 * t), (x + s, y + 0.9 * s, 0.0), _WHITE)
    _box(scene, (-s, -0.9 * s, z), (x + s, y + 0.9 * s, z + 0.9 * t), _WHITE)


def _wall_with_door(
    scene: Scene, at: float, span: tuple[float, float], gap: float, height: float, across: bool
) -> None:
    """A wall 0.12 m thick with a door 0.9 m wide and 2 m high that begins at `gap`; across: along x."""
    parts = (
        (span[0] - _SUNK, gap, -_SUNK),
        (gap + 0.9, span[1] + _SUNK, -_SUNK),
        (gap - 0.01, gap + 0.91, 2.0),
    )
    for first, last, low in parts:
        inset = 0.0 if low < 0.0 else 0.002  # the lintel's faces lie within the wall's
        side = at - 0.06 + inset, at + 0.06 - inset
        a, b = ((first, side[0]), (last, side[1])) if across else ((side[0], first), (side[1], last))
        _box(scene, (a[0], low, a[1]), (b[0], height + _SUNK, b[1]), _WHITE)


def _box(scene: Scene, low: Triple, high: Triple, color: Triple) -> None:
    scene.add(box(low, high), material=lambert(color))


def _lamp(scene: Scene, place: Triple, intensity: float) -> None:
    scene.add(PointLight((intensity,) * 3), name="lamp", translation=place)


ROOMS = {"steps": steps, "level": level, "sunlit": sunlit, "two-rooms": two_rooms}
"""Name to function."""
