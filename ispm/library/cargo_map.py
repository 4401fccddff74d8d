"""The cargo deck of a station: one bay, five round a crossing, and the whole of fifteen."""

from __future__ import annotations

import math

import numpy as np

from ispm.library import cargo_bay as modules
from ispm.library.common import add_camera, closed_path, stand, turns_about
from ispm.library.finishes import Finishes, pieces
from ispm.library.forms import pose, refined
from ispm.library.shapes import sheet
from ispm.library.tug import tug
from ispm.scene.animation import Animation
from ispm.scene.light import PointLight
from ispm.scene.material import Material
from ispm.scene.scene import Node, Scene

PERIOD = 20.0  # s
_STEP_X, _STEP_Z = 2.0 * modules.HALF_X + modules.LENGTH, 2.0 * modules.HALF_Z + modules.LENGTH
_RANGE = 45.0  # m of a lamp, which brings a tenth of a lux there
_KEYS = 2.0 * np.pi * np.arange(48) / 48
_WARM, _COLD, _RED, _GREEN = (1.0, 0.62, 0.30), (0.42, 0.66, 1.0), (1.0, 0.16, 0.08), (0.35, 1.0, 0.55)

Cell = tuple[int, int]
Lamp = tuple[float, float, float, tuple[float, float, float], float]


def cargo_bay() -> Scene:
    """A cargo bay of a space station with a hovering tug, four lights: 73,081 triangles."""
    lights: list[Lamp] = [
        (-8.0, 7.1, 2.6, _WARM, 150.0),
        (8.6, 7.1, -1.4, _COLD, 130.0),
        (0.5, 7.1, 0.0, (1.0, 0.86, 0.70), 60.0),
        (10.6, 2.6, 6.9, _RED, 14.0),
    ]
    scene = _deck("cargo-bay", [(0, 0)], 58_319, 1, lights)
    for name, eye, target, fov in (
        ("deck", (-10.9, 1.75, 2.6), (5.0, 2.6, -1.2), 62.0),
        ("walk", (10.8, 5.0, -6.9), (-5.0, 1.6, 2.5), 62.0),
        ("stairs", (-3.5, 1.6, -0.4), (-10.5, 2.4, -6.6), 58.0),
    ):
        add_camera(scene, eye, target, math.radians(fov)).name = name
    return scene


def cargo_level() -> Scene:
    """Five cargo bays round a crossing of corridors, ten tugs, four lights: 404,773 triangles."""
    x, z = _STEP_X, _STEP_Z
    lights: list[Lamp] = [
        (-7.4, 7.1, 1.5, _WARM, 190.0),
        (7.5, 7.1, -1.0, _COLD, 150.0),
        (x - 4.0, 7.1, 0.5, _WARM, 170.0),
        (0.5, 7.1, z - 2.0, _GREEN, 150.0),
    ]
    cells = [(0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)]
    scene = _deck("cargo-level", cells, 257_153, 10, lights)
    for name, eye, target, fov in (
        ("crossing", (-10.8, 1.75, -1.2), (14.0, 2.4, 0.4), 58.0),
        ("corridor", (0.6, 1.8, -3.0), (-0.2, 2.0, 20.0), 60.0),
        ("walk", (10.8, 5.0, -6.9), (-5.0, 1.6, 2.5), 62.0),
        ("far bay", (x + 10.6, 2.2, 3.4), (x - 8.0, 2.4, -1.0), 62.0),
    ):
        add_camera(scene, eye, target, math.radians(fov)).name = name
    return scene


def cargo_map() -> Scene:
    """A whole cargo deck of fifteen bays with twenty-one tugs and thirty lights: 1,190,405 triangles."""
    cells = [(i, k) for i in range(-2, 3) for k in range(-1, 2)]
    lights: list[Lamp] = []
    for number, (i, k) in enumerate(cells):
        x, z = i * _STEP_X, k * _STEP_Z
        first, second = [(_COLD, _RED), (_WARM, _COLD), (_WARM, _GREEN)][number % 3]
        lights.append((x - 7.4, 7.1, z + 1.6, first, 170.0))
        lights.append((x + 7.6, 7.1, z - 1.2, second, 120.0))
    scene = _deck("cargo-map", cells, 880_403, 21, lights)
    for name, eye, target, fov in (
        ("avenue", (-10.8, 1.75, -1.2), (14.0, 2.4, 0.4), 58.0),
        ("corridor", (14.0, 1.8, 0.5), (30.0, 2.0, -0.3), 60.0),
        ("walk", (10.8, 5.0, -6.9), (-5.0, 1.6, 2.5), 62.0),
        ("crossing", (0.6, 1.8, -3.0), (-0.2, 2.0, 20.0), 60.0),
    ):
        add_camera(scene, eye, target, math.radians(fov)).name = name
    return scene


def _deck(
    name: str,
    cells: list[Cell],
    still: int,
    tugs: int,
    lights: list[Lamp],
) -> Scene:
    """Return bays at cells of the plan, joined by corridors, with tugs in them and lights.

    cells   numbers along x and z of the bays
    still   triangles that do not move
    lights  x, y, z in m, color and candela
    """
    scene, finishes = Scene(name=name), Finishes()
    glow = Material((0.92, 0.96, 1.0), unlit=True, name="light strip")
    stand(scene, "bays", modules.bay(finishes, glow), [_at(cell) for cell in cells])
    for kind in range(min(3, len(cells))):
        own = [_at(cell) for number, cell in enumerate(cells) if number % 3 == kind]
        stand(scene, f"cargo {kind}", modules.cargo(finishes, kind), own)
    passages, doors = [], []
    for i, k in cells:
        for di, dk, yaw, reach in (
            (1, 0, -90.0, modules.HALF_X),
            (-1, 0, 90.0, modules.HALF_X),
            (0, 1, 180.0, modules.HALF_Z),
            (0, -1, 0.0, modules.HALF_Z),
        ):
            if (i + di, k + dk) not in cells:
                doors.append(_at((i, k)) @ pose(yaw=yaw) @ pose(z=-reach))
            elif di + dk > 0:
                middle = 0.5 * np.array([_at((i, k))[:3, 3], _at((i + di, k + dk))[:3, 3]]).sum(axis=0)
                x, y, z = middle
                passages.append(pose(x, y, z, yaw=90.0 * dk))
    stand(scene, "blast doors", modules.blast_door(finishes), doors)
    if passages:
        stand(scene, "corridors", modules.corridor(finishes, glow), passages)
    _fill(scene, finishes, still, cells)
    _fly(scene, finishes, cells, tugs)
    for number, (x, y, z, color, candela) in enumerate(lights):
        r, g, b = (candela * c for c in color)
        scene.add(PointLight((r, g, b), range=_RANGE), name=f"light {number}", translation=(x, y, z))
    return scene


def _at(cell: Cell) -> np.ndarray:
    """The place of a cell of the plan."""
    return pose(cell[0] * _STEP_X, 0.0, cell[1] * _STEP_Z)


def _fill(scene: Scene, finishes: Finishes, still: int, cells: list[Cell]) -> None:
    """Add stacks of crates, and a landing mat of the number of triangles that is left."""
    parts = modules.stack(finishes)
    each = sum(len(part.mesh.triangles) for part in parts)
    rest = still - scene.triangle_count
    spots = [
        (-0.4, 6.9, 0.0),
        (10.6, 2.9, 90.0),
        (10.7, -2.9, 80.0),
        (-10.9, 3.6, 75.0),
        (-10.7, -3.4, 95.0),
        (1.0, 4.6, 10.0),
        (-1.6, -4.4, -8.0),
        (10.8, 7.0, 30.0),
        (0.2, -6.9, 0.0),
        (3.4, 4.4, 50.0),
        (10.7, -5.9, 85.0),
        (-2.0, 4.6, 20.0),
    ]
    places = [_at(cell) @ pose(x, 0.0, z, yaw) for x, z, yaw in spots for cell in cells]
    taken = min(len(places), (rest - 400) // each)
    if taken > 0:
        stand(scene, "stacks", parts, places[:taken])
    rest = still - scene.triangle_count
    side = max(2, int(math.sqrt(max(rest, 2) / 2.0)))
    x, z = np.linspace(-3.6, 3.6, side + 1), np.linspace(-2.2, 2.2, side + 1)
    grid = np.full((side + 1, side + 1, 3), 0.012)
    grid[..., 0], grid[..., 2] = x, z[:, None]
    mat = pieces()
    mat["rubber"].append(refined(sheet(grid), rest))
    finishes.add(scene, "landing mat", mat)


def _fly(scene: Scene, finishes: Finishes, cells: list[Cell], tugs: int) -> None:
    """Let tugs circle in the bays, two at opposite ends where there are more than bays."""
    parts = tug(finishes)
    channels = []
    for number in range(tugs):
        i, k = cells[number % len(cells)]
        phase = _KEYS + math.pi * (number // len(cells)) + 2.3
        bob = 0.12 * np.sin(2.0 * _KEYS)
        path = np.stack(
            [5.6 * np.cos(phase) + i * _STEP_X, 5.35 + bob, 3.0 * np.sin(phase) + k * _STEP_Z], axis=1
        )
        heading = np.unwrap(np.arctan2(-3.0 * np.cos(phase), -5.6 * np.sin(phase)))
        node = Node(f"tug {number}", parts=parts)
        scene.roots.append(node)
        channels.append(closed_path(node, "translation", path, PERIOD))
        channels.append(closed_path(node, "rotation", turns_about((0.0, 1.0, 0.0), heading), PERIOD))
    scene.animations.append(Animation(channels, "fly"))
